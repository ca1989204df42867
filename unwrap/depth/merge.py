"""Merging a prediction with a wrapped distance map: eq. 6, eq. 8, the nearest candidate, or none.

All take and return [..., H, W] in metres. Equation numbers are those of Nagiub et al. (2023).
`predicted_m` is d_p, `unambiguous_m` d_u; `wrapped_m` is d_M1, the distance within one unambiguous
range, and `saturation_m` d_sat, the wrapped distance from which on the sensor is not to be trusted.

Every rule of `RULES` has two forms, which a test holds together: a function of torch tensors, for
any device and for exported files, and a branch of the compiled loop `merge_pixels`, which
processors use. A new rule needs a function, a branch, a line of `RULES` and a word in `Merge`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

import numpy as np
import torch
from torch import Tensor

from unwrap.signal import TurnsTable
from unwrap.support import loop, require_floats, require_positive

Array = np.ndarray
Merge = Literal["nearest", "floor", "none"]
# float32, since a Python float would make the arithmetic of a loop float64.
ZERO, TWO_PI = np.float32(0.0), np.float32(2 * np.pi)
NONE, FLOOR, NEAREST = range(3)
"""Branches of `merge_pixels`."""


def nearest_wraps(predicted_m: Tensor, wrapped_m: Tensor, unambiguous_m: float) -> Tensor:
    """Whole wraps, as floats, that bring `wrapped_m` nearest to `predicted_m`; never negative.

    Examples
    --------
    >>> nearest_wraps(torch.tensor([7.0, 11.0, 0.1]), torch.tensor([1.0, 6.0, 6.0]), 6.25)
    tensor([1., 1., 0.])
    """
    return predicted_m.sub(wrapped_m).mul_(1 / unambiguous_m).round_().clamp_(min=0)


def merge_regression(
    predicted_m: Tensor, wrapped_m: Tensor, unambiguous_m: float, saturation_m: float
) -> Tensor:
    """Eq. 6: floor(d_p / d_u) d_u + d_M1 where d_M1 < d_sat, else d_p."""
    require_floats(alike=True, predicted_m=predicted_m, wrapped_m=wrapped_m)
    require_positive(unambiguous_m=unambiguous_m, saturation_m=saturation_m)
    wraps = predicted_m.mul(1 / unambiguous_m).floor_()
    return _add_wraps(wraps, wrapped_m, unambiguous_m, predicted_m, saturation_m)


def merge_segmentation(
    wraps: Tensor, wrapped_m: Tensor, unambiguous_m: float, saturation_m: float
) -> Tensor:
    """Eq. 8: class d_u + d_M1 where d_M1 < d_sat, else class d_u; `wraps` are the classes 0, 1, ...

    No line of `RULES`: distances within a class (`class_depth_m`) and "floor" say the same.
    """
    if not isinstance(wraps, Tensor) or wraps.is_complex():
        raise TypeError("wraps is no torch tensor of real numbers")
    require_floats(wrapped_m=wrapped_m)
    if wraps.shape != wrapped_m.shape:
        raise ValueError(f"wraps has shape {tuple(wraps.shape)}; expected {tuple(wrapped_m.shape)}")
    require_positive(unambiguous_m=unambiguous_m, saturation_m=saturation_m)
    return _add_wraps(wraps, wrapped_m, unambiguous_m, wraps * unambiguous_m, saturation_m)


def merge_nearest(
    predicted_m: Tensor, wrapped_m: Tensor, unambiguous_m: float, saturation_m: float
) -> Tensor:
    """n d_u + d_M1 with n = max(0, round((d_p - d_M1) / d_u)) where d_M1 < d_sat, else d_p.

    Ours. Right wherever the prediction errs by less than half an unambiguous range, while eq. 6
    errs as soon as prediction and truth lie on different sides of a wrap.

    Examples
    --------
    A pixel at 6.4 m, of which a network says 6.1 m, with an unambiguous range of 6.25 m:

    >>> predicted_m, wrapped_m = torch.tensor([6.1]), torch.tensor([0.15])
    >>> merge_nearest(predicted_m, wrapped_m, 6.25, 6.2)
    tensor([6.4000])
    >>> merge_regression(predicted_m, wrapped_m, 6.25, 6.2)
    tensor([0.1500])
    """
    require_floats(alike=True, predicted_m=predicted_m, wrapped_m=wrapped_m)
    require_positive(unambiguous_m=unambiguous_m, saturation_m=saturation_m)
    wraps = nearest_wraps(predicted_m, wrapped_m, unambiguous_m)
    return _add_wraps(wraps, wrapped_m, unambiguous_m, predicted_m, saturation_m)


def merge_none(
    predicted_m: Tensor, wrapped_m: Tensor, unambiguous_m: float, saturation_m: float
) -> Tensor:
    """The prediction as it is: of networks that have seen the samples and refine each distance."""
    # A copy, as the other rules give one: who changes it must not change the prediction.
    return predicted_m.clone()


def _add_wraps(
    wraps: Tensor, wrapped_m: Tensor, unambiguous_m: float, otherwise_m: Tensor, saturation_m: float
) -> Tensor:
    """Wrapped distance plus wraps where the sensor is to be trusted, else `otherwise_m`."""
    unwrapped_m = torch.add(wrapped_m, wraps, alpha=unambiguous_m)
    return torch.where(wrapped_m < saturation_m, unwrapped_m, otherwise_m.to(unwrapped_m))


class Rule(NamedTuple):
    """A merge rule: its function of tensors, and its branch of `merge_pixels`."""

    of_tensors: Callable[[Tensor, Tensor, float, float], Tensor]
    branch: int


RULES: Mapping[Merge, Rule] = {
    "nearest": Rule(merge_nearest, NEAREST),
    "floor": Rule(merge_regression, FLOOR),
    "none": Rule(merge_none, NONE),
}
"""All merge rules, by the name that configurations and the command line use."""


class Limits(NamedTuple):
    """Constants of a sensor, float32: its unambiguous range, and what `correct` trusts."""

    unambiguous_m: np.float32
    saturation_m: np.float32
    min_snr: np.float32


@loop
def merge_pixels(
    angle_rad: Array,
    turns_table: TurnsTable,
    shift_turns: Array,
    amplitude: Array,
    noise: Array,
    saturated: Array,
    predicted_m: Array,
    limits: Limits,
    branch: int,
    distance_m: Array,
    valid: Array,
) -> None:
    """Angles to distances, unwrapped by a prediction; maps are [B, H, W], float32 or bool.

    One pass for what `correct` does with torch in a dozen: angle to turns without the stored phase
    error (`WiggleTable.turns_of`), the shift (`shift_turns_`), turns to phase (`to_phase_`), the
    merge rule, and what is valid (`is_strong`, not saturated). Tests hold each to its torch form.

    Parameters
    ----------
    angle_rad
        atan2 of the quadratures, in [-pi, pi]; becomes the phase in [0, 2 pi).
    turns_table : TurnsTable
        See `WiggleTable.turns_table`.
    shift_turns : float32 [B]
        Added to the turns; not negative.
    branch : int
        `NONE`, `FLOOR` or `NEAREST`, see `RULES`.
    distance_m, valid
        Are written.
    """
    unambiguous_m, saturation_m, min_snr = limits
    metres_per_rad, per_m = unambiguous_m / TWO_PI, np.float32(1.0) / unambiguous_m
    constant, slope, first, bins_per_rad = turns_table
    nearest, merges = branch == NEAREST, branch != NONE
    frames, rows, columns = angle_rad.shape
    for b in range(frames):
        for i in range(rows):
            # Rows as arrays of their own: the compiler then knows that pixels lie side by side.
            angle, signal, deviation = angle_rad[b, i], amplitude[b, i], noise[b, i]
            full, guess, out, good = (
                saturated[b, i],
                predicted_m[b, i],
                distance_m[b, i],
                valid[b, i],
            )
            # Two loops over the row: looking into a table keeps a loop from vector instructions, so
            # it has one of its own, and the other takes many pixels at once.
            for j in range(columns):
                place = first + bins_per_rad * angle[j]
                line = np.uint32(place)  # With a sign Numba would test for indices from the end.
                out[j] = constant[line] + slope[line] * place + shift_turns[b]
            for j in range(columns):
                phase_rad = (out[j] - np.floor(out[j])) * TWO_PI
                wrapped_m = phase_rad * metres_per_rad
                if nearest:
                    wraps = max(np.rint((guess[j] - wrapped_m) * per_m), ZERO)
                else:
                    wraps = np.floor(guess[j] * per_m)
                good[j] = (signal[j] - min_snr * deviation[j] >= ZERO) & (not full[j])
                trusted = merges & good[j] & (wrapped_m < saturation_m)
                out[j] = wrapped_m + wraps * unambiguous_m if trusted else guess[j]
                angle[j] = phase_rad
