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
    samples = sound_samples(dcs, offset_lsb)
    quadratures = quadratures_of(samples)
    phase_rad = phase_of_turns(turns_of(angle_of(*quadratures)))
    return PhaseFrame(phase_rad, *strength_of(samples, *quadratures))


def sound_samples(dcs: Tensor, offset_lsb: Tensor | None) -> Tensor:
    """Samples [..., n, H, W], refused if they are unsound, without their offset [..., H, W]."""
    _check(dcs)
    return dcs if offset_lsb is None else dcs - offset_lsb.unsqueeze(-3)


def quadratures_of(samples: Tensor) -> tuple[Tensor, Tensor]:
    """Cosine and sine [..., H, W]: D0 - D2 and D1 - D3 of four samples, D0 and D1 of two."""
    maps = samples.unbind(-3)
    if len(maps) == 2:
        return maps[0], maps[1]
    return maps[0] - maps[2], maps[1] - maps[3]


def angle_of(cosine: Tensor, sine: Tensor) -> Tensor:
    """Phase in [-pi, pi]."""
    return torch.atan2(sine, cosine)


def strength_of(samples: Tensor, cosine: Tensor, sine: Tensor) -> tuple[Tensor, Tensor | None]:
    """Amplitude and residual of samples, see `PhaseFrame`.

    The quadratures of four samples, which are not needed any more, lend their memory: what is
    in the processor's cache need not be fetched.
    """
    if samples.shape[-3] == 2:
        return (cosine * cosine).addcmul_(sine, sine).sqrt_(), None
    amplitude = cosine.mul_(cosine).addcmul_(sine, sine).sqrt_().mul_(0.5)
    first, second, third, fourth = samples.unbind(-3)
    residual = torch.add(first, third, out=sine).abs_()
    return amplitude, torch.maximum(residual, (second + fourth).abs_(), out=residual)


def turns_of(phase_rad: Tensor) -> Tensor:
    """Phases in [-pi, 2 pi), in place, as turns, one more, so none is negative."""
    return phase_rad.mul_(1 / TWO_PI).add_(1)


def phase_of_turns(turns: Tensor) -> Tensor:
    """Phase in [0, 2 pi), in place, of turns that are not negative.

    The largest float below one, times 2 pi, rounds to one below 2 pi.
    """
    return turns.frac_().mul_(TWO_PI)


def _check(dcs: Tensor) -> None:
    if not dcs.is_floating_point():
        raise ValueError(f"dcs is {dcs.dtype}; expected a floating-point tensor")
    if dcs.ndim < 3 or dcs.shape[-3] not in (2, 4):
        raise ValueError(f"dcs has shape {tuple(dcs.shape)}; expected [..., 2 or 4, H, W]")
    if torch.compiler.is_compiling():
        return  # A graph, such as an exported one, is made before there are values.
    # A sum is one pass and is finite unless a sample is not (or samples are absurdly large).
    if not math.isfinite(dcs.sum()):
        for name, wrong in (("NaN", dcs.isnan()), ("an infinity", dcs.isinf())):
            if wrong.any():
                raise ValueError(f"dcs holds {name} at {wrong.nonzero()[0].tolist()}")
