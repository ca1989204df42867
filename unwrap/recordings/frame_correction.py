"""Recorded samples to depth, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from unwrap.depth import correct
from unwrap.networks import Unwrapper, load_unwrapper
from unwrap.recordings.camera import Camera
from unwrap.recordings.network_choice import predict_distance
from unwrap.recordings.recording import NoUsablePixelError, Recording
from unwrap.recordings.sample_noise import SampleNoise, noise_of
from unwrap.signal import (
    DepthFrame,
    Sensed,
    SensorDescription,
    Shots,
    decode_at,
    distance_m,
    is_strong,
    unambiguous_range_m,
)


@dataclass(frozen=True)
class CorrectedFrame:
    """One recorded frame, a batch of one, and what was made of it.

    Attributes
    ----------
    recording : Recording
        Of this frame alone.
    depth : DepthFrame
    confidence : float32 [1, H, W] or None
        The network's; None where none was asked.
    noise : SampleNoise
        What counted as noise, and where that is known from.
    """

    recording: Recording
    depth: DepthFrame
    confidence: Tensor | None
    noise: SampleNoise


def correct_recording(
    recording: Recording, camera: Camera, network: Unwrapper | None = None
) -> list[CorrectedFrame]:
    """Depth of every frame; the network is asked where there are gray images.

    Without a network two and four samples give the wrapped distance.

    Parameters
    ----------
    network : Unwrapper, optional
        That of `camera.unwrapper`, where it is loaded already.

    Raises
    ------
    ValueError
        There is no such network, or it is of no use at this frequency, see `frequency_warning`;
        or it is to tell the wraps of eight samples, and there are no gray images.
    NoUsablePixelError
        A frame without a valid pixel.
    """
    if camera.eight == "network" and (recording.gray is None or camera.unwrapper is None):
        missing = "network" if camera.unwrapper is None else "gray image"
        raise ValueError(
            f"eight is 'network' and there is no {missing}; expected gray images beside the "
            "samples and a network, or 'two_frequency' or 'kernel_density'"
        )
    unwrapper = None
    if recording.gray is not None and camera.unwrapper is not None:
        unwrapper = network or load_unwrapper(camera.unwrapper)
    frames = []
    # One at a time: the feature maps of a long recording would not fit into memory.
    for number in range(len(recording.names)):
        one, prediction = recording.frame(number), None
        noise = noise_of(one.raw, camera, made=one.made)
        if unwrapper is not None and one.gray is not None:
            # A recording has one map for all frames, a batch of frames one for each.
            offset_lsb = None if one.offset_lsb is None else one.offset_lsb.unsqueeze(0)
            sensed = Sensed(one.gray, one.raw, offset_lsb, noise.noise_lsb)
            prediction = predict_distance(unwrapper, sensed, camera.description)
        if camera.unwrapper is None and one.raw.shots != Shots.EIGHT:
            depth = wrapped_frame(one, noise.noise_lsb, camera.description)
        else:
            depth = correct(
                one.raw,
                None if prediction is None else prediction.distance_m,
                camera.description,
                merge=camera.merge,
                eight=camera.eight,
                offset_lsb=one.offset_lsb,
                noise_lsb=noise.noise_lsb,
            )
        require_valid(one, depth)
        confidence = None if prediction is None else prediction.confidence
        frames.append(CorrectedFrame(one, depth, confidence, noise))
    return frames


def wrapped_frame(one: Recording, noise_lsb: Tensor, sensor: SensorDescription) -> DepthFrame:
    """Two or four samples as they are: the distance within one unambiguous range of f1.

    Valid is what is strong and not saturated; elsewhere the distance is NaN.
    """
    first = decode_at(0, one.raw, sensor, offset_lsb=one.offset_lsb)
    valid = is_strong(first.amplitude, noise_lsb, sensor) & ~one.raw.saturated
    wrapped_m = distance_m(first.phase_rad, sensor.f1_hz)
    return DepthFrame(
        wrapped_m.where(valid, torch.nan),
        valid,
        first.phase_rad,
        first.amplitude,
        first.residual,
        unambiguous_range_m(sensor.f1_hz),
    )


def require_valid(one: Recording, depth: DepthFrame) -> None:
    """Raise `NoUsablePixelError` where no pixel of one frame is valid."""
    if not bool(depth.valid.any()):
        saturated, pixels = int(one.raw.saturated.sum()), one.raw.saturated.numel()
        frame = f" in frame {one.names[0]}" if one.names[0] else ""
        raise NoUsablePixelError(
            f"no usable pixel{frame}: {saturated} of {pixels} are saturated, the others are "
            "lost in noise or at odds between the frequencies"
        )
