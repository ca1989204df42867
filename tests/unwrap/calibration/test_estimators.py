"""Each estimator against light, taps and patterns drawn here, or a closed form."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy import stats

from unwrap.calibration.dark_offsets import (
    ambient_slope,
    drift_of_pattern,
    offset_map,
    pattern_parts,
)
from unwrap.calibration.delays import common_delay_m, drift_per_kelvin, rad_per_m
from unwrap.calibration.full_well import full_well_e
from unwrap.calibration.intervals import (
    Estimate,
    around,
    jackknife,
    pivotal,
    significant,
    student_quantile,
    variance_draws,
)
from unwrap.calibration.moments import Moments, Setting, moments_of
from unwrap.calibration.overtones import (
    fit_wiggle,
    fundamentals,
    overtone_factor,
    strength_of,
    table_of,
)
from unwrap.calibration.photon_transfer import (
    ambient_e,
    gray_gain,
    photon_transfer,
    read_noise_e,
    transfer_points,
    variance_fit,
)
from unwrap.signal import correlation_samples, harmonic_weights, wiggle_of

DARK, LIT = Setting("dark"), Setting("still")


def recording(setting, mean_lsb, variance_lsb2=1.0, *, frames=16, flagged=0.0, **more) -> Moments:
    """Moments with one mean [K, 4, P] and the same variance everywhere."""
    pixels = mean_lsb.shape[-1]
    return Moments(
        setting,
        frames,
        mean_lsb,
        np.full((len(mean_lsb), pixels), variance_lsb2),
        np.broadcast_to(flagged, pixels),
        **more,
    )


def taps(rng, signal_e, ambient_e, phase, contrast, read_e, frames):
    """Both taps of four samples as Poisson's counts, read: [2, F, 1, 4, P] electrons."""
    wave = np.stack([np.cos(phase - k * np.pi / 2) for k in range(4)])
    means = [(signal_e + ambient_e + s * contrast * signal_e * wave) / 2 for s in (1, -1)]
    size = (frames, 1, *wave.shape)
    return np.stack([rng.poisson(m, size) + read_e * rng.standard_normal(size) for m in means])


def test_moments_are_those_of_numpy_and_pixels_can_be_chosen():
    rng = np.random.default_rng(0)
    samples, gray = rng.normal(5.0, 2.0, (6, 2, 4, 3, 5)), rng.normal(100.0, 9.0, (6, 3, 5))
    saturated = rng.random((6, 3, 5)) < 0.3
    found = moments_of(LIT, samples, saturated, gray)
    flat = samples.reshape(6, 2, 4, 15)
    np.testing.assert_allclose(found.mean_lsb, flat.mean(0))
    np.testing.assert_allclose(found.variance_lsb2, flat.var(0, ddof=1).mean(1))
    np.testing.assert_allclose(found.flagged, saturated.reshape(6, 15).mean(0))
    np.testing.assert_allclose(found.gray_variance, gray.reshape(6, 15).var(0, ddof=1))
    some = found.of(np.array([3, 7]))
    np.testing.assert_array_equal(some.mean_lsb, found.mean_lsb[..., [3, 7]])
    np.testing.assert_array_equal(some.gray_mean, found.gray_mean[[3, 7]])


def test_moments_refuse_what_does_not_fit():
    samples = np.zeros((3, 1, 4, 2, 2))
    with pytest.raises(ValueError, match=r"wall.npz: gray is \(3, 2, 3\); expected \(3, 2, 2\)"):
        moments_of(Setting("wall", "wall.npz"), samples, np.zeros((3, 2, 2)), np.zeros((3, 2, 3)))
    with pytest.raises(ValueError, match="2 samples a frequency; expected 4"):
        moments_of(LIT, samples[:, :, :2], np.zeros((3, 2, 2)))


