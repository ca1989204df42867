"""Calibration of confidences: of the pixels with confidence p, a share p should be right.

Expected calibration error and reliability diagram as in Guo, Pleiss, Sun and Weinberger, On
Calibration of Modern Neural Networks (2017), and their temperature scaling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

BINS = 15
TEMPERATURES = (0.05, 20.0)
"""Range that a temperature is sought in; assumed."""


@dataclass(frozen=True)
class ReliabilityTable:
    """A reliability diagram: bins of equal width over confidences 0..1.

    Attributes
    ----------
    share : float64 [bins]
        Of all pixels, those whose confidence lies in the bin.
    confidence, accuracy : float64 [bins]
        Mean confidence, and share that is right, in the bin; NaN where it is empty.
    """

    share: Tensor
    confidence: Tensor
    accuracy: Tensor

    @property
    def expected_error(self) -> float:
        """Mean over all pixels of how far their bin's accuracy is from its confidence."""
        apart = (self.accuracy - self.confidence).abs()
        return float((self.share * apart).nansum())


def reliability(confidence: Tensor, right: Tensor, *, bins: int = BINS) -> ReliabilityTable:
    """Reliability diagram of `confidence` (float, any shape) and `right` (bool, the same shape).

    A bin holds its lower edge; the last one holds 1, too.

    Raises
    ------
    ValueError
        Unequal shapes, nothing to count, a `right` that is not bool, a confidence outside 0..1,
        or fewer than one bin.
    """
    if confidence.shape != right.shape or not confidence.numel():
        shapes = (tuple(confidence.shape), tuple(right.shape))
        raise ValueError(f"confidence, right are {shapes}; expected one shape, not empty")
    if right.dtype != torch.bool:
        raise ValueError(f"right is {right.dtype}; expected torch.bool")
    if not bool(((confidence >= 0) & (confidence <= 1)).all()):  # False for NaN, too.
        raise ValueError("confidence holds NaN or values outside 0..1")
    if bins < 1:
        raise ValueError(f"bins is {bins}; expected at least 1")
    values = confidence.detach().flatten().double()
    place = (values * bins).long().clamp(max=bins - 1)
    # Empty bins divide 0 by 0: the NaN says that they have no mean.
    counts = torch.bincount(place, minlength=bins)
    sums = torch.bincount(place, values, minlength=bins)
    hits = torch.bincount(place, right.flatten().double(), minlength=bins)
    return ReliabilityTable(counts / len(values), sums / counts, hits / counts)


def expected_calibration_error(confidence: Tensor, right: Tensor, *, bins: int = BINS) -> float:
    """Mean distance between confidence and accuracy over bins of confidence, 0..1.

    See `reliability`, which gives each bin and tells what is raised.

    Examples
    --------
    >>> confidence = torch.tensor([0.75, 0.75, 0.75, 0.75])
    >>> expected_calibration_error(confidence, torch.tensor([True, True, False, False]))
    0.25
    """
    return reliability(confidence, right, bins=bins).expected_error


def fit_temperature(logits: Tensor, target: Tensor) -> float:
    """Temperature T for which softmax(logits / T) gives `target` the greatest likelihood.

    The negative log-likelihood is convex in 1 / T, so a golden-section search finds its minimum.

    Parameters
    ----------
    logits : float [N, classes]
    target : int64 [N]

    Raises
    ------
    ValueError
        There are no logits, or one is NaN or infinite.
    """
    if not (logits.numel() and bool(logits.isfinite().all())):
        raise ValueError(f"logits {tuple(logits.shape)} are empty or not all finite")
    coldest, hottest = TEMPERATURES
    inverse = golden_section(
        lambda inverse: float(functional.cross_entropy(logits * inverse, target)),
        1 / hottest,
        1 / coldest,
    )
    return 1 / inverse


def golden_section(
    function: Callable[[float], float], low: float, high: float, *, tolerance: float = 1e-4
) -> float:
    """Place of the minimum of a unimodal function on [low, high], with low > 0 (Kiefer 1953).

    `tolerance` is relative to the place.

    Examples
    --------
    >>> round(golden_section(lambda x: (x - 2) ** 2, 1.0, 5.0), 3)
    2.0
    """
    # The interval shrinks by this factor, at which one of the two inner places serves again.
    ratio = (5**0.5 - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = function(left), function(right)
    while high - low > tolerance * low:
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - ratio * (high - low)
            at_left = function(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + ratio * (high - low)
            at_right = function(right)
    return (low + high) / 2
