"""Bootstrap intervals over drives: every policy is judged on the same drives, so pairs count."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.stats import bootstrap

from agents.config import StudyConfig

Statistic = Callable[..., np.ndarray]


@dataclass(frozen=True)
class Interval:
    """A point estimate and its confidence interval."""

    value: float
    low: float
    high: float

    def named(self, name: str) -> dict[str, float]:
        """As plain numbers, the point estimate under `name`."""
        numbers = asdict(self)
        return {name: numbers.pop("value"), **numbers}


def mean(values: np.ndarray, axis: int = -1) -> np.ndarray:
    """Mean over drives."""
    return np.mean(values, axis=axis)


def mean_difference(a: np.ndarray, b: np.ndarray, axis: int = -1) -> np.ndarray:
    """Mean over drives of the paired difference a - b."""
    return np.mean(a - b, axis=axis)


def excess(cost: np.ndarray, reference: np.ndarray, axis: int = -1) -> np.ndarray:
    """How much more `cost` is than `reference`, summed over drives: 0.15 is 15 % more."""
    return np.sum(cost, axis=axis) / np.sum(reference, axis=axis) - 1.0


def study_interval(statistic: Statistic, study: StudyConfig, *samples: np.ndarray) -> Interval:
    """`interval` with the draws and the confidence of a study."""
    return interval(statistic, *samples, draws=study.bootstrap_draws, confidence=study.confidence)


def interval(
    statistic: Statistic,
    *samples: Sequence[float] | np.ndarray,
    draws: int,
    confidence: float,
    seed: int = 0,
) -> Interval:
    """Bias-corrected and accelerated (BCa) bootstrap interval of a statistic of paired samples.

    Parameters
    ----------
    statistic : callable
        `statistic(*samples, axis)`, such as `mean`, `mean_difference` or `excess`.
    samples : float [N] each
        One value per drive; the drives of all samples are the same and resampled together.
    draws, confidence, seed
        Number of resamples, coverage, and the seed of the resampling.

    Raises
    ------
    ValueError
        Fewer than two drives, samples of unequal length, or a value that is not finite.

    Notes
    -----
    Efron, *Better bootstrap confidence intervals*, J. Am. Stat. Assoc. 82 (1987). Where the
    statistic does not depend on which drives are drawn, the interval is the point itself.
    """
    arrays = tuple(np.asarray(sample, dtype=np.float64) for sample in samples)
    shapes = [array.shape for array in arrays]
    if len(set(shapes)) != 1 or arrays[0].ndim != 1 or arrays[0].size < 2:
        raise ValueError(f"samples have shapes {shapes}; expected equal [N] with N >= 2 drives")
    if not all(np.isfinite(array).all() for array in arrays):
        raise ValueError("samples hold a value that is not finite; expected one number per drive")
    point = float(statistic(*arrays, axis=-1))
    # BCa divides by the spread over samples with one drive left out; it is 0 where a policy does
    # the same in every drive, as always 2 DCS does in its share of shots. scipy would answer with
    # a warning and NaN.
    kept = ~np.eye(arrays[0].size, dtype=bool)
    one_left_out = [float(statistic(*(array[row] for array in arrays), axis=-1)) for row in kept]
    if np.allclose(one_left_out, point, rtol=1e-12, atol=1e-15):
        return Interval(point, point, point)
    result = bootstrap(
        arrays,
        statistic,
        paired=True,
        vectorized=True,
        n_resamples=draws,
        confidence_level=confidence,
        method="BCa",
        batch=1000,  # resamples held in memory at a time
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return Interval(point, float(result.low), float(result.high))
