"""One recording to the arrays of a clip: read piece by piece, checked, in one order and unit."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shotenv.bank import RecordedClip, sha256_of
from shotenv.config import SensorConfig
from shotenv.recorded.clip_settings import settings_of, times_of
from shotenv.recorded.frame_tables import read_ego, read_offset, read_truth
from shotenv.recorded.recordings_file import RECORDINGS_FILE, RecordedFile
from shotenv.sensor import full_scale_lsb
from unwrap.cameras import CameraFrames, CameraRecording, open_camera_recording
from unwrap.cameras.files import CameraDescription
from unwrap.signal import SAMPLES_PER_FREQUENCY

TOLD = ("laser_power_w", "integration_s", "temperature_k", "timestamp_s")
INT16 = np.iinfo(np.int16)


@dataclass(frozen=True)
class Shape:
    """What is the same in all recordings of a bank: the camera, and how its samples are kept.

    Attributes
    ----------
    camera : CameraDescription
    sensor : SensorConfig
    size : (int, int)
        Rows and columns.
    frequencies : int
        Kept, 1 or 2.
    made : bool
        Samples were made of phasors.
    words : str
        "int16", or "float32" of samples that are not whole or larger.
    """

    camera: CameraDescription
    sensor: SensorConfig
    size: tuple[int, int]
    frequencies: int
    made: bool
    words: str

    @property
    def samples(self) -> int:
        """Of a frame."""
        return self.frequencies * SAMPLES_PER_FREQUENCY


def opened(row: RecordedFile, folder: Path, camera: CameraDescription) -> CameraRecording:
    """The recording of `row`, with its gray images."""
    gray = None if row.gray is None else folder / row.gray
    return open_camera_recording(folder / row.file, camera, gray=gray)


def shape_of(recording: CameraRecording, sensor: SensorConfig) -> Shape:
    """How all recordings are kept, by the first frame of one.

    Raises
    ------
    ValueError
        Other frequencies than the sensor's, or two samples of a frequency.
    """
    camera, first = recording.camera, recording.read(0, 1)
    where = str(recording.source.path)
    places_of(first, sensor, where)
    _, frequencies, count, *_ = first.samples_lsb.shape
    if count != SAMPLES_PER_FREQUENCY:
        raise ValueError(f"{where}: {count} samples of a frequency; expected 4")
    low, high = (limit - camera.words.mid_scale for limit in camera.words.limits)
    whole = not (camera.words.real or first.made) and low >= INT16.min and high <= INT16.max
    return Shape(
        camera,
        sensor,
        recording.size,
        min(frequencies, 2),
        first.made,
        "int16" if whole else "float32",
    )


def places_of(frames: CameraFrames, sensor: SensorConfig, where: str) -> list[int]:
    """Places of the sensor's frequencies among those of the frames.

    Raises
    ------
    ValueError
        They are not among them.
    """
    there = frames.frequencies_hz
    wanted = (sensor.f1_hz, sensor.f2_hz)[: len(there)]
    if any(hz not in there for hz in wanted):
        told, asked = (" and ".join(f"{hz / 1e6:g}" for hz in all_hz) for all_hz in (there, wanted))
        raise ValueError(
            f"{where}: modulation frequencies are {told} MHz, and those of sensor {sensor.name} "
            f"{asked} MHz; expected a sensor that has them"
        )
    return [there.index(hz) for hz in wanted]


def take_in(
    row: RecordedFile,
    number: int,
    folder: Path,
    bank: Path,
    shape: Shape,
    *,
    frame_rate_hz: float | None,
    external: bool,
) -> tuple[RecordedClip, float]:
    """Write the clip of one recording into the folder `bank`: its record, and its frame rate.

    Parameters
    ----------
    number : int
        Of the recording.
    folder : Path
        That file names are relative to.
    external : bool
        Whether a reference is kept.

    Raises
    ------
    ValueError
        What the camera's reader refuses; another size or frequency than `shape`, no gray images,
        settings that are missing or change, dropped frames; the message names file and frame.
    """
    recording = opened(row, folder, shape.camera)
    where, names, size = str(recording.source.path), recording.names, recording.size
    if size != shape.size:
        raise ValueError(f"{where}: frames are {size}; expected {shape.size}, as the others are")
    frames = len(names)
    ego = {} if row.ego is None else read_ego(folder / row.ego, frames)
    arrays = _tables_of(row, folder, (frames, *size), external)
    clip = f"{number:03d}-{re.sub(r'[^A-Za-z0-9_-]+', '_', Path(row.file).stem)}"[:80]
    target = bank / "clips" / clip
    target.mkdir(parents=True)
    # Mapped, for they may not fit in memory.
    arrays |= {
        "words": _mapped(target / "words.npy", shape.words, (frames, shape.samples, *size)),
        "saturated": _mapped(target / "saturated.npy", "uint8", (frames, *size)),
        "gray": _mapped(target / "gray.npy", "uint16", (frames, *size)),
    }
    stored = _fill(arrays, recording, shape, where)
    exposure_s = ego.get("gray_exposure_s")
    if exposure_s is None:
        if row.gray_exposure_s is None:
            raise ValueError(
                f"{where}: no gray_exposure_s is told; expected it in {RECORDINGS_FILE}, or a "
                "column of the table that its ego names"
            )
        exposure_s = (row.gray_exposure_s,) * frames
    settings = settings_of(row, stored, names, shape.sensor, where)
    if settings.integration_s >= shape.sensor.sample_period_s:
        raise ValueError(
            f"{where}: integration_s is {settings.integration_s:g}; expected less than "
            f"sample_period_s = {shape.sensor.sample_period_s:g} of sensor {shape.sensor.name}"
        )
    times_s, rate_hz = times_of(stored, names, frame_rate_hz, where)
    still = (0.0,) * frames
    facts: dict[str, Any] = {
        **settings._asdict(),
        "name": clip,
        "family": row.family,
        "seed": number if row.seed is None else row.seed,
        "split": row.split,
        "frames": frames,
        "time_s": times_s,
        "ego_speed_m_s": ego.get("ego_speed_m_s", still),
        "yaw_rate_rad_s": ego.get("yaw_rate_rad_s", still),
        "gray_exposure_s": exposure_s,
        "folder": f"clips/{clip}",
        "source": row.file,
        "sha256": _written(target, arrays),
    }
    return RecordedClip.model_validate(facts), rate_hz


def _tables_of(
    row: RecordedFile, folder: Path, shape: tuple[int, int, int], external: bool
) -> dict[str, np.ndarray]:
    """Offset, and with external truth the reference."""
    size = shape[1:]
    no_offset = np.zeros(size, np.float32)
    found = {
        "offset_lsb": no_offset if row.offset is None else read_offset(folder / row.offset, size)
    }
    if external and row.truth is not None:  # There is one of each recording.
        found["distance_m"] = read_truth(folder / row.truth, shape)
    return found


def _mapped(path: Path, dtype: str, shape: tuple[int, ...]) -> np.memmap:
    return np.lib.format.open_memmap(path, mode="w+", dtype=dtype, shape=shape)


def _fill(
    arrays: dict[str, np.ndarray],
    recording: CameraRecording,
    shape: Shape,
    where: str,
) -> dict[str, list[float]]:
    """Write the frames into "words", "saturated" and "gray": what is stored beside them."""
    full_scale, start = full_scale_lsb(shape.sensor.adc_bits), 0
    stored: dict[str, list[float]] = {}
    for piece in recording.pieces():
        stop = start + len(piece)
        if piece.gray is None:
            raise ValueError(
                f"{where}: no gray images, which every frame begins with; expected them in the "
                f"recording, or a file that gray in {RECORDINGS_FILE} names"
            )
        places = places_of(piece, shape.sensor, where)
        samples = piece.samples_lsb[:, places].flatten(1, 2).numpy()
        flags = piece.saturated_samples[:, places].flatten(1, 2).numpy()
        arrays["words"][start:stop] = samples
        # Bit k is that of sample k.
        arrays["saturated"][start:stop] = np.packbits(flags, axis=1, bitorder="little")[:, 0]
        arrays["gray"][start:stop] = np.rint(piece.gray.numpy() * full_scale)
        for name in TOLD:
            values = getattr(piece, name)
            if values is not None:
                stored.setdefault(name, []).extend(values)
        start = stop
    return stored


def _written(target: Path, arrays: dict[str, np.ndarray]) -> dict[str, str]:
    """Digest of the file of each array, all of them written."""
    digests = {}
    for name, array in arrays.items():
        path = target / f"{name}.npy"
        if isinstance(array, np.memmap):
            array.flush()
        else:
            np.save(path, array, allow_pickle=False)
        digests[name] = sha256_of(path)
    return digests
