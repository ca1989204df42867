"""Light that comes by more than one surface: against slow sums and an independent renderer.

The independent renderer is mitransient. It comes with the `dev` extra (by way of `verify`), which
`make test` and the machines that test every change install: there nothing is skipped.
"""

from __future__ import annotations

import importlib.util
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from render_worlds import (
    ALBEDO,
    SMALL,
    floor,
    mesh,
    phasor,
    ray_directions,
    solid_angle_sr,
    square,
    wall,
    world,
)

from shotenv.render.backend.llvm import start_mitsuba

pytestmark = pytest.mark.render
SPEED_OF_LIGHT_M_S = 299_792_458.0
F1_HZ = 24e6
PROJECT = Path(__file__).parents[2] / "pyproject.toml"


@pytest.fixture(scope="module")
def trace():
    start_mitsuba()
    from shotenv.render.integrator import trace

    return trace


def second_bounce(camera, height_m, wall_m, frequency_hz, steps=200):
    """Phasor of the light laser -> floor -> wall -> camera, summed over patches of the floor.

    Mean over the camera's pixels on the wall, each through its centre.
    """
    eye = np.array([0.0, 0.0, height_m])
    rays = ray_directions(camera).reshape(-1, 3)
    on_wall = eye + rays * (wall_m / rays[:, :1])
    across = math.tan(math.radians(camera.horizontal_fov_deg / 2))
    x = np.linspace(0, wall_m, steps + 1)[:-1] + wall_m / steps / 2
    y = np.linspace(-across * wall_m, across * wall_m, steps + 1)[:-1] + across * wall_m / steps
    patch = np.stack(np.broadcast_arrays(x[:, None], y[None, :], 0.0), axis=-1).reshape(-1, 3)
    area = (wall_m / steps) * (2 * across * wall_m / steps)
    away = patch - eye
    seen = np.abs(away[:, 1:]).max(axis=1) <= across * away[:, 0]
    patch, away = patch[seen], away[seen]
    to_laser = np.linalg.norm(away, axis=1)
    lit = ALBEDO / math.pi / solid_angle_sr(camera) * (height_m / to_laser) / to_laser**2
    total = []
    for point in on_wall[on_wall[:, 2] > 0]:
        between = np.linalg.norm(patch - point, axis=1)
        cosines = (point[2] / between) * ((wall_m - patch[:, 0]) / between)
        radiance = ALBEDO / math.pi * lit * cosines / between**2 * area
        path = np.linalg.norm(point - eye) + between + to_laser
        phase = 2 * math.pi * frequency_hz * path / SPEED_OF_LIGHT_M_S
        total.append((radiance * np.exp(1j * phase)).sum())
    return np.mean(total)


def test_the_second_bounce_is_that_of_a_slow_sum_over_patches(trace):
    camera = SMALL.model_copy(update={"samples_per_pixel": 256, "bounces": 2})
    height_m, wall_m = 1.0, 4.0
    corner = world(mesh(np.concatenate([wall(wall_m), floor()])), height_m=height_m)
    rays = ray_directions(camera)
    on_wall = height_m + wall_m * rays[..., 2] / rays[..., 0] > 0
    both = phasor(trace, corner, camera, F1_HZ)
    first = phasor(trace, corner, camera.model_copy(update={"bounces": 1}), F1_HZ)
    found = (both - first)[on_wall].mean()
    expected = second_bounce(camera, height_m, wall_m, F1_HZ)
    assert abs(found - expected) < 0.03 * abs(expected)


def box_in_a_room() -> np.ndarray:
    """A room that begins 1.5 m ahead, and a box on its floor."""
    sides = [square((3.25, y, 1.0), (1.75, 0, 0), (0, 0, 2)) for y in (-2.0, 2.0)]
    sides += [square((3.25, 0, z), (1.75, 0, 0), (0, 2, 0)) for z in (-1.0, 3.0)]
    front = square((3.0, 0.5, -0.3), (0, 0.6, 0), (0, 0, 0.7))
    lid = square((3.4, 0.5, 0.4), (0.4, 0, 0), (0, 0.6, 0))
    return np.concatenate([*sides, wall(5.0, half_m=3.0), front, lid])


