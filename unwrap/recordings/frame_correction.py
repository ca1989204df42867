"""Recorded samples to depth, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from unwrap.depth import correct
from unwrap.networks import load_unwrapper
from unwrap.recordings.camera import Camera
from unwrap.recordings.recording import NoUsablePixelError, Recording
from unwrap.recordings.sample_noise import SampleNoise, noise_of
from unwrap.signal import DepthFrame, Sensed


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


def correct_recording(recording: Recording, camera: Camera) -> list[CorrectedFrame]:
    """Depth of every frame; the network is asked where there are gray images.

    Raises
    ------
    ValueError
        There is no such network, or it was trained for another frequency; or it is to tell the
        wraps of eight samples, and there are no gray images.
    NoUsablePixelError
        A frame without a valid pixel.
    """
    if recording.gray is None and camera.eight == "network":
        raise ValueError(
            "eight is 'network' and there is no gray image; expected gray images beside the "
            "samples, or 'two_frequency' or 'kernel_density'"
        )
    unwrapper = None if recording.gray is None else load_unwrapper(camera.unwrapper)
    frames = []
    # One at a time: the feature maps of a long recording would not fit into memory.
    for number in range(len(recording.names)):
        one, prediction = recording.frame(number), None
        noise = noise_of(one.raw, camera)
        if unwrapper is not None and one.gray is not None:
            # A recording has one map for all frames, a batch of frames one for each.
            offset_lsb = None if one.offset_lsb is None else one.offset_lsb.unsqueeze(0)
            sensed = Sensed(one.gray, one.raw, offset_lsb, noise.noise_lsb)
            prediction = unwrapper.predict_sensed(sensed, camera.description)
        depth = correct(
            one.raw,
            None if prediction is None else prediction.distance_m,
            camera.description,
            merge=camera.merge,
            eight=camera.eight,
            offset_lsb=one.offset_lsb,
            noise_lsb=noise.noise_lsb,
        )
        _require_valid(one, depth)
        confidence = None if prediction is None else prediction.confidence
        frames.append(CorrectedFrame(one, depth, confidence, noise))
    return frames


def _require_valid(one: Recording, depth: DepthFrame) -> None:
    if not bool(depth.valid.any()):
        saturated, pixels = int(one.raw.saturated.sum()), one.raw.saturated.numel()
        frame = f" in frame {one.names[0]}" if one.names[0] else ""
        raise NoUsablePixelError(
            f"no usable pixel{frame}: {saturated} of {pixels} are saturated, the others are "
            "lost in noise or at odds between the frequencies"
        )
