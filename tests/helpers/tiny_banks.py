"""A tiny bank of light from closed forms, for which no renderer is needed.

Walls, boxes and floors at known distances, moving at known speeds.
"""

from __future__ import annotations

import math

import numpy as np
import torch

from shotenv.bank.files.store import write_clip, write_manifest
from shotenv.config.bank import BankConfig
from shotenv.config.families import FAMILIES
from shotenv.config.sensor import SensorConfig
from shotenv.sensor.gray import capture_gray
from unwrap.signal.shots import (
    demodulation_phase_rad,
    frequency_index,
    harmonic_weights,
    sample_times_s,
)

SPEED_OF_LIGHT_M_S = 299_792_458.0
HEIGHT, WIDTH = 24, 32
CLIPS, FRAMES_PER_CLIP = 16, 4
LASER_SOLID_ANGLE_SR = 0.8
AMBIENT_IRRADIANCE_W_M2 = {
    "sunny_road": 8.0,
    "overcast_street": 1.0,
    "garage": 0.03,
    "tunnel": 0.1,
    "night_road": 1e-4,
}


def scene_at(family: str, seed: int, time_s: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Distance [H, W], albedo [H, W] and ego speed: a wall and a box over a floor, drawing near."""
    random = np.random.default_rng(seed)
    wall_m, box_m, speed_m_s = random.uniform(10, 30), random.uniform(3, 9), random.uniform(0, 8)
    rows = np.arange(HEIGHT)[:, None] * np.ones((1, WIDTH))
    # Below the horizon a floor 1.2 m down, seen under 1.5 degrees per row.
    below = np.deg2rad(np.maximum(rows - HEIGHT / 2, 0.5) * 1.5)
    distance = np.minimum(wall_m, 1.2 / np.sin(below))
    albedo = 0.15 + 0.35 * random.random((HEIGHT, WIDTH))
    left = int(random.integers(0, WIDTH - 10))
    distance[6:18, left : left + 8] = box_m
    albedo[6:18, left : left + 8] = random.uniform(0.05, 0.9)
    distance = distance - speed_m_s * time_s * 0.1
    if family in ("sunny_road", "overcast_street", "night_road"):
        distance[:4] = np.inf
    return distance, albedo, float(speed_m_s)


def closed_form_light(
    family: str, seed: int, time_s: float, sensor: SensorConfig
) -> dict[str, np.ndarray]:
    """Light of one frame: one bounce, every sample at its own instant."""
    times = [time_s + t for t in sample_times_s(8, sensor.sample_period_s)]
    frequencies = (sensor.f1_hz, sensor.f2_hz)
    weights = harmonic_weights(sensor.harmonic_strength, sensor.highest_harmonic)
    correlation, active = [], []
    for k, instant in enumerate(times):
        distance, albedo, _ = scene_at(family, seed, instant)
        radiance = albedo / math.pi / (LASER_SOLID_ANGLE_SR * distance**2)
        hit = np.where(np.isinf(distance), 0.0, distance)
        phase = 4 * math.pi * frequencies[frequency_index(k)] * hit / SPEED_OF_LIGHT_M_S
        angle = phase - demodulation_phase_rad(k)
        correlation.append(radiance * sum(w * np.cos(h * angle) for h, w in weights))
        active.append(radiance)
    distance, albedo, _ = scene_at(family, seed, time_s)
    irradiance = AMBIENT_IRRADIANCE_W_M2[family] * (1 + 0.3 * math.sin(seed + time_s))
    light = {
        "correlation": np.stack(correlation),
        "active": np.mean(active, axis=0),
        "ambient": np.where(np.isinf(distance), 2.0, albedo) * irradiance / math.pi,
        "distance_m": distance,
    }
    return {name: value.astype(np.float32) for name, value in light.items()}


def write_tiny_bank(folder, sensor: SensorConfig) -> None:
    """One clip of each family in each split, and one more for training."""
    records = []
    for number in range(CLIPS):
        family = FAMILIES[number % len(FAMILIES)]
        split = ("train", "validation", "test")[number // len(FAMILIES) % 3]
        times = [0.1 * i for i in range(FRAMES_PER_CLIP)]
        light = [closed_form_light(family, number, time, sensor) for time in times]
        arrays = {name: np.stack([frame[name] for frame in light]) for name in light[0]}
        noise = torch.randn(
            arrays["ambient"].shape, generator=torch.Generator().manual_seed(number)
        )
        gray, exposure_s = capture_gray(torch.from_numpy(arrays["ambient"]), sensor, noise=noise)
        arrays["gray"] = gray.numpy().astype(np.uint16)
        name = f"{number:03d}-{family}"
        metadata = {
            "name": name,
            "family": family,
            "seed": number,
            "split": split,
            "time_s": times,
            "ego_speed_m_s": [scene_at(family, number, 0.0)[2]] * FRAMES_PER_CLIP,
            "yaw_rate_rad_s": [0.1 * math.sin(number)] * FRAMES_PER_CLIP,
            "gray_exposure_s": exposure_s.tolist(),
        }
        records.append(write_clip(folder / "clips" / name, arrays, metadata))
    write_manifest(folder, "tiny", records, (HEIGHT, WIDTH), BankConfig(name="tiny", sensor=sensor))
