"""Fronts, for whatever points: convex, falling, below mixtures, which spend what they say."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from agents.optimum.fronts import Front, blind_front, by_clip, front_of

CLOSE = 1e-9
shares = st.integers(0, 64).map(lambda whole: whole / 64)


@st.composite
def fronts(draw) -> tuple[Front, np.ndarray]:
    """A front of 1 to 8 points over 1 to 3 clips, many of them level, and how often clips count."""
    clips, points = draw(st.integers(1, 3)), draw(st.integers(1, 8))
    frames = draw(arrays(np.float64, clips, elements=st.integers(1, 20).map(float)))
    energy, error = (
        draw(arrays(np.float64, (clips, points), elements=shares)) * frames[:, None]
        for _ in range(2)
    )
    weight = draw(arrays(np.float64, clips, elements=st.integers(1, 5).map(float)))
    return Front(energy, error, frames), weight


def with_point(front: Front, energy: float, error: float) -> Front:
    """The same front with one more point, of the same means in each clip."""
    more = front.frames[:, None]
    return Front(
        np.hstack((front.energy, energy * more)),
        np.hstack((front.depth_mae_m, error * more)),
        front.frames,
    )


@given(fronts())
def test_corners_are_convex_and_fall(case):
    front, weight = case
    energy, error = (values[front.corners(weight)] for values in front.means(weight))
    assert np.all(np.diff(energy) > 0) and np.all(np.diff(error) < 0)
    slopes = np.diff(error) / np.diff(energy)
    assert np.all(np.diff(slopes) > -CLOSE * np.abs(slopes[:-1]).max(initial=1))


@given(fronts(), shares)
def test_no_mixture_of_two_points_is_better(case, share):
    front, weight = case
    energy, error = front.means(weight)
    mixed = [share * values[:, None] + (1 - share) * values for values in (energy, error)]
    # `error_at` has no energy below the least but by rounding.
    least = front.error_at(np.maximum(mixed[0], energy.min()), weight)
    assert np.all(least <= mixed[1] + CLOSE)


@given(fronts())
def test_more_energy_never_errs_more_and_gains_less_and_less(case):
    front, weight = case
    grid = np.linspace(front.means(weight)[0].min(), 1.5, 61)
    error = front.error_at(grid, weight)
    assert np.all(np.diff(error) <= CLOSE) and np.all(np.diff(error, 2) >= -CLOSE)
    assert front.error_at(grid[0] - 0.01, weight) == np.inf


@given(fronts(), shares)
def test_least_energy_and_least_error_are_inverse(case, error_m):
    front, weight = case
    energy = front.energy_at(error_m, weight)
    if not front.reaches(error_m, weight):
        assert energy == 1.0
        return
    lowest = float(front.means(weight)[0].min())
    assert front.error_at(max(energy, lowest), weight) <= error_m + 1e-7
    cheaper = energy - 1e-6
    assert cheaper < lowest or front.error_at(cheaper, weight) >= error_m - 1e-5


@given(fronts(), shares, shares)
def test_mixtures_are_shares_that_come_to_what_they_say(case, error_m, energy):
    front, weight = case
    means = front.means(weight)
    for mixture in (front.mixture_at(error_m, weight), front.mixture_spending(energy, weight)):
        assert np.all(mixture >= 0) and abs(mixture.sum() - 1) < CLOSE
        assert np.count_nonzero(mixture) <= 2
    corner_energy, corner_error = (values[front.corners(weight)] for values in means)
    spending = front.mixture_spending(energy, weight)
    spent = np.clip(energy, corner_energy[0], corner_energy[-1])
    assert abs(spending @ means[0] - spent) < CLOSE
    assert abs(spending @ means[1] - front.error_at(spent, weight)) < 1e-7
    at = front.mixture_at(error_m, weight)
    assert abs(at @ means[1] - np.clip(error_m, corner_error[-1], corner_error[0])) < CLOSE


@given(fronts(), shares, shares, shares)
def test_one_more_point_never_makes_a_front_worse(case, energy, error_m, at):
    front, weight = case
    more = with_point(front, energy, error_m)
    assert more.error_at(at, weight) <= front.error_at(at, weight) + CLOSE
    if front.reaches(at, weight):
        assert more.energy_at(at, weight) <= front.energy_at(at, weight) + CLOSE
    for reference_m in (0.5, 1.0):
        before_m = front.hypervolume(reference_m, weight)
        assert more.hypervolume(reference_m, weight) >= before_m - CLOSE
    # Nor does a second point of the same place change anything.
    twice = with_point(more, energy, error_m)
    assert twice.error_at(at, weight) == more.error_at(at, weight)
    assert abs(twice.hypervolume(1.0, weight) - more.hypervolume(1.0, weight)) < CLOSE


@given(fronts(), shares, st.randoms(use_true_random=False), st.integers(1, 9))
def test_order_of_points_and_clips_and_size_of_weights_do_not_count(case, at, random, times):
    front, weight = case
    points, clips = (list(range(n)) for n in front.energy.shape[::-1])
    random.shuffle(points)
    random.shuffle(clips)
    other = Front(
        front.energy[clips][:, points], front.depth_mae_m[clips][:, points], front.frames[clips]
    )
    for measure in (Front.error_at, Front.energy_at, Front.hypervolume):
        one = measure(front, at, weight)
        two = measure(other, at, times * weight[clips])
        # Energies at the least one are infinitely far from those just below.
        assert one == np.inf or two == np.inf or abs(one - two) < 1e-7


@given(fronts())
def test_the_dominated_area_is_that_of_a_grid(case):
    """Counted cell by cell: a cell is dominated where a point has no more energy and error."""
    front, weight = case
    # Of one clip, means are whole 64ths, on the lines of the grid.
    front = Front(front.energy[:1], front.depth_mae_m[:1], front.frames[:1])
    energy, error = front.means(weight[:1])
    left = np.arange(64) / 64
    dominated = (energy <= left[:, None, None] + CLOSE) & (error <= left[None, :, None] + CLOSE)
    assert abs(front.hypervolume(1.0, weight[:1]) - dominated.any(-1).mean()) < CLOSE


@st.composite
def drives(draw):
    """Costs and errors of 3 actions in frames of some drives, and the clips these pass."""
    shape = (draw(st.integers(1, 3)), draw(st.integers(1, 6)))
    costs, error_m = (draw(arrays(np.float64, (*shape, 3), elements=shares)) for _ in range(2))
    clips = draw(arrays(np.int64, shape, elements=st.sampled_from([3, 5, 8])))
    return costs, SimpleNamespace(depth_mae_m=error_m), clips


@given(drives())
def test_dearer_energy_never_buys_more_of_it(case):
    costs, table, clips = case
    front = front_of(costs, table, clips)
    once = np.ones(len(front.frames))
    # PRICES fall along the front.
    assert np.all(np.diff(front.means(once)[0]) >= -CLOSE)
    assert front.frames.sum() == clips.size
    free = np.take_along_axis(table.depth_mae_m, costs.argmin(-1)[..., None], -1)
    assert abs(front.means(once)[1][-1] - free.mean()) < CLOSE


@given(drives())
def test_sums_by_clip_lose_nothing(case):
    _, table, clips = case
    np.testing.assert_allclose(
        by_clip(table.depth_mae_m, clips).sum(0), table.depth_mae_m.sum((0, 1)), atol=CLOSE
    )
    front = blind_front(table, clips)
    once = np.ones(len(front.frames))
    np.testing.assert_allclose(front.means(once)[0], [0.25, 0.5, 1.0])
    np.testing.assert_allclose(front.means(once)[1], table.depth_mae_m.mean((0, 1)), atol=CLOSE)
