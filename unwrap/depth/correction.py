"""Correction: raw samples and a network's prediction to unwrapped depth.

Two or four samples are decoded and merged with the prediction. Eight are unwrapped by their two
frequencies, pixel by pixel or by a vote of neighbours, and need the prediction only where these
cannot tell; or the prediction decides, as with four.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np
import torch
from torch import Tensor

from unwrap.depth.kernel_density import unwrap_kernel_density
from unwrap.depth.merge import RULES, Limits, Merge, merge_pixels
from unwrap.depth.multi_frequency import dual_limits, fuse_pixels, unwrap_dual
from unwrap.signal import (
    FLAT,
    DepthFrame,
    PhaseFrame,
    RawFrame,
    Sensed,
    SensorDescription,
    Shots,
    TurnsTable,
    angle_rad,
    check_frames,
    decode_at,
    distance_m,
    is_strong,
    phase_at,
    quadratures,
    samples_at,
    unambiguous_range_m,
)
from unwrap.support import (
    array,
    array_of,
    can_loop,
    long_rows,
    require_choice,
)

Eight = Literal["two_frequency", "kernel_density", "network"]
"""Who tells the wraps of eight samples, see `correct`."""


def correct(
    raw: RawFrame,
    predicted_m: Tensor | None,
    sensor: SensorDescription,
    *,
    merge: Merge = "nearest",
    eight: Eight = "two_frequency",
    offset_lsb: Tensor | None = None,
    noise_lsb: Tensor | float | None = None,
    shift_m: Tensor | None = None,
) -> DepthFrame:
    """Unwrap the samples of a batch of frames, by a prediction or by their two frequencies.

    Pixels that are not valid hold the prediction, the best guess there is, or NaN without one.

    Parameters
    ----------
    raw : RawFrame
        Two, four or eight samples.
    predicted_m : float32 [B, H, W] or None
        A network's coarse distance. None is allowed with eight samples.
    merge : "nearest", "floor" or "none"
        Rule by which the prediction tells the wraps, see `unwrap.depth.merge`: the wrap candidate
        nearest to it (ours); its own whole wraps (eq. 6); or no merging, for networks that refine
        the measured distance themselves. For TofSegNet, whose prediction lies within its likeliest
        class, "floor" is eq. 8, with the prediction where the sensor saturates.
    eight : "two_frequency", "kernel_density" or "network"
        Who tells the wraps of eight samples: the two frequencies of each pixel, and the prediction
        where these disagree or f2 is weak; the neighbours' vote (`unwrap_kernel_density`), and the
        prediction where the vote is not confident; or the prediction everywhere, merged with the
        wrapped distance at f1 as of four samples. Valid is what is strong and not saturated;
        without a prediction also agreement, or a confident vote.
    offset_lsb : float [H, W] or [B, H, W], optional
        Stored dark-offset map.
    noise_lsb : float or float [B, H, W], optional
        Standard deviation of one sample, if known better than `sensor.noise_lsb`.
    shift_m : float [B], optional
        See `decode_at`.

    Raises
    ------
    ValueError
        Two or four samples, or eight by "network", without a prediction, an unknown `merge` or
        `eight`, or samples that `decode` refuses.

    Examples
    --------
    Two samples of a pixel at a wrapped distance of 0, and a network that says 7 m: one wrap.

    >>> raw = RawFrame(torch.tensor([100.0, 0.0]).view(1, 2, 1, 1), torch.zeros(1, 1, 1).bool())
    >>> frame = correct(raw, torch.full((1, 1, 1), 7.0), SensorDescription())
    >>> frame.distance_m, frame.valid
    (tensor([[[6.2457]]]), tensor([[[True]]]))

    Eight samples of 0 m, and the same network: it is asked only by "network".

    >>> dcs = torch.tensor([100.0, 0.0, -100.0, 0.0] * 2).view(1, 8, 1, 1)
    >>> raw, guess = RawFrame(dcs, torch.zeros(1, 1, 1).bool()), torch.full((1, 1, 1), 7.0)
    >>> for eight in ("two_frequency", "network"):
    ...     print(correct(raw, guess, SensorDescription(), eight=eight).distance_m)
    tensor([[[0.]]])
    tensor([[[6.2457]]])
    """
    require_choice(RULES, merge=merge)
    require_choice(get_args(Eight), eight=eight)
    check_frames(raw, predicted_m, sensor, offset_lsb, noise_lsb, shift_m)
    noise = sensor.noise_lsb if noise_lsb is None else noise_lsb
    calibration = _Calibration(sensor, offset_lsb, noise, shift_m)
    if raw.shots == Shots.EIGHT:
        if eight == "two_frequency":
            if predicted_m is not None and _can_loop(raw, predicted_m):
                return _by_two_loops(raw, predicted_m, calibration, merge)
            return _by_two_frequencies(raw, predicted_m, calibration, merge)
        if eight == "kernel_density":
            return _by_vote(raw, predicted_m, calibration, merge)
        if predicted_m is None:
            raise ValueError("predicted_m is None; expected a prediction for eight='network'")
        # Samples at f2 have no say; saturated are still the pixels in which any sample was.
        raw = RawFrame(samples_at(0, raw), raw.saturated)
    if predicted_m is None:
        raise ValueError(f"predicted_m is None; {int(raw.shots)} samples cannot be unwrapped alone")
    if _can_loop(raw, predicted_m):
        return _by_loop(raw, predicted_m, calibration, merge)
    return _by_torch(raw, predicted_m, calibration, merge)


class _Calibration(NamedTuple):
    """What is known of the sensor, and of these frames beside their samples; see `correct`."""

    sensor: SensorDescription
    offset_lsb: Tensor | None
    noise_lsb: Tensor | float
    shift_m: Tensor | None

    def first_phase(self, raw: RawFrame) -> PhaseFrame:
        """Phase and amplitude at f1."""
        return decode_at(0, raw, self.sensor, offset_lsb=self.offset_lsb, shift_m=self.shift_m)

    def valid(self, first: PhaseFrame, raw: RawFrame) -> Tensor:
        """Where the signal at f1 is strong and not saturated."""
        return is_strong(first.amplitude, self.noise_lsb, self.sensor) & ~raw.saturated


def _by_two_frequencies(
    raw: RawFrame, predicted_m: Tensor | None, calibration: _Calibration, merge: Merge
) -> DepthFrame:
    """Eight samples: the prediction is asked where f2 is weak or the frequencies disagree."""
    sensor, first = calibration.sensor, calibration.first_phase(raw)
    # Of the second frequency no residual is needed, so it is not decoded as a whole.
    cosine, sine, amplitude, _ = quadratures(samples_at(1, raw), calibration.offset_lsb)
    depth_m, residual_m = unwrap_dual(
        first.phase_rad,
        phase_at(1, cosine, sine, sensor, shift_m=calibration.shift_m),
        sensor.f1_hz,
        sensor.f2_hz,
        max_range_m=sensor.max_range_m,
    )
    # A phase of noise agrees by chance: what is lost at f2 tells as little as what disagrees.
    agree = (residual_m <= sensor.max_residual_m) & is_strong(
        amplitude, calibration.noise_lsb, sensor
    )
    valid = calibration.valid(first, raw)
    if predicted_m is None:
        return _frame(depth_m, valid & agree, first, torch.nan, sensor)
    depth_m = torch.where(agree, depth_m, _merged(first, predicted_m, sensor, merge))
    return _frame(depth_m, valid, first, predicted_m, sensor)


def _by_vote(
    raw: RawFrame, predicted_m: Tensor | None, calibration: _Calibration, merge: Merge
) -> DepthFrame:
    """Eight samples: the prediction is asked where the neighbours' vote is not confident."""
    sensor = calibration.sensor
    found = unwrap_kernel_density(
        raw,
        sensor,
        offset_lsb=calibration.offset_lsb,
        noise_lsb=calibration.noise_lsb,
        shift_m=calibration.shift_m,
    ).depth
    first = PhaseFrame(found.phase_rad, found.amplitude, found.residual)
    if predicted_m is None:
        return _frame(found.distance_m, found.valid, first, torch.nan, sensor)
    # Where the vote is not valid, either it is not confident or the guess stands in any case.
    depth_m = torch.where(found.valid, found.distance_m, _merged(first, predicted_m, sensor, merge))
    return _frame(depth_m, calibration.valid(first, raw), first, predicted_m, sensor)


