"""Close the loop: a scheduler chooses the shots of a camera on the network, frame by frame.

    python examples/live.py [--policy runs/demo/agent] [--frames 100] [--size 120x160]

The camera is emulated on the loopback: it drives through a made-up street and a tunnel, and speaks
the wire format of an epc660. Without a policy a rule chooses. Printed are how long each stage of a
frame takes, the frame rate, and the energy beside that of 8 samples in every frame.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from emulated_camera import EmulatedCamera, ServedFrame, wire_words

from agents import LookAndHoldPolicy, Policy, load_policy
from shotenv.config import SensorConfig, env_config, find_config, read_config
from shotenv.live import EpcCamera, FrameTimes, LiveShotScheduleEnv
from shotenv.sensor import (
    Exposure,
    OffsetPattern,
    Purpose,
    Sensitivity,
    acquire_prefixes,
    capture_gray,
    draw_offsets,
    incident_light,
    noise_samples,
    sensitivity,
    stream,
)
from unwrap.cameras.files import CameraDescription
from unwrap.signal import (
    SPEED_OF_LIGHT_M_S,
    Shots,
    correlation_samples,
    harmonic_weights,
    sample_times_s,
)
from unwrap.support import progress

LASER_POWER_W, INTEGRATION_S = 5.0, 500e-6
CENTI_CELSIUS = 3500
FOV_DEG, LASER_SR = 60.0, 0.8
SPEED_M_S, CAMERA_HEIGHT_M = 8.0, 1.2
WALLS_M, WALL_HEIGHT_M, CEILING_M = 6.0, 5.0, 3.0
TUNNEL_M = (35.0, 75.0)
SUN_W_M2, TUNNEL_W_M2 = 4.0, 0.05
"""Irradiance within the band of the camera's filter."""


@dataclass(frozen=True)
class Block:
    """A box along the axes: a car, a pillar or a person.

    Attributes
    ----------
    center_m, half_m : (right, down, ahead)
        Down from the camera; half of its size.
    albedo : float
    speed_m_s : float
        To the right.
    """

    center_m: tuple[float, float, float]
    half_m: tuple[float, float, float]
    albedo: float
    speed_m_s: float = 0.0


def blocks() -> list[Block]:
    """What stands and walks in the street."""
    cars = [
        Block(((-1) ** n * 3.4, 0.5, 8.0 + 9.0 * n), (0.9, 0.7, 2.0), 0.1 + 0.07 * n)
        for n in range(11)
    ]
    people = [
        Block((-4.0, 0.35, 24.0), (0.25, 0.85, 0.2), 0.4, 1.4),
        Block((9.0, 0.35, 66.0), (0.25, 0.85, 0.2), 0.4, -1.4),
    ]
    # Above the tunnel's mouths.
    fronts = [Block((0.0, -5.5, z), (WALLS_M, 2.5, 0.3), 0.3) for z in TUNNEL_M]
    return cars + people + fronts


def rays(size: tuple[int, int]) -> np.ndarray:
    """Directions [3, H, W] right, down and ahead, of length one."""
    height, width = size
    focal = width / 2 / np.tan(np.radians(FOV_DEG) / 2)
    right = (np.arange(width) - (width - 1) / 2) / focal
    down = (np.arange(height) - (height - 1) / 2) / focal
    across = np.stack(np.broadcast_arrays(right, down[:, None], 1.0))
    return across / np.linalg.norm(across, axis=0)


