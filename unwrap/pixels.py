"""Two or four samples to depth in two walks over the pixels, compiled: `correct` on processors.

The formulas are those of `unwrap.phase`, `unwrap.calibration` and `unwrap.merge`, which other
devices and exported files need as chains of array operations. Between the walks stands the arc
tangent, which torch takes of many pixels at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from unwrap.compiled import loop

Array = np.ndarray
HALF, ZERO, TWO_PI = np.float32(0.5), np.float32(0.0), np.float32(2 * np.pi)
NONE, FLOOR, NEAREST = range(3)
RULES = ("none", "floor", "nearest")
"""Merge rules in the order of these numbers, see `unwrap.merge`."""


class Straight(NamedTuple):
    """How an angle becomes turns without the stored phase error, float32; see `WiggleTable`.

    Attributes
    ----------
    constant, slope : [n]
        Turns at the place x of an angle in bins: constant + slope x, in the bin that holds x.
    first, bins_per_rad
        The place of an angle: first + bins_per_rad angle.
    """

    constant: Array
    slope: Array
    first: np.float32
    bins_per_rad: np.float32


class Limits(NamedTuple):
    """Constants of a sensor, float32: its unambiguous range, and what `correct` trusts."""

    unambiguous_m: np.float32
    saturation_m: np.float32
    min_snr: np.float32


@loop
def decode_pixels(
    dcs: Array, offset: Array, cosine: Array, sine: Array, amplitude: Array, residual: Array
) -> bool:
    """Quadratures and strength of samples [B, n, H, W] less their offset [B, H, W]; all float32.

    The maps [B, H, W] are written, `residual` only for four samples. False if a sample is NaN or
    infinite.
    """
    four, finite = dcs.shape[1] == 4, True
    frames, rows, columns = amplitude.shape
    for b in range(frames):
        for i in range(rows):
            for j in range(columns):
                common = offset[b, i, j]
                x, y = dcs[b, 0, i, j] - common, dcs[b, 1, i, j] - common
                scale = np.float32(1.0)
                if four:
                    third, fourth = dcs[b, 2, i, j] - common, dcs[b, 3, i, j] - common
                    residual[b, i, j] = max(abs(x + third), abs(y + fourth))
                    x, y, scale = x - third, y - fourth, HALF
                squared = x * x + y * y
                cosine[b, i, j], sine[b, i, j] = x, y
                amplitude[b, i, j] = np.sqrt(squared) * scale
                finite = finite & (squared - squared == ZERO)
    return finite


@loop
def merge_pixels(
    angle_rad: Array,
    straight: Straight,
    shift_turns: Array,
    amplitude: Array,
    noise: Array,
    saturated: Array,
    predicted_m: Array,
    limits: Limits,
    merge: int,
    distance_m: Array,
    valid: Array,
) -> None:
    """Distances of angles, unwrapped by a prediction; maps are [B, H, W], float32 or bool.

    Parameters
    ----------
    shift_turns : float32 [B]
        Added to the turns; not negative.
    merge : int
        Place in `RULES`.
    distance_m, valid
        Are written.
    """
    unambiguous_m, saturation_m, min_snr = limits
    metres_per_rad, per_m = unambiguous_m / TWO_PI, np.float32(1.0) / unambiguous_m
    constant, slope, first, bins_per_rad = straight
    nearest, merges = merge == NEAREST, merge != NONE
    frames, rows, columns = angle_rad.shape
    for b in range(frames):
        for i in range(rows):
            angle, strong, weak = angle_rad[b, i], amplitude[b, i], noise[b, i]
            full, guess, out, good = (
                saturated[b, i],
                predicted_m[b, i],
                distance_m[b, i],
                valid[b, i],
            )
            # A look into a table keeps a loop from taking many pixels at once: it has its own.
            for j in range(columns):
                place = first + bins_per_rad * angle[j]
                line = np.uint32(place)  # A sign would have to be looked at.
                out[j] = constant[line] + slope[line] * place + shift_turns[b]
            for j in range(columns):
                wrapped_m = (out[j] - np.floor(out[j])) * TWO_PI * metres_per_rad
                if nearest:
                    wraps = max(np.rint((guess[j] - wrapped_m) * per_m), ZERO)
                else:
                    wraps = np.floor(guess[j] * per_m)
                good[j] = (strong[j] - min_snr * weak[j] >= ZERO) & (not full[j])
                trusted = merges & good[j] & (wrapped_m < saturation_m)
                out[j] = wrapped_m + wraps * unambiguous_m if trusted else guess[j]
