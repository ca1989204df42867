"""Veiling glare and ghost: off at zero, energy kept, and the bias of closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shotenv.config import SensorConfig
from shotenv.config.reader import find_config, merged, read_config
from shotenv.render.lens import blurred, kernel, through_lens

HEIGHT, WIDTH, F1_HZ = 48, 64, 24e6
C_M_S = 299_792_458.0
CLEAN = {"veiling_glare": 0.0, "ghost": 0.0}


@pytest.fixture
def clean(sensor):
    return merged(sensor, CLEAN)


def phasor(distance_m, amplitude=1.0):
    return amplitude * np.exp(4j * np.pi * F1_HZ * np.asarray(distance_m) / C_M_S)


def measured_m(shown):
    return np.angle(shown) % (2 * np.pi) * C_M_S / (4 * np.pi * F1_HZ)


def phasors_through(light, sensor):
    """Complex light [H, W] by its two quadratures, as correlations pass."""
    return through_lens(light.real, sensor) + 1j * through_lens(light.imag, sensor)


def test_zero_switches_it_off_bit_for_bit(clean):
    images = np.random.default_rng(0).normal(size=(8, HEIGHT, WIDTH)).astype(np.float32)
    assert through_lens(images, clean) is images
    assert not np.array_equal(through_lens(images, merged(clean, {"ghost": 1e-3})), images)


@pytest.mark.parametrize(
    "changes",
    [{"veiling_glare": 0.3}, {"ghost": 0.3}, {"veiling_glare": 0.2, "ghost": 0.5}],
)
def test_no_light_is_lost_or_made(clean, changes):
    lens, random = merged(clean, changes), np.random.default_rng(0)
    images = random.exponential(size=(3, HEIGHT, WIDTH)) ** 3
    images[:, :20] = 0.0
    images[:, 0, -1] = 1e4  # at the very border, where a kernel that ends would lose half
    shown = through_lens(images, lens)
    np.testing.assert_allclose(shown.sum((1, 2)), images.sum((1, 2)), rtol=1e-12)
    assert shown.min() >= 0.0
    # An even scene stays even, up to its borders.
    np.testing.assert_allclose(through_lens(np.ones((HEIGHT, WIDTH)), lens), 1.0, rtol=1e-12)


@pytest.mark.parametrize(("pixels", "spread_px"), [(16, 0.0), (16, 0.4), (64, 16.0), (20, 40.0)])
def test_a_kernel_gives_as_much_as_it_takes(pixels, spread_px):
    found = kernel(pixels, spread_px)
    np.testing.assert_allclose(found, found.T, atol=1e-15)
    np.testing.assert_allclose(found.sum(0), 1.0, rtol=1e-12)
    assert found.min() >= 0


def test_a_point_far_from_the_border_becomes_a_gaussian_and_its_mirror_image(clean):
    lens = merged(clean, {"veiling_glare": 0.1, "veiling_glare_width": 0.05, "ghost": 0.02})
    lens = merged(lens, {"ghost_width": 0.0})
    image = np.zeros((HEIGHT, WIDTH))
    image[20, 25] = 1.0
    shown, spread_px = through_lens(image, lens), 0.05 * WIDTH
    gauss = 0.1 * math.exp(-(3**2 + 4**2) / (2 * spread_px**2)) / (2 * math.pi * spread_px**2)
    assert shown[23, 29] == pytest.approx(gauss, rel=1e-3)
    assert shown[HEIGHT - 1 - 20, WIDTH - 1 - 25] == pytest.approx(0.02, rel=1e-3)


def test_light_is_linear_and_turned_signs_stay(clean):
    lens = merged(clean, {"veiling_glare": 0.1, "ghost": 0.05})
    one, other = np.random.default_rng(1).normal(size=(2, HEIGHT, WIDTH))
    np.testing.assert_allclose(
        through_lens(2 * one - 3 * other, lens),
        2 * through_lens(one, lens) - 3 * through_lens(other, lens),
        atol=1e-12,
    )


def test_a_dark_pixel_beside_a_bright_one_errs_by_the_closed_form(clean):
    """Its phasor and the glare's share of the other's: atan of the sum of both."""
    lens = merged(clean, {"veiling_glare": 0.02, "veiling_glare_width": 0.1})
    near_m, far_m, brighter = 1.0, 3.0, 50.0
    light = np.zeros((HEIGHT, WIDTH), complex)
    light[24, 30], light[24, 33] = phasor(near_m, brighter), phasor(far_m)
    spread_px = 0.1 * WIDTH
    peak = 0.02 / (2 * math.pi * spread_px**2)
    beside = brighter * peak * math.exp(-(3**2) / (2 * spread_px**2))
    expected = measured_m((0.98 + peak) * phasor(far_m) + beside * phasor(near_m))
    found = measured_m(phasors_through(light, lens))[24, 33]
    assert found == pytest.approx(expected, abs=1e-5) and far_m - found > 2e-3


def test_a_retro_reflecting_sheet_pulls_what_lies_around_it_by_decimetres(clean):
    """A tenth of the image at 3.5 m and 300 times as bright as the wall at 5 m; 1 % of glare."""
    lens = merged(clean, {"veiling_glare": 0.01})
    light = np.full((HEIGHT, WIDTH), phasor(5.0))
    light[16:32, 20:40] = phasor(3.5, 300.0)
    error_m = measured_m(phasors_through(light, lens))[8, 48] - 5.0
    assert -0.6 < error_m < -0.1
    weak = measured_m(phasors_through(light, merged(clean, {"veiling_glare": 0.001})))
    assert -0.05 < weak[8, 48] - 5.0 < -0.005
    # The sheet itself is hardly wrong.
    assert abs(measured_m(phasors_through(light, lens))[24, 30] - 3.5) < 1e-3


@pytest.mark.parametrize("name", ["epc660", "mlx75027"])
def test_shipped_lenses_are_good_ones(name):
    shipped = read_config(SensorConfig, find_config("sensor", name))
    assert 0 < shipped.veiling_glare <= 0.02 and 0 < shipped.ghost <= 0.002


def test_more_than_all_light_is_refused(sensor):
    with pytest.raises(ValueError, match=r"veiling_glare is 0\.7 and ghost 0\.4"):
        merged(sensor, {"veiling_glare": 0.7, "ghost": 0.4})


def test_blur_of_an_image_is_that_of_a_slow_sum():
    image = np.random.default_rng(2).random((6, 9))
    across, down = kernel(9, 0.2 * 9), kernel(6, 0.2 * 9)
    slow = sum(image[y, x] * np.outer(down[:, y], across[x]) for y in range(6) for x in range(9))
    np.testing.assert_allclose(blurred(image, 0.2), slow, rtol=1e-12)