def test_photon_transfer_finds_the_gain_of_counted_electrons():
    """Poisson's counts, in place of the normal distribution that the simulation draws."""
    rng = np.random.default_rng(1)
    gain, contrast, read_e, pixels, frames = 0.02, 0.7, 90.0, 4000, 32
    phase = rng.uniform(0, 2 * np.pi, pixels)
    timed = {"integration_s": 1e-3, "gray_exposure_s": 2e-3}
    recordings, amplitudes = [], []
    for kind, most_e, light_e, ambient in (
        ("still", 40e3, 0.0, False),
        ("dark", 0.0, 60e3, True),
        ("dark", 0.0, 0.0, False),
    ):
        signal_e, lamp_e = np.linspace(0, most_e, pixels), np.linspace(0, light_e, pixels)
        a, b = taps(rng, signal_e, lamp_e, phase, contrast, read_e, frames)
        words = np.rint(gain * (a - b) + 3.0)[..., None, :]
        gray = np.rint(0.03 * rng.poisson(2 * lamp_e, (frames, pixels)))[:, None]
        setting = Setting(kind, ambient=ambient, **timed)
        recordings.append(moments_of(setting, words, np.zeros((frames, 1, pixels), bool), gray))
        amplitudes.append((gain * contrast * signal_e)[None])
    per_e = gray_gain(recordings)
    assert per_e == pytest.approx(0.03, rel=0.01)
    expected_e = np.linspace(0, 60e3, pixels)
    np.testing.assert_allclose(ambient_e(recordings[1], 0.03), expected_e, rtol=0.02, atol=100)
    points = transfer_points(recordings, amplitudes, per_e)
    over_contrast, found, dark = photon_transfer(*points)
    assert found == pytest.approx(gain, rel=0.01)
    assert found / over_contrast == pytest.approx(contrast, rel=0.02)
    assert read_noise_e(dark, found) == pytest.approx(read_e, rel=0.02)


def test_without_ambient_light_only_gain_over_contrast_is_told():
    columns = np.stack((np.arange(100.0), np.zeros(100), np.ones(100)), -1)
    found = photon_transfer(columns, 2.0 + 0.5 * np.arange(100.0), np.full(100, 9.0))
    assert found[0] == pytest.approx(0.5) and np.isnan(found[1]) and found[2] == pytest.approx(2.0)
    assert np.isnan(gray_gain([recording(LIT, np.zeros((1, 4, 3)))]))
    # Ambient light that no gray image counts tells nothing at all.
    unknown = recording(Setting("still", ambient=True), np.ones((1, 4, 3)))
    assert np.isnan(photon_transfer(*transfer_points([unknown], [np.ones((1, 3))], np.nan))).all()


def test_small_measured_variances_do_not_count_more_than_others():
    """Weights by measured variances would find too little: by 2 / freedom."""
    rng = np.random.default_rng(2)
    measured = 5.0 * rng.chisquare(3, 20_000) / 3
    found = variance_fit(np.ones((20_000, 1)), measured, np.full(20_000, 3.0))
    assert found[0] == pytest.approx(measured.mean())


def test_the_map_weighs_recordings_by_their_frames_and_knows_its_noise():
    low, high = np.zeros((1, 4, 3)), np.ones((1, 4, 3))
    pattern, noise = offset_map(
        [recording(DARK, low, 2.0, frames=8), recording(DARK, high, 2.0, frames=24)]
    )
    np.testing.assert_allclose(pattern, 0.75)
    assert noise == pytest.approx(2.0 / (4 * 32))


def test_rows_and_pixels_are_told_apart_as_often_as_intervals_say():
    rng, generator = np.random.default_rng(3), np.random.default_rng(4)
    inside = np.zeros(2, int)
    for _ in range(300):
        rows, pixels = rng.normal(0, 6.0, (20, 1)), rng.normal(0, 8.0, (20, 30))
        noise = rng.normal(0, 0.5, (20, 30))
        std, share = pattern_parts(rows + pixels + noise, 0.25, generator)
        inside += [std.low <= 10.0 <= std.high, share.low <= 0.36 <= share.high]
    low, high = stats.binom.interval(0.999, 300, 0.95)
    assert (low <= inside).all() and (inside <= high).all()


