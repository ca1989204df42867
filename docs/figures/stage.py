"""What the figures look at: walls whose light is written down, and worlds of a few triangles."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import torch
from matplotlib.figure import Figure
from torch import Tensor

from shotenv.config import (
    CameraConfig,
    EmissionConfig,
    LaserConfig,
    SensorConfig,
    find_config,
    read_config,
)
from shotenv.render import RenderedFrame, render_frame
from shotenv.sensor import Exposure, OffsetPattern, electrons_per_radiance_second, expose
from shotenv.world.geometry import Arc, Light, Material, Mesh, Pose, World
from shotenv.world.geometry.meshes import polygon
from shotenv.world.geometry.model import MovingObject
from unwrap.signal import (
    TWO_PI,
    RawFrame,
    Shots,
    demodulation_phase_rad,
    frequency_index,
    harmonic_weights,
    unambiguous_range_m,
)
from unwrap.signal.frequencies import SPEED_OF_LIGHT_M_S

# Without stray light, which would be in all that is rendered; it has a figure of its own.
SENSOR = read_config(SensorConfig, find_config("sensor", "epc660")).model_copy(
    update={"veiling_glare": 0.0, "ghost": 0.0}
)
LASER = read_config(LaserConfig, find_config("laser", "vcsel_detailed"))
SINE = SENSOR.model_copy(update={"harmonic_strength": 0.0})
"""The sensor with sines for light and demodulation."""
POWER_W, INTEGRATION_S, ALBEDO = 7.0, 6e-4, 0.4  # assumed: ordinary ones of the drives
CAMERA = CameraConfig(
    width=17,
    height=17,
    samples_per_pixel=1,
    gray_instants=1,
    bounces=1,
    # Even over the field of view and dark beyond: light of a closed form.
    emission=EmissionConfig(edge_softness_deg=0.0),
)
MIDDLE = (8, 8)
PER_RADIAN_M = unambiguous_range_m(SENSOR.f1_hz) / TWO_PI
DARK = Light(0.0, (0.0, 0.0, 1.0), 0.0, 0.0, ())
BLUE, RED, GREEN, GRAY = "#0b62a8", "#c0392b", "#2e8b57", "#777777"


class Row(NamedTuple):
    """A line of the page's table: a quantity by its formula and as the functions give it."""

    quantity: str
    formula: str
    measured: str


Made = tuple[Figure, list[Row]]


def axes(*titles: str, widths: tuple[float, ...] | None = None) -> tuple[Figure, list]:
    """A figure with one panel for each title, side by side."""
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    ratios = widths or (1.0,) * len(titles)
    panels = figure.subplots(1, len(titles), width_ratios=ratios, squeeze=False)[0]
    figure.get_layout_engine().set(w_pad=0.08)  # else labels touch the next panel
    for panel, title in zip(panels, titles, strict=True):
        panel.set_title(title)
    return figure, list(panels)


def label(panel, x: str, y: str, **legend) -> None:
    """Name both axes, with their units, and what is drawn."""
    panel.set(xlabel=x, ylabel=y)
    if panel.get_legend_handles_labels()[0]:
        panel.legend(**legend)


def show(figure: Figure, panel, values, unit: str = "", **options):
    """Draw a map [H, W], beside its scale if it has a unit of its own; returns the image."""
    image = panel.imshow(values, **options)
    panel.grid(False)
    if unit:
        figure.colorbar(image, ax=panel, label=unit, shrink=0.8)
    panel.set(xlabel="column", ylabel="row")
    return image


def light_of(
    sensor: SensorConfig, distance_m: Tensor, active: Tensor, ambient: float = 0.0
) -> Exposure:
    """One bounce of laser light on maps [H, W], active in W m-2 sr-1 per watt."""
    frequencies = (sensor.f1_hz, sensor.f2_hz)
    weights = harmonic_weights(sensor.harmonic_strength, sensor.highest_harmonic)
    samples = []
    for k in range(8):
        # Double: at 25 m the phase is 25 rad, which float32 knows to 2e-6 only.
        phase = phase_of(distance_m.double(), frequencies[frequency_index(k)])
        angle = phase - demodulation_phase_rad(k)
        samples.append(active * sum(weight * torch.cos(h * angle) for h, weight in weights))
    everywhere = torch.full_like(active, ambient)
    correlation = torch.stack(samples).float()
    return Exposure(correlation[None], active[None], everywhere[None], distance_m[None])


