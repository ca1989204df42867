"""Whether plain learners learn the default problem, and whether what was looked at helps them.

.venv/bin/python docs/learnability.py --seeds 3 --json docs/problem/learnability.json

PPO and DQN come straight from stable-baselines3, with the library's defaults but for the discount,
on `gym.make("shotenv/ShotSchedule-v0")`. Each is trained for 150,000 frames, by default with each
of some seeds, and then plays test drives, as each fixed choice does. The same is done without what
looking tells: those features are 0, so that the agent cannot remember it. Intervals are over clips.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import gymnasium as gym
import numpy as np
import torch
from gymnasium.wrappers import TransformObservation
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm

import shotenv  # noqa: F401 - registers the environments
from agents import Policy
from agents.config import StudyConfig
from agents.evaluation import FIXED_POLICIES, PlayedDrives, difference, make_envs, play_drives
from shotenv.config import env_config
from shotenv.decision import FEATURE_NAMES, feature_index

STEPS: Final = 150_000
GAMMA: Final = 0.95
DRIVES: Final = 192
ALGORITHMS: Final[Mapping[str, type[BaseAlgorithm]]] = {"PPO": PPO, "DQN": DQN}
LOOKED: Final = (
    "two_from_four",
    "regret_of_two",
    "regret_of_four",
    "since_eight",
    "change_since_eight",
)
"""Features that tell what an earlier, longer acquisition showed, and how far away that is."""


def visible(*, looking: bool) -> np.ndarray:
    """1 for each feature that the agent is shown, 0 for those it is not, float32 [D]."""
    shown = np.ones(len(FEATURE_NAMES), dtype=np.float32)
    if not looking:
        shown[[feature_index(FEATURE_NAMES, name) for name in LOOKED]] = 0.0
    return shown


class Learned(Policy):
    """What a model of stable-baselines3 would choose of the features that it is shown."""

    def __init__(self, model: BaseAlgorithm, shown: np.ndarray) -> None:
        self._model, self._shown = model, shown

    def act(self, observation: Any, info: Mapping[str, Any] | None = None) -> Any:
        """The model's best action."""
        return self._model.predict(observation * self._shown, deterministic=True)[0]


def train(algorithm: str, *, seed: int, looking: bool = True, steps: int = STEPS) -> Learned:
    """Train with the library's defaults."""
    shown = visible(looking=looking)
    env = gym.make("shotenv/ShotSchedule-v0")
    env = TransformObservation(env, lambda seen: seen * shown, env.observation_space)
    model = ALGORITHMS[algorithm]("MlpPolicy", env, gamma=GAMMA, seed=seed, device="cpu")
    model.learn(steps)
    return Learned(model, shown)


def played(policies: Mapping[str, Policy], drives: int = DRIVES) -> dict[str, PlayedDrives]:
    """The same test drives under each policy and under each fixed choice."""
    seeds = range(1000, 1000 + drives)
    envs = make_envs(env_config(), "test", drives, "Disabled")
    return {
        name: play_drives(policy, envs, seeds)
        for name, policy in {**FIXED_POLICIES, **policies}.items()
    }


def compared(one: PlayedDrives, others: Mapping[str, PlayedDrives]) -> dict[str, dict[str, float]]:
    """Differences of the returns of a drive, with 95 % intervals."""
    study = StudyConfig()
    return {
        name: difference(one, other, study).named("difference") for name, other in others.items()
    }


def measure(algorithm: str, seed: int) -> dict[str, Any]:
    """An agent beside the fixed choices, and beside the same agent that cannot remember."""
    drives = played(
        {
            "agent": train(algorithm, seed=seed),
            "without": train(algorithm, seed=seed, looking=False),
        }
    )
    agent, without = drives.pop("agent"), drives.pop("without")
    return {
        "algorithm": algorithm,
        "seed": seed,
        "depth_mae_m": float(np.nanmean(agent.depth_mae_m)),
        "shots_share": agent.shots_share(),
        "over": compared(agent, drives),
        "over_itself_without_looking": compared(agent, {"without": without})["without"],
    }


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=3, help="trainings of each kind")
    parser.add_argument("--json", type=Path, help="file for the numbers")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    found = []
    for algorithm in ALGORITHMS:
        for seed in range(arguments.seeds):
            found.append(measure(algorithm, seed))
            print(json.dumps(found[-1]), flush=True)
    if arguments.json:
        arguments.json.write_text(
            json.dumps({"steps": STEPS, "drives": DRIVES, "runs": found}, indent=1) + "\n"
        )


if __name__ == "__main__":
    main()
