"""Recordings of simulated cameras on the bench of `examples/calibration_recordings.py`."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np

from unwrap.calibration import Assumed, Moments, Setting, calibrate_camera, moments_of

EXAMPLE = Path(__file__).parents[2] / "examples" / "calibration_recordings.py"


def load_example():
    spec = importlib.util.spec_from_file_location(EXAMPLE.stem, EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[EXAMPLE.stem] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


example = load_example()
# Far from every hidden camera's: what was not measured would be seen.
ASSUMED = Assumed((24e6, 10e6), 12, 0.5, 0.03, 300e3, 0.9, 7)


def moments(camera, known: dict, scene, frames: int, number: int) -> Moments:
    """Recording `number` of a scene, reduced to its moments."""
    raw, gray, exposure_s = example.record(camera, scene, frames, number)
    setting = Setting(
        kind=known["kind"],
        name=f"recording {number}",
        distance_m=known.get("distance_m"),
        temperature_k=known.get("temperature_k"),
        integration_s=known.get("integration_s"),
        gray_exposure_s=exposure_s,
        ambient=known.get("ambient", False),
    )
    samples = raw.dcs_lsb.numpy().reshape(frames, 2, 4, camera.height, camera.width)
    return moments_of(setting, samples, raw.saturated.numpy(), gray.numpy())


def recorded(camera, kinds=("dark", "still", "wall", "warm")) -> list[Moments]:
    """All recordings of the bench that are of some kinds."""
    return [
        moments(camera, known, scene, frames, number)
        for number, (known, scene, frames) in enumerate(example.bench(camera))
        if known["kind"] in kinds
    ]


def calibrated(camera, recordings, assumed=ASSUMED):
    """What recordings of a camera tell."""
    stretch = camera.stretch.numpy().ravel().astype(np.float64)
    return calibrate_camera(recordings, (camera.height, camera.width), stretch, assumed)


def hidden_number(camera, name: str) -> float:
    """The true value of a number of a calibration."""
    return getattr(camera.sensor, name) if hasattr(camera.sensor, name) else camera.delay_m
