"""Random numbers of the renderer: even over the samples of a pixel."""

from __future__ import annotations

import numpy as np
import pytest
from render_worlds import SMALL, at

from shotenv.render.backend.llvm import start_mitsuba

pytestmark = pytest.mark.render
SAMPLES = 4


@pytest.fixture
def sampler():
    start_mitsuba()
    from shotenv.render.sampling import Lanes, Sampler

    camera = SMALL.model_copy(update={"width": 64, "height": 64, "samples_per_pixel": SAMPLES})
    return Sampler(Lanes.of(1, camera), at(0.0), camera, seed=3)


def by_pixel(values) -> np.ndarray:
    """Numbers [pixels, samples]."""
    return values.numpy().reshape(-1, SAMPLES)


def test_rays_of_a_pixel_balance_about_its_centre_and_reach_all_of_it(sampler):
    for point in sampler.in_pixel(3):
        x, y = by_pixel(point.x), by_pixel(point.y)
        for side in (x, y):
            np.testing.assert_allclose(side.mean(axis=1), 0.5, atol=1e-6)
            # Even for each sample by itself: what a sample is used for does not depend on where.
            assert side.mean(axis=0) == pytest.approx(np.full(SAMPLES, 0.5), abs=0.02)
            assert side.var(axis=0) == pytest.approx(np.full(SAMPLES, 1 / 12), abs=0.005)
        # One in each quarter.
        quarter = 2 * (x > 0.5) + (y > 0.5)
        np.testing.assert_array_equal(np.sort(quarter, axis=1), np.tile(np.arange(4), (len(x), 1)))


def test_of_four_samples_one_chooses_in_each_quarter(sampler):
    number = by_pixel(sampler.next_choice())
    np.testing.assert_array_equal(
        np.sort((4 * number).astype(int), axis=1), np.tile(np.arange(4), (len(number), 1))
    )
    assert number.mean(axis=0) == pytest.approx(np.full(SAMPLES, 0.5), abs=0.02)


def test_samples_of_a_pixel_take_neighbouring_blocks(sampler):
    first = by_pixel(sampler.next_block(12, 4096))
    np.testing.assert_array_equal(np.diff(first.astype(int), axis=1) % 4096, 12)


def test_neighbours_of_the_plane_sequence_spread_over_the_square():
    start_mitsuba()
    from shotenv.render.sampling import plane_sequence

    points = plane_sequence(4096, seed=1)
    for start in (0, 1000, 3000):
        cells = {tuple(cell) for cell in (points[start : start + 64] * 4).astype(int)}
        assert len(cells) == 16
