"""Correlation samples to phase, and phase to distance.

The samples are D_k ~ m S cos(phi - k pi / 2), see `unwrap.acquisition`; distance and phase are tied
by phi = 4 pi f d / c (mod 2 pi).
"""

from __future__ import annotations

import math
from dataclasses import replace

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
    frame = decode_angle(dcs, offset_lsb=offset_lsb)
    turns = torch.add(frame.phase_rad.new_ones(()), frame.phase_rad, alpha=1 / TWO_PI)
    return replace(frame, phase_rad=phase_of_turns(turns))


def decode_angle(dcs: Tensor, *, offset_lsb: Tensor | None = None) -> PhaseFrame:
    """As `decode`, but with phases in [-pi, pi]."""
    _check(dcs)
    if offset_lsb is not None:
        dcs = dcs - offset_lsb.unsqueeze(-3)
    if dcs.shape[-3] == 2:
        return PhaseFrame(*_polar(dcs), None)
    first, opposite = dcs.split(2, dim=-3)
    angle, length = _polar(first - opposite)
    return PhaseFrame(angle, length.mul_(0.5), (first + opposite).abs_().amax(dim=-3))


def _polar(quadratures: Tensor) -> tuple[Tensor, Tensor]:
    """Angle and length of [..., 2, H, W], cosine and sine."""
    cosine, sine = quadratures.unbind(-3)
    return torch.atan2(sine, cosine), (cosine * cosine).addcmul_(sine, sine).sqrt_()


def phase_of_turns(turns: Tensor) -> Tensor:
    """Phase in [0, 2 pi), in place, of turns that are not negative.

    A fraction of a turn is a whole number of steps of float and never rounds up to the next one.
    """
    return turns.frac_().mul_(TWO_PI)


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
