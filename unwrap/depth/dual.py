"""Two-frequency unwrapping: the pair of wrap candidates that agrees best, within a range."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from unwrap.signal import SensorDescription, TurnsTable, distance_m, unambiguous_range_m
from unwrap.support import loop

Array = np.ndarray
# float32, since a Python float would make the arithmetic of a loop float64.
ZERO, FAR, TWO_PI = np.float32(0.0), np.float32(1e9), np.float32(2 * np.pi)


def unwrap_dual(
    phase1_rad: Tensor, phase2_rad: Tensor, f1_hz: float, f2_hz: float, *, max_range_m: float
) -> tuple[Tensor, Tensor]:
    """Distance from the wrapped phases at two frequencies.

    Of all wraps of f1 up to `max_range_m`, each with its nearest wrap of f2, the one with the
    smallest disagreement wins. The two distances are fused by inverse variance: at equal phase
    noise the standard deviation goes with 1 / f, so the weights go with f^2.

    Parameters
    ----------
    phase1_rad, phase2_rad : float [..., H, W]
        Phases in [0, 2 pi) at `f1_hz` and `f2_hz`.
    max_range_m : float
        Largest distance considered, metres. In noise a wrong candidate may win anywhere in this
        range, so it should be no larger than the scene.

    Returns
    -------
    distance_m : float [..., H, W]
        Fused distance, metres, never negative.
    residual_m : float [..., H, W]
        Disagreement of the two frequencies, metres.

    Raises
    ------
    ValueError
        Unequal shapes, or a frequency or range that is not positive.

    Examples
    --------
    Phases of a surface at 10 m, beyond the unambiguous range of 24 MHz, 6.25 m:

    >>> phases = [torch.tensor([4 * torch.pi * f / 299_792_458 * 10.0]) for f in (24e6, 10e6)]
    >>> wrapped = [phase.remainder(2 * torch.pi) for phase in phases]
    >>> distance_m, residual_m = unwrap_dual(*wrapped, 24e6, 10e6, max_range_m=25.0)
    >>> distance_m, bool(residual_m < 1e-4)
    (tensor([10.0000]), True)
    """
    if phase1_rad.shape != phase2_rad.shape:
        raise ValueError(
            f"phase2_rad has shape {tuple(phase2_rad.shape)}; expected that of phase1_rad, "
            f"{tuple(phase1_rad.shape)}"
        )
    for name, value in (("f1_hz", f1_hz), ("f2_hz", f2_hz), ("max_range_m", max_range_m)):
        if not (value > 0 and math.isfinite(value)):
            raise ValueError(f"{name} is {value}; expected a positive number")
    range1_m, range2_m = unambiguous_range_m(f1_hz), unambiguous_range_m(f2_hz)
    wrapped1_m, wrapped2_m = distance_m(phase1_rad, f1_hz), distance_m(phase2_rad, f2_hz)
    # Disagreements are held in wraps of f2: its nearest wrap is then found by rounding.
    gap = (wrapped1_m - wrapped2_m).mul_(1 / range2_m)
    last = math.floor(max_range_m / range1_m)
    wraps = _best_wraps(gap, range1_m / range2_m, last + 1)
    if last:
        # The last wrap ends beyond the range: only the nearer part of its distances is considered.
        fits = wrapped1_m < max_range_m - last * range1_m
        wraps = torch.where(fits, wraps, _best_wraps(gap, range1_m / range2_m, last))
    # What is left over the nearest whole wrap of f2: the disagreement of the chosen pair.
    best = gap.add_(wraps, alpha=range1_m / range2_m)
    best.sub_(best.round())
    share2 = f2_hz**2 / (f1_hz**2 + f2_hz**2)
    # (1 - share2) d1 + share2 d2 = d1 - share2 (d1 - d2); the second distance is never formed.
    fused_m = wrapped1_m.add_(wraps, alpha=range1_m).sub_(best, alpha=share2 * range2_m)
    return fused_m.clamp_(min=0), best.abs_().mul_(range2_m)


def _best_wraps(gap: Tensor, wrap: float, count: int) -> Tensor:
    """The n below `count` that brings `gap` + n `wrap` nearest to a whole number.

    Candidate n fits exactly where the fraction of the gap is that of -n `wrap`. On the circle of
    fractions it is the nearest one up to half way to its neighbours. So each pixel needs `count`
    comparisons with constants, and no distance to each of the candidates.
    """
    places = sorted((-n * wrap % 1.0, n) for n in range(count))
    # From half way between the last place and the first, that of no wrap, all the way round.
    start = (places[-1][0] + 1.0) / 2.0
    turned = gap.add(2.0 - start).frac_()
    wraps, beyond = torch.zeros_like(gap), torch.empty_like(gap)
    # A staircase: at each border the n of the place before gives way to that of the place after.
    for (low, before), (high, after) in pairwise(places):
        torch.ge(turned, (low + high) / 2.0 + 1.0 - start, out=beyond)
        wraps.add_(beyond, alpha=after - before)
    return wraps


class DualLimits(NamedTuple):
    """Constants of two frequencies for `fuse_pixels`, float32 but for the last wrap of f1.

    Attributes
    ----------
    range1_m, range2_m
        Unambiguous ranges.
    share2
        Weight of the second distance.
    last, last_ends_m
        Last wrap of f1 that begins within the range, and the wrapped distance where the range ends
        in it.
    max_residual_m, min_snr
        As in `SensorDescription`.
    """

    range1_m: np.float32
    range2_m: np.float32
    share2: np.float32
    last: int
    last_ends_m: np.float32
    max_residual_m: np.float32
    min_snr: np.float32


def dual_limits(sensor: SensorDescription) -> DualLimits:
    """The constants of a sensor."""
    range1_m, range2_m = map(unambiguous_range_m, (sensor.f1_hz, sensor.f2_hz))
    last = math.floor(sensor.max_range_m / range1_m)
    share2 = sensor.f2_hz**2 / (sensor.f1_hz**2 + sensor.f2_hz**2)
    ends_m = sensor.max_range_m - last * range1_m if last else float(FAR)
    return DualLimits(
        range1_m=np.float32(range1_m),
        range2_m=np.float32(range2_m),
        share2=np.float32(share2),
        last=last,
        last_ends_m=np.float32(ends_m),
        max_residual_m=np.float32(sensor.max_residual_m),
        min_snr=np.float32(sensor.min_snr),
    )


@loop
def fuse_pixels(
    phase1_rad: Array,
    angle2_rad: Array,
    turns_table: TurnsTable,
    shift_turns: Array,
    amplitude2: Array,
    noise: Array,
    valid: Array,
    limits: DualLimits,
    distance_m: Array,
) -> None:
    """Distances by two frequencies where these agree; maps are [B, H, W], float32 or bool.

    What `correct` does with `unwrap_dual` and torch in fifty passes, candidate by candidate.

    Parameters
    ----------
    phase1_rad, angle2_rad
        Phase at f1 in [0, 2 pi); atan2 of the quadratures at f2.
    turns_table, shift_turns : TurnsTable, float32 [B]
        Of f2, see `merge_pixels`.
    amplitude2, noise, valid
        Amplitude at f2, the noise of a sample, and where the signal at f1 may be used.
    distance_m
        Is written where pixels are valid, f2 is strong, and the frequencies agree.
    """
    range1_m, range2_m = limits.range1_m, limits.range2_m
    per_rad1, per_rad2 = range1_m / TWO_PI, range2_m / TWO_PI
    per_m, wrap = np.float32(1.0) / range2_m, range1_m / range2_m
    constant, slope, first, bins_per_rad = turns_table
    frames, rows, columns = phase1_rad.shape
    # Disagreements are held in wraps of f2: its nearest wrap is then found by rounding.
    gap, wraps = np.empty(columns, np.float32), np.empty(columns, np.float32)
    apart = np.empty(columns, np.float32)
    for b in range(frames):
        for i in range(rows):
            phase1, angle2, strength = phase1_rad[b, i], angle2_rad[b, i], amplitude2[b, i]
            deviation, good, out = noise[b, i], valid[b, i], distance_m[b, i]
            for j in range(columns):
                place = first + bins_per_rad * angle2[j]
                line = np.uint32(place)  # With a sign Numba would test for indices from the end.
                gap[j] = constant[line] + slope[line] * place + shift_turns[b]
            for j in range(columns):
                phase2_rad = (gap[j] - np.floor(gap[j])) * TWO_PI
                gap[j] = (phase1[j] * per_rad1 - phase2_rad * per_rad2) * per_m
                apart[j], wraps[j] = FAR, ZERO
            for n in range(limits.last + 1):
                number = np.float32(n)
                ends_m = limits.last_ends_m if n == limits.last else FAR
                for j in range(columns):
                    turns = gap[j] + number * wrap
                    off = turns - np.rint(turns)
                    nearer = (abs(off) < abs(apart[j])) & (phase1[j] * per_rad1 < ends_m)
                    apart[j] = off if nearer else apart[j]
                    wraps[j] = number if nearer else wraps[j]
            for j in range(columns):
                fused_m = phase1[j] * per_rad1 + wraps[j] * range1_m
                fused_m = max(fused_m - limits.share2 * range2_m * apart[j], ZERO)
                agree = (abs(apart[j]) * range2_m <= limits.max_residual_m) & (
                    strength[j] - limits.min_snr * deviation[j] >= ZERO
                )
                out[j] = fused_m if agree & good[j] else out[j]