def seen(directions: np.ndarray, time_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance (infinite: sky), albedo, and how far ahead in the street, each [H, W]."""
    right, down, ahead = directions
    at_m = SPEED_M_S * time_s
    with np.errstate(divide="ignore"):
        ground_m = np.where(down > 0, CAMERA_HEIGHT_M / down, np.inf)
        walls_m = WALLS_M / np.abs(right)
        ceiling_m = np.where(down < 0, CEILING_M / -down, np.inf)
    # A tunnel's walls end at its ceiling, which is there alone.
    height_m = np.where(within(at_m + walls_m * ahead), CEILING_M, WALL_HEIGHT_M)
    walls_m[walls_m * -down > height_m] = np.inf
    ceiling_m[~within(at_m + ceiling_m * ahead)] = np.inf
    found = np.stack([ground_m, walls_m, ceiling_m])
    albedo = np.choose(found.argmin(axis=0), (0.2, 0.35, 0.3))
    distance_m = found.min(axis=0)
    for block in blocks():
        moved_m = np.array((block.speed_m_s * time_s, 0.0, -at_m))
        hit_m = distance_to(block.center_m + moved_m, np.array(block.half_m), directions)
        albedo = np.where(hit_m < distance_m, block.albedo, albedo)
        distance_m = np.minimum(distance_m, hit_m)
    along_m = at_m + distance_m * ahead
    # A coarse pattern that stays on the surfaces as the camera passes.
    place = np.where(np.isfinite(distance_m), distance_m, 0.0) * directions + [
        [[0]],
        [[0]],
        [[at_m]],
    ]
    pattern = np.sin(np.floor(2.0 * place).T @ (12.9898, 78.233, 37.719)).T * 43758.5453 % 1.0
    return distance_m, albedo * (0.6 + 0.8 * pattern), along_m


def within(along_m: np.ndarray) -> np.ndarray:
    """Whether a place in the street is in the tunnel."""
    return (along_m > TUNNEL_M[0]) & (along_m < TUNNEL_M[1])


def distance_to(center: np.ndarray, half: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Distance [H, W] to a box along each direction; infinite where it is missed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one = (center - half)[:, None, None] / directions
        other = (center + half)[:, None, None] / directions
    enters = np.minimum(one, other).max(axis=0)
    leaves = np.maximum(one, other).min(axis=0)
    return np.where((enters > 0) & (enters < leaves), enters, np.inf)


def light_at(sensor: SensorConfig, directions: np.ndarray, time_s: float) -> Exposure:
    """Noise-free light of a frame, each sample at its own instant."""
    instants = [time_s + t for t in sample_times_s(Shots.EIGHT, sensor.sample_period_s)]
    views = [seen(directions, instant) for instant in instants]
    weights = harmonic_weights(sensor.harmonic_strength, sensor.highest_harmonic)
    correlation, active = [], []
    for number, (distance_m, albedo, _) in enumerate(views):
        radiance = np.where(np.isfinite(distance_m), albedo, 0.0) / np.pi
        radiance = radiance / (LASER_SR * np.maximum(distance_m, 0.2) ** 2)
        hz = sensor.f1_hz if number < 4 else sensor.f2_hz
        phase = 4 * np.pi * hz / SPEED_OF_LIGHT_M_S * np.nan_to_num(distance_m, posinf=0.0)
        waves = correlation_samples(torch.from_numpy(phase), weights)
        correlation.append(torch.from_numpy(radiance) * waves[number % 4])
        active.append(torch.from_numpy(radiance))
    distance_m, albedo, along_m = views[0]
    sunlight = np.where(within(along_m), TUNNEL_W_M2, SUN_W_M2)
    ambient = np.where(np.isfinite(distance_m), albedo, 0.6) * sunlight / np.pi
    return Exposure(
        torch.stack(correlation)[None].float(),
        torch.stack(active).mean(dim=0)[None].float(),
        torch.from_numpy(ambient)[None].float(),
        torch.from_numpy(distance_m)[None].float(),
    )


def served_frame(
    sensor: SensorConfig,
    directions: np.ndarray,
    per_light: Sensitivity,
    offsets: OffsetPattern,
    number: int,
    period_s: float,
) -> ServedFrame:
    """What the camera delivers of frame `number`, if it is asked for."""
    size = directions.shape[1:]
    exposure = light_at(sensor, directions, number * period_s)
    *normals, for_gray = islice(noise_samples([0], [number], *size), 9)
    gray, exposure_s = capture_gray(exposure.ambient, sensor, noise=for_gray[:, 0])
    taken = acquire_prefixes(
        incident_light(exposure, per_light),
        sensor,
        shots=Shots.EIGHT,
        noise=normals,
        offsets=offsets,
    )
    full = np.zeros((8, *size), bool)
    for shots, raw in taken.items():
        full[shots - 1] = raw.saturated[0].numpy()
    words = wire_words(taken[Shots.EIGHT].dcs_lsb[0].numpy(), full)
    exposure_us = round(1e6 * float(exposure_s[0]))
    return ServedFrame(gray[0].numpy().astype(np.uint16), exposure_us, words)


def street(
    sensor: SensorConfig, frames: int, size: tuple[int, int], period_s: float
) -> tuple[list[ServedFrame], OffsetPattern]:
    """What the camera will have in store, and the fixed pattern of its imager."""
    directions, per_light = rays(size), camera_sensitivity(sensor)
    offsets = draw_offsets(sensor, *size, generator=stream(Purpose.OFFSETS, 0))
    with progress(frames, "what the camera sees", "frame") as bar:
        stored = []
        for number in range(frames):
            stored.append(served_frame(sensor, directions, per_light, offsets, number, period_s))
            bar.update()
    return stored, offsets


def camera_sensitivity(sensor: SensorConfig) -> Sensitivity:
    """Electrons per light with the camera's laser power and integration time."""
    power_w = torch.tensor([LASER_POWER_W], dtype=torch.float64)
    return sensitivity(sensor, power_w, torch.full_like(power_w, INTEGRATION_S))


def play(env: LiveShotScheduleEnv, policy: Policy) -> tuple[list[FrameTimes], list[dict]]:
    """When the stages of each frame ended, and its info."""
    times, infos, over = [], [], False
    observation, info = env.reset(seed=0)
    while not over:
        observation, _, _, over, info = env.step(policy.act(observation, info))
        times.append(env.times)
        infos.append(info)
    return times, infos


def summary(times: Sequence[FrameTimes], infos: Sequence[dict], period_s: float) -> str:
    """What is printed."""
    gray, chosen, samples, depth = np.array(
        [(t.gray_s, t.chosen_s, t.samples_s, t.depth_s) for t in times]
    ).T
    stages = {
        "gray received -> shots chosen": chosen - gray,
        "shots chosen -> samples received": samples - chosen,
        "samples received -> depth": depth - samples,
        "gray received -> depth": depth - gray,
    }
    lines = [f"{'':34}{'median':>10}{'95 %':>10}"]
    for name, taken_s in stages.items():
        middle, high = 1e3 * np.percentile(taken_s, (50, 95))
        lines.append(f"{name:34}{middle:7.1f} ms{high:7.1f} ms")
    between_s = np.diff(gray)
    late = int((between_s > 1.5 * period_s).sum())
    counted = Counter(int(info["shots"]) for info in infos)
    energy = 100 * np.mean([info["reward_terms"]["power"] for info in infos])
    laser_k = infos[-1]["temperature_k"]
    lines += [
        f"{len(infos)} frames at {1 / between_s.mean():.2f} Hz, {late} later than 1.5 periods",
        "frames of " + ", ".join(f"{n} samples: {counted[n]}" for n in sorted(counted)),
        f"energy {energy:.0f} % of that of 8 samples in every frame, laser at {laser_k:.1f} K",
    ]
    return "\n".join(lines)


def main(policy: Policy, frames: int, size: tuple[int, int], *, real_time: bool = True) -> str:
    """Play a drive over the socket; without `real_time` as fast as it goes."""
    config = env_config()
    sensor, period_s = config.sensor, 1.0 / config.frame_rate_hz
    stored, offsets = street(sensor, frames + 1, size, period_s)
    # A camera takes a frame each period, and each sample takes its time.
    pace = {"period_s": period_s, "sample_s": sensor.sample_period_s} if real_time else {}
    with EmulatedCamera(stored, centi_celsius=CENTI_CELSIUS, **pace) as server:
        camera = EpcCamera(
            "127.0.0.1",
            server.port,
            description=read_config(CameraDescription, find_config("camera", "epc660_wire")),
            frequencies_hz=(sensor.f1_hz, sensor.f2_hz),
            laser_power_w=LASER_POWER_W,
            integration_s=INTEGRATION_S,
            size=size,
        )
        env = LiveShotScheduleEnv(
            camera,
            frames_per_drive=frames,
            offset_lsb=offsets.calibrated_lsb[0],
            # Made-up samples do not drift with the imager's temperature.
            shift_m=0.0,
            ego=lambda: (SPEED_M_S, 0.0),
            # Others may have the processor: late is better than never here.
            stale_s=10 * period_s,
        )
        with env:
            return summary(*play(env, policy), period_s)


def rule() -> Policy:
    """8 samples after a change or every 16 frames, between them the fewest that lose little."""
    return LookAndHoldPolicy(LiveShotScheduleEnv.feature_names, limit=0.1, period=16, change=0.3)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--policy", type=Path, help="folder of a trained scheduler")
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--size", default="120x160", help="rows x columns")
    asked = parser.parse_args()
    rows, columns = (int(part) for part in asked.size.split("x"))
    chooser = rule() if asked.policy is None else load_policy(asked.policy)
    print(main(chooser, asked.frames, (rows, columns)))
