"""What a recording was made with: one number each for all of its frames, which a drive plays."""

from __future__ import annotations

from collections.abc import Sequence
from math import isclose
from typing import NamedTuple

import numpy as np
import torch

from shotenv.config import SensorConfig
from shotenv.recorded.recordings_file import RECORDINGS_FILE, RecordedFile
from shotenv.sensor import distance_drift_m
from unwrap.cameras import dropped_frames

ROUNDING = 1e-3
"""Share by which what is told may differ from what is stored, which may be rounded; assumed."""
STEADY = {"laser_power_w": 1e-6, "integration_s": 1e-6}
"""Share by which a setting may vary in a recording."""
WARM_UP_K = 5.0
"""Change of temperature from which on one calibration does not serve all frames, 6 cm at 12.5 mm/K;
assumed, as `camera describe` has it."""


class Settings(NamedTuple):
    """As `shotenv.bank.ClipSettings` has them, without the offset."""

    laser_power_w: float
    integration_s: float
    ambient_k: float
    shift_m: float


def settings_of(
    row: RecordedFile,
    stored: dict[str, list[float]],
    names: Sequence[str],
    sensor: SensorConfig,
    where: str,
) -> Settings:
    """What the recording `where` was made with.

    Parameters
    ----------
    stored : dict of list of float
        "laser_power_w", "integration_s" and "temperature_k" of each frame, as far as the recording
        or the camera's description tells.
    names : sequence of str
        Of the frames.

    Raises
    ------
    ValueError
        A setting is neither stored nor told, or both and different, or changes on the way.
    """
    imager_k = None
    if row.ambient_k is None or row.temperature_k is not None or "temperature_k" in stored:
        imager_k = one_number("temperature_k", row.temperature_k, stored, names, where)
    if row.ambient_k is None:
        assert imager_k is not None  # Without either it has been refused.
        ambient_k = imager_k - sensor.self_heating_k
    else:
        ambient_k = row.ambient_k
        imager_k = ambient_k + sensor.self_heating_k if imager_k is None else imager_k
    drift_m = float(distance_drift_m(sensor, torch.tensor(imager_k, dtype=torch.float64)))
    compensated_m = sensor.drift_compensated_share * drift_m
    return Settings(
        one_number("laser_power_w", row.laser_power_w, stored, names, where),
        one_number("integration_s", row.integration_s, stored, names, where),
        ambient_k,
        -compensated_m if row.shift_m is None else row.shift_m,
    )


def one_number(
    name: str,
    told: float | None,
    stored: dict[str, list[float]],
    names: Sequence[str],
    where: str,
) -> float:
    """The number `name` of all frames; of a temperature their mean."""
    if name not in stored:
        if told is None:
            raise ValueError(f"{where}: no {name} is stored; expected it in {RECORDINGS_FILE}")
        return told
    values = np.array(stored[name])
    allowed = STEADY[name] * values[0] if name in STEADY else WARM_UP_K
    if np.ptp(values) > allowed:
        # The frame farthest from the first says more than one just beyond the limit.
        other = int(np.argmax(np.abs(values - values[0])))
        raise ValueError(
            f"{where}: {name} changes from {values[0]:g} in frame {names[0]} to "
            f"{values[other]:g} in frame {names[other]}; expected one for all frames: split the "
            "recording"
        )
    found = float(values.mean()) if name not in STEADY else float(values[0])
    if told is None:
        return found
    if not isclose(told, found, rel_tol=ROUNDING):
        raise ValueError(
            f"{where}: {name} is {found:g} as stored, and {told:g} in {RECORDINGS_FILE}; expected "
            "one of them"
        )
    return told


def times_of(
    stored: dict[str, list[float]],
    names: Sequence[str],
    frame_rate_hz: float | None,
    where: str,
) -> tuple[tuple[float, ...], float]:
    """Time of each frame since the first, s, and the frame rate, Hz.

    Raises
    ------
    ValueError
        Frames were dropped, times run backwards, are neither stored nor told, or are not those of
        the frame rate.
    """
    times = stored.get("timestamp_s")
    if times is None or len(times) < 2:
        if frame_rate_hz is None:
            raise ValueError(
                f"{where}: no times are stored; expected frame_rate_hz in {RECORDINGS_FILE}"
            )
        return tuple(number / frame_rate_hz for number in range(len(names))), frame_rate_hz
    if gaps := dropped_frames(times, names):
        raise ValueError(f"{where}: {gaps[0]}; expected frames without a gap: split the recording")
    found_hz = float(f"{1.0 / np.median(np.diff(times)):.6g}")
    # Clocks of cameras jitter.
    if frame_rate_hz is not None and not isclose(found_hz, frame_rate_hz, rel_tol=0.05):
        raise ValueError(
            f"{where}: frames come at {found_hz:.4g} Hz; expected {frame_rate_hz:g} Hz, as the "
            f"others or {RECORDINGS_FILE} have it"
        )
    return tuple(time - times[0] for time in times), frame_rate_hz or found_hz
