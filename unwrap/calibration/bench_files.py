"""The folder of a calibration: what `calibration.yaml` says of its recordings, and their frames."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from pydantic import Field, model_validator

from unwrap.calibration.moments import Kind, Moments, Setting, moments_of
from unwrap.depth import focal_px, points_of
from unwrap.recordings import load_recording
from unwrap.signal import Shots
from unwrap.support import Positive, Section

BENCH_FILE = "calibration.yaml"
Kelvin = Annotated[float, Field(ge=200.0, le=450.0)]
LEAST_FRAMES = 2
"""A single frame has no temporal variance."""


class RecordingConfig(Section):
    """One recording of a calibration, and what is known of it."""

    file: str = Field(min_length=1, description="recording, beside this file: .npz, .npy or folder")
    kind: Kind = Field(description="dark (laser off), still, wall (flat, at distance_m) or warm")
    distance_m: Positive | None = Field(
        None, description="of a wall that faces the camera, along the optical axis, m"
    )
    temperature_k: Kelvin | None = Field(None, description="of the imager, K")
    integration_s: Positive | None = Field(None, description="of one sample, s")
    laser_power_w: Positive | None = Field(None, description="for the page: optical power, W")
    ambient: bool = Field(False, description="whether there was other light than the laser's")
    gray_exposure_s: Positive | None = Field(None, description="of the gray image, s")

    @model_validator(mode="after")
    def _tells_what_its_kind_needs(self) -> RecordingConfig:
        needed = {
            "wall": ("distance_m",),
            "warm": ("temperature_k",),
            # The gray image tells the electrons of ambient light by the ratio of the times.
            "dark": ("integration_s", "gray_exposure_s") if self.ambient else (),
        }
        missing = [name for name in needed.get(self.kind, ()) if getattr(self, name) is None]
        if missing:
            light = " in ambient light" if self.kind == "dark" else ""
            raise ValueError(
                f"{self.file}: {' and '.join(missing)} is missing; expected with kind "
                f"{self.kind}{light}"
            )
        return self


class BenchConfig(Section):
    """`calibration.yaml`: the recordings of one camera."""

    name: str = Field("camera", pattern=r"^[\w .-]+$", description="of the camera")
    horizontal_fov_deg: float | None = Field(
        None, ge=1.0, le=179.0, description="horizontal field of view of a pinhole, degrees"
    )
    recordings: list[RecordingConfig] = Field(min_length=1, description="one entry each")

    @model_validator(mode="after")
    def _walls_have_rays(self) -> BenchConfig:
        walls = [r.file for r in self.recordings if r.kind == "wall"]
        if walls and self.horizontal_fov_deg is None:
            raise ValueError(
                f"horizontal_fov_deg is missing; expected with the wall {walls[0]}, whose distance "
                "is told along the optical axis"
            )
        return self


def read_bench(
    config: BenchConfig,
    folder: Path,
    *,
    bits: int,
    tick: Callable[[], object] = lambda: None,
) -> tuple[list[Moments], tuple[int, int]]:
    """Moments of every recording of a folder, one after the other in memory; the images' shape.

    Raises
    ------
    ValueError
        What `load_recording` refuses; two samples, a single frame, or recordings of unequal sizes
        or numbers of samples. The message names the file.
    """
    found: list[Moments] = []
    first: tuple[str, tuple[int, ...]] | None = None
    for row in config.recordings:
        recording = load_recording(folder / row.file, bits=bits, unwrapped=False)
        frames, count, height, width = recording.raw.dcs_lsb.shape
        if count == Shots.TWO:
            raise ValueError(f"{row.file}: 2 samples; expected 4 or 8, in which offsets cancel")
        if frames < LEAST_FRAMES:
            raise ValueError(f"{row.file}: {frames} frame; expected at least {LEAST_FRAMES}")
        if first is None:
            first = row.file, (count, height, width)
        if (count, height, width) != first[1]:
            raise ValueError(
                f"{row.file}: samples [n, H, W] are {(count, height, width)}; expected {first[1]}, "
                f"as in {first[0]}"
            )
        samples = recording.raw.dcs_lsb.numpy().reshape(frames, count // 4, 4, height, width)
        gray = None if recording.gray is None else recording.gray.numpy() * (2**bits - 1)
        flags = recording.raw.saturated.numpy()
        found.append(moments_of(setting_of(row), samples, flags, gray))
        tick()
    return found, (height, width)


def setting_of(row: RecordingConfig) -> Setting:
    """What estimators need to know of a recording."""
    return Setting(
        kind=row.kind,
        name=row.file,
        distance_m=row.distance_m,
        temperature_k=row.temperature_k,
        integration_s=row.integration_s,
        gray_exposure_s=row.gray_exposure_s,
        ambient=row.ambient,
    )


def stretch_of(shape: tuple[int, int], horizontal_fov_deg: float | None) -> np.ndarray:
    """Radial distance of each pixel over that along the optical axis [P]; ones without a view."""
    if horizontal_fov_deg is None:
        return np.ones(shape[0] * shape[1])
    unit = torch.ones(1, *shape, dtype=torch.float64)
    ahead = points_of(unit, focal_px(shape[1], horizontal_fov_deg))[0]
    return (1.0 / ahead).flatten().numpy()
