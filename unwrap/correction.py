"""Correction: raw samples and a network's prediction to unwrapped depth.

Two or four samples are decoded and merged with the prediction; eight are unwrapped by their two
frequencies, and need the prediction only where these disagree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from unwrap.acquisition import SAMPLES_PER_FREQUENCY, Shots
from unwrap.calibration import FLAT, WiggleTable, shift_turns
from unwrap.compiled import array, array_of, can_loop
from unwrap.dual import unwrap_dual
from unwrap.frames import DepthFrame, PhaseFrame, RawFrame
from unwrap.merge import merge_nearest, merge_none, merge_regression
from unwrap.phase import (
    angle_of,
    components,
    distance_m,
    phase_of_turns,
    turns_of,
    unambiguous_range_m,
)
from unwrap.pixels import RULES, Limits, merge_pixels

Merge = Literal["nearest", "floor", "none"]
MERGES: dict[Merge, Callable[[Tensor, Tensor, float, float], Tensor]] = {
    "nearest": merge_nearest,
    "floor": merge_regression,
    "none": merge_none,
}


@dataclass(frozen=True)
class SensorDescription:
    """What correction must know of a sensor.

    Attributes
    ----------
    f1_hz, f2_hz : float
        Modulation frequencies.
    max_range_m : float
        Range that eight samples are unwrapped over.
    saturation_range_m : float
        d_sat of eq. 6 and 8: wrapped distances from here on are not trusted.
    noise_lsb : float
        Standard deviation of one sample in the dark, used where no better estimate is given.
    min_snr : float
        Amplitude over noise below which a pixel is invalid.
    max_residual_m : float
        Disagreement of the two frequencies above which they are not trusted: the pixel is merged
        with the prediction, or invalid without one. With 24 and 10 MHz candidates within 25 m lie
        2.5 m apart, so that 1.25 m is the most there is.
    wiggle : tuple of two WiggleTable, or None
        Stored phase errors at f1 and f2.
    """

    f1_hz: float = 24e6
    f2_hz: float = 10e6
    max_range_m: float = 25.0
    saturation_range_m: float = 6.2
    noise_lsb: float = 1.5
    min_snr: float = 1.0
    max_residual_m: float = 1.0
    wiggle: tuple[WiggleTable, WiggleTable] | None = None


def correct(
    raw: RawFrame,
    predicted_m: Tensor | None,
    sensor: SensorDescription,
    *,
    merge: Merge = "nearest",
    offset_lsb: Tensor | None = None,
    noise_lsb: Tensor | float | None = None,
    shift_m: Tensor | None = None,
) -> DepthFrame:
    """Unwrapped depth of a batch of frames with the same number of samples.

    Pixels that are invalid hold the prediction, the best guess there is, or NaN without one.

    Parameters
    ----------
    raw : RawFrame
        Two, four or eight samples.
    predicted_m : float32 [B, H, W] or None
        A network's coarse distance. None is allowed with eight samples.
    merge : "nearest", "floor" or "none"
        The nearest wrap candidate, ours; eq. 6; or the prediction as it is, for networks that
        refine the measured distance. For TofSegNet, whose prediction lies within its likeliest
        class, "floor" is eq. 8, with the prediction where the sensor saturates.
    offset_lsb : float [H, W] or [B, H, W], optional
        Stored dark-offset map.
    noise_lsb : float or float [B, H, W], optional
        Standard deviation of one sample, if known better than `sensor.noise_lsb`.
    shift_m : float [B], optional
        See `decode_at`.

    Raises
    ------
    ValueError
        Two or four samples without a prediction, an unknown merge, or samples that `decode`
        refuses.
    """
    if merge not in MERGES:
        raise ValueError(f"merge is {merge!r}; expected one of {', '.join(MERGES)}")
    noise = sensor.noise_lsb if noise_lsb is None else noise_lsb
    if predicted_m is not None and _can_loop(raw, predicted_m):
        return _looped(raw, predicted_m, sensor, merge, offset_lsb, noise, shift_m)
    first = decode_at(0, raw, sensor, offset_lsb=offset_lsb, shift_m=shift_m)
    # Weights 0 and 1 in floats: comparing into a bool and converting it is several times slower.
    valid = torch.sub(first.amplitude, noise, alpha=sensor.min_snr).ge_(0)
    valid.gt_(raw.saturation)
    if raw.shots == Shots.EIGHT:
        second = components(_samples_at(1, raw), offset_lsb)[:2]
        merged_m, residual_m = unwrap_dual(
            first.phase_rad,
            phase_at(1, *second, sensor, shift_m=shift_m),
            sensor.f1_hz,
            sensor.f2_hz,
            max_range_m=sensor.max_range_m,
        )
        agree = residual_m.le_(sensor.max_residual_m)
        if predicted_m is not None:
            guess_m = _merged(first, predicted_m, sensor, merge)
            merged_m = guess_m.lerp_(merged_m, agree)
        else:
            valid.mul_(agree)
    elif predicted_m is None:
        raise ValueError(f"predicted_m is None; {int(raw.shots)} samples cannot be unwrapped alone")
    else:
        merged_m = _merged(first, predicted_m, sensor, merge)
    return _frame(merged_m, valid, first, predicted_m, sensor)


def _can_loop(raw: RawFrame, predicted_m: Tensor) -> bool:
    """Whether `unwrap.pixels` may do the work: two or four samples, in memory."""
    samples = raw.dcs_lsb
    # A loop trusts shapes.
    fits = samples.ndim == 4 and samples[:, 0].shape == raw.saturated.shape == predicted_m.shape
    return raw.shots != Shots.EIGHT and fits and can_loop(samples, predicted_m)


def _looped(
    raw: RawFrame,
    predicted_m: Tensor,
    sensor: SensorDescription,
    merge: Merge,
    offset_lsb: Tensor | None,
    noise_lsb: Tensor | float,
    shift_m: Tensor | None,
) -> DepthFrame:
    """`correct` by compiled loops."""
    cosine, sine, amplitude, residual = components(raw.dcs_lsb, offset_lsb)
    # The quadratures lend their memory: what is in the processor's cache need not be fetched.
    angle_rad, distance_m = torch.atan2(sine, cosine, out=cosine), sine
    valid = torch.empty(raw.saturated.shape, dtype=torch.bool)
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    merge_pixels(
        array(angle_rad),
        (FLAT if sensor.wiggle is None else sensor.wiggle[0]).straight,
        _shift_turns(shift_m, unambiguous_m, len(valid)),
        array(amplitude),
        array_of(noise_lsb, valid.shape),
        array(raw.saturated, np.bool_),
        array(predicted_m),
        Limits(*map(np.float32, (unambiguous_m, sensor.saturation_range_m, sensor.min_snr))),
        RULES.index(merge),
        array(distance_m),
        array(valid, np.bool_),
    )
    return DepthFrame(distance_m, valid, amplitude, residual, unambiguous_m)


def _shift_turns(shift_m: Tensor | None, unambiguous_m: float, batch: int) -> np.ndarray:
    """A shift of each frame, float32 [B], as a share of the unambiguous range."""
    turns = np.zeros(batch, np.float32)
    if shift_m is not None:
        turns[:] = shift_m.numpy() % unambiguous_m / unambiguous_m
    return turns


def decode_at(
    frequency: int,
    raw: RawFrame,
    sensor: SensorDescription,
    *,
    offset_lsb: Tensor | None = None,
    shift_m: Tensor | None = None,
) -> PhaseFrame:
    """Phase and amplitude of the samples at f1 (0) or f2 (1), the stored wiggle removed.

    `shift_m` [B] is added to the wrapped distances: minus the drift that a real sensor's
    temperature tells; or what its compensation leaves, where samples are simulated without drift.
    """
    cosine, sine, amplitude, residual = components(_samples_at(frequency, raw), offset_lsb)
    phase_rad = phase_at(frequency, cosine, sine, sensor, shift_m=shift_m)
    return PhaseFrame(phase_rad, amplitude, residual)


def _samples_at(frequency: int, raw: RawFrame) -> Tensor:
    start = frequency * SAMPLES_PER_FREQUENCY
    return raw.dcs_lsb[:, start : start + SAMPLES_PER_FREQUENCY]


def phase_at(
    frequency: int,
    cosine: Tensor,
    sine: Tensor,
    sensor: SensorDescription,
    *,
    shift_m: Tensor | None,
) -> Tensor:
    """Phase [B, H, W] in [0, 2 pi) of quadratures at f1 (0) or f2 (1); see `decode_at`."""
    angle_rad = angle_of(cosine, sine)
    straight = turns_of if sensor.wiggle is None else sensor.wiggle[frequency].turns_of
    turns = straight(angle_rad)
    if shift_m is not None:
        shift_turns(turns, shift_m, (sensor.f1_hz, sensor.f2_hz)[frequency])
    return phase_of_turns(turns)


def _merged(
    first: PhaseFrame, predicted_m: Tensor, sensor: SensorDescription, merge: Merge
) -> Tensor:
    """The first frequency's wrapped map, unwrapped by the prediction."""
    return MERGES[merge](
        predicted_m,
        distance_m(first.phase_rad, sensor.f1_hz),
        unambiguous_range_m(sensor.f1_hz),
        sensor.saturation_range_m,
    )


def _frame(
    merged_m: Tensor,
    valid: Tensor,
    first: PhaseFrame,
    predicted_m: Tensor | None,
    sensor: SensorDescription,
) -> DepthFrame:
    """Depth with the guess, or NaN without one, where the weight `valid` is 0."""
    if predicted_m is None:
        depth_m = merged_m.masked_fill_(valid == 0, torch.nan)
    else:
        depth_m = predicted_m.lerp(merged_m, valid)
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    return DepthFrame(depth_m, valid.bool(), first.amplitude, first.residual, unambiguous_m)
