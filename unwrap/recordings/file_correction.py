"""Recorded samples to depth: reading with a camera's description, correction, writing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jsonargparse import ArgumentParser, Namespace
from torch import Tensor

from shotenv.config import SensorConfig, find_config, read_config
from shotenv.sensor import description_of
from unwrap.depth import Merge, correct
from unwrap.networks import load_unwrapper
from unwrap.recordings.arrays import read_arrays
from unwrap.recordings.depth_files import FILES, Corrected, contents, numbers_of
from unwrap.recordings.images import read_folder, read_gray16
from unwrap.recordings.recording import (
    ARRAYS,
    NoUsablePixelError,
    Recording,
    read_recording,
    with_gray,
    with_offset,
)
from unwrap.signal import (
    DepthFrame,
    Sensed,
    SensorDescription,
    Shots,
    read_wiggle,
)
from unwrap.support import progress, write_bytes


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of `shotenv unwrap correct`."""
    parser.add_argument("input", type=Path, help=".npy, .npz, or a folder of 16-bit PNG files")
    parser.add_argument("--sensor", default="epc660", help="name or path of a sensor configuration")
    parser.add_argument("--unwrapper", default="tofsegnet", help="name or path of a network")
    parser.add_argument(
        "--merge", type=Merge, default="nearest", help="nearest, floor (eq. 6), or none"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/corrected"), metavar="DIR")
    parser.add_argument("--gray", type=Path, metavar="FILE", help="gray images (.npy, .npz, .png)")
    parser.add_argument("--offset", type=Path, metavar="FILE", help="dark-offset map (.npy), LSB")
    parser.add_argument("--wiggle", type=Path, metavar="FILE", help="the sensor's own wiggle table")
    parser.add_argument("--noise-lsb", type=float, metavar="X", help="std of a sample, LSB")
    parser.add_argument("--fov-deg", type=float, default=60.0, help="horizontal field of view")
    parser.add_argument("--overwrite", action="store_true", help="replace files that stand in DIR")


def correct_files(arguments: Namespace) -> dict[str, Any]:
    """Correct the recording that the arguments name, write its depth and return the numbers.

    Raises
    ------
    ValueError
        What `camera_of`, `read`, `correct_recording` and `require_free` refuse; nothing is written
        then.
    """
    camera = camera_of(
        arguments.sensor,
        unwrapper=arguments.unwrapper,
        merge=arguments.merge,
        horizontal_fov_deg=arguments.fov_deg,
        wiggle=arguments.wiggle,
        noise_lsb=arguments.noise_lsb,
    )
    recording = read(arguments.input, camera, gray=arguments.gray, offset=arguments.offset)
    if not arguments.overwrite:
        require_free(recording, arguments.out)
    frames = correct_recording(recording, camera)
    with progress(len(frames), "writing", "frame") as bar:
        found = write_all(frames, camera, arguments.out, tick=bar.update)
    for frame in found["frames"]:
        told = f"{100 * frame['valid_share']:.1f} % valid, median {frame['median_m']:.3f} m"
        beyond = frame["pixels_beyond_png"]
        print(
            f"{frame['folder']}: {told}" + f", {beyond} beyond 65.535 m in the PNG" * (beyond > 0)
        )
    return found


@dataclass(frozen=True)
class Camera:
    """How recordings are read and corrected.

    Attributes
    ----------
    description : SensorDescription
        With the stored wiggle tables.
    bits : int
        Of the converter.
    unwrapper : str
        Name or path of a network; it is loaded where a recording has gray images.
    merge : "nearest", "floor" or "none"
    horizontal_fov_deg : float
        Horizontal field of view.
    """

    description: SensorDescription
    bits: int
    unwrapper: str
    merge: Merge
    horizontal_fov_deg: float


def camera_of(
    sensor: str,
    *,
    unwrapper: str,
    merge: Merge,
    horizontal_fov_deg: float,
    wiggle: Path | None = None,
    noise_lsb: float | None = None,
) -> Camera:
    """Camera with a configured sensor; the wiggle tables and the dark noise may be its own.

    Raises
    ------
    ConfigError
        No sensor of that name.
    ValueError
        A table that is missing, a field of view or a noise out of range.
    """
    config = read_config(SensorConfig, find_config("sensor", sensor))
    description = description_of(config)
    if not 1 <= horizontal_fov_deg <= 179:
        raise ValueError(f"fov_deg is {horizontal_fov_deg:g}; expected 1 to 179 degrees")
    if wiggle is not None:
        description = replace(description, wiggle=_tables(wiggle, description))
    if noise_lsb is not None:
        if not 0 <= noise_lsb <= 2**config.adc_bits:
            raise ValueError(f"noise_lsb is {noise_lsb:g}; expected 0 to {2**config.adc_bits}")
        description = replace(description, noise_lsb=noise_lsb)
    return Camera(description, config.adc_bits, unwrapper, merge, horizontal_fov_deg)


def _tables(path: Path, description: SensorDescription):
    tables = read_wiggle(path)
    wanted = (description.f1_hz, description.f2_hz)
    missing = [f"{hz:g}" for hz in wanted if hz not in tables]
    if missing:
        known = ", ".join(f"{hz:g}" for hz in tables) or "none"
        raise ValueError(f"{path}: no table at {', '.join(missing)} Hz; it has {known}")
    return tuple(tables[hz] for hz in wanted)


def read(
    path: Path, camera: Camera, *, gray: Path | None = None, offset: Path | None = None
) -> Recording:
    """Recording of a file or a folder; gray images and the offset map may be in other files.

    Raises
    ------
    ValueError
        What `read_recording` or `read_folder` refuses, or samples that need gray images without.
    """
    recording = (read_folder if path.is_dir() else read_recording)(path, bits=camera.bits)
    if gray is not None:
        recording = with_gray(recording, _map_of(gray, "gray"), str(gray), bits=camera.bits)
    if offset is not None:
        recording = with_offset(recording, _map_of(offset, "offset_lsb"), str(offset))
    shots = recording.raw.shots
    if recording.gray is None and shots != Shots.EIGHT:
        raise ValueError(
            f"{path}: {int(shots)} samples and no gray image; expected gray images beside them, in "
            "the recording or with --gray, or 8 samples"
        )
    return recording


def _map_of(path: Path, name: str) -> np.ndarray:
    if path.suffix == ".png":
        return read_gray16(path)
    arrays = read_arrays(path, name, ARRAYS)
    if name not in arrays:
        raise ValueError(f"{path}: {name} is missing")
    return arrays[name]


def correct_recording(recording: Recording, camera: Camera) -> list[Corrected]:
    """Depth of every frame.

    Raises
    ------
    NoUsablePixelError
        A frame without a valid pixel.
    """
    unwrapper = None if recording.gray is None else load_unwrapper(camera.unwrapper)
    frames = []
    for number in range(len(recording.names)):
        one, prediction = recording.frame(number), None
        if unwrapper is not None and one.gray is not None:
            sensed = Sensed(one.gray, one.raw, _for_batch(one.offset_lsb))
            prediction = unwrapper.predict_sensed(sensed, camera.description)
        depth = correct(
            one.raw,
            None if prediction is None else prediction.distance_m,
            camera.description,
            merge=camera.merge,
            offset_lsb=one.offset_lsb,
        )
        _require_valid(one, depth)
        confidence = None if prediction is None else prediction.confidence
        frames.append(Corrected(one, depth, confidence))
    return frames


def _for_batch(offset_lsb: Tensor | None) -> Tensor | None:
    return None if offset_lsb is None else offset_lsb.unsqueeze(0)


def _require_valid(one: Recording, depth: DepthFrame) -> None:
    if not bool(depth.valid.any()):
        saturated, pixels = int(one.raw.saturated.sum()), one.raw.saturated.numel()
        frame = f" in frame {one.names[0]}" if one.names[0] else ""
        raise NoUsablePixelError(
            f"no usable pixel{frame}: {saturated} of {pixels} are saturated, the others are "
            "lost in noise or at odds between the frequencies"
        )


def require_free(recording: Recording, out: Path) -> None:
    """Refuse to overwrite.

    Raises
    ------
    ValueError
        A file that would be written stands already; the message names it.
    """
    for path in (out / name / file for name in recording.names for file in FILES):
        if path.exists():
            raise ValueError(f"{path} stands already; --overwrite replaces it")


def write_all(
    frames: list[Corrected],
    camera: Camera,
    out: Path,
    *,
    tick: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Write `FILES` of every frame, into a folder each where there are several; their numbers."""
    numbers = []
    for frame in frames:
        folder = out / frame.recording.names[0]
        for name, content in contents(frame, camera.description, camera.horizontal_fov_deg).items():
            write_bytes(folder / name, content)
        numbers.append({"folder": str(folder), **numbers_of(frame)})
        tick()
    shots = int(frames[0].recording.raw.shots)
    return {"shots": shots, "merge": camera.merge, "frames": numbers}
