"""Statistics over training seeds and clips.

Clips are the same for all seeds and policies: they are crossed with the seeds, not nested in them.
So a resample draws clips once for all, as whole clusters of frames, and beside them the seeds of
each policy (Owen, "The pigeonhole bootstrap", Ann. Appl. Stat. 1, 2007); to draw other clips for
each seed would average away what the choice of clips does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agents.config import StudyConfig
from agents.evaluation import Interval

MOST_DRAWS = 1000
"""Resamples at most (assumed): each measures every front anew."""
CUT = 0.25
"""Of the seeds at either end, which an interquartile mean leaves out."""


def interquartile_mean(values: np.ndarray, axis: int = -1) -> np.ndarray:
    """Mean of the middle half, along `axis`; of 5 values that of the middle 3, of few of all.

    Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice", NeurIPS
    2021 (rliable).

    Examples
    --------
    >>> float(interquartile_mean(np.array([-90.0, 1.0, 2.0, 3.0, 1000.0])))
    2.0
    """
    ordered = np.sort(values, axis=axis)
    count = ordered.shape[axis]
    cut = int(CUT * count)
    return ordered.take(range(cut, count - cut), axis=axis).mean(axis=axis)


@dataclass(frozen=True)
class Resamples:
    """Draws of clips, that all policies share, and the seed of those of training seeds.

    Attributes
    ----------
    clips : float64 [B, C]
        How often each clip was drawn.
    study : StudyConfig
        Confidence.
    """

    clips: np.ndarray
    study: StudyConfig

    @classmethod
    def draw(cls, clips: int, study: StudyConfig) -> Resamples:
        """As many as the study wants, `MOST_DRAWS` at most."""
        draws = min(study.bootstrap_draws, MOST_DRAWS)
        even = np.full(clips, 1.0 / clips)
        counts = np.random.default_rng(0).multinomial(clips, even, size=draws)
        return cls(counts.astype(np.float64), study)

    def seeds(self, policy: int, count: int) -> np.ndarray:
        """Training seeds of the policy of a number, as each resample drew them; int64 [B, S]."""
        return np.random.default_rng((1, policy)).integers(count, size=(len(self.clips), count))

    def interval(self, point: float, drawn: np.ndarray) -> Interval:
        """Percentile interval of what the resamples came to, [B]."""
        tail = (1.0 - self.study.confidence) / 2.0
        low, high = np.quantile(drawn, (tail, 1.0 - tail))
        return Interval(float(point), float(low), float(high))

    def over_seeds(self, point: np.ndarray, drawn: np.ndarray, policy: int) -> Interval:
        """Interquartile mean over the seeds.

        Parameters
        ----------
        point : float64 [S]
            Measure of each seed on all clips.
        drawn : float64 [B, S]
            The same with the clips of each resample.
        policy : int
            Number of the policy.
        """
        return self.interval(float(interquartile_mean(point)), self.seed_means(drawn, policy))

    def seed_means(self, drawn: np.ndarray, policy: int) -> np.ndarray:
        """Interquartile mean [B] over the seeds that each resample drew, of `drawn` [B, S]."""
        chosen = np.take_along_axis(drawn, self.seeds(policy, drawn.shape[1]), axis=1)
        return interquartile_mean(chosen)

    def improvement(
        self, one: np.ndarray, other: np.ndarray, policies: tuple[int, int]
    ) -> Interval:
        """Probability that one policy does better than another on a clip, whatever their seeds.

        The mean over clips, and over pairs of seeds, of 1 where `one` is more, .5 where both are
        equal, else 0 (Agarwal et al. 2021: their tasks are clips here).

        Parameters
        ----------
        one, other : float64 [S, C], [R, C]
            Score of each seed on each clip.
        policies : (int, int)
            Their numbers.
        """
        difference = one[:, None] - other[None]
        better = (np.sign(difference) + 1.0) / 2.0
        own, its = (
            (self.seeds(policy, len(scores))[..., None] == np.arange(len(scores))).mean(axis=1)
            for policy, scores in zip(policies, (one, other), strict=True)
        )
        clips = self.clips / self.clips.sum(axis=1, keepdims=True)
        drawn = np.einsum("bi,bj,bc,ijc->b", own, its, clips, better, optimize=True)
        return self.interval(float(better.mean()), drawn)
