"""Depth of frames at three modulation frequencies, which unwrap each other."""

from __future__ import annotations

from dataclasses import replace

from unwrap.cameras.camera_frames import CameraFrames
from unwrap.depth import KernelDensity, unwrap_frequencies, vote_frequencies
from unwrap.recordings import Camera, CorrectedFrame, require_valid
from unwrap.signal import PhaseFrame, RawFrame, decode_at, is_strong


def unwrap_three(
    frames: CameraFrames, wrapped: list[CorrectedFrame], settings: Camera
) -> list[CorrectedFrame]:
    """Frames that are wrapped at the highest frequency, unwrapped by all of them.

    Valid is what is strong at every frequency, not saturated, and where the frequencies agree; by
    "kernel_density" where the neighbours do, as of two frequencies.

    Parameters
    ----------
    wrapped : list of CorrectedFrame
        Of each frame, its samples at the highest frequency.
    settings : Camera
        Its description has the range, and how far the frequencies may disagree.

    Raises
    ------
    NoUsablePixelError
        A frame without a valid pixel.
    """
    sensor, found = settings.description, []
    for number, frame in enumerate(wrapped):
        phases, noise_lsb = phases_of(frames, number, frame, settings), frame.noise.noise_lsb
        valid = frame.depth.valid
        if settings.eight == "kernel_density":
            distance_m, confidence = vote_frequencies(
                phases, frames.frequencies_hz, noise_lsb, max_range_m=sensor.max_range_m
            )
            valid = valid & (confidence >= KernelDensity().min_confidence)
        else:
            distance_m, residual_m = unwrap_frequencies(
                [phase.phase_rad for phase in phases],
                frames.frequencies_hz,
                max_range_m=sensor.max_range_m,
            )
            valid = valid & (residual_m <= sensor.max_residual_m)
            for phase in phases[1:]:
                valid = valid & is_strong(phase.amplitude, noise_lsb, sensor)
        depth = replace(frame.depth, distance_m=distance_m.where(valid, float("nan")), valid=valid)
        require_valid(frame.recording, depth)
        found.append(replace(frame, depth=depth))
    return found


def phases_of(
    frames: CameraFrames, number: int, frame: CorrectedFrame, settings: Camera
) -> list[PhaseFrame]:
    """Phases of one frame at each of its frequencies, a batch of one."""
    recording = frame.recording
    return [
        decode_at(
            0,  # Each stands alone here; without a wiggle table its number does not count.
            RawFrame(samples_lsb.unsqueeze(0), recording.raw.saturated),
            settings.description,
            offset_lsb=recording.offset_lsb,
        )
        for samples_lsb in frames.samples_lsb[number]
    ]
