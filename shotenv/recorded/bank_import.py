"""A folder of recordings to a bank, written whole or not at all, and how to play it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shotenv.bank import (
    BankError,
    RecordedBank,
    RecordedClip,
    RecordedContents,
    TruthLevel,
    write_recorded_contents,
)
from shotenv.config import EnvConfig, SensorConfig, configs_dir, read_config
from shotenv.recorded.recordings_file import (
    RECORDINGS_FILE,
    RecordedFile,
    RecordingsConfig,
    read_recordings,
    with_settings_of,
)
from shotenv.recorded.taking_in import Shape, opened, shape_of, take_in
from unwrap.cameras.files import CameraDescription
from unwrap.support import progress, unfinished, write_bytes, write_text

ENV_FILE, SENSOR_FILE, LASER_FILE = "env.yaml", "sensor.yaml", "laser.yaml"
LONGEST_DRIVE = 256
"""Frames of a drive where recordings are longer, as the default environment's."""


def import_bank(
    folder: Path,
    camera: CameraDescription,
    sensor_path: Path,
    out: Path,
    *,
    truth: TruthLevel | None = None,
) -> RecordedBank:
    """Make a bank of the recordings in `folder`.

    Parameters
    ----------
    folder : Path
        Recordings of the described camera, and what is told of them in `recordings.yaml`.
    sensor_path : Path
        Configuration of the sensor that the camera counts as.
    out : Path
        Folder of the bank; must not exist yet, or be empty. Where the same import has ended already
        (in a command that was killed at its very end, say), what stands there is left as it is.
    truth : "external", "own" or "none", optional
        What distances are scored against. None is external where references are named, else own
        with eight samples, else none.

    Raises
    ------
    ValueError
        A recording is damaged, lacks something, or is not like the others; the message names file
        and frame, and nothing is written. Or `out` has anything else than this bank.
    """
    standing = contents_standing_in(out)
    config, sensor = read_recordings(folder), read_config(SensorConfig, sensor_path)
    rows = rows_of(config, folder, camera)
    shape = shape_of(opened(rows[0], folder, camera), sensor)
    level = level_of(truth, rows, shape.samples)
    if standing is not None:  # What can be told before the work is.
        found = (standing.name, standing.camera, standing.sensor, standing.truth)
        require_same(found, (config.name, camera.name, sensor, level), out)
        require_same(len(standing.clips), len(rows), out)
    temporary = unfinished(out.resolve())
    try:
        temporary.mkdir(parents=True)
        clips: list[RecordedClip] = []
        rate_hz, external = config.frame_rate_hz, level == "external"
        with progress(len(rows), "importing", "recording") as bar:
            for number, row in enumerate(rows):
                clip, rate_hz = take_in(
                    row, number, folder, temporary, shape, frame_rate_hz=rate_hz, external=external
                )
                clips.append(clip)
                bar.update()
        assert rate_hz is not None  # There is a recording.
        contents = contents_of(config.name, clips, shape, level, rate_hz)
        if standing is None:
            write_recorded_contents(temporary, contents)
            write_environment(temporary, out, sensor_path, contents)
            temporary.replace(out)
        else:
            require_same(standing, contents, out)
    except OSError as error:
        raise BankError(
            f"cannot write {out}: {error.strerror or error}; choose another folder"
        ) from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return RecordedBank(out)


def contents_standing_in(out: Path) -> RecordedContents | None:
    """Table of contents of the bank that `out` holds; None where the folder is free.

    Raises
    ------
    BankError
        There is something else.
    """
    if not out.is_dir() or not any(out.iterdir()):
        return None
    try:
        return RecordedBank(out).manifest
    except (BankError, OSError):
        raise BankError(f"{out} is not empty; choose another folder, or delete it") from None


def require_same(standing: Any, made: Any, out: Path) -> None:
    """Raise `BankError` unless what is told of the bank in `out` is so of the one to be made."""
    if standing != made:
        raise BankError(f"{out} holds another bank; choose another folder, or delete it")


def rows_of(
    config: RecordingsConfig, folder: Path, camera: CameraDescription
) -> list[RecordedFile]:
    """The recordings that are named; without any all in the folder that the camera's reader opens.

    Raises
    ------
    ValueError
        There is none.
    """
    if config.recordings:
        return [with_settings_of(row, config) for row in config.recordings]
    rows, refused = [], []
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.suffix == ".yaml":
            continue
        row = with_settings_of(RecordedFile(file=path.name), config)
        try:
            opened(row, folder, camera)
        except ValueError as error:
            refused.append(str(error))
        else:
            rows.append(row)
    if not rows:
        why = f" ({refused[0]})" if refused else ""
        raise ValueError(f"{folder} holds no recording of {camera.name}{why}")
    return rows


def level_of(wanted: TruthLevel | None, rows: Sequence[RecordedFile], samples: int) -> TruthLevel:
    """What distances are scored against.

    Raises
    ------
    ValueError
        References are wanted where some are not named, or the depth of eight samples of four.
    """
    missing = [row.file for row in rows if row.truth is None]
    if wanted is None and len(missing) == len(rows):
        return "own" if samples == 8 else "none"
    if wanted in (None, "external"):
        if missing:
            raise ValueError(
                f"truth is 'external', but {RECORDINGS_FILE} names none of {missing[0]}; expected "
                "one of every recording, or own or none"
            )
        return "external"
    if wanted == "own" and samples != 8:
        raise ValueError(
            f"truth is 'own', but recordings have {samples} samples; expected 8, whose two "
            "frequencies tell the distance, or external or none"
        )
    return wanted


def contents_of(
    name: str, clips: Sequence[RecordedClip], shape: Shape, level: TruthLevel, rate_hz: float
) -> RecordedContents:
    """Table of contents of the bank."""
    return RecordedContents.model_validate(
        {
            "name": name,
            "height": shape.size[0],
            "width": shape.size[1],
            "config": None,
            "camera": shape.camera.name,
            "sensor": shape.sensor,
            "samples": shape.samples,
            "words": shape.words,
            "made": shape.made,
            "truth": level,
            "frame_rate_hz": rate_hz,
            "clips": tuple(clips),
        }
    )


def write_environment(
    folder: Path, bank: Path, sensor_path: Path, contents: RecordedContents
) -> None:
    """Write a configuration that plays the bank, and the sensor and laser that it names.

    Raises
    ------
    ConfigError
        The frame rate leaves no time for eight samples of the sensor.
    """
    splits = {clip.split for clip in contents.clips}
    split = "test" if "test" in splits else contents.clips[0].split
    shortest = min(clip.frames for clip in contents.clips)
    frames = max(2, min(LONGEST_DRIVE, shortest - 1))
    write_bytes(folder / SENSOR_FILE, sensor_path.read_bytes())
    write_bytes(folder / LASER_FILE, (configs_dir() / "laser" / "vcsel.yaml").read_bytes())
    lines = (
        f"# Drives through the recordings in this folder, of a {contents.camera}. Where the folder",
        "# is moved, `bank` is to be changed; `laser` is the light source that heat and energy are",
        "# computed of.",
        f"sensor: {SENSOR_FILE}",
        f"laser: {LASER_FILE}",
        f'bank: "{bank.resolve()}"',
        f"split: {split}",
        f"frames_per_drive: {frames}",
        f"frame_rate_hz: {contents.frame_rate_hz!r}",
    )
    write_text(folder / ENV_FILE, "\n".join(lines) + "\n")
    read_config(EnvConfig, folder / ENV_FILE)  # As whoever plays it will.
