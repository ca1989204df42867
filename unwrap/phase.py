"""Correlation samples to phase, and phase to distance.

The samples are D_k ~ m S cos(phi - k pi / 2), see `unwrap.acquisition`; distance and phase are tied
by phi = 4 pi f d / c (mod 2 pi).
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from unwrap.frames import PhaseFrame
from unwrap.frequencies import SPEED_OF_LIGHT_M_S, unambiguous_range_m

__all__ = ["SPEED_OF_LIGHT_M_S", "TWO_PI", "decode", "distance_m", "unambiguous_range_m"]

TWO_PI = 2 * math.pi
BELOW_TWO_PI = float(np.nextafter(np.float32(TWO_PI), np.float32(0)))
"""Largest float32 phase of a period."""


def distance_m(phase_rad: Tensor, frequency_hz: float) -> Tensor:
    """Wrapped distance of a phase: d = c phi / (4 pi f)."""
    return phase_rad * (unambiguous_range_m(frequency_hz) / TWO_PI)


def decode(dcs: Tensor, *, offset_lsb: Tensor | None = None) -> PhaseFrame:
    """Phase and amplitude of two or four samples of one modulation frequency.

    Four samples: phi = atan2(D1 - D3, D0 - D2), A = hypot(D1 - D3, D0 - D2) / 2; offsets cancel.
    Two samples: phi = atan2(D1, D0), A = hypot(D1, D0); nothing cancels.

    Parameters
    ----------
    dcs : float [..., n, H, W]
        Samples in any one unit, n = 2 or 4.
    offset_lsb : float [..., H, W], optional
        Calibrated offset of each pixel, common to its samples, in the unit of the samples.

    Raises
    ------
    ValueError
        Another number of samples, another dtype, or a NaN or infinity; the message says where.
    """
    _check(dcs)
    if offset_lsb is not None:
        dcs = dcs - offset_lsb.unsqueeze(-3)
    if dcs.shape[-3] == 2:
        d0, d1 = dcs.unbind(-3)
        return PhaseFrame(_phase(d1, d0), _hypot(d1, d0), None)
    d0, d1, d2, d3 = dcs.unbind(-3)
    cosine, sine = d0 - d2, d1 - d3
    residual = torch.maximum((d0 + d2).abs_(), (d1 + d3).abs_())
    return PhaseFrame(_phase(sine, cosine), _hypot(sine, cosine).mul_(0.5), residual)


def _phase(sine: Tensor, cosine: Tensor) -> Tensor:
    """atan2 in [0, 2 pi); the clamp catches angles so little below 0 that adding 2 pi rounds up."""
    phase = torch.atan2(sine, cosine)
    turns = phase.mul(1 / TWO_PI).floor_()
    return phase.add_(turns, alpha=-TWO_PI).clamp_(max=BELOW_TWO_PI)


def _hypot(a: Tensor, b: Tensor) -> Tensor:
    return torch.addcmul(a * a, b, b).sqrt_()


def _check(dcs: Tensor) -> None:
    if not dcs.is_floating_point():
        raise ValueError(f"dcs is {dcs.dtype}; expected a floating-point tensor")
    if dcs.ndim < 3 or dcs.shape[-3] not in (2, 4):
        raise ValueError(f"dcs has shape {tuple(dcs.shape)}; expected [..., 2 or 4, H, W]")
    # A sum is one pass and is finite unless a sample is not (or samples are absurdly large).
    if not math.isfinite(dcs.sum()):
        for name, wrong in (("NaN", dcs.isnan()), ("an infinity", dcs.isinf())):
            if wrong.any():
                raise ValueError(f"dcs holds {name} at {wrong.nonzero()[0].tolist()}")
