"""Moved depth against closed forms of walls, points and turns, and against a rendered world."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import torch
from render_worlds import floor, mesh, square, wall as wall_ahead, world

from shotenv.config.bank import CameraConfig
from shotenv.render.frame import render_frame
from shotenv.world.geometry.motion import Arc
from unwrap.depth.warp import move_depth

FOV_DEG = 60.0
HEIGHT, WIDTH = 24, 32
CAMERA = CameraConfig(width=48, height=36, samples_per_pixel=1, gray_instants=1, bounces=1)
FOCAL = WIDTH / 2 / math.tan(math.radians(FOV_DEG / 2))


def rays() -> tuple[torch.Tensor, torch.Tensor]:
    """Leftward and upward slope of each pixel's ray [H, W]."""
    left = ((WIDTH - 1) / 2 - torch.arange(WIDTH).double()) / FOCAL
    up = ((HEIGHT - 1) / 2 - torch.arange(HEIGHT).double()) / FOCAL
    return left.expand(HEIGHT, WIDTH), up[:, None].expand(HEIGHT, WIDTH)


def wall(ahead_m: float) -> torch.Tensor:
    """Radial distance [1, H, W] of a wall across the camera's axis."""
    left, up = rays()
    return (ahead_m * (1 + left**2 + up**2).sqrt())[None].float()


def one_point(row: int, column: int, distance_m: float) -> torch.Tensor:
    distance = torch.full((1, HEIGHT, WIDTH), torch.inf)
    distance[0, row, column] = distance_m
    return distance


def move(distance_m, forward_m=0.0, yaw_rad=0.0, fov_deg=FOV_DEG):
    return move_depth(distance_m, forward_m=forward_m, yaw_rad=yaw_rad, horizontal_fov_deg=fov_deg)


def reference(distance_m, forward_m, yaw_rad):
    """Pixel after pixel, in plain numbers: the camera's pose in the old axes, then the new ones."""
    seen = {}
    if yaw_rad:
        radius = forward_m / yaw_rad
        camera = (radius * math.sin(yaw_rad), radius * (1 - math.cos(yaw_rad)))
    else:
        camera = (forward_m, 0.0)
    for row in range(HEIGHT):
        for column in range(WIDTH):
            distance = float(distance_m[row, column])
            if not math.isfinite(distance):
                continue
            y, z = ((WIDTH - 1) / 2 - column) / FOCAL, ((HEIGHT - 1) / 2 - row) / FOCAL
            scale = distance / math.hypot(1, y, z)
            x, y, z = scale - camera[0], scale * y - camera[1], scale * z
            x, y = (
                x * math.cos(yaw_rad) + y * math.sin(yaw_rad),
                y * math.cos(yaw_rad) - x * math.sin(yaw_rad),
            )
            if x <= 0:
                continue
            place = (
                round((HEIGHT - 1) / 2 - FOCAL * z / x),
                round((WIDTH - 1) / 2 - FOCAL * y / x),
            )
            seen[place] = min(seen.get(place, math.inf), math.hypot(x, y, z))
    seen = {p: d for p, d in seen.items() if 0 <= p[0] < HEIGHT and 0 <= p[1] < WIDTH}
    for down, right in ((0, 1), (1, 0)):
        found = dict(seen)
        for row, column in product(range(HEIGHT), range(WIDTH)):
            sides = (row - down, column - right), (row + down, column + right)
            if (row, column) not in found and all(side in found for side in sides):
                seen[row, column] = min(found[side] for side in sides)
    return seen


@pytest.mark.parametrize(("forward_m", "yaw_rad"), [(0, 0), (1.1, 0), (0.7, 0.12), (-0.4, -0.3)])
def test_equals_a_slow_reference(forward_m, yaw_rad):
    distance = 1 + 9 * torch.rand(1, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(0))
    distance[0, 3:6] = torch.nan
    expected = torch.zeros(HEIGHT, WIDTH)
    for (row, column), value in reference(distance[0], forward_m, yaw_rad).items():
        expected[row, column] = value
    found = move(distance, forward_m, yaw_rad)
    torch.testing.assert_close(found.distance_m[0], expected)
    assert torch.equal(found.known[0], (expected > 0).float())


def test_without_motion_nothing_changes():
    distance = 1 + 9 * torch.rand(2, HEIGHT, WIDTH)
    found = move(distance)
    torch.testing.assert_close(found.distance_m, distance)
    assert found.known.min() == 1


def test_a_wall_comes_nearer_by_the_way_gone():
    found = move(wall(8.0), forward_m=1.1)
    assert found.known.min() == 1  # The wall grows by 8 / 6.9, which opens holes a pixel wide.
    # A point lands up to half a pixel beside the ray that it is stored at, a hole's a whole one.
    torch.testing.assert_close(found.distance_m, wall(6.9), rtol=0.03, atol=0.0)


