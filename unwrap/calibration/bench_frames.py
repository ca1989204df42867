"""Frames of a calibration's recordings: of plain files, or of a described camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from unwrap.cameras import open_camera_recording
from unwrap.cameras.files import CameraDescription
from unwrap.recordings import load_recording
from unwrap.signal import Shots

Array = np.ndarray


@dataclass(frozen=True)
class BenchFrames:
    """Some frames of a recording, F of them, at K modulation frequencies.

    Attributes
    ----------
    samples_lsb : [F, K, 4, H, W]
        D_k ~ cos(phi - k pi / 2) in LSB.
    saturated : bool [F, H, W]
    gray_words : [F, H, W] or None
    frequencies_hz : tuple of K floats or None
        Descending; None where neither the file nor a description tells.
    temperature_k, integration_s : tuple of F floats or None
    """

    samples_lsb: Array
    saturated: Array
    gray_words: Array | None
    frequencies_hz: tuple[float, ...] | None = None
    temperature_k: tuple[float, ...] | None = None
    integration_s: tuple[float, ...] | None = None


def plain_frames(path: Path, gray: Path | None, *, bits: int) -> BenchFrames:
    """All frames of an `.npz`, an `.npy` or a folder of PNG files.

    Raises
    ------
    ValueError
        What `load_recording` refuses, or two samples.
    """
    recording = load_recording(path, bits=bits, gray=gray, unwrapped=False)
    frames, count, height, width = recording.raw.dcs_lsb.shape
    if count == Shots.TWO:
        raise ValueError(f"{path.name}: 2 samples; expected 4 or 8, in which offsets cancel")
    samples = recording.raw.dcs_lsb.numpy().reshape(frames, count // 4, 4, height, width)
    words = None if recording.gray is None else recording.gray.numpy() * (2**bits - 1)
    return BenchFrames(samples, recording.raw.saturated.numpy(), words)


def camera_frames(
    path: Path, gray: Path | None, camera: CameraDescription
) -> Iterator[BenchFrames]:
    """Frames of a described camera's recording, in its order, piece by piece.

    Raises
    ------
    ValueError
        What reading the recording refuses; phasors or three phases, two samples a frequency, or
        more frequencies than a sensor is simulated with.
    """
    recording = open_camera_recording(path, camera, gray=gray)
    for piece in recording.pieces():
        if piece.made:
            raise ValueError(
                f"{path.name}: phasors, or three phases, of {camera.name}; expected four samples "
                "a frequency, which tell offsets and noise"
            )
        _, frequencies, count, _, _ = piece.samples_lsb.shape
        if count != 4 or frequencies > 2:
            raise ValueError(
                f"{path.name}: {frequencies} frequencies of {count} samples; expected one or two "
                "of 4, as sensors are simulated with"
            )
        yield BenchFrames(
            piece.samples_lsb.numpy(),
            piece.saturated.numpy(),
            None if piece.gray is None else piece.gray.numpy() * camera.passive.highest,
            piece.frequencies_hz,
            piece.temperature_k,
            piece.integration_s,
        )
