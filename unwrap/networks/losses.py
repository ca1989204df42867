"""Losses of TofRegNet: scale invariant, structural similarity, depth guided, and their sum, eq. 7.

They take prediction and truth [B, H, W] in one unit and return a scalar: the mean over the images.
Equation numbers are those of Nagiub et al., Near Field iToF LIDAR Depth Improvement from Limited
Number of Shots (2023).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import torch
from torch import Tensor

from unwrap.support import require_floats

EQUATION_7 = (0.5, 0.4, 0.1)
"""Weights of the scale-invariant, similarity and depth-guided terms."""
IGNORED = -100
"""Class of a pixel that `torch.nn.functional.cross_entropy` leaves out."""

Count = TypeVar("Count", int, Tensor)


def own(count: Count) -> Count:
    """The total of a count where one process has the whole batch: the count."""
    return count


@dataclass(frozen=True)
class LossWeights:
    """How the terms of TofRegNet's loss count, and how frames do that several processes share.

    Attributes
    ----------
    equation_7 : float
        Weight of the paper's loss.
    mean_share : float
        See `scale_invariant_loss`; the paper's is 1.
    wrap : float
        Weight of `wrap_loss`; 0 in the paper.
    total : callable
        Gives the sum of a number of images or pixels over all processes that have a share of the
        batch. Every mean divides by such totals, so that a loss is the process's own part: the
        parts of all are together the loss of the whole batch, and so are their gradients.
    """

    equation_7: float = 1.0
    mean_share: float = 1.0
    wrap: float = 0.0
    total: Callable = own


def scale_invariant_loss(prediction: Tensor, truth: Tensor, mean_share: float = 1.0) -> Tensor:
    """mean(d^2) - mean_share * mean(d)^2 of each image, with d = truth - prediction.

    With the paper's `mean_share` of 1 this is the variance of the error, which says nothing about
    its mean: a depth map too far by any constant costs nothing. Less than 1 ties it down.

    Examples
    --------
    >>> truth = torch.zeros(1, 2, 2)
    >>> scale_invariant_loss(truth + 3, truth), scale_invariant_loss(truth + 3, truth, 0.85)
    (tensor(0.), tensor(1.3500))
    """
    _require_maps(prediction, truth)
    difference = (truth - prediction).flatten(1)
    squares = difference.square().mean(1)
    return (squares - mean_share * difference.mean(1).square()).mean()


def depth_guided_loss(prediction: Tensor, truth: Tensor, known: Tensor | None = None) -> Tensor:
    """Mean squared difference over the N = (W // 10) (H // 10) farthest true pixels of each image.

    At least one pixel is used. Pixels that are not `known` (bool [B, H, W]) are never the farthest;
    where an image has fewer known ones than N, the others count as no difference.

    Examples
    --------
    Of 20 x 10 pixels the two farthest count; only one is known, and its difference is 4:

    >>> truth = torch.full((1, 20, 10), 5.0)
    >>> known = torch.zeros(1, 20, 10, dtype=torch.bool)
    >>> known[0, 0, 0] = True
    >>> depth_guided_loss(truth + 4, truth, known)
    tensor(8.)
    """
    _require_maps(prediction, truth)
    height, width = truth.shape[-2:]
    count = max(1, (width // 10) * (height // 10))
    ranked, difference = truth, truth - prediction
    if known is not None:
        ranked, difference = truth.masked_fill(~known, -torch.inf), difference.where(known, 0.0)
    places = ranked.flatten(1).topk(count, dim=1, sorted=False).indices
    return difference.flatten(1).gather(1, places).square().mean()


def ssim_loss(prediction: Tensor, truth: Tensor, data_range: float = 1.0) -> Tensor:
    """1 - structural similarity (Wang et al. 2004): Gaussian window of 11 pixels, sigma 1.5.

    Only windows that lie inside the image count; images smaller than 11 pixels raise ValueError.
    """
    _require_maps(prediction, truth)
    if min(truth.shape[-2:]) < 11:
        raise ValueError(f"image is {tuple(truth.shape[-2:])}; the similarity window needs 11 x 11")
    # The constants of the paper, which keep the quotients from 0 / 0.
    c1, c2 = (0.01 * data_range) ** 2, (0.03 * data_range) ** 2
    moments = torch.stack((prediction, truth, prediction**2, truth**2, prediction * truth), 1)
    # The window is separable: a matrix product along each axis, without padding.
    height, width = truth.shape[-2:]
    blurred = _windows(height, moments) @ moments @ _windows(width, moments).T
    mean_p, mean_t, square_p, square_t, product = blurred.unbind(1)
    variances = (square_p - mean_p**2) + (square_t - mean_t**2)
    covariance = product - mean_p * mean_t
    luminance = (2 * mean_p * mean_t + c1) / (mean_p**2 + mean_t**2 + c1)
    structure = (2 * covariance + c2) / (variances + c2)
    return 1 - (luminance * structure).mean()


def _require_maps(prediction: Tensor, truth: Tensor) -> None:
    require_floats(alike=True, prediction=prediction, truth=truth)
    if truth.ndim != 3 or not truth.numel():
        raise ValueError(f"truth has shape {tuple(truth.shape)}; expected [B, H, W], not empty")


def _windows(length: int, like: Tensor) -> Tensor:
    """The window at each of its places along an axis, one place a row: [length - 10, length]."""
    distances = torch.arange(length) - torch.arange(5, length - 5)[:, None]
    # Cut off at five pixels either way and normalised, as in the paper's reference.
    window = torch.exp(-(distances**2) / (2 * 1.5**2)) * (distances.abs() <= 5)
    return (window / window.sum(1, keepdim=True)).to(like)


def regression_loss(
    prediction_m: Tensor,
    truth_m: Tensor,
    *,
    range_m: float = 30.0,
    weights: tuple[float, float, float] = EQUATION_7,
    mean_share: float = 1.0,
    known: Tensor | None = None,
) -> Tensor:
    """Eq. 7: 0.5 L_SI + 0.4 L_SSIM + 0.1 L_DG, of depths divided by `range_m`.

    The paper scales depth maps to [0, 1]; `range_m` is the depth that becomes 1. Pixels that are
    not `known` (bool [B, H, W]) count as predicted rightly.
    """
    require_floats(alike=True, prediction_m=prediction_m, truth_m=truth_m)
    if known is not None:
        truth_m = torch.where(known, truth_m, prediction_m.detach())
    prediction, truth = prediction_m / range_m, truth_m / range_m
    invariant, similar, guided = weights
    return (
        invariant * scale_invariant_loss(prediction, truth, mean_share)
        + similar * ssim_loss(prediction, truth)
        + guided * depth_guided_loss(prediction, truth, known)
    )


def masked_mean(values: Tensor, mask: Tensor, total: Callable = own) -> Tensor:
    """Mean of `values` where the bool `mask` of their shape holds; 0 where it holds nowhere.

    Of processes that share a batch each gives its part of the mean, see `LossWeights.total`.

    Examples
    --------
    >>> masked_mean(torch.tensor([1.0, torch.nan, 3.0]), torch.tensor([True, False, True]))
    tensor(2.)
    """
    # `where`, not a product: NaN times 0 is NaN.
    return values.where(mask, 0.0).sum() / total(mask.sum()).clamp(min=1)


def wrap_loss(prediction_m: Tensor, truth_m: Tensor, unambiguous_m: float) -> Tensor:
    """Mean of |e| / h and of e^2 / (e^2 + h^2), with h half the unambiguous range; ours, not eq. 7.

    The nearest-candidate merge errs where |e| > h. The second term is a smooth form of that step;
    the first has a gradient also where the error is so large that the second is flat.
    """
    error = (prediction_m - truth_m) / (unambiguous_m / 2)
    squared = error.square()
    return (error.abs() + squared / (squared + 1)).mean() / 2
