"""A scheduler trained as a configuration says: environments, validation and warm start for PPO."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from agents.config import DemoConfig
from agents.evaluation import drive_seeds, make_envs, play_drives
from agents.policies import NetworkPolicy
from agents.training.ppo import Trainer, training_drives
from agents.training.sb3_vector import Sb3VecEnv
from agents.training.warmup import ROLLOUTS, known_frames, warm_start
from shotenv.decision import FEATURE_NAMES
from unwrap.support import progress

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy

VALIDATION_DRIVES: Final = 6
"""Most drives that choose the best round (assumed): they are played again after each."""


def train_scheduler(config: DemoConfig, out: Path) -> NetworkPolicy:
    """Train PPO on training drives, from its checkpoint in `out` where there is one.

    The policy with the best return on validation drives is kept.
    """
    envs = make_envs(config.env, "train", config.agent.num_envs, "SameStep")
    seeds = drive_seeds(config.study, min(VALIDATION_DRIVES, config.study.tuning_drives))
    # Other clips than those of training, and than those of the test that the report tells of.
    judges = make_envs(config.env, "validation", len(seeds), "Disabled")

    def validate(policy: NetworkPolicy) -> float:
        return float(play_drives(policy, judges, seeds).reward.sum(axis=1).mean())

    def warm(network: ActorCriticPolicy) -> None:
        """Play every action in every frame of the training drives, and learn from that."""
        known = training_drives(config.agent).tolist()
        players = make_envs(config.env, "train", len(known), "Disabled")
        frames = (1 + ROLLOUTS) * len(known) * config.env.frames_per_drive
        with progress(frames, "every action in the training drives", "frame") as bar:
            cases = known_frames(players, known, tick=bar.update)
        warm_start(network, cases, seed=config.agent.seed)

    return Trainer(
        Sb3VecEnv(envs),
        FEATURE_NAMES,
        config.env.frames_per_drive,
        config.agent,
        validate,
        out,
        warm if config.agent.warm_start else None,
        config.env.reward.power,
    ).run()
