"""Unwrapping over one to three frequencies: the wrap candidates that agree best, within a range."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from unwrap.signal import SensorDescription, TurnsTable, distance_m, unambiguous_range_m
from unwrap.support import loop, require_floats, require_positive

Array = np.ndarray
# float32, since a Python float would make the arithmetic of a loop float64.
ZERO, FAR, TWO_PI = np.float32(0.0), np.float32(1e9), np.float32(2 * np.pi)
MOST_WRAPS = 10_000
"""Candidates of f1 that are searched, at most: each is a pass over all pixels."""


def unwrap_frequencies(
    phases_rad: Tensor | Sequence[Tensor], frequencies_hz: Sequence[float], *, max_range_m: float
) -> tuple[Tensor, Tensor]:
    """Distance from the wrapped phases at one, two or three frequencies.

    Of all wraps of the first frequency up to `max_range_m`, each with the nearest wrap of the
    second and the wrap of the third nearest to both, the one whose distances agree best wins: least
    sum of squares, weighted by inverse variance, about the fused distance, which is their mean with
    the same weights. At equal phase noise the standard deviation goes with 1 / f, so the weights go
    with f^2.

    One frequency cannot tell wraps: its distance is the wrapped one, within its unambiguous range.

    Parameters
    ----------
    phases_rad : float [K, ..., H, W] or K of float [..., H, W]
        Phases in [0, 2 pi) at each of the frequencies.
    frequencies_hz : K floats
        The highest first: its wraps are searched, and its noise moves them least.
    max_range_m : float
        Largest distance considered, metres. In noise a wrong candidate may win anywhere in this
        range, so it should be no larger than the scene; beyond `joint_range_m` no two or three
        phases can tell a distance from one that is nearer by that range.

    Returns
    -------
    distance_m : float [..., H, W]
        Fused distance, metres, never negative.
    residual_m : float [..., H, W]
        Largest disagreement of any two frequencies, metres; 0 with one.

    Raises
    ------
    ValueError
        Another number of frequencies, unequal shapes, or a frequency or range that is not positive.

    Examples
    --------
    The Kinect's three frequencies see a surface at 10 m, eight wraps of the first away:

    >>> frequencies_hz = (120e6, 80e6, 16e6)
    >>> turns = torch.tensor([[2 * f / 299_792_458 * 10.0] for f in frequencies_hz]).frac()
    >>> distance_m, residual_m = unwrap_frequencies(
    ...     2 * torch.pi * turns, frequencies_hz, max_range_m=18.7
    ... )
    >>> round(float(distance_m), 4), bool(residual_m < 1e-4)
    (10.0, True)
    """
    check_phases(phases_rad, frequencies_hz, max_range_m)
    wrapped_m = [
        distance_m(phase, hz) for phase, hz in zip(phases_rad, frequencies_hz, strict=True)
    ]
    ranges_m, shares = [*map(unambiguous_range_m, frequencies_hz)], fusing_shares(frequencies_hz)
    if len(wrapped_m) == 1:
        return wrapped_m[0], torch.zeros_like(wrapped_m[0])
    last = math.floor(max_range_m / ranges_m[0])
    best_wraps = _wraps_of_two if len(wrapped_m) == 2 else _wraps_of_more
    wraps = best_wraps(wrapped_m, frequencies_hz, last + 1)
    if last:
        # The last wrap ends beyond the range: only the nearer part of its distances is considered.
        fits = wrapped_m[0] < max_range_m - last * ranges_m[0]
        wraps = torch.where(fits, wraps, best_wraps(wrapped_m, frequencies_hz, last))
    fused_m = torch.add(wrapped_m[0], wraps, alpha=ranges_m[0])
    # How far the distances at the frequencies so far, and their fusion, lie beyond the first.
    least_m = most_m = moved_m = torch.zeros_like(fused_m)
    for k in range(1, len(wrapped_m)):
        gap = (wrapped_m[0] + moved_m - wrapped_m[k]).mul_(1 / ranges_m[k])
        # What is left over the nearest whole wrap of f_k: the disagreement of the chosen wraps.
        apart = gap.add_(wraps, alpha=ranges_m[0] / ranges_m[k])
        apart.sub_(apart.round())
        own_m = torch.sub(moved_m, apart, alpha=ranges_m[k])
        least_m, most_m = torch.minimum(least_m, own_m), torch.maximum(most_m, own_m)
        # (1 - share) d + share d_k = d - share (d - d_k); the distance d_k is never formed.
        fused_m.sub_(apart, alpha=shares[k] * ranges_m[k])
        moved_m = torch.sub(moved_m, apart, alpha=shares[k] * ranges_m[k])
    return fused_m.clamp_(min=0), most_m - least_m


def unwrap_dual(
    phase1_rad: Tensor, phase2_rad: Tensor, f1_hz: float, f2_hz: float, *, max_range_m: float
) -> tuple[Tensor, Tensor]:
    """Distance and disagreement from the phases at two frequencies: see `unwrap_frequencies`.

    Examples
    --------
    Phases of a surface at 10 m, beyond the unambiguous range of 24 MHz, 6.25 m:

    >>> phases = [torch.tensor([4 * torch.pi * f / 299_792_458 * 10.0]) for f in (24e6, 10e6)]
    >>> wrapped = [phase.remainder(2 * torch.pi) for phase in phases]
    >>> distance_m, residual_m = unwrap_dual(*wrapped, 24e6, 10e6, max_range_m=25.0)
    >>> distance_m, bool(residual_m < 1e-4)
    (tensor([10.0000]), True)
    """
    return unwrap_frequencies((phase1_rad, phase2_rad), (f1_hz, f2_hz), max_range_m=max_range_m)


def fusing_shares(frequencies_hz: Sequence[float]) -> tuple[float, ...]:
    """Weight of each distance as it is fused with the mean of those before it; 1 for the first.

    By inverse variance, which goes with f^2 at equal phase noise.

    Examples
    --------
    >>> fusing_shares((2.0, 2.0, 1.0))
    (1.0, 0.5, 0.1111111111111111)
    """
    squares = [hz**2 for hz in frequencies_hz]
    return tuple(own / total for own, total in zip(squares, accumulate(squares), strict=True))


def check_phases(
    phases_rad: Tensor | Sequence[Tensor], frequencies_hz: Sequence[float], max_range_m: float
) -> None:
    """Raise ValueError unless there are one to three phases, alike, and as many frequencies.

    Where the range has more wraps than can be searched, too.
    """
    if not isinstance(frequencies_hz, Sequence):
        raise TypeError(
            f"frequencies_hz is {type(frequencies_hz).__name__}; expected 1 to 3 numbers"
        )
    if not isinstance(phases_rad, Tensor | list | tuple):
        raise TypeError(f"phases_rad is {type(phases_rad).__name__}; expected 1 to 3 tensors")
    if isinstance(phases_rad, Tensor) and not phases_rad.ndim:
        raise ValueError("phases_rad has no axes; expected [K, ..., H, W]")
    if not 1 <= len(frequencies_hz) <= 3 or len(phases_rad) != len(frequencies_hz):
        raise ValueError(
            f"phases_rad has {len(phases_rad)} phases and frequencies_hz {len(frequencies_hz)} "
            "frequencies; expected 1 to 3 of both"
        )
    for number, phase_rad in enumerate(phases_rad, 1):
        require_floats(**{f"phase{number}_rad": phase_rad})
        if phase_rad.shape != phases_rad[0].shape:
            raise ValueError(
                f"phase{number}_rad has shape {tuple(phase_rad.shape)}; expected that of "
                f"phase1_rad, {tuple(phases_rad[0].shape)}"
            )
    named = {f"f{number}_hz": hz for number, hz in enumerate(frequencies_hz, 1)}
    require_positive(**named, max_range_m=max_range_m)
    range_m = unambiguous_range_m(frequencies_hz[0])
    if max_range_m / range_m > MOST_WRAPS:
        raise ValueError(
            f"max_range_m is {max_range_m:g}; expected at most {MOST_WRAPS} unambiguous ranges of "
            f"f1_hz, of {range_m:g} m each"
        )


def _wraps_of_two(
    wrapped_m: Sequence[Tensor], frequencies_hz: Sequence[float], count: int
) -> Tensor:
    """The n below `count` that brings the candidate of f1 nearest to one of f2.

    In wraps of f2, gap + n range1 / range2 is to be nearest to a whole number. Candidate n fits
    exactly where the fraction of the gap is that of -n range1 / range2. On the circle of fractions
    it is the nearest one up to half way to its neighbours. So each pixel needs `count` comparisons
    with constants, and no distance to each of the candidates.
    """
    range1_m, range2_m = map(unambiguous_range_m, frequencies_hz)
    gap, wrap = (wrapped_m[0] - wrapped_m[1]).mul_(1 / range2_m), range1_m / range2_m
    places = sorted((-n * wrap % 1.0, n) for n in range(count))
    # From half way between the last place and the first, that of no wrap, all the way round.
    start = (places[-1][0] + 1.0) / 2.0
    turned = gap.add_(2.0 - start).frac_()
    wraps, beyond = torch.zeros_like(gap), torch.empty_like(gap)
    # A staircase: at each border the n of the place before gives way to that of the place after.
    for (low, before), (high, after) in pairwise(places):
        torch.ge(turned, (low + high) / 2.0 + 1.0 - start, out=beyond)
        wraps.add_(beyond, alpha=after - before)
    return wraps


def _wraps_of_more(
    wrapped_m: Sequence[Tensor], frequencies_hz: Sequence[float], count: int
) -> Tensor:
    """The n below `count` whose distances agree best, one by one; of equals the nearest.

    The sum of squares about the mean is summed one frequency after the other, each against the mean
    of those before it: over the variance of that difference, which goes with 1 / f^2 of its own and
    1 / sum of f^2 of those before.
    """
    ranges_m, shares = [*map(unambiguous_range_m, frequencies_hz)], fusing_shares(frequencies_hz)
    wraps = torch.zeros_like(wrapped_m[0])
    least = torch.full_like(wraps, torch.inf)
    for n in range(count):
        mean_m, cost = wrapped_m[0] + n * ranges_m[0], torch.zeros_like(wraps)
        for k in range(1, len(wrapped_m)):
            gap = (mean_m - wrapped_m[k]).mul_(1 / ranges_m[k])
            apart_m = gap.sub_(gap.round()).mul_(ranges_m[k])
            mean_m.sub_(apart_m, alpha=shares[k])
            # f_k^2 (1 - share_k) is 1 over the sum of both: 1 / f_k^2 and 1 / sum before.
            cost.addcmul_(apart_m, apart_m, value=(1 - shares[k]) / ranges_m[k] ** 2)
        nearer = cost < least
        wraps.masked_fill_(nearer, n)
        least = torch.where(nearer, cost, least)
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
    _, share2 = fusing_shares((sensor.f1_hz, sensor.f2_hz))
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
