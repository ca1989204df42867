"""Evaluation: every policy on the same drives with the same sensor noise, compared in pairs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from agents.policies import FixedPolicy, Policy
from agents.statistics import Interval, interval, mean, mean_difference
from shotenv.config import StudyConfig

if TYPE_CHECKING:
    from gymnasium.vector import VectorEnv

SHOTS: Final = (2, 4, 8)
FIXED: Final = {f"always_{shots}": FixedPolicy(shots) for shots in SHOTS}
MEASURES: Final = (
    "return",
    "laser_energy_j",
    "energy_j",
    "depth_mae_m",
    "wrap_accuracy",
    "tripped_share",
)
PACKAGES: Final = (
    "shotenv",
    "torch",
    "stable-baselines3",
    "gymnasium",
    "mitsuba",
    "numpy",
    "scipy",
)


@dataclass(frozen=True)
class Played:
    """Drives as a policy drove them; N drives of T frames.

    Attributes
    ----------
    seeds : int64 [N]
        Seeds of the drives.
    shots : int64 [N, T]
        Samples taken; 0 where the laser was off.
    reward, laser_energy_j, energy_j, depth_mae_m, wrap_accuracy, temperature_k : float64 [N, T]
        As in the environment's `info`; error and wrap accuracy are NaN where the laser was off.
    family : str [N, T]
        Scene family of the frame.
    """

    seeds: np.ndarray
    shots: np.ndarray
    reward: np.ndarray
    laser_energy_j: np.ndarray
    energy_j: np.ndarray
    depth_mae_m: np.ndarray
    wrap_accuracy: np.ndarray
    temperature_k: np.ndarray
    family: np.ndarray

    @property
    def per_drive(self) -> dict[str, np.ndarray]:
        """One number [N] per drive for each of `MEASURES`."""
        return {
            "return": self.reward.sum(axis=1),
            "laser_energy_j": self.laser_energy_j.sum(axis=1),
            "energy_j": self.energy_j.sum(axis=1),
            "depth_mae_m": np.nanmean(self.depth_mae_m, axis=1),
            "wrap_accuracy": np.nanmean(self.wrap_accuracy, axis=1),
            "tripped_share": np.mean(self.shots == 0, axis=1),
        }

    def shots_share(self, family: str | None = None) -> list[float]:
        """Share of 2, 4 and 8 shots among the frames with laser, of one family or of all."""
        counted = self.shots if family is None else self.shots[self.family == family]
        total = max(int(np.count_nonzero(counted)), 1)
        return [float(np.count_nonzero(counted == shots) / total) for shots in SHOTS]


def drive_seeds(study: StudyConfig, drives: int) -> list[int]:
    """Seeds of the first `drives` drives of a study."""
    return [study.seed + i for i in range(drives)]


def play_drives(
    policy: Policy,
    envs: VectorEnv,
    seeds: Sequence[int],
    *,
    tick: Callable[[int], object] = lambda frames: None,
) -> Played:
    """Drive one drive per environment, all at once, to the end.

    Parameters
    ----------
    policy : Policy
        Is reset first.
    envs : gymnasium.vector.VectorEnv
        As many environments as `seeds`, in any autoreset mode.
    seeds : sequence of int
        Seed of each drive.
    tick : callable
        Told the number of frames driven after each step.
    """
    one_each: Any = list(seeds)  # gymnasium's annotation forgets sequences
    observations, infos = envs.reset(seed=one_each)
    policy.reset()
    frames: list[dict[str, np.ndarray]] = []
    done = np.zeros(len(seeds), dtype=bool)
    while not done.all():
        actions = policy.act(observations, infos)
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        done = terminated | truncated
        frames.append(_frame(rewards, infos))
        tick(len(seeds))
    stacked = {name: np.stack([frame[name] for frame in frames], axis=1) for name in frames[0]}
    return Played(seeds=np.asarray(seeds), **stacked)


def _frame(rewards: np.ndarray, infos: Mapping[str, Any]) -> dict[str, Any]:
    told = infos.get("final_info", infos)
    off = np.asarray(told["shots"]) == 0
    return {
        "shots": np.array(told["shots"], dtype=np.int64),
        "reward": np.array(rewards, dtype=np.float64),
        "laser_energy_j": np.array(told["laser_energy_j"]),
        "energy_j": np.array(told["energy_j"]),
        "depth_mae_m": np.where(off, np.nan, told["depth_mae_m"]),
        "wrap_accuracy": np.where(off, np.nan, told["wrap_accuracy"]),
        "temperature_k": np.array(told["temperature_k"]),
        "family": np.array(told["family"], dtype=np.str_),
    }


def best_fixed(played: Mapping[str, Played]) -> str:
    """Name of the fixed choice with the highest mean return on these drives."""
    return max(FIXED, key=lambda name: played[name].reward.sum())


def best_rival(played: Mapping[str, Played], scheduler: str) -> str:
    """Name of the policy with the highest mean return on these drives, but for the scheduler."""
    others = [name for name in played if name != scheduler]
    return max(others, key=lambda name: played[name].reward.sum())


def summary(
    played: Mapping[str, Played], study: StudyConfig, *, scheduler: str, **extra: Any
) -> dict[str, Any]:
    """The content of `results.json`.

    Parameters
    ----------
    played : mapping of str to Played
        The same drives under each policy, the fixed ones among them.
    study : StudyConfig
        Bootstrap draws and confidence.
    scheduler : str
        Name of the policy that was trained.
    extra
        Further keys.
    """
    fixed, rival = best_fixed(played), best_rival(played, scheduler)
    families = sorted(set(played[fixed].family.ravel().tolist()))
    return {
        "policies": {name: _measured(one, study) for name, one in played.items()},
        "paired_to_best_fixed": {
            name: difference(one, played[fixed], study).named("difference")
            for name, one in played.items()
        },
        "paired_to_best_rival": difference(played[scheduler], played[rival], study).named(
            "difference"
        ),
        "drives": len(played[fixed].seeds),
        "seeds": played[fixed].seeds.tolist(),
        "versions": versions(),
        "scheduler": scheduler,
        "best_fixed": fixed,
        "best_rival": rival,
        "confidence": study.confidence,
        "families": {
            name: {family: one.shots_share(family) for family in families}
            for name, one in played.items()
        },
        **extra,
    }


def _measured(played: Played, study: StudyConfig) -> dict[str, Any]:
    intervals = {
        name: _interval(mean, study, values).named("mean")
        for name, values in played.per_drive.items()
    }
    return {**intervals, "shots_share": played.shots_share()}


def difference(one: Played, other: Played, study: StudyConfig) -> Interval:
    """Mean difference of the returns, drive by drive, one minus other."""
    return _interval(mean_difference, study, one.per_drive["return"], other.per_drive["return"])


def _interval(statistic: Callable, study: StudyConfig, *samples: np.ndarray) -> Interval:
    return interval(statistic, *samples, draws=study.bootstrap_draws, confidence=study.confidence)


def versions() -> dict[str, str]:
    """Versions of the packages that the numbers depend on."""
    return {name: version(name) for name in PACKAGES}


def drive_rows(played: Mapping[str, Played]) -> list[dict[str, Any]]:
    """One row per policy and drive: the content of `drives.csv`."""
    return [
        {
            "policy": name,
            "seed": int(one.seeds[i]),
            **{measure: float(values[i]) for measure, values in one.per_drive.items()},
        }
        for name, one in played.items()
        for i in range(len(one.seeds))
    ]


def timeline(
    played: Mapping[str, Played], drive: int, frame_rate_hz: float, trip_k: float, release_k: float
) -> dict[str, Any]:
    """One drive, frame by frame, under each policy: the content of `timeline.json`."""
    first = next(iter(played.values()))
    return {
        "drive": int(first.seeds[drive]),
        "frame_rate_hz": frame_rate_hz,
        "trip_k": trip_k,
        "release_k": release_k,
        "family": first.family[drive].tolist(),
        "policies": {
            name: {
                "shots": one.shots[drive].tolist(),
                "depth_mae_m": [None if np.isnan(x) else float(x) for x in one.depth_mae_m[drive]],
                "temperature_k": one.temperature_k[drive].tolist(),
            }
            for name, one in played.items()
        },
    }
