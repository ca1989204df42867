"""A scheduler trained as a configuration says: environments, validation and warm start."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from agents.config import DemoConfig
from agents.evaluation import FIXED_POLICIES, drive_seeds, make_envs
from agents.policies import Provenance, Scheduler, load_policy
from agents.training.branching import Branches
from agents.training.checkpoint import Validate, provenance_of, training_drives
from agents.training.ppo import PpoTrainer
from agents.training.q_learning import QLearner
from agents.training.regression import RegressionTrainer
from agents.training.sb3_vector import Sb3VecEnv
from agents.training.warmup import ROLLOUTS, known_frames, warm_start
from shotenv.config import EnvConfig
from shotenv.decision import FEATURE_NAMES, open_problem
from unwrap.support import Range, progress, say, write_json

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy

VALIDATION: Final = "validation.json"
VALIDATION_PRICES: Final = 4
"""Prices of power at which validation drives are played (assumed)."""


def train_scheduler(config: DemoConfig, out: Path) -> Scheduler:
    """Train on training drives, where the learner can from its checkpoint in `out`.

    The policy with the best return on validation drives, over all prices, is kept;
    `validation.json` has what it gains on others. A run that is at its end is not begun again.

    Raises
    ------
    ValueError
        `out` holds the checkpoint of another configuration, or a damaged one.
    ImportError
        The learner, or TensorBoard, needs a package that is not installed.
    """
    env, agent = priced(config.env, config.agent.power_price), config.agent
    if (policy := finished(provenance_of(agent, FEATURE_NAMES, env), out)) is not None:
        return policy
    count = config.study.tuning_drives
    if agent.algorithm == "regression":
        count = agent.regression.validation_drives
    # Other clips than those of training, and than those of the test that the report tells of.
    seeds = drive_seeds(config.study, 2 * count)
    judging = branches_of(env, "validation", seeds[:count])
    prices = validation_prices(env.reward.power)

    def validate(policy: Scheduler) -> float:
        return judging.mean_return(policy, prices)

    policy = _trained(env, config, judging, validate, out)
    others = branches_of(env, "validation", seeds[count:])
    rescore(policy, judging, others, prices, out)
    return policy


def finished(run: Provenance, out: Path) -> Scheduler | None:
    """What such a run has left in `out`, where it is at its end: what is written last stands."""
    if not (out / VALIDATION).is_file():
        return None
    policy = load_policy(out)
    return policy if same_run(policy.provenance, run) else None


def same_run(one: Provenance, other: Provenance) -> bool:
    """Whether two runs are told the same; versions of packages may differ."""
    return one.model_copy(update={"versions": other.versions}) == other


def _trained(
    env: EnvConfig, config: DemoConfig, judging: Branches, validate: Validate, out: Path
) -> Scheduler:
    """The policy that the learner of the configuration keeps."""
    agent = config.agent
    if agent.algorithm == "regression":
        seeds = training_drives(agent.seed, agent.regression.drives).tolist()
        training = branches_of(env, "train", seeds)
        return RegressionTrainer(training, judging, agent, validate, out).run()
    if agent.algorithm in ("ppo", "recurrent_ppo"):
        return ppo_trainer(env, config, validate, out).run()
    envs = Sb3VecEnv(make_envs(env, "train", agent.dqn.num_envs, "SameStep"))
    return QLearner(envs, FEATURE_NAMES, env.frames_per_drive, agent, validate, out, env).run()


def rescore(
    policy: Scheduler,
    judging: Branches,
    others: Branches,
    prices: Sequence[float],
    out: Path,
) -> None:
    """Say and write what the kept policy gains on drives that did not choose it.

    The best of many rounds is in part the luckiest on the drives that it is chosen by. Some drives
    are easier than others: told is what is gained over the best fixed choice on the same drives.
    """
    chose, rest = (gain_over_fixed(policy, drives, prices) for drives in (judging, others))
    told = {"gain_on_drives_that_chose": chose, "gain_on_others": rest, "prices": list(prices)}
    write_json(out / VALIDATION, told)
    say(
        f"return beyond the best fixed choice: {chose:.1f} on the validation drives that chose the "
        f"policy, {rest:.1f} on others"
    )


def gain_over_fixed(policy: Scheduler, drives: Branches, prices: Sequence[float]) -> float:
    """Mean return beyond that of the best fixed choice at each of the `prices`."""
    fixed = [
        max(drives.mean_return(one, [price]) for one in FIXED_POLICIES.values()) for price in prices
    ]
    return drives.mean_return(policy, prices) - float(np.mean(fixed))


def ppo_trainer(env: EnvConfig, config: DemoConfig, validate: Validate, out: Path) -> PpoTrainer:
    """PPO on drives of `env`, with its warm start."""
    agent = config.agent
    envs = Sb3VecEnv(make_envs(env, "train", agent.ppo.num_envs, "SameStep"))

    def warm(network: ActorCriticPolicy) -> None:
        """Play every action in every frame of the training drives, and learn from that."""
        known = training_drives(agent.seed, agent.ppo.drives).tolist()
        players = make_envs(env, "train", len(known), "Disabled")
        frames = (1 + ROLLOUTS) * len(known) * env.frames_per_drive
        with progress(frames, "every action in the training drives", "frame") as bar:
            cases = known_frames(players, known, tick=bar.update)
        warm_start(network, cases, seed=agent.seed)

    return PpoTrainer(
        envs,
        FEATURE_NAMES,
        env.frames_per_drive,
        agent,
        validate,
        out,
        warm if agent.ppo.warm_start else None,
        env,
    )


def branches_of(env: EnvConfig, split: str, seeds: list[int]) -> Branches:
    """Drives of a split, measured under a progress bar."""
    problem = open_problem(env.model_copy(update={"split": split}))
    frames = len(seeds) * env.frames_per_drive
    with progress(frames, f"every action in the {split} drives", "frame") as bar:
        return Branches(problem, seeds, tick=bar.update)


def priced(env: EnvConfig, power_price: Range | None) -> EnvConfig:
    """`env` with this range of prices of power; of None, as it is."""
    if power_price is None:
        return env
    reward = env.reward.model_copy(update={"power": power_price})
    return env.model_copy(update={"reward": reward})


def validation_prices(power_price: Range) -> list[float]:
    """Prices that stand for equally likely parts of the range."""
    low, high = power_price
    if low == high:
        return [low]
    middles = (np.arange(VALIDATION_PRICES) + 0.5) / VALIDATION_PRICES
    return (low * (high / low) ** middles).tolist()
