"""A folder of recorded drives, as `shotenv bank import` takes it.

<folder>/recordings.yaml        files of each drive, and what the camera does not store
<folder>/sensor.yaml            the imager
<folder>/<drive>.*              the recording, in the camera's own format
<folder>/<drive>_gray.*         gray images, where the recording cannot hold them
<folder>/<drive>_truth.npy      true distance float32 [F, H, W], NaN where a pixel does not count
<folder>/<drive>_offset.npy     calibrated dark offset float32 [H, W], LSB
<folder>/<drive>_ego.csv        speed, yaw rate and gray exposure, a row a frame
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from shotenv.config import SensorConfig
from shotenv.decision import Problem
from shotenv.recorded.bank_import import SENSOR_FILE
from shotenv.recorded.delivered_drive import DeliveredDrive, deliver_drive
from shotenv.recorded.recordings_file import RECORDINGS_FILE
from unwrap.cameras.files import CameraDescription
from unwrap.cameras.writing import container_of, kept_frequencies, write_camera_recording
from unwrap.support import building_folder, write_text

EGO = ("ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
SETTINGS = ("laser_power_w", "integration_s", "temperature_k")


def require_camera(camera: CameraDescription, sensor: SensorConfig) -> tuple[float, ...]:
    """Frequencies, descending, at which the camera would have recorded the sensor's samples.

    Raises
    ------
    ValueError
        It has no recordings, other frequencies, or words that are too short; the message names it.
    """
    container = container_of(camera)
    kept = kept_frequencies(
        (sensor.f1_hz, sensor.f2_hz),
        camera,
        tells_frequencies="frequencies_hz" in container.tells,
    )
    if sensor.f1_hz not in kept:
        raise ValueError(
            f"{camera.name} takes {kept[0] / 1e6:g} MHz alone; expected {sensor.f1_hz / 1e6:g} "
            "MHz, at which 2 and 4 samples are taken"
        )
    if not camera.words.real and camera.words.bits < sensor.adc_bits:
        raise ValueError(
            f"words of {camera.name} have {camera.words.bits} bits; expected at least "
            f"{sensor.adc_bits}, as sensor {sensor.name} has"
        )
    for name in SETTINGS:
        if getattr(camera.constants, name) is not None:
            raise ValueError(
                f"constants.{name} of {camera.name} is {getattr(camera.constants, name):g}; "
                "expected none, as each drive has its own"
            )
    return tuple(sorted(kept, reverse=True))


def write_drives(
    folder: Path,
    problem: Problem,
    drives: Mapping[str, int],
    camera: CameraDescription,
    *,
    tick: Callable[[int], object] = lambda frames: None,
) -> None:
    """Write drives as the camera would have recorded them, all or nothing.

    Parameters
    ----------
    drives : mapping of str to int
        Seed of each drive, by the name of its files.

    Raises
    ------
    ValueError
        The folder is not empty, or the camera cannot hold the frames.
    """
    require_camera(camera, problem.config.sensor)
    with building_folder(folder) as building:
        rows = [
            _write_drive(building, name, deliver_drive(problem, seed, tick=tick), camera)
            for name, seed in drives.items()
        ]
        about = {
            "name": re.sub(r"[^A-Za-z0-9_-]+", "_", folder.name)[:80] or "recorded",
            "frame_rate_hz": problem.config.frame_rate_hz,
            "recordings": rows,
        }
        _write_yaml(building / SENSOR_FILE, problem.config.sensor.model_dump(mode="json"))
        _write_yaml(building / RECORDINGS_FILE, about)


def _write_drive(
    folder: Path, name: str, drive: DeliveredDrive, camera: CameraDescription
) -> dict[str, Any]:
    """Write the files of a drive; its entry in the list of recordings."""
    written = write_camera_recording(folder, name, drive.frames, camera)
    row: dict[str, Any] = {"file": written.recording.name}
    if written.gray is not None:
        row["gray"] = written.gray.name
    for kind, array in (("truth", drive.truth_m), ("offset", drive.offset_lsb)):
        row[kind] = f"{name}_{kind}.npy"
        np.save(folder / row[kind], array.numpy(), allow_pickle=False)
    row["ego"] = f"{name}_ego.csv"
    columns = zip(*(getattr(drive, column).tolist() for column in EGO), strict=True)
    # `repr` of a float is the shortest text that gives it back.
    lines = (",".join(map(repr, frame)) for frame in columns)
    write_text(folder / row["ego"], "\n".join((",".join(EGO), *lines)) + "\n")
    if drive.family is not None:
        row["family"] = drive.family
    # Known of simulated drives alone: whoever imports a real one has to take it from the sensor.
    row |= {"seed": drive.seed, "ambient_k": drive.ambient_k, "shift_m": drive.shift_m}
    told = container_of(camera).tells
    row |= {n: getattr(drive.frames, n)[0] for n in SETTINGS if n not in told}
    return row


def _write_yaml(path: Path, value: Any) -> None:
    write_text(path, yaml.safe_dump(value, sort_keys=False))
