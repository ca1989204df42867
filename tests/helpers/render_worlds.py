"""Worlds of a few triangles whose light has a closed form."""

from __future__ import annotations

import math

import numpy as np

from shotenv.config.bank import CameraConfig
from shotenv.config.emission import EmissionConfig
from shotenv.render.instants import Instants
from shotenv.world.geometry.meshes import join
from shotenv.world.geometry.model import Light, Mesh, MovingObject, World
from shotenv.world.geometry.motion import Arc, Pose

DARK = Light(0.0, (0.0, 0.0, 1.0), 0.0, 0.0, ())
ALBEDO = 0.4
KNIFE_EDGE = EmissionConfig(edge_softness_deg=0.0)
"""A laser that is even over the field of view and dark beyond: light of a closed form."""
SMALL = CameraConfig(
    width=17, height=17, samples_per_pixel=1, gray_instants=1, bounces=1, emission=KNIFE_EDGE
)
MIDDLE = (8, 8)


def square(centre, across, up) -> np.ndarray:
    """Two triangles [2, 3, 3]: a parallelogram about `centre` with these half edges."""
    c, a, u = (np.asarray(vector, dtype=float) for vector in (centre, across, up))
    corners = [c - a - u, c + a - u, c + a + u, c - a + u]
    return np.float32([[corners[i] for i in face] for face in ((0, 1, 2), (0, 2, 3))])


def wall(distance_m: float, half_m: float = 60.0) -> np.ndarray:
    """A wall across the x axis."""
    return square((distance_m, 0, 0), (0, half_m, 0), (0, 0, half_m))


def floor(half_m: float = 100.0) -> np.ndarray:
    """The ground at z = 0."""
    return square((0, 0, 0), (half_m, 0, 0), (0, half_m, 0))


def mesh(
    corners: np.ndarray, albedo=ALBEDO, retro=0.0, emission=0.0, mirror=0.0, clear=0.0
) -> Mesh:
    """A mesh of one plain material."""
    numbers = (albedo, albedo, retro, emission, mirror, clear)
    uv = np.zeros((len(corners), 3, 2), np.float32)
    per_face = [np.full(len(corners), number, np.float32) for number in numbers]
    return Mesh(np.asarray(corners, np.float32), uv, *per_face)


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one."""
    return join(meshes)


def world(
    static: Mesh,
    *,
    light: Light = DARK,
    moving: tuple[MovingObject, ...] = (),
    height_m: float = 1.0,
    pitch_rad: float = 0.0,
    speed_m_s: float = 0.0,
) -> World:
    """A world seen from (0, 0, height), looking ahead."""
    ego = Arc(Pose((0.0, 0.0, height_m), 0.0, pitch_rad), speed_m_s)
    return World("garage", 0, static, moving, light, ego)


def at(*times_s: float, frequency_hz: float = 0.0, theta_rad: float = 0.0) -> Instants:
    """Instants at which everything is rendered, with the same random numbers."""
    everywhere, count = (True,) * len(times_s), len(times_s)
    hz, theta = (frequency_hz,) * count, (theta_rad,) * count
    return Instants(times_s, everywhere, everywhere, (0,) * count, hz, theta)


def phasor(trace, scene: World, camera: CameraConfig, frequency_hz: float, seed=0) -> np.ndarray:
    """Sum over light paths of radiance times exp(i 2 pi f L / c), complex [H, W]."""
    in_phase, in_quadrature = (
        trace(scene, at(0.0, frequency_hz=frequency_hz, theta_rad=theta), camera, seed=seed)
        for theta in (0.0, math.pi / 2)
    )
    return in_phase.correlation[0] + 1j * in_quadrature.correlation[0]


def ray_directions(camera: CameraConfig) -> np.ndarray:
    """Unit directions [H, W, 3] through the pixels' centres of a camera that looks along x."""
    across = math.tan(math.radians(camera.horizontal_fov_deg / 2))
    left = across * (1 - 2 * (np.arange(camera.width) + 0.5) / camera.width)
    up = across * (camera.height - 2 * np.arange(camera.height) - 1) / camera.width
    ray = np.stack(np.broadcast_arrays(1.0, left[None, :], up[:, None]), axis=-1)
    return ray / np.linalg.norm(ray, axis=-1, keepdims=True)


def solid_angle_sr(camera: CameraConfig, steps: int = 2000) -> float:
    """Solid angle of the field of view, by summing cos^3 over the image plane."""
    across = math.tan(math.radians(camera.horizontal_fov_deg / 2))
    down = across * camera.height / camera.width
    y = (np.arange(steps) + 0.5) / steps * 2 * across - across
    z = (np.arange(steps) + 0.5) / steps * 2 * down - down
    area = (2 * across / steps) * (2 * down / steps)
    return float(((1 + y[:, None] ** 2 + z[None, :] ** 2) ** -1.5).sum() * area)


def laser_return(distance_m, cosine, camera: CameraConfig = SMALL):
    """Radiance per watt that a Lambertian surface returns of an even laser beside the camera."""
    return ALBEDO / math.pi * cosine / (solid_angle_sr(camera) * distance_m**2)