def _by_torch(
    raw: RawFrame, predicted_m: Tensor, calibration: _Calibration, merge: Merge
) -> DepthFrame:
    """Two or four samples, by torch's operations: on any device, and with gradients."""
    sensor, first = calibration.sensor, calibration.first_phase(raw)
    depth_m = _merged(first, predicted_m, sensor, merge)
    return _frame(depth_m, calibration.valid(first, raw), first, predicted_m, sensor)


def _merged(
    first: PhaseFrame, predicted_m: Tensor, sensor: SensorDescription, merge: Merge
) -> Tensor:
    """Wrapped distance at f1, unwrapped by the prediction."""
    return RULES[merge].of_tensors(
        predicted_m,
        distance_m(first.phase_rad, sensor.f1_hz),
        unambiguous_range_m(sensor.f1_hz),
        sensor.saturation_range_m,
    )


def _frame(
    depth_m: Tensor,
    valid: Tensor,
    first: PhaseFrame,
    guess_m: Tensor | float,
    sensor: SensorDescription,
) -> DepthFrame:
    """`depth_m` where valid, else the guess."""
    return DepthFrame(
        torch.where(valid, depth_m, guess_m),
        valid,
        first.phase_rad,
        first.amplitude,
        first.residual,
        unambiguous_range_m(sensor.f1_hz),
    )