def test_a_wall_that_recedes_leaves_a_border():
    found = move(wall(8.0), forward_m=-8.0)
    known = found.known[0] > 0
    inner = known[HEIGHT // 4 + 1 : -HEIGHT // 4 - 1, WIDTH // 4 + 1 : -WIDTH // 4 - 1]
    assert inner.all()
    assert not known[: HEIGHT // 4 - 1].any()
    assert not known[:, -WIDTH // 4 + 1 :].any()


@pytest.mark.parametrize("pixels", [3, -5])
def test_a_turn_to_the_left_moves_the_image_to_the_right(pixels):
    column = WIDTH // 2
    offset = column - (WIDTH - 1) / 2
    yaw = math.atan((offset + pixels) / FOCAL) - math.atan(offset / FOCAL)
    found = move(one_point(HEIGHT // 2, column, 5.0), yaw_rad=yaw)
    assert found.known[0].nonzero().tolist() == [[HEIGHT // 2, column + pixels]]
    assert found.distance_m[0, HEIGHT // 2, column + pixels].item() == pytest.approx(5.0)


def test_a_corner_keeps_its_distances_under_a_turn():
    """Two walls at right angles, seen from the middle, turned by 45 degrees: one wall ahead."""
    left, up = rays()
    # Walls |x - y| and |x + y| = 6 sqrt 2 of the turned room; ahead = 6 sqrt 2 / (1 + |left|).
    corner = (math.sqrt(72) / (1 + left.abs()) * (1 + left**2 + up**2).sqrt())[None].float()
    found = move(corner, yaw_rad=math.pi / 4)
    known = found.known > 0
    # Rays at 45 to 15 degrees on the old left lie at 0 to 30 on the new right; the old view ends
    # at 30, which is 15 now.
    columns = known[0].any(0)
    assert columns[-8:].all()
    assert not columns[: WIDTH // 2 + 3].any()
    torch.testing.assert_close(found.distance_m[known], wall(6.0)[known], rtol=0.03, atol=0.0)


def test_what_is_passed_vanishes():
    assert move(wall(2.0), forward_m=2.5).known.sum() == 0
    assert move(wall(2.0), yaw_rad=math.pi).known.sum() == 0


def test_the_nearer_of_two_points_wins():
    """Backing off squeezes neighbours into one pixel."""
    distance = one_point(12, 20, 9.0)
    distance[0, 12, 21] = 4.0
    found = move(distance, forward_m=-40.0)
    assert found.known.sum() == 1
    near = move(one_point(12, 21, 4.0), forward_m=-40.0)
    assert torch.equal(found.distance_m, near.distance_m)


@pytest.mark.parametrize("unknown", [math.nan, math.inf, 0.0])
def test_unknown_pixels_are_left_out(unknown):
    found = move(torch.full((1, HEIGHT, WIDTH), unknown), forward_m=0.5, yaw_rad=0.1)
    assert found.known.sum() == found.distance_m.abs().sum() == 0


def test_each_frame_has_its_own_motion():
    distance = torch.cat((wall(5.0), wall(9.0)))
    forward, yaw = torch.tensor([0.5, 1.0]).double(), torch.tensor([0.0, 0.1]).double()
    both = move(distance, forward, yaw)
    for i in range(2):
        one = move(distance[i : i + 1], float(forward[i]), float(yaw[i]))
        torch.testing.assert_close(one.distance_m[0], both.distance_m[i])
    assert both.distance_m.dtype == both.known.dtype == torch.float32


@pytest.mark.parametrize(
    ("distance", "fov_deg", "message"),
    [
        (torch.ones(HEIGHT, WIDTH), 60.0, "distance_m"),
        (torch.ones(1, HEIGHT, WIDTH, dtype=torch.long), 60.0, "distance_m"),
        (torch.ones(1, HEIGHT, WIDTH), 180.0, "horizontal_fov_deg"),
        (torch.ones(1, HEIGHT, WIDTH), math.nan, "horizontal_fov_deg"),
    ],
)
def test_bad_input_is_named(distance, fov_deg, message):
    with pytest.raises(ValueError, match=message):
        move(distance, fov_deg=fov_deg)


def side_wall(left_m: float) -> np.ndarray:
    """A wall along the x axis, to the left."""
    return square((0, left_m, 0), (60.0, 0, 0), (0, 0, 60.0))


@pytest.mark.render
@pytest.mark.parametrize("yaw_rate_rad_s", [0.5, -0.5])
def test_moved_depth_agrees_with_the_rendered_next_frame(sensor, yaw_rate_rad_s):
    """Signs and pixel order are those of the renderer, its worlds and its banks."""
    corner = mesh(np.concatenate([wall_ahead(8.0), floor(), side_wall(3.0)]))
    still = world(corner, height_m=1.3)
    scene = replace(still, ego=Arc(still.ego.start, 6.0, yaw_rate_rad_s))
    before, after = (
        torch.from_numpy(render_frame(scene, time_s, CAMERA, sensor, seed=0).distance_m)[None]
        for time_s in (0.0, 0.1)
    )

    def errors(forward_m, yaw_rad):
        found = move(before, forward_m, yaw_rad, CAMERA.horizontal_fov_deg)
        known = found.known > 0
        assert known.float().mean() > 0.5
        return (found.distance_m - after)[known].abs()

    right = errors(0.6, 0.1 * yaw_rate_rad_s)
    assert right.median() < 0.05
    assert right.quantile(0.9) < 0.2
    for wrong in (errors(-0.6, 0.1 * yaw_rate_rad_s), errors(0.6, -0.1 * yaw_rate_rad_s)):
        assert wrong.median() > 2 * right.median()
