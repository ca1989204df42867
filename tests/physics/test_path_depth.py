"""What light paths of few surfaces leave out: against the closed form of a hollow sphere, and in
drawn worlds as `docs/physics.md` tells it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from render_worlds import DARK, SMALL, at, mesh, world

from shotenv.config import CameraConfig, WorldConfig
from shotenv.world import draw_world
from shotenv.world.geometry import Lamp

pytestmark = pytest.mark.render
F1_HZ = 24e6
DEPTHS = (1, 2, 3, 4, 8)
WORLD_SEEDS = (3, 14)
FIELDS = ("active", "ambient")
CAMERA = CameraConfig(width=32, height=24, samples_per_pixel=64, gray_filter_m=0.0)
# Shares of the laser's phasors and of the ambient light that paths of 2 surfaces leave out, of
# those of 8; a little above what docs/physics.md has for these worlds.
LEFT_OUT = {"garage": (0.02, 0.16), "construction_site": (0.01, 0.005)}


@pytest.fixture(scope="module")
def trace():
    from shotenv.render.backend import start_mitsuba

    start_mitsuba()
    from shotenv.render.integrator import trace

    return trace


def hollow_sphere(radius_m: float) -> np.ndarray:
    """Triangles [N, 3, 3] of a sphere about the camera at (0, 0, 1)."""
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=radius_m)
    return sphere.triangles + np.array([0.0, 0.0, 1.0])


def test_in_a_hollow_sphere_each_further_surface_adds_its_albedos_share(trace):
    """Whatever a sphere's wall scatters falls on all of it evenly (the integrating sphere)."""
    albedo, radius_m, intensity = 0.6, 2.0, 3.0
    lamp = Lamp((0.0, 0.0, 1.0), intensity)
    light = replace(DARK, lamps=(lamp,))
    room = world(mesh(hollow_sphere(radius_m), albedo=albedo), light=light)
    camera = SMALL.model_copy(update={"samples_per_pixel": 64, "gray_filter_m": 0.0})
    lights = [
        trace(room, at(0.0), camera.model_copy(update={"bounces": depth}), seed=0)
        for depth in DEPTHS
    ]
    active, ambient = np.array([[getattr(one, name).mean() for one in lights] for name in FIELDS])
    # Of one watt, the share `albedo` is spread over the sphere, and seen after one more surface.
    second = albedo / math.pi * albedo / (4 * math.pi * radius_m**2)
    first = albedo / math.pi * intensity / (radius_m**2 + lamp.radius_m**2)
    series = np.cumsum(albedo ** np.arange(DEPTHS[-1]))[np.array(DEPTHS) - 1]
    np.testing.assert_allclose(active - active[0], second * (series - 1) / albedo, rtol=0.03)
    np.testing.assert_allclose(ambient, first * series, rtol=0.02)


@pytest.mark.parametrize("family", LEFT_OUT)
def test_light_rises_to_that_of_deeper_paths_and_two_surfaces_leave_little_out(trace, family):
    both = replace(at(0.5, 0.5), frequency_hz=(F1_HZ,) * 2, theta_rad=(0.0, math.pi / 2))
    left_out = []
    for seed in WORLD_SEEDS:
        scene = draw_world(family, seed, WorldConfig())
        depths = (CAMERA.model_copy(update={"bounces": depth}) for depth in DEPTHS)
        lights = [trace(scene, both, camera, seed=0) for camera in depths]
        active, ambient = ([getattr(one, name).sum() for one in lights] for name in FIELDS)
        # Equal seeds draw equal paths: every surface only adds to the laser's light.
        assert (np.diff(active) >= 0).all() and active[1] > active[0]
        # Those of the last surface differ for sun, sky and lamps.
        assert ambient[0] < ambient[1] < ambient[2]
        assert (np.diff(ambient) > -1e-3 * ambient[-1]).all()
        phasors = [one.correlation[0] + 1j * one.correlation[1] for one in lights]
        late = np.abs(phasors[-1] - phasors[1]).sum() / np.abs(phasors[-1]).sum()
        left_out.append((late, 1 - ambient[1] / ambient[-1]))
    laser, gray = np.mean(left_out, axis=0)
    largest_laser, largest_gray = LEFT_OUT[family]
    assert laser < largest_laser
    assert gray < largest_gray
