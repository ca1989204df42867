"""The laser's emission profile: power kept, walls lit by closed forms, directions drawn from it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from render_worlds import (
    ALBEDO,
    KNIFE_EDGE,
    SMALL,
    at,
    mesh,
    phasor,
    ray_directions,
    square,
    wall,
    world as world_of,
)

from shotenv.config import CameraConfig, EmissionConfig
from shotenv.render.backend.llvm import start_mitsuba

pytestmark = pytest.mark.render
PROFILES = {
    "knife's edge": KNIFE_EDGE,
    "soft edges": EmissionConfig(),
    "very soft edges": EmissionConfig(edge_softness_deg=40.0),
    "gaussian": EmissionConfig(profile="gaussian", fwhm_deg=50.0),
    "table": EmissionConfig(profile="table", angle_deg=(0, 25, 50, 70), intensity=(0.6, 1, 0.3, 0)),
}


@pytest.fixture(scope="module")
def beam():
    start_mitsuba()
    from shotenv.render import beam

    return beam


def camera(emission: EmissionConfig) -> CameraConfig:
    return SMALL.model_copy(update={"emission": emission})


def per_watt(beam, camera: CameraConfig, axes: np.ndarray) -> np.ndarray:
    """Radiant intensity towards unit directions [N, 3], W sr-1 per watt."""
    import mitsuba as mi

    return beam.Beam(camera).intensity(*(mi.Float(np.float32(a)) for a in axes.T)).numpy()


@pytest.mark.parametrize("name", PROFILES)
def test_one_watt_is_emitted_per_watt(beam, name):
    # Midpoints of a grid over azimuth and the sine of elevation, which keeps areas.
    steps = (np.arange(1600) + 0.5) / 800 - 1
    azimuth, sine = (a.ravel() for a in np.meshgrid(math.pi * steps, steps))
    cosine = np.sqrt(1 - sine**2)
    axes = np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine], axis=1)
    watts = per_watt(beam, camera(PROFILES[name]), axes).mean(dtype=np.float64) * 4 * math.pi
    assert watts == pytest.approx(1.0, abs=4e-3)


@pytest.mark.parametrize("name", PROFILES)
def test_directions_are_drawn_wherever_it_shines(beam, name):
    points = np.random.default_rng(5).random((40_000, 2))
    one = camera(PROFILES[name])
    drawn = beam.draw_directions(one, points)
    share = per_watt(beam, one, drawn.axes) / drawn.per_sr
    assert np.linalg.norm(drawn.axes, axis=1) == pytest.approx(1.0, abs=1e-5)
    # Weighted by intensity over density they make the whole watt, and its mean direction: ahead.
    assert share.mean() == pytest.approx(1.0, abs=5e-3)
    aside = (share[:, None] * drawn.axes[:, 1:]).mean(axis=0)
    assert aside == pytest.approx(np.zeros(2), abs=0.02)
    assert (share > 0).mean() > 0.9


def expected_intensity(emission: EmissionConfig, rays: np.ndarray) -> np.ndarray:
    """Relative intensity by formula along rays [H, W, 3]."""
    ahead, left, up = np.moveaxis(rays, -1, 0)
    angle = np.degrees(np.arccos(ahead))
    if emission.profile == "gaussian":
        return 0.5 ** ((2 * angle / emission.fwhm_deg) ** 2)
    if emission.profile == "table":
        return np.interp(angle, emission.angle_deg, emission.intensity)
    half = SMALL.horizontal_fov_deg / 2
    sides = [np.degrees(np.arctan2(np.abs(side), ahead)) for side in (left, up)]
    if emission.edge_softness_deg == 0:
        return np.ones_like(angle)
    t = [np.clip((half - side) / emission.edge_softness_deg + 0.5, 0, 1) for side in sides]
    return math.prod(x * x * (3 - 2 * x) for x in t)


@pytest.mark.parametrize("name", PROFILES)
def test_a_facing_wall_is_lit_as_the_profile_says(beam, name):
    from shotenv.render.integrator import trace

    emission = PROFILES[name]
    one = camera(emission)
    rays = ray_directions(one)
    found = trace(world_of(mesh(wall(5.0))), at(0.0), one, seed=0).active[0]
    # albedo / pi x intensity x cosine / distance squared, the distance 5 m over the cosine.
    intensity = expected_intensity(emission, rays) / beam.emitted_sr(one)
    np.testing.assert_allclose(
        found, ALBEDO / math.pi * intensity * rays[..., 0] ** 3 / 25, rtol=2e-3, atol=1e-7
    )


def test_light_beyond_the_view_comes_back_from_a_closed_room(beam):
    from shotenv.render.integrator import trace

    sides = [square((2.5, y, 1.0), (2.6, 0, 0), (0, 0, 1.6)) for y in (-2.0, 2.0)]
    sides += [square((2.5, 0, z), (2.6, 0, 0), (0, 2, 0)) for z in (-0.5, 2.5)]
    ends = [square((x, 0, 1.0), (0, 2, 0), (0, 0, 1.6)) for x in (-0.1, 5.0)]
    room = world_of(mesh(np.concatenate([*sides, *ends]), albedo=0.7))
    phases = []
    for softness in (0.0, 20.0, 50.0):
        one = SMALL.model_copy(
            update={
                "bounces": 3,
                "samples_per_pixel": 64,
                "emission": EmissionConfig(edge_softness_deg=softness),
            }
        )
        phases.append(np.angle(phasor(trace, room, one, 24e6).sum()))
    # Side walls out of view are near: what they return came a longer way than the direct light.
    assert phases[0] + 0.01 < phases[1]
    assert phases[1] + 0.02 < phases[2]