def _can_loop(raw: RawFrame, predicted_m: Tensor) -> bool:
    """Whether `merge_pixels` may do the work: samples in memory, and maps of one shape."""
    samples = raw.dcs_lsb
    # A loop trusts shapes, where torch would broadcast or refuse them.
    fits = samples.ndim == 4 and samples[:, 0].shape == raw.saturated.shape == predicted_m.shape
    return fits and can_loop(samples, predicted_m)


def _by_loop(
    raw: RawFrame, predicted_m: Tensor, calibration: _Calibration, merge: Merge
) -> DepthFrame:
    """Two or four samples, by compiled loops: several times faster than torch on processors."""
    sensor, shift_m = calibration.sensor, calibration.shift_m
    cosine, sine, amplitude, residual = quadratures(raw.dcs_lsb, calibration.offset_lsb)
    # The phase overwrites the cosine, the distance the sine: both maps belong to this function
    # alone, and lie in the processor's cache, where new memory would have to be fetched.
    phase_rad, depth_m = angle_rad(sine, cosine, out=cosine), sine
    valid = torch.empty(raw.saturated.shape, dtype=torch.bool)
    merge_pixels(
        long_rows(array(phase_rad)),
        turns_table(0, sensor),
        shift_in_turns(0, sensor, shift_m, len(valid)),
        long_rows(array(amplitude)),
        long_rows(array_of(calibration.noise_lsb, valid.shape)),
        long_rows(array(raw.saturated, np.bool_)),
        long_rows(array(predicted_m)),
        merge_limits(sensor),
        RULES[merge].branch,
        # Written to; both are contiguous, so that `array` gives their own memory.
        long_rows(array(depth_m)),
        long_rows(array(valid, np.bool_)),
    )
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    return DepthFrame(depth_m, valid, phase_rad, amplitude, residual, unambiguous_m)


def _by_two_loops(
    raw: RawFrame, predicted_m: Tensor, calibration: _Calibration, merge: Merge
) -> DepthFrame:
    """Eight samples by two frequencies, by compiled loops: as four, and then by f2 as well."""
    sensor, shift_m = calibration.sensor, calibration.shift_m
    depth = _by_loop(RawFrame(samples_at(0, raw), raw.saturated), predicted_m, calibration, merge)
    cosine, sine, amplitude, _ = quadratures(samples_at(1, raw), calibration.offset_lsb)
    fuse_pixels(
        long_rows(array(depth.phase_rad)),
        long_rows(array(angle_rad(sine, cosine, out=cosine))),
        turns_table(1, sensor),
        shift_in_turns(1, sensor, shift_m, len(predicted_m)),
        long_rows(array(amplitude)),
        long_rows(array_of(calibration.noise_lsb, predicted_m.shape)),
        long_rows(array(depth.valid, np.bool_)),
        dual_limits(sensor),
        # Written to; contiguous, so that `array` gives its own memory.
        long_rows(array(depth.distance_m)),
    )
    return depth


def merge_limits(sensor: SensorDescription) -> Limits:
    """Constants of a sensor for `merge_pixels`."""
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    return Limits(*map(np.float32, (unambiguous_m, sensor.saturation_range_m, sensor.min_snr)))


def turns_table(frequency: int, sensor: SensorDescription) -> TurnsTable:
    """The stored phase error at f1 (0) or f2 (1) for compiled loops."""
    return (FLAT if sensor.wiggle is None else sensor.wiggle[frequency]).turns_table


def shift_in_turns(
    frequency: int, sensor: SensorDescription, shift_m: Tensor | None, frames: int
) -> np.ndarray:
    """`shift_m` of each frame in turns of f1 (0) or f2 (1), float32 [B], not negative."""
    turns = np.zeros(frames, np.float32)
    if shift_m is not None:
        unambiguous_m = unambiguous_range_m((sensor.f1_hz, sensor.f2_hz)[frequency])
        # Python's remainder, in float64 and never negative, as in `shift_turns_`.
        turns[:] = shift_m.numpy() % unambiguous_m / unambiguous_m
    return turns


def correct_sensed(
    sensed: Sensed,
    predicted_m: Tensor | None,
    sensor: SensorDescription,
    *,
    merge: Merge = "nearest",
    eight: Eight = "two_frequency",
) -> DepthFrame:
    """`correct` for frames as networks see them.

    Raises
    ------
    ValueError
        No samples, or what `correct` refuses.
    """
    return correct(
        sensed.require_raw(),
        predicted_m,
        sensor,
        merge=merge,
        eight=eight,
        offset_lsb=sensed.offset_lsb,
        noise_lsb=sensed.noise_lsb,
        shift_m=sensed.shift_m,
    )
