"""How a scheduler is trained."""

from __future__ import annotations

from pydantic import Field

from unwrap.support import Fraction, NonNegative, Positive, Section


class AgentConfig(Section):
    """Training of a scheduler with PPO."""

    total_steps: int = Field(100_000, ge=1, description="environment steps in all")
    num_envs: int = Field(16, ge=1, description="environments in the batch")
    drives: int = Field(32, ge=1, description="different drives to train on, again and again")
    rollout_steps: int = Field(128, ge=2, description="steps of each environment per update")
    batch_size: int = Field(512, ge=2, description="steps per gradient batch")
    epochs: int = Field(10, ge=1, description="passes over a rollout")
    learning_rate: Positive = Field(1e-3, description="Adam learning rate")
    gamma: Fraction = Field(0.98, description="discount per frame")
    gae_lambda: Fraction = Field(0.95, description="lambda of the advantage estimate")
    entropy_coefficient: NonNegative = Field(0.005, description="weight of the policy's entropy")
    hidden: tuple[int, ...] = Field((64, 64), description="hidden layers of policy and value")
    warm_start: bool = Field(
        True, description="whether to start from the known costs of all actions in the drives"
    )
    seed: int = Field(0, ge=0, description="seed of weights and drives")