def test_ambient_light_adds_in_even_rows_what_it_takes_in_odd_ones():
    rng = np.random.default_rng(5)
    pattern, light = rng.normal(0, 9.0, 12), rng.uniform(0, 1e5, 12)
    parity = np.tile([1.0, -1.0], 6)
    lit = recording(DARK, np.broadcast_to(pattern + parity * 4e-5 * light, (1, 4, 12)))
    assert ambient_slope(pattern, [lit], [light], parity) == pytest.approx(4e-5)
    full = recording(DARK, lit.mean_lsb + 99.0, flagged=1.0)
    assert ambient_slope(pattern, [lit, full], [light, light], parity) == pytest.approx(4e-5)
    assert np.isnan(ambient_slope(pattern, [full], [light], parity))


def test_the_drift_of_offsets_is_that_of_their_slopes_less_the_noise():
    rng = np.random.default_rng(6)
    slopes, pattern = rng.normal(0, 0.05, 5000), rng.normal(0, 10.0, 5000)
    dark = [
        recording(
            Setting("dark", temperature_k=300.0 + warmer),
            np.broadcast_to(
                pattern + warmer * slopes + rng.normal(0, 1 / np.sqrt(4 * 16), 5000), (1, 4, 5000)
            ),
        )
        for warmer in (0.0, 10.0)
    ]
    found = drift_of_pattern(dark, rng)
    assert found.low < 0.05 < found.high and found.high - found.low < 0.003
    assert drift_of_pattern(dark[:1], rng) is None


def test_overtones_are_those_that_four_samples_decode():
    phase = np.linspace(0, 2 * np.pi, 500)
    samples = correlation_samples(torch.from_numpy(phase), harmonic_weights(0.7, 9)).numpy()
    phasors = (samples[0] - samples[2] + 1j * (samples[1] - samples[3])) / 2
    np.testing.assert_allclose(
        phasors, overtone_factor(phase, 0.7, 9) * np.exp(1j * phase), atol=1e-12
    )
    np.testing.assert_allclose(fundamentals(phasors, 0.7, 9), np.exp(1j * phase), atol=5e-6)
    np.testing.assert_array_equal(fundamentals(phasors, 0.0, 9), phasors)


@pytest.mark.parametrize("strength", [0.0, 0.05, 0.3, 1.0])
def test_a_quarter_of_a_period_tells_the_table_and_the_strength(strength):
    true = np.linspace(0.3, 0.3 + np.pi / 2, 4000)
    error = np.angle(overtone_factor(true, strength, 7))
    found = fit_wiggle(true + error + 0.2, true, np.ones_like(true))
    assert found[0] == pytest.approx(0.2, abs=1e-3 * strength + 1e-12)
    # A delay of the light would turn the curve; here it is electronic, and the curve is not.
    found = fit_wiggle(true + error, true, np.ones_like(true))
    assert strength_of(float(found[2]), 7) == pytest.approx(strength, abs=1e-3)
    expected = wiggle_of(harmonic_weights(strength, 7)).error_rad
    np.testing.assert_allclose(table_of(found).error_rad, expected, atol=2e-3 * strength**2 + 2e-4)


def test_less_than_a_quarter_of_a_period_tells_no_table():
    true = np.linspace(0.0, 0.6 * np.pi / 2, 1000)
    assert np.isnan(fit_wiggle(true, true, np.ones_like(true))).all()


def test_a_wave_that_no_strength_has_is_no_strength():
    assert np.isnan(strength_of(0.1, 7)) and np.isnan(strength_of(-0.5, 7))


