"""The filter of gray light from all around: closed forms, bounds, and what it gains."""

from __future__ import annotations

import math

import numpy as np
import pytest
from render_worlds import ALBEDO, SMALL, floor, joined, mesh, ray_directions, square, world

from shotenv.config import CameraConfig, WorldConfig
from shotenv.render.backend.llvm import start_mitsuba
from shotenv.render.instants import Instants
from shotenv.world import draw_world
from shotenv.world.geometry.model import Light

pytestmark = pytest.mark.render
SKY = Light(0.0, (0.0, 0.0, 1.0), 1.0, 1.0, ())
"""An even sky of radiance 1 and nothing else."""
CAMERA = SMALL.model_copy(update={"width": 32, "height": 24, "samples_per_pixel": 4, "bounces": 2})
GRAY = Instants((0.5, 0.501), (False,) * 2, (True,) * 2, (0, 1), (0.0,) * 2, (0.0,) * 2)


@pytest.fixture(scope="module")
def trace():
    start_mitsuba()
    from shotenv.render.integrator import trace

    return trace


def reaching(metres: float, camera: CameraConfig = CAMERA) -> CameraConfig:
    return camera.model_copy(update={"gray_filter_m": metres})


def images(trace, scene, camera: CameraConfig, seeds: range) -> np.ndarray:
    """Gray images [seeds, H, W]."""
    return np.stack(
        [trace(scene, GRAY, camera, seed=seed).ambient.mean(axis=0) for seed in seeds]
    ).astype(float)


def test_floor_beside_a_wall_is_lit_by_the_sky_that_the_wall_leaves(trace):
    # A black wall of height h at distance x hides all but (1 + x / sqrt(x^2 + h^2)) / 2 of the
    # light of an even sky; one sees it from above, so that the filter works near its foot too.
    foot_m, tall_m = 2.0, 3.0
    black = mesh(square((foot_m, 0, tall_m / 2), (0, 400, 0), (0, 0, tall_m / 2)), albedo=0.0)
    scene = world(joined(mesh(floor()), black), light=SKY, height_m=2.5, pitch_rad=math.pi / 3)
    seen = trace(scene, GRAY, CAMERA, seed=0).distance_m[0]
    ahead = ray_directions(CAMERA).reshape(*seen.shape, 3)
    turned = math.cos(math.pi / 3) * ahead[..., 0] + math.sin(math.pi / 3) * ahead[..., 2]
    away_m = foot_m - seen * turned
    on_floor = (away_m > 0.2) & (away_m < 2.5)
    assert on_floor.sum() > 200
    share = (1 + away_m / np.hypot(away_m, tall_m)) / 2
    mean = images(trace, scene, CAMERA, range(24)).mean(axis=0)
    error = (mean / (ALBEDO * share) - 1)[on_floor]
    assert abs(error.mean()) < 0.005
    assert np.sqrt((error**2).mean()) < 0.015


def test_texture_stays_where_the_plane_is_lit_evenly(trace):
    dark = mesh(square((0, 50, 0), (100, 0, 0), (0, 50, 0)), albedo=0.1)
    bright = mesh(square((0, -50, 0), (100, 0, 0), (0, 50, 0)), albedo=0.7)
    scene = world(joined(dark, bright), light=SKY, pitch_rad=0.5)
    off, on = (trace(scene, GRAY, reaching(m), seed=1).ambient for m in (0.0, 1.0))
    assert off.min() < 0.11
    assert off.max() > 0.69
    np.testing.assert_allclose(on, off, rtol=1e-5)


@pytest.mark.parametrize("apart", ["normal", "plane", "length"])
def test_light_of_another_plane_or_far_along_it_stays_out(trace, apart):
    import mitsuba as mi

    from shotenv.render.irradiance_filter import SoftLight, filtered

    camera = reaching(0.5, CAMERA.model_copy(update={"samples_per_pixel": 1}))
    row, column = np.divmod(np.arange(32 * 24), 32)
    right = column >= 16
    normal = np.zeros((3, row.size))
    normal[2] = 1.0
    point = np.stack([0.01 * column, 0.01 * row, 0.0 * row])
    if apart == "normal":
        normal[:, right] = np.array([[0.1], [0.0], [math.sqrt(0.99)]])
    elif apart == "plane":
        point[2, right] = 0.02
    else:
        point[0, right] += 0.5
    noise = np.random.default_rng(0).uniform(-0.1, 0.1, row.size)
    radiance = np.where(right, 5.0, 1.0) + noise
    soft = SoftLight(
        mi.Float(np.float32(radiance)),
        mi.Float(np.full(row.size, 0.3, np.float32)),
        mi.Vector3f(*np.float32(normal)),
        mi.Point3f(*np.float32(point)),
    )
    image = filtered(soft, np.array([0]), camera)[0]
    for side, level in ((image[:, :16], 1.0), (image[:, 16:], 5.0)):
        # Averaged on each side, and never with the other.
        assert np.abs(side - level).max() < 0.06
    one_lane = filtered(soft, np.array([0]), reaching(0.0, camera))[0]
    np.testing.assert_allclose(one_lane.ravel(), radiance, rtol=1e-6)


def test_zero_switches_the_filter_off(trace, monkeypatch):
    from shotenv.render import integrator

    scene = draw_world("warehouse", 3, WorldConfig())
    on = trace(scene, GRAY, reaching(0.3), seed=2).ambient
    # Each pixel by itself: what is filtered and what is not add up to all the light.
    alone = integrator.filtered
    monkeypatch.setattr(
        integrator, "filtered", lambda soft, i, camera: alone(soft, i, reaching(0.0, camera))
    )
    own = trace(scene, GRAY, reaching(0.3), seed=2).ambient
    monkeypatch.setattr(integrator, "filtered", None)
    off = trace(scene, GRAY, reaching(0.0), seed=2).ambient
    np.testing.assert_allclose(own, off, rtol=1e-4)
    assert np.abs(on - off).max() > 0.05 * off.mean()


@pytest.mark.parametrize(("family", "gain"), [("warehouse", 2.5), ("snowy_street", 2.5)])
def test_filter_takes_more_noise_than_it_brings_bias(trace, family, gain):
    camera, scene = CameraConfig(width=80, height=60), draw_world(family, 3, WorldConfig())
    off, on = (images(trace, scene, reaching(m, camera), range(16)) for m in (0.0, 0.3))
    mean = off.mean(axis=0)
    lit = mean > 0.1 * mean.mean()
    # By the same seeds: most of the noise is in both. The product of halves has no noise of its own
    # in the mean.
    halves = [(on - off)[k::2].mean(axis=0)[lit] / mean[lit] for k in (0, 1)]
    bias = math.sqrt(max(0.0, float((halves[0] * halves[1]).mean())))
    noise, left = (image.std(axis=0, ddof=1)[lit] / mean[lit] for image in (off, on))
    removed = math.sqrt((noise**2).mean() - (left**2).mean())
    assert abs(sum(halves).mean()) / 2 < 0.005
    assert bias < 0.02
    assert bias < 0.5 * removed
    assert np.median(left) < np.median(noise) / gain
