"""Clips of a study's drives by what they show: families of scenes, and how fast the ego drives."""

from __future__ import annotations

from typing import Final

import numpy as np

from agents.config import DemoConfig
from agents.evaluation import drive_seeds
from agents.optimum import by_clip, clips_of, drive_of, frames_of
from shotenv.decision import open_problem

FAMILY: Final = "family"
SPEED: Final = "ego_speed"
SPEEDS: Final = 3
"""Groups of equally many clips."""


def clip_groups(config: DemoConfig) -> dict[str, dict[str, np.ndarray]]:
    """Which of the C clips that the drives pass are of each group, bool [C].

    By "family" and its name; by "ego_speed" and its range in m/s, the mean over the frames that are
    played of the speed forwards or backwards, as the bank tells it. Clips are in the order of
    `by_clip`.

    Examples
    --------
    >>> groups = clip_groups(config)                                    # doctest: +SKIP
    >>> list(groups["ego_speed"])                                       # doctest: +SKIP
    ['0.0 to 1.9 m/s', '2.0 to 4.2 m/s', '4.3 to 15.0 m/s']
    """
    study = config.study
    problem = open_problem(config.env.model_copy(update={"split": study.split}))
    frames = frames_of([drive_of(problem, seed) for seed in drive_seeds(study, study.drives)])
    clips = clips_of(problem, frames)
    families = np.array([problem.bank.clips[number].family for number in np.unique(clips)])
    speed = np.abs(np.asarray(problem.bank.ego_speed_m_s))[frames]
    mean_m_s = by_clip(speed, clips) / by_clip(np.ones(clips.shape), clips)
    return {
        FAMILY: {str(name): families == name for name in dict.fromkeys(sorted(families))},
        SPEED: _thirds(mean_m_s),
    }


def _thirds(speed_m_s: np.ndarray) -> dict[str, np.ndarray]:
    """Equally many clips each, the slowest first."""
    groups = {}
    for third in np.array_split(np.argsort(speed_m_s, kind="stable"), SPEEDS):
        if len(third):
            low, high = speed_m_s[third[0]], speed_m_s[third[-1]]
            groups[f"{low:.1f} to {high:.1f} m/s"] = np.isin(np.arange(len(speed_m_s)), third)
    return groups
