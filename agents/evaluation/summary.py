"""What was played, as the tables that a report is made of."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from agents.config import StudyConfig
from agents.evaluation.play import FIXED_POLICIES, PlayedDrives
from agents.evaluation.statistics import Interval, ratio, study_interval

PACKAGES: Final = (
    "shotenv",
    "torch",
    "stable-baselines3",
    "gymnasium",
    "mitsuba",
    "numpy",
    "scipy",
)
"""Packages whose versions the numbers depend on."""


def best_fixed(played: Mapping[str, PlayedDrives]) -> str:
    """Name of the fixed choice with the highest mean return on these drives."""
    fixed = [name for name in FIXED_POLICIES if name in played]
    return max(fixed, key=lambda name: played[name].reward.sum())


def best_rival(played: Mapping[str, PlayedDrives], scheduler: str) -> str:
    """Name of the policy with the highest mean return on these drives, but for the scheduler."""
    others = [name for name in played if name != scheduler]
    return max(others, key=lambda name: played[name].reward.sum())


def summary(
    played: Mapping[str, PlayedDrives], study: StudyConfig, *, scheduler: str, drive_s: float
) -> dict[str, Any]:
    """Means, differences in pairs and their intervals: the content of `results.json`.

    Parameters
    ----------
    played : mapping of str to PlayedDrives
        The same drives under each policy, the fixed ones among them.
    study : StudyConfig
        Bootstrap draws and confidence.
    scheduler : str
        Name of the policy that was trained.
    drive_s : float
        How long a drive takes, seconds.
    """
    # 8 DCS, or the most that was recorded.
    most = [name for name in FIXED_POLICIES if name in played][-1]
    # Both are picked on the drives that are judged, which favours them, not the scheduler.
    fixed, rival = best_fixed(played), best_rival(played, scheduler)
    families = sorted(set(played[fixed].family.ravel().tolist()))
    return {
        "policies": {
            name: {
                **{
                    measure: mean_interval(total, count, study)
                    for measure, (total, count) in one.per_clip().items()
                },
                "shots_share": one.shots_share(),
                "life_factor": life_factor(one, played[most], study).named("mean"),
                **tails(one, drive_s),
            }
            for name, one in played.items()
        },
        "paired_to_best_fixed": {
            name: difference(one, played[fixed], study).named("difference")
            for name, one in played.items()
        },
        "paired_to_best_rival": difference(played[scheduler], played[rival], study).named(
            "difference"
        ),
        "drives": len(played[fixed].seeds),
        "seeds": played[fixed].seeds.tolist(),
        "versions": {name: version(name) for name in PACKAGES},
        "scheduler": scheduler,
        "best_fixed": fixed,
        "best_rival": rival,
        "confidence": study.confidence,
        "families": {
            name: {family: one.shots_share(family) for family in families}
            for name, one in played.items()
        },
    }


def mean_interval(
    total: np.ndarray, count: np.ndarray, study: StudyConfig
) -> dict[str, float] | None:
    """Mean of what adds up to `total` [C] in `count` [C] frames of each clip, with its interval.

    Clips without any such frame tell nothing of it. None where it is known of fewer than two.
    """
    there = count > 0
    if np.count_nonzero(there) < 2:
        return None
    return study_interval(ratio, study, total[there], count[there]).named("mean")


def difference(one: PlayedDrives, other: PlayedDrives, study: StudyConfig) -> Interval:
    """Mean difference of the returns of a drive, frame by frame, one minus other."""
    (total, count), (other_total, _) = (each.per_clip()["return"] for each in (one, other))
    return study_interval(ratio, study, total - other_total, count)


def life_factor(one: PlayedDrives, other: PlayedDrives, study: StudyConfig) -> Interval:
    """How many times as long the laser lives as it would with another policy."""
    (own, _), (its, _) = (each.per_clip()["life_used_h"] for each in (one, other))
    return study_interval(ratio, study, its, own)


def tails(one: PlayedDrives, drive_s: float) -> dict[str, Any]:
    """What means hide: the worst that a policy did, the median drive, and how many drives tripped.

    Returns
    -------
    dict
        "depth_mae_p95_m": 95th percentile over frames with laser; "worst_clip": the clip with the
        highest mean error; "highest_temperature_k"; "laser_wh_per_h": watt-hours of laser per hour
        of driving; "tripped_drives_share": of drives with a frame without laser; "median": of
        drives, some of the measures.
    """
    lit = one.shots > 0
    known = lit & ~np.isnan(one.depth_mae_m)
    error_m, frames = one.per_clip()["depth_mae_m"]
    # A clip without any laser has no error.
    worst = int(np.argmax(np.where(frames > 0, error_m / np.maximum(frames, 1.0), -np.inf)))
    number = np.unique(one.clip)[worst]
    return {
        "depth_mae_p95_m": float(np.quantile(one.depth_mae_m[known], 0.95))
        if known.any()
        else None,
        "worst_clip": {
            "clip": int(number),
            "family": str(one.family[one.clip == number][0]),
            "depth_mae_m": float(error_m[worst] / max(frames[worst], 1.0)),
        }
        if known.any()
        else None,
        "highest_temperature_k": float(one.temperature_k.max()),
        # Joules a second are watt-hours an hour.
        "laser_wh_per_h": float(one.per_drive["laser_energy_j"].mean() / drive_s),
        "tripped_drives_share": float((~lit).any(axis=1).mean()),
        "median": {
            # JSON knows no NaN.
            name: None
            if np.isnan(one.per_drive[name]).any()
            else float(np.median(one.per_drive[name]))
            for name in ("return", "laser_energy_j", "life_used_h", "depth_mae_m")
        },
    }


def drive_rows(played: Mapping[str, PlayedDrives]) -> list[dict[str, Any]]:
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
    played: Mapping[str, PlayedDrives],
    drive: int,
    frame_rate_hz: float,
    trip_k: float,
    release_k: float,
) -> dict[str, Any]:
    """One drive, frame by frame, under each policy: the content of `timeline.json`.

    Parameters
    ----------
    played : mapping of str to PlayedDrives
        The drive under each policy, among others or not.
    drive : int
        Row of the drive in the first.
    frame_rate_hz, trip_k, release_k : float
        Of the drives, and temperatures at which their laser trips and comes back.
    """
    first = next(iter(played.values()))
    seed = int(first.seeds[drive])
    drives = {name: (one, one.seeds.tolist().index(seed)) for name, one in played.items()}
    return {
        "drive": seed,
        "power_price": float(first.power_price[drive]),
        "frame_rate_hz": frame_rate_hz,
        "trip_k": trip_k,
        "release_k": release_k,
        "family": first.family[drive].tolist(),
        "policies": {
            name: {
                "shots": one.shots[row].tolist(),
                # JSON knows no NaN.
                "depth_mae_m": [None if np.isnan(x) else float(x) for x in one.depth_mae_m[row]],
                "temperature_k": one.temperature_k[row].tolist(),
                "laser_energy_j": one.laser_energy_j[row].tolist(),
            }
            for name, (one, row) in drives.items()
        },
    }
