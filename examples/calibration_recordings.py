"""Make up what a laboratory records to calibrate a camera.

    python examples/calibration_recordings.py bench [--seed 1]
    shotenv camera calibrate bench --out bench/sensor.yaml

The camera is simulated: an epc660-class imager with numbers of its own, which `hidden.yaml` in the
folder tells. A real camera's recordings lie in such a folder, too, beside a `calibration.yaml`.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from shotenv.config import SensorConfig, find_config, read_config
from shotenv.sensor import (
    Exposure,
    Purpose,
    capture_gray,
    draw_offsets,
    electrons_per_radiance_second,
    expose,
    noise_samples,
    stream,
)
from unwrap.signal import (
    SPEED_OF_LIGHT_M_S,
    RawFrame,
    Shots,
    correlation_samples,
    harmonic_weights,
    to_words,
)

FOV_DEG = 60.0
INTEGRATION_S = 6e-4
ROOM_K = 298.15
WARM_K = (288.15, 293.15, 303.15, 313.15, 323.15)
WALLS_M = tuple(0.5 + 0.35 * n for n in range(13))


@dataclass(frozen=True)
class Camera:
    """A camera whose numbers a calibration is to find.

    Attributes
    ----------
    sensor : SensorConfig
    delay_m : float
        Distance that it measures too much at its calibration temperature.
    seed : int
        Of its fixed pattern and its noise.
    height, width : int
    """

    sensor: SensorConfig
    delay_m: float
    seed: int
    height: int = 24
    width: int = 32

    @property
    def stretch(self) -> Tensor:
        """Radial distance of each pixel over that along the optical axis [H, W]."""
        focal = self.width / 2 / np.tan(np.radians(FOV_DEG) / 2)
        right = (torch.arange(self.width) - (self.width - 1) / 2) / focal
        down = (torch.arange(self.height) - (self.height - 1) / 2) / focal
        return (1 + right**2 + down[:, None] ** 2).sqrt()


@dataclass(frozen=True)
class Scene:
    """What stands before the camera.

    Attributes
    ----------
    distance_m : [H, W]
    signal_e, ambient_e : [H, W]
        Electrons of the laser's and of the ambient light in both taps of a sample.
    temperature_k : float
        Of the imager.
    """

    distance_m: Tensor
    signal_e: Tensor
    ambient_e: Tensor
    temperature_k: float = ROOM_K


def hidden_camera(seed: int, **size: int) -> Camera:
    """An imager like the epc660, with numbers drawn within what such imagers have."""
    draw = np.random.default_rng(seed).uniform
    base = read_config(SensorConfig, find_config("sensor", "epc660"))
    well_e = draw(80e3, 200e3)
    drawn = {
        "full_well_e": well_e,
        # A full tap is a part of the converter's half range, so that it is the tap that fills.
        "gain_lsb_per_e": draw(0.5, 0.9) * 2 ** (base.adc_bits - 1) / well_e,
        "read_noise_e": draw(60.0, 150.0),
        "contrast": draw(0.6, 0.9),
        "harmonic_strength": draw(0.05, 0.4),
        "offset_std_lsb": draw(5.0, 25.0),
        "offset_row_share": draw(0.2, 0.8),
        "offset_ambient_lsb": draw(3.0, 12.0),
        "offset_drift_lsb_per_k": draw(0.02, 0.1),
        "distance_drift_m_per_k": draw(2e-3, 20e-3),
        "calibration_temperature_k": ROOM_K,
    }
    sensor = SensorConfig.model_validate(base.model_dump() | drawn)
    return Camera(sensor, draw(-0.2, 0.2), seed, **size)


def record(
    camera: Camera, scene: Scene, frames: int, number: int
) -> tuple[RawFrame, Tensor, float]:
    """Eight samples, gray words and the gray exposure of frames of a scene.

    `number` tells recordings apart: each has noise of its own.
    """
    sensor = camera.sensor
    warmer_k = scene.temperature_k - sensor.calibration_temperature_k
    # A true delay of the light: it turns under the overtones, as that of a real camera does.
    far_m = scene.distance_m + camera.delay_m + sensor.distance_drift_m_per_k * warmer_k
    weights = harmonic_weights(sensor.harmonic_strength, sensor.highest_harmonic)
    per_m = [4 * np.pi * hz / SPEED_OF_LIGHT_M_S for hz in (sensor.f1_hz, sensor.f2_hz)]
    waves = torch.cat([correlation_samples(far_m.double() * k, weights) for k in per_m])
    per_radiance_e = electrons_per_radiance_second(sensor) * INTEGRATION_S
    active, ambient = scene.signal_e / per_radiance_e, scene.ambient_e / per_radiance_e
    shape = (frames, camera.height, camera.width)
    exposure = Exposure(
        (active * waves).float().expand(frames, -1, -1, -1),
        active.float().expand(shape),
        ambient.float().expand(shape),
        far_m.float().expand(shape),
    )
    seeds = [1000 * camera.seed + number] * frames
    *normals, for_gray = islice(noise_samples(seeds, range(frames), *shape[1:]), 9)
    offsets = draw_offsets(
        sensor,
        *shape[1:],
        generator=stream(Purpose.OFFSETS, camera.seed),
        imager_k=scene.temperature_k,
    )
    raw = expose(
        exposure,
        sensor,
        shots=Shots.EIGHT,
        laser_power_w=torch.ones(frames),
        integration_s=torch.full((frames,), INTEGRATION_S),
        noise=torch.stack(normals, 1),
        offsets=offsets,
    )
    gray, exposure_s = capture_gray(exposure.ambient, sensor, noise=for_gray[:, 0])
    return raw, gray, float(exposure_s[0])


def bench(camera: Camera) -> list[tuple[dict, Scene, int]]:
    """What is known of each recording, its scene and its number of frames."""
    height, width = camera.height, camera.width
    full_e = 2 * camera.sensor.full_well_e
    # The signal that just fills a tap at phase 0.
    most_e = full_e / (1 + camera.sensor.contrast)
    across = torch.linspace(0, 1, width).expand(height, width)
    down = torch.linspace(0, 1, height)[:, None].expand(height, width)
    dark = torch.zeros(height, width)
    slope_m = 1.0 + 2.0 * down
    room = {"integration_s": INTEGRATION_S, "temperature_k": ROOM_K}
    planned: list[tuple[dict, Scene, int]] = [
        ({"kind": "dark", **room}, Scene(slope_m, dark, dark), 64)
    ]
    for kelvin in (ROOM_K + 20, ROOM_K + 40):
        known = {"kind": "dark", **room, "temperature_k": kelvin}
        planned.append((known, Scene(slope_m, dark, dark, kelvin), 32))
    for share in (0.3, 0.8):
        light_e = share * full_e * (0.1 + 0.9 * (across + down) / 2)
        known = {"kind": "dark", **room, "ambient": True}
        planned.append((known, Scene(slope_m, dark, light_e), 64))
    for share in (0.2, 0.6, 1.1, 1.25, 1.4, 1.6):
        known = {"kind": "still", **room, "laser_power_w": 5 * share}
        planned.append((known, Scene(slope_m, share * most_e * (0.1 + 0.9 * across), dark), 32))
    for wall_m in WALLS_M:
        # Light falls off towards the corners; power is set for each distance.
        light_e = 0.6 * most_e / camera.stretch**3
        known = {"kind": "wall", **room, "distance_m": round(wall_m, 3)}
        planned.append((known, Scene(wall_m * camera.stretch, light_e, dark), 8))
    for kelvin in WARM_K:
        known = {"kind": "warm", **room, "temperature_k": kelvin}
        planned.append(
            (known, Scene(slope_m, 0.5 * most_e * (0.3 + 0.7 * across), dark, kelvin), 8)
        )
    return planned


def main(folder: Path, seed: int, **size: int) -> None:
    """Write the recordings, what is known of them and, beside them, the camera's hidden numbers."""
    folder.mkdir(parents=True, exist_ok=True)
    camera = hidden_camera(seed, **size)
    rows = []
    for number, (known, scene, frames) in enumerate(bench(camera)):
        raw, gray, exposure_s = record(camera, scene, frames, number)
        file = f"{number:02d}_{known['kind']}.npz"
        np.savez(
            folder / file,
            dcs=to_words(raw.dcs_lsb, camera.sensor.adc_bits).numpy().astype(np.uint16),
            gray=gray.numpy().astype(np.uint16),
            saturated=raw.saturated.numpy(),
        )
        rows.append({"file": file, **known, "gray_exposure_s": exposure_s})
    # JSON is YAML, too; one recording a line.
    lines = ",\n  ".join(json.dumps(row) for row in rows)
    (folder / "calibration.yaml").write_text(
        f"name: made-up-{seed}\nhorizontal_fov_deg: {FOV_DEG}\nrecordings: [\n  {lines}\n]\n"
    )
    hidden = camera.sensor.model_dump(mode="json") | {"distance_offset_m": camera.delay_m}
    (folder / "hidden.yaml").write_text(json.dumps(hidden, indent=1))
    print(f"{len(rows)} recordings in {folder}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    main(arguments.folder, arguments.seed)
