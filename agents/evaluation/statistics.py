"""Bootstrap intervals of paired samples.

Drives that pass the same clips are no independent trials. Where clips are known they are what is
resampled, each as a whole (a cluster).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TypeVar

import numpy as np
from scipy.stats import bootstrap

from agents.config import StudyConfig

Statistic = Callable[..., np.ndarray]
Key = TypeVar("Key", bound=Hashable)
MOST_DRAWS = 2000
"""Of `resampled`, whose statistics are computed one by one."""


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


def excess(cost: np.ndarray, reference: np.ndarray, axis: int = -1) -> np.ndarray:
    """How much more `cost` is than `reference`, summed over drives: 0.15 is 15 % more."""
    return np.sum(cost, axis=axis) / np.sum(reference, axis=axis) - 1.0


def ratio(total: np.ndarray, count: np.ndarray, axis: int = -1) -> np.ndarray:
    """Mean of what adds up to `total` [C] over `count` [C] frames of each clip."""
    return np.sum(total, axis=axis) / np.sum(count, axis=axis)


def resampled(
    statistic: Callable[[np.ndarray], float], clusters: int, study: StudyConfig, *, seed: int = 0
) -> Interval:
    """`resampled_each` of one statistic."""
    return resampled_each(lambda weight: {"": statistic(weight)}, clusters, study, seed=seed)[""]


def resampled_each(
    statistics: Callable[[np.ndarray], Mapping[Key, float]],
    clusters: int,
    study: StudyConfig,
    *,
    seed: int = 0,
) -> dict[Key, Interval]:
    """Percentile bootstrap intervals of statistics of how often each cluster counts.

    For statistics that are no plain sums, such as the error at a given energy. Those of one call
    share the resamples, as pairs do.

    Parameters
    ----------
    statistics : callable
        From weights float64 [C], all 1 for the point estimates, else how often each cluster was
        drawn, to the same keys each time.
    clusters : int
        Their number C.
    study : StudyConfig
        Draws, of which `MOST_DRAWS` at most are made, and confidence.
    """
    draws = np.random.default_rng(seed).multinomial(
        clusters, np.full(clusters, 1 / clusters), size=min(study.bootstrap_draws, MOST_DRAWS)
    )
    values = [list(statistics(weight.astype(np.float64)).values()) for weight in draws]
    tail = (1.0 - study.confidence) / 2.0
    low, high = np.quantile(values, (tail, 1.0 - tail), axis=0)
    points = statistics(np.ones(clusters))
    return {
        key: Interval(float(point), float(low[i]), float(high[i]))
        for i, (key, point) in enumerate(points.items())
    }


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
        `statistic(*samples, axis)`, such as `ratio` or `excess`.
    samples : float [N] each
        One value per drive, or per clip; those of all samples are the same and resampled together.
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