def two_walls() -> np.ndarray:
    """An inner corner that opens towards the camera."""
    half = 1.5 / math.sqrt(2)
    left, right = (square((3.0, s * half, 1.0), (half, -s * half, 0), (0, 0, 1.5)) for s in (1, -1))
    return np.concatenate([left, right])


def wall_on_a_floor() -> np.ndarray:
    """A wall at the far edge of a stretch of floor."""
    ground = square((2.5, 0.0, 0.0), (1.5, 0, 0), (0, 1.7, 0))
    return np.concatenate([ground, square((4.0, 0.0, 1.5), (0, 1.7, 0), (0, 0, 1.5))])


def transient_phasor(scene, camera, samples, seed):
    """The phasor [H, W] as the Fourier integral of mitransient's histogram over path lengths.

    Its laser shines everywhere, and so does ours where all surfaces are in view.
    """
    import mitransient  # noqa: F401 - registers its film and integrator; wants a variant set
    import mitsuba as mi

    from shotenv.render.stock import stock_scene

    bins, width_m = 2000, 0.02
    film = {"type": "transient_hdr_film", "temporal_bins": bins, "bin_width_opl": width_m}
    laser = {"type": "point", "position": [0.0, 0.0, 1.0], "intensity": 1 / solid_angle_sr(camera)}
    stock = stock_scene(scene, 0.0, camera, {**film, "start_opl": 0.0}, laser=laser)
    path = {"type": "transient_path", "max_depth": camera.bounces + 1, "rr_depth": 1000}
    _, histogram = mi.load_dict(path).render(stock, spp=samples, seed=seed)
    length_m = (np.arange(bins) + 0.5) * width_m
    turn = np.exp(2j * np.pi * F1_HZ * length_m / SPEED_OF_LIGHT_M_S)
    return np.array(histogram)[..., 0] @ turn


def parts(image: np.ndarray) -> np.ndarray:
    """Means over 4 x 4 parts of an image."""
    height, width = image.shape
    return image.reshape(4, height // 4, 4, width // 4).mean(axis=(1, 3))


def test_the_dev_extra_brings_the_independent_renderer():
    extras = tomllib.loads(PROJECT.read_text())["project"]["optional-dependencies"]
    (ours,) = (name for name in extras["dev"] if name.startswith("shotenv["))
    assert "verify" in ours.removeprefix("shotenv[").removesuffix("]").split(",")
    assert any(name.startswith("mitransient") for name in extras["verify"])


# Looked up and not imported: an extra that is there but broken is a failure.
@pytest.mark.skipif(
    importlib.util.find_spec("mitransient") is None, reason="the verify extra is not installed"
)
@pytest.mark.parametrize(
    "surfaces",
    [
        pytest.param(two_walls, marks=pytest.mark.slow),
        box_in_a_room,
        pytest.param(wall_on_a_floor, marks=pytest.mark.slow),
    ],
)
def test_phasors_are_those_of_an_independent_transient_renderer(trace, surfaces):
    camera = SMALL.model_copy(update={"width": 16, "height": 16, "horizontal_fov_deg": 120.0})
    scene, samples, seeds = world(mesh(surfaces(), albedo=0.7)), 128, range(6)
    ours, theirs = [], []
    for bounces in (1, 3):
        camera = camera.model_copy(update={"bounces": bounces, "samples_per_pixel": samples})
        ours.append([parts(phasor(trace, scene, camera, F1_HZ, seed=s)) for s in seeds])
        theirs.append([parts(transient_phasor(scene, camera, samples, s)) for s in seeds])
    (direct, total), (their_direct, their_total) = np.array(ours), np.array(theirs)
    assert_same_mean(direct, their_direct, within=0.03)
    # Equal seeds go through the same points of a pixel, so that only further bounces remain.
    assert_same_mean(total - direct, their_total - their_direct, within=0.06)


def assert_same_mean(ours: np.ndarray, theirs: np.ndarray, within: float) -> None:
    """Means over seeds agree within their Monte Carlo error, and that is a small share of them."""
    lit = np.abs(ours).min(axis=0) > 0
    error = np.sqrt((ours.var(axis=0) + theirs.var(axis=0))[lit] / (len(ours) - 1))
    difference = np.abs(ours.mean(axis=0) - theirs.mean(axis=0))[lit]
    assert np.sqrt(((difference / error) ** 2).mean()) < 2.0
    assert error.mean() < within * np.abs(ours.mean(axis=0))[lit].mean()
