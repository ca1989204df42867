"""Phase at one frequency of a frame, corrected by the calibration: offset, wiggle, drift."""

from __future__ import annotations

from torch import Tensor

from unwrap.signal.decoding import angle_rad, quadratures, to_phase_, to_turns_
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import PhaseFrame, RawFrame
from unwrap.signal.shots import SAMPLES_PER_FREQUENCY
from unwrap.signal.wiggle import shift_turns_


def decode_at(
    frequency: int,
    raw: RawFrame,
    sensor: SensorDescription,
    *,
    offset_lsb: Tensor | None = None,
    shift_m: Tensor | None = None,
) -> PhaseFrame:
    """Phase and amplitude of the samples at f1 (0) or f2 (1), corrected by the calibration.

    Parameters
    ----------
    offset_lsb : float [H, W] or [B, H, W], optional
        Stored dark-offset map, subtracted from the samples.
    shift_m : float [B], optional
        Added to the wrapped distances, metres, which wrap again. For a real sensor: minus the error
        of distance that its temperature brings. Simulated samples are without that error; their
        shift is the part of it that the sensor's own compensation leaves.

    Raises
    ------
    ValueError
        What `decode` refuses.
    """
    cosine, sine, amplitude, residual = quadratures(samples_at(frequency, raw), offset_lsb)
    phase_rad = phase_at(frequency, cosine, sine, sensor, shift_m=shift_m)
    return PhaseFrame(phase_rad, amplitude, residual)


def samples_at(frequency: int, raw: RawFrame) -> Tensor:
    """Samples [B, 2 or 4, H, W] at f1 (0) or f2 (1)."""
    start = frequency * SAMPLES_PER_FREQUENCY
    # Of a frame of two samples the slice takes both: it ends where the samples end.
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
    angle = angle_rad(sine, cosine)
    # Without a table there is nothing to look up, and the same conversion is one multiplication.
    to_turns = to_turns_ if sensor.wiggle is None else sensor.wiggle[frequency].turns_of
    turns = to_turns(angle)
    if shift_m is not None:
        shift_turns_(turns, shift_m, (sensor.f1_hz, sensor.f2_hz)[frequency])
    return to_phase_(turns)
