"""Intervals of 95 % have a known truth within them in about 95 % of repetitions.

Each repetition draws what two policies do in 74 clips, as many as 24 test drives pass: clips differ
much more than policies do, as clips do. The truth is that of all clips that could be drawn.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from agents.config import StudyConfig
from agents.evaluation.statistics import Interval, excess, resampled, study_interval
from reliability.rows import Progress, Row

CLIPS, REPETITIONS = 74, 1000
TRUTH = 0.15
"""By how much the second policy's cost exceeds the first's."""
ALLOWED = 0.02
"""Of the coverage; three standard deviations of 1000 repetitions."""


def drawn(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Costs of two policies in each clip, [C]: skewed, and alike in the same clip."""
    clip = random.gamma(4.0, 1.0, CLIPS)
    one, other = clip * random.gamma(25.0, 1 / 25, (2, CLIPS))
    return one, (1 + TRUTH) * other


def by_acceleration(cost: np.ndarray, reference: np.ndarray, study: StudyConfig) -> Interval:
    """As reports have it of plain sums over clips."""
    return study_interval(excess, study, cost, reference)


def by_percentiles(cost: np.ndarray, reference: np.ndarray, study: StudyConfig) -> Interval:
    """As reports have it of what is no sum over clips."""
    return resampled(
        lambda weight: float((weight * cost).sum() / (weight * reference).sum() - 1), CLIPS, study
    )


def measure(progress: Progress) -> list[Row]:
    repetitions = progress.size(REPETITIONS, 20)
    study = StudyConfig(bootstrap_draws=progress.size(StudyConfig().bootstrap_draws, 500))
    kinds: dict[str, Callable[[np.ndarray, np.ndarray, StudyConfig], Interval]] = {
        "bias-corrected and accelerated": by_acceleration,
        "percentiles": by_percentiles,
    }

    def of(name: str) -> Row:
        begun, random, covered = time.perf_counter(), np.random.default_rng(0), 0
        for number in range(repetitions):
            reference, cost = drawn(random)
            found = kinds[name](cost, reference, study)
            covered += found.low <= TRUTH <= found.high
            if (number + 1) % 100 == 0:
                progress(f"{name}: {covered} of {number + 1} covered")
        share = covered / repetitions
        return Row(
            14,
            f"{repetitions} repetitions, {CLIPS} clips, a ratio of sums; bootstrap: {name}",
            {"covered, %": 100 * share},
            abs(share - 0.95) <= ALLOWED,
            time.perf_counter() - begun,
        )

    return [progress.row(14, name, partial(of, name)) for name in kinds]