def test_a_delay_near_half_a_period_is_found_whole():
    true = np.linspace(0, 2 * np.pi, 2000)
    rng = np.random.default_rng(7)
    decoded = np.angle(np.exp(1j * (true + 3.1 + rng.normal(0, 0.2, 2000))))
    assert fit_wiggle(decoded, true, np.ones(2000))[0] == pytest.approx(3.1, abs=0.02)


def test_delays_of_frequencies_are_averaged_by_their_squares():
    hz = (24e6, 10e6)
    assert common_delay_m(rad_per_m(hz) * 0.3, hz) == pytest.approx(0.3)
    found = common_delay_m(rad_per_m(hz) * [0.3, 0.4], hz)
    assert found == pytest.approx((0.3 * 576 + 0.4 * 100) / 676)


def test_drift_is_a_regression_with_students_interval():
    kelvin, far = np.array([280.0, 290, 300, 310, 330]), np.array([0.0, 0.12, 0.26, 0.37, 0.63])
    found, expected = drift_per_kelvin(kelvin, far), stats.linregress(kelvin, far)
    assert found.value == pytest.approx(expected.slope)
    reach = stats.t.ppf(0.975, 3) * expected.stderr
    assert found.high - found.value == pytest.approx(reach, rel=0.01)
    assert drift_per_kelvin(kelvin[[0, 0, 1]], far[:3]) is None


def test_the_full_well_is_found_where_taps_begin_to_be_cut_off():
    rng = np.random.default_rng(8)
    well, read_e, pixels, frames = 60e3, 50.0, 3000, 40
    charges = np.linspace(0.5, 1.2, pixels) * well
    # One tap is filled, the other is empty; what is read is not above the full well.
    held = rng.poisson(charges, (frames, 4, pixels))
    flagged = (held + read_e * rng.standard_normal(held.shape) >= well).any(1).mean(0)
    mean = np.minimum(held, well).mean(0)
    lit = recording(LIT, 0.01 * mean[None], flagged=flagged)
    told = np.stack((mean, np.zeros_like(mean)))[:, None]
    assert full_well_e([lit], [told], read_e, 12) == pytest.approx(well, rel=2e-3)
    none = recording(LIT, lit.mean_lsb)
    assert np.isnan(full_well_e([none], [told], read_e, 12))
    # With a converter that overflows first, flags are not those of the tap.
    assert np.isnan(full_well_e([lit], [told], read_e, 10))


@pytest.mark.parametrize("freedom", [3, 5, 19, 1000])
def test_students_quantiles(freedom):
    for probability in (0.84, 0.975):
        expected = stats.t.ppf(probability, freedom)
        assert student_quantile(probability, freedom) == pytest.approx(expected, rel=0.01)


def test_the_jackknife_of_a_mean_has_its_standard_error():
    values = np.random.default_rng(9).normal(3.0, 2.0, 4000)
    found = jackknife(lambda pixels: {"mean": values[pixels].mean(), "no": np.nan}, 4000)
    assert set(found) == {"mean"} and found["mean"].value == values.mean()
    error = (found["mean"].high - found["mean"].value) / stats.t.ppf(0.975, 19)
    # 19 degrees of freedom: within a factor of 1.6 in all but .1 % of cases.
    assert 2.0 / np.sqrt(4000) / 1.6 < error < 1.6 * 2.0 / np.sqrt(4000)


def test_a_variance_s_interval_is_that_of_chi_square():
    draws = variance_draws(4.0, 12, np.random.default_rng(10))
    found = pivotal(4.0, draws)
    for end, probability in ((found.low, 0.975), (found.high, 0.025)):
        assert end == pytest.approx(48 / stats.chi2.ppf(probability, 12), rel=0.03)


def test_intervals_are_told_with_two_digits():
    assert str(Estimate(1.23456, 1.20001, 1.27)) == "1.235 [1.200, 1.270]"
    assert significant(5700.0) == 0 and significant(0.02) == 3
    assert str(around(2.0, 0.0, 5)) == "2.000000 [2.000000, 2.000000]"
