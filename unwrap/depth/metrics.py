"""Depth metrics: per image over valid pixels, then the mean over images.

KITTI's development kit and the papers after Eigen et al. (2014) give the name SqRel to different
numbers: e^2 / truth^2 and e^2 / truth; both are given, named apart. Predictions are raised to
`MIN_DEPTH_M` and true depths below it are left out, since iRMSE and the logarithmic error explode
near 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import torch
from torch import Tensor

from unwrap.support import require_floats

MIN_DEPTH_M = 0.1
"""Smallest depth used, metres."""


def depth_metrics(prediction_m: Tensor, truth_m: Tensor, valid: Tensor) -> dict[str, float]:
    """Errors of depth maps.

    Parameters
    ----------
    prediction_m, truth_m : float [B, H, W]
        Metres; only values at valid pixels are looked at.
    valid : bool [B, H, W]
        Pixels to score.

    Returns
    -------
    dict
        With e = prediction - truth and l = ln truth - ln prediction: `mae_m` mean(|e|), `rmse_m`
        sqrt(mean(e^2)), `irmse_per_km` 1000 sqrt(mean((1 / truth - 1 / prediction)^2)), `abs_rel`
        mean(|e| / truth), `sq_rel_kitti` mean(e^2 / truth^2), `sq_rel_eigen` mean(e^2 / truth),
        `silog` 100 sqrt(mean(l^2) - mean(l)^2), `within_0p1m` and `within_0p5m` shares of pixels,
        `p95_m` the 95th percentile of |e|. Images without valid pixels do not count; all values
        are NaN where none has any.

    Raises
    ------
    ValueError
        Shapes differ, or `valid` is not bool.

    Examples
    --------
    >>> truth_m = torch.full((1, 2, 2), 10.0)
    >>> metrics = depth_metrics(truth_m + 0.5, truth_m, torch.ones(1, 2, 2).bool())
    >>> round(metrics["mae_m"], 3), round(metrics["abs_rel"], 3)
    (0.5, 0.05)
    """
    require_floats(prediction_m=prediction_m, truth_m=truth_m)
    if not isinstance(valid, Tensor):
        raise TypeError(f"valid is {type(valid).__name__}; expected a torch tensor of bool")
    if not (prediction_m.shape == truth_m.shape == valid.shape) or valid.ndim != 3:
        shapes = [tuple(tensor.shape) for tensor in (prediction_m, truth_m, valid)]
        raise ValueError(f"prediction_m, truth_m, valid are {shapes}; expected one shape [B, H, W]")
    if valid.dtype != torch.bool:
        raise ValueError(f"valid is {valid.dtype}; expected torch.bool")
    used = valid & (truth_m >= MIN_DEPTH_M)
    # In float64: squares of float32 would lose digits where errors are small beside the depth.
    images = [
        (prediction.clamp(min=MIN_DEPTH_M).double(), truth.double())
        for prediction, truth in (
            (prediction_m[i][used[i]], truth_m[i][used[i]]) for i in range(len(used))
        )
        if len(truth)
    ]
    if not images:
        return dict.fromkeys(METRICS, math.nan)
    values = [[float(metric(*image)) for metric in METRICS.values()] for image in images]
    means = torch.tensor(values, dtype=torch.float64).mean(0).tolist()
    return dict(zip(METRICS, means, strict=True))


METRICS: Mapping[str, Callable[[Tensor, Tensor], Tensor]] = {
    "mae_m": lambda p, t: (p - t).abs().mean(),
    "rmse_m": lambda p, t: (p - t).square().mean().sqrt(),
    "irmse_per_km": lambda p, t: 1000 * (1 / t - 1 / p).square().mean().sqrt(),
    "abs_rel": lambda p, t: ((p - t).abs() / t).mean(),
    "sq_rel_kitti": lambda p, t: ((p - t).square() / t.square()).mean(),
    "sq_rel_eigen": lambda p, t: ((p - t).square() / t).mean(),
    # mean(l^2) - mean(l)^2 is the variance, which does not come out negative by rounding.
    "silog": lambda p, t: 100 * (t.log() - p.log()).var(correction=0).sqrt(),
    "within_0p1m": lambda p, t: ((p - t).abs() <= 0.1).double().mean(),
    "within_0p5m": lambda p, t: ((p - t).abs() <= 0.5).double().mean(),
    "p95_m": lambda p, t: (p - t).abs().quantile(0.95),
}
"""Metrics of one image by name, of its predicted and true distances (float64 [N], metres)."""
