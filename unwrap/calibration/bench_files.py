"""The folder of a calibration: what `calibration.yaml` says of its recordings, and their frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import torch
from pydantic import Field

from unwrap.calibration.bench_frames import BenchFrames, camera_frames, plain_frames
from unwrap.calibration.moments import Kind, Moments, MomentsInPieces, Setting
from unwrap.cameras.files import CameraDescription
from unwrap.depth import focal_px, points_of
from unwrap.support import Positive, Section

BENCH_FILE = "calibration.yaml"
Kelvin = Annotated[float, Field(ge=200.0, le=450.0)]
LEAST_FRAMES = 2
"""A single frame has no temporal variance."""
CHANGES = {"temperature_k": 5.0, "integration_s": 0.0}
"""What recordings may tell of themselves, and by how much it may change within one: the temperature
by what noise it has, but not by what a camera warms up (assumed)."""


class RecordingConfig(Section):
    """One recording of a calibration, and what is known of it."""

    file: str = Field(
        min_length=1,
        description="recording, beside this file: .npz, .npy, folder, or as --camera tells",
    )
    gray: str | None = Field(None, description="gray images, where the recording has none")
    kind: Kind = Field(description="dark (laser off), still, wall (flat, at distance_m) or warm")
    distance_m: Positive | None = Field(
        None, description="of a wall that faces the camera, along the optical axis, m"
    )
    temperature_k: Kelvin | None = Field(None, description="of the imager, K")
    integration_s: Positive | None = Field(None, description="of one sample, s")
    laser_power_w: Positive | None = Field(None, description="for the page: optical power, W")
    ambient: bool = Field(False, description="whether there was other light than the laser's")
    gray_exposure_s: Positive | None = Field(None, description="of the gray image, s")


class BenchConfig(Section):
    """`calibration.yaml`: the recordings of one camera."""

    name: str = Field("camera", pattern=r"^[\w .-]+$", description="of the camera")
    horizontal_fov_deg: float | None = Field(
        None,
        ge=1.0,
        le=179.0,
        description="horizontal field of view of a pinhole, degrees, where no lens is described",
    )
    recordings: list[RecordingConfig] = Field(min_length=1, description="one entry each")


@dataclass(frozen=True)
class Bench:
    """What the frames of a folder say.

    Attributes
    ----------
    recordings : list of Moments
    shape : (int, int)
        Rows and columns of an image.
    frequencies_hz : tuple of float or None
        Descending; None where no camera is described.
    """

    recordings: list[Moments]
    shape: tuple[int, int]
    frequencies_hz: tuple[float, ...] | None


class Kept(NamedTuple):
    """What all recordings of a bench have in common, and of which one it is."""

    file: str
    samples: int
    size: tuple[int, int]
    frequencies_hz: tuple[float, ...] | None

    def refuse_unlike(self, first: Kept) -> None:
        """Raise ValueError unless this is as that of the first recording."""
        shape, expected = (self.samples, *self.size), (first.samples, *first.size)
        if shape != expected:
            raise ValueError(
                f"{self.file}: samples [n, H, W] are {shape}; expected {expected}, as in "
                f"{first.file}"
            )
        if self.frequencies_hz != first.frequencies_hz:
            found, wanted = (
                " and ".join(f"{hz / 1e6:g}" for hz in some or ())
                for some in (self.frequencies_hz, first.frequencies_hz)
            )
            raise ValueError(
                f"{self.file}: recorded at {found} MHz; expected {wanted}, as {first.file}"
            )


def read_bench(
    config: BenchConfig,
    folder: Path,
    *,
    bits: int,
    camera: CameraDescription | None = None,
    tick: Callable[[], object] = lambda: None,
) -> Bench:
    """Moments of every recording of a folder, one after the other in memory.

    Parameters
    ----------
    bits : int
        Of the converter, where no camera is described.
    camera : CameraDescription, optional
        How recordings are read. What they, or it, tell of temperature and integration time serves
        where `config` does not.

    Raises
    ------
    ValueError
        What reading refuses; a single frame; recordings of unequal sizes, numbers of samples or
        frequencies; what is not told and its kind needs; a temperature or an integration time that
        changes within a recording. The message names the file.
    """
    _refuse_directions(config, camera)
    if camera is None:
        for row in config.recordings:
            setting_of(row)  # What is missing is told before anything is read.
    found: list[Moments] = []
    first: Kept | None = None
    for row in config.recordings:
        gathered = MomentsInPieces(row.file, cut_off=camera is not None)
        told: dict[str, list[float]] = {name: [] for name in CHANGES}
        for frames in frames_of(row, folder, bits=bits, camera=camera):
            _, frequencies, count, height, width = frames.samples_lsb.shape
            own = Kept(row.file, frequencies * count, (height, width), frames.frequencies_hz)
            first = first or own
            own.refuse_unlike(first)
            gathered.add(frames.samples_lsb, frames.saturated, frames.gray_words)
            for name, values in told.items():
                values += getattr(frames, name) or ()
        if gathered.frames < LEAST_FRAMES:
            raise ValueError(
                f"{row.file}: {gathered.frames} frame; expected at least {LEAST_FRAMES}"
            )
        found.append(gathered.of(setting_of(row, told)))
        tick()
    assert first is not None  # No bench is without recordings.
    return Bench(found, first.size, first.frequencies_hz)


def _refuse_directions(config: BenchConfig, camera: CameraDescription | None) -> None:
    """Raise ValueError where directions of pixels are told twice, or are wanted and not told."""
    fov_deg = config.horizontal_fov_deg
    if camera is not None and fov_deg is not None:
        raise ValueError(
            f"horizontal_fov_deg is {fov_deg:g}, and the lens of {camera.name} tells directions, "
            "too; expected no horizontal_fov_deg with a described camera"
        )
    walls = [r.file for r in config.recordings if r.kind == "wall"]
    if camera is None and fov_deg is None and walls:
        raise ValueError(
            f"horizontal_fov_deg is missing; expected with the wall {walls[0]}, whose distance "
            "is told along the optical axis"
        )


def frames_of(
    row: RecordingConfig, folder: Path, *, bits: int, camera: CameraDescription | None
) -> Iterable[BenchFrames]:
    """Frames of one recording, piece by piece."""
    path, gray = folder / row.file, None if row.gray is None else folder / row.gray
    if camera is None:
        return [plain_frames(path, gray, bits=bits)]
    return camera_frames(path, gray, camera)


def setting_of(row: RecordingConfig, told: Mapping[str, Sequence[float]] | None = None) -> Setting:
    """What estimators need to know of a recording.

    Parameters
    ----------
    told : mapping of str to sequence of float
        Temperatures and integration times that its frames tell, for where `row` does not.

    Raises
    ------
    ValueError
        What its kind needs is told nowhere, or changes within the recording.
    """
    known = {name: getattr(row, name) for name in CHANGES}
    for name, values in (told or {}).items():
        if known[name] is None and values:
            if max(values) - min(values) > CHANGES[name]:
                raise ValueError(
                    f"{row.file}: {name} goes from {min(values):g} to {max(values):g}; expected "
                    "one of a recording, or that which counts in calibration.yaml"
                )
            known[name] = sum(values) / len(values)
    needed = {
        "wall": ("distance_m",),
        "warm": ("temperature_k",),
        # The gray image tells the electrons of ambient light by the ratio of the times.
        "dark": ("integration_s", "gray_exposure_s") if row.ambient else (),
    }
    setting = Setting(
        kind=row.kind,
        name=row.file,
        distance_m=row.distance_m,
        gray_exposure_s=row.gray_exposure_s,
        ambient=row.ambient,
        **known,
    )
    missing = [name for name in needed.get(row.kind, ()) if getattr(setting, name) is None]
    if missing:
        light = " in ambient light" if row.kind == "dark" else ""
        raise ValueError(
            f"{row.file}: {' and '.join(missing)} is missing; expected with kind {row.kind}{light}"
        )
    return setting


def stretch_of(shape: tuple[int, int], horizontal_fov_deg: float | None) -> np.ndarray:
    """Radial distance of each pixel over that along the optical axis [P]; ones without a view."""
    if horizontal_fov_deg is None:
        return np.ones(shape[0] * shape[1])
    unit = torch.ones(1, *shape, dtype=torch.float64)
    ahead = points_of(unit, focal_px(shape[1], horizontal_fov_deg))[0]
    return (1.0 / ahead).flatten().numpy()