def phase_of(distance_m, frequency_hz: float):
    """Phase 4 pi f d / c, not wrapped."""
    return distance_m * (4 * math.pi * frequency_hz / SPEED_OF_LIGHT_M_S)


def acquired(
    exposure: Exposure,
    sensor: SensorConfig = SENSOR,
    shots: Shots = Shots.FOUR,
    *,
    noise: Tensor | None = None,
    offsets: OffsetPattern | None = None,
) -> RawFrame:
    """One frame at the power and integration time of all figures."""
    one = torch.ones(1, dtype=torch.float64)
    return expose(
        exposure,
        sensor,
        shots=shots,
        laser_power_w=POWER_W * one,
        integration_s=INTEGRATION_S * one,
        noise=noise,
        offsets=offsets,
    )


def active_of(electrons: float) -> float:
    """Radiance per watt that gives a signal of so many electrons over both taps."""
    return ambient_of(electrons) / POWER_W


def ambient_of(electrons: float) -> float:
    """Radiance that gives so many electrons of ambient light over both taps."""
    return electrons / (electrons_per_radiance_second(SENSOR) * INTEGRATION_S)


def plate(centre, across, up, **material: float) -> Mesh:
    """A parallelogram about `centre` with these half edges, of one plain material."""
    c, a, u = (np.asarray(vector, dtype=float) for vector in (centre, across, up))
    albedo = material.pop("albedo", ALBEDO)
    return polygon(
        np.stack([c - a - u, c + a - u, c + a + u, c - a + u]),
        Material(albedo, albedo, **material),
    )


def wall(distance_m: float, half_m: float = 60.0, **material: float) -> Mesh:
    """A wall across the way ahead."""
    return plate((distance_m, 0, 0), (0, half_m, 0), (0, 0, half_m), **material)


def floor(**material: float) -> Mesh:
    """The ground at z = 0."""
    return plate((0, 0, 0), (100, 0, 0), (0, 100, 0), **material)


def moving(mesh: Mesh, start, yaw_rad: float, speed_m_s: float) -> MovingObject:
    """`mesh` on a straight way."""
    return MovingObject(mesh, Arc(Pose(start, yaw_rad), speed_m_s))


def world(static: Mesh, *things: MovingObject, light: Light = DARK) -> World:
    """A world seen from 1 m above the origin, looking ahead."""
    return World("garage", 0, static, things, light, Arc(Pose((0.0, 0.0, 1.0))))


def rendered(scene: World, camera: CameraConfig = CAMERA, **options) -> RenderedFrame:
    """One frame of `scene` with sines for light and demodulation."""
    return render_frame(scene, 0.0, camera, SINE, seed=1, **options)


def rays(camera: CameraConfig = CAMERA) -> np.ndarray:
    """Unit directions [H, W, 3] through the pixels' centres."""
    across = math.tan(math.radians(camera.horizontal_fov_deg / 2))
    left = across * (1 - 2 * (np.arange(camera.width) + 0.5) / camera.width)
    up = across * (camera.height - 2 * np.arange(camera.height) - 1) / camera.width
    ray = np.stack(np.broadcast_arrays(1.0, left[None, :], up[:, None]), axis=-1)
    return ray / np.linalg.norm(ray, axis=-1, keepdims=True)


@cache
def _solid_angle_sr(camera: CameraConfig) -> float:
    # Closed form of a rectangle seen from above its middle, half sides 1 away.
    across = math.tan(math.radians(camera.horizontal_fov_deg / 2))
    down = across * camera.height / camera.width
    return 4 * math.asin(across / math.hypot(1, across) * down / math.hypot(1, down))


def apart_m(measured_m, true_m, range_m: float):
    """Difference of two distances, wrapped to half an unambiguous range on either side of 0."""
    return (measured_m - true_m + range_m / 2) % range_m - range_m / 2


def wall_return(distance_m, albedo: float = ALBEDO, camera: CameraConfig = CAMERA):
    """Radiance per watt of a wall straight ahead: albedo / (pi Omega d^2)."""
    return albedo / (math.pi * _solid_angle_sr(camera) * distance_m**2)
