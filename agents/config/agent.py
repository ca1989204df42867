"""How a scheduler is trained."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, field_validator, model_validator

from unwrap.support import Fraction, NonNegative, Positive, Range, Section, check_range

Algorithm = Literal["ppo", "recurrent_ppo", "dqn", "qrdqn", "regression"]
LEARNERS: Final = frozenset(("ppo", "recurrent", "dqn", "regression"))
"""Sections of the learners."""
SECTIONS: Final[dict[Algorithm, frozenset[str]]] = {
    "ppo": frozenset(("ppo",)),
    "recurrent_ppo": frozenset(("ppo", "recurrent")),
    "dqn": frozenset(("dqn",)),
    "qrdqn": frozenset(("dqn",)),
    "regression": frozenset(("regression",)),
}
"""Which of them count for an algorithm."""
# Assumed limits: beyond them no number is meant, and memory or time would end.
Count = Annotated[int, Field(ge=1, le=10**9)]
Batch = Annotated[int, Field(ge=2, le=10**6)]
Few = Annotated[int, Field(ge=1, le=4096)]
WIDEST, MOST_HIDDEN = 1024, 14
"""Units of a layer, and hidden layers, of the network that a scheduler is saved as."""
HIGHEST_PRICE = 1e6
Width = Annotated[int, Field(ge=1, le=WIDEST)]


class PpoConfig(Section):
    """Proximal policy optimisation, by stable-baselines3; with a memory by sb3-contrib."""

    total_steps: Count = Field(65_536, description="environment steps in all")
    num_envs: Few = Field(16, description="environments in the batch")
    drives: Count = Field(24, description="different drives to train on, again and again")
    rollout_steps: Batch = Field(128, description="steps of each environment per update")
    batch_size: Batch = Field(512, description="steps per gradient batch")
    epochs: Count = Field(10, description="passes over a rollout")
    learning_rate: Positive = Field(1e-3, description="Adam learning rate")
    gamma: Fraction = Field(0.98, description="discount per frame")
    gae_lambda: Fraction = Field(0.95, description="lambda of the advantage estimate")
    entropy_coefficient: NonNegative = Field(0.005, description="weight of the policy's entropy")
    warm_start: bool = Field(
        True, description="whether to start from the known costs of all actions in the drives"
    )


class RecurrentConfig(Section):
    """What RecurrentPPO has beside what `PpoConfig` tells."""

    units: int = Field(
        64, ge=1, le=1024, description="units of the LSTM that reads the features, one layer"
    )


class DqnConfig(Section):
    """Deep Q-learning by stable-baselines3, or with quantiles (QR-DQN) by sb3-contrib."""

    total_steps: Count = Field(200_000, description="environment steps in all")
    num_envs: Few = Field(8, description="environments in the batch")
    # At most what a checkpoint may be large: some 200 bytes a step.
    buffer_size: int = Field(200_000, ge=1, le=10**7, description="steps that are remembered")
    learning_starts: int = Field(2_000, ge=0, le=10**9, description="steps before the first update")
    gradient_steps: Few = Field(2, description="updates per step of all environments")
    batch_size: Batch = Field(128, description="steps per update")
    learning_rate: Positive = Field(3e-4, description="Adam learning rate")
    gamma: Fraction = Field(0.95, description="discount per frame")
    target_update: Count = Field(4_000, description="steps between updates of the target")
    exploration: Fraction = Field(0.2, description="share of the run until epsilon is at its end")
    epsilon: Fraction = Field(0.05, description="share of random actions from then on")
    quantiles: int = Field(32, ge=2, le=4096, description="quantiles of each value, QR-DQN alone")
    validations: Count = Field(20, description="times that the policy is judged, evenly spread")


class RegressionConfig(Section):
    """Regression of every action's worth on the observation, from counterfactual outcomes."""

    rounds: Count = Field(4, description="rounds of playing, looking ahead and fitting")
    drives: Count = Field(512, description="different training drives")
    validation_drives: Count = Field(
        24, description="validation drives that stop the fit and choose the round"
    )
    horizon: Count = Field(
        12, description="frames that each action is followed for; 1: its own frame alone"
    )
    gamma: Fraction = Field(0.9, description="discount per frame of those that follow")
    heat_price: NonNegative = Field(
        0.2, description="least price of power at the trip, where heat is short; 0: none"
    )
    heat_near_k: Positive = Field(2.0, description="margin to the trip where it begins, K")
    stride: Count = Field(10, description="every how manieth frame of a drive is looked at")
    epsilon: Fraction = Field(
        0.5, description="share of random actions in the drive that has most; others have fewer"
    )
    members: Few = Field(5, description="networks whose scores are averaged")
    passes: Count = Field(12, description="most passes over the frames; the best is kept")
    batch_size: Batch = Field(512, description="frames per gradient batch")
    learning_rate: Positive = Field(3e-3, description="AdamW learning rate at the start")
    weight_decay: NonNegative = Field(0.03, description="of AdamW")
    noise: NonNegative = Field(
        0.3, description="noise on features of the scene in training, in their standard deviations"
    )
    unseen: tuple[str, ...] = Field(
        (), description="features that the learner is not shown: what they are worth to it"
    )


class AgentConfig(Section):
    """Training of a scheduler.

    Attributes
    ----------
    ppo, recurrent, dqn, regression
        Of each learner; those of the `algorithm` count. DQN and QR-DQN share one; RecurrentPPO has
        that of PPO and `recurrent`.
    """

    algorithm: Algorithm = Field("ppo", description="which learner")
    hidden: tuple[Width, ...] = Field(
        (64, 64),
        max_length=MOST_HIDDEN,
        description="hidden layers of each network; none: a linear ridge, regression alone",
    )
    power_price: Range | None = Field(
        (0.01, 0.35),
        description="range of the price of power that drives are trained with, drawn "
        "log-uniformly for each; none: that of the environment",
    )
    seed: int = Field(0, ge=0, le=2**32 - 1, description="seed of weights and drives")
    tensorboard: bool = Field(False, description="whether to log for TensorBoard in the folder")
    ppo: PpoConfig = PpoConfig()
    recurrent: RecurrentConfig = RecurrentConfig()
    dqn: DqnConfig = DqnConfig()
    regression: RegressionConfig = RegressionConfig()

    @field_validator("power_price")
    @classmethod
    def _price_possible(cls, power_price: Range | None) -> Range | None:
        if power_price is None:
            return None
        low, high = power_price
        check_range("power_price", power_price)
        if low <= 0 or high > HIGHEST_PRICE:
            raise ValueError(
                f"power_price is ({low:g}, {high:g}); expected prices above 0 and at most "
                f"{HIGHEST_PRICE:g}"
            )
        return power_price

    @model_validator(mode="after")
    def _can_be_saved(self) -> AgentConfig:
        # The members of a regression stand side by side in the network that is saved.
        members = self.regression.members if self.algorithm == "regression" else 1
        if members * max(self.hidden, default=0) > WIDEST:
            raise ValueError(
                f"hidden is {self.hidden} and members {members}: {members * max(self.hidden)} "
                f"units side by side; expected at most {WIDEST}"
            )
        return self

    def told(self) -> dict[str, object]:
        """What the run depends on, as JSON has it: of the learners those of the `algorithm`."""
        others = (LEARNERS - SECTIONS[self.algorithm]) | {"tensorboard"}
        return self.model_dump(mode="json", exclude=set(others))
