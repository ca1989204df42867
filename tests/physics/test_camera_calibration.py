"""Calibrated cameras: hidden numbers are found as often as intervals say, and what is simulated
with them cannot be told from the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from calibration_bench import calibrated, example, hidden_number, moments, recorded
from scipy import stats

from shotenv.config import SensorConfig, find_config, read_config
from unwrap.calibration import ambient_e, amplitudes_of, gray_gain

CAMERAS = range(100, 200)
LEVEL = 1e-3
"""Of every test of a number of successes, and of every comparison of recordings."""
STUDENT = {"gain_lsb_per_e", "contrast", "read_noise_e", "full_well_e", "offset_ambient_lsb"}
"""Numbers whose intervals are symmetric, of the jackknife's 19 degrees of freedom."""
JACKKNIFED = STUDENT | {"harmonic_strength", "distance_offset_m"}
OTHERS = {"offset_std_lsb", "offset_row_share", "offset_drift_lsb_per_k", "distance_drift_m_per_k"}


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_hidden_numbers_of_100_cameras_are_within_their_intervals_as_often_as_these_say():
    """At 95 %, and at half of the intervals' widths: they are not too wide, either."""
    inside, within_half = (dict.fromkeys(JACKKNIFED | OTHERS, 0) for _ in range(2))
    for seed in CAMERAS:
        camera = example.hidden_camera(seed)
        found = calibrated(camera, recorded(camera))
        assert found.missing == {} and found.leaning == {}, seed
        for name in inside:
            number, true = found.numbers[name], hidden_number(camera, name)
            inside[name] += number.low <= true <= number.high
            within_half[name] += abs(true - number.value) <= (number.high - number.low) / 4
    low, high = stats.binom.interval(1 - LEVEL, len(CAMERAS), 0.95)
    assert {name: n for name, n in inside.items() if not low <= n <= high} == {}
    half = stats.t.cdf(stats.t.ppf(0.975, 19) / 2, 19)
    low, high = stats.binom.interval(1 - LEVEL, len(CAMERAS), 2 * half - 1)
    outside = {name: within_half[name] for name in JACKKNIFED}
    assert {name: n for name, n in outside.items() if not low <= n <= high} == {}


def scenes_of(camera):
    """A still scene with the laser alone, one with ambient light too, and one that saturates."""
    height, width = camera.height, camera.width
    across = torch.linspace(0.15, 1.0, width).expand(height, width)
    slope_m = torch.linspace(0.9, 4.2, height)[:, None].expand(height, width)
    dark = torch.zeros(height, width)
    most_e = 2 * camera.sensor.full_well_e / (1 + camera.sensor.contrast)
    return {
        "still": example.Scene(slope_m, 0.8 * most_e * across, dark),
        "bright": example.Scene(slope_m, 1.3 * most_e * across, dark),
        "ambient": example.Scene(slope_m, dark, 0.8 * most_e * across.flip(1)),
        "warm": example.Scene(slope_m, 0.8 * most_e * across, dark, example.ROOM_K + 15),
    }


KNOWN = {
    "still": {"kind": "still"},
    "bright": {"kind": "still"},
    "warm": {"kind": "warm", "temperature_k": example.ROOM_K + 15},
    "ambient": {"kind": "dark", "ambient": True, "integration_s": example.INTEGRATION_S},
}


def p_values(camera, twin, found, frames=16):
    """Two-sample tests of recordings of a camera and of its twin, by what they compare.

    The twin's scenes have the light that a further recording of the camera shows: how much light a
    watt brings is no part of the calibration. Distances are told.
    """
    sensor, scenes = twin.sensor, scenes_of(camera)
    shape = camera.height, camera.width
    shown = moments(camera, KNOWN["still"], scenes["still"], 64, 900)
    amplitude = amplitudes_of(shown, sensor.harmonic_strength, sensor.highest_harmonic).mean(0)
    signal_e = torch.from_numpy(amplitude.reshape(shape)) / (
        sensor.gain_lsb_per_e * sensor.contrast
    )
    lit = moments(camera, KNOWN["ambient"], scenes["ambient"], 64, 901)
    light_e = torch.from_numpy(ambient_e(lit, gray_gain(found.recordings)).reshape(shape))
    twins = {
        "still": replace(scenes["still"], signal_e=signal_e),
        "bright": replace(scenes["bright"], signal_e=signal_e * (1.3 / 0.8)),
        "warm": replace(scenes["warm"], signal_e=signal_e),
        "ambient": replace(scenes["ambient"], ambient_e=light_e),
    }
    first = {n: moments(camera, KNOWN[n], scenes[n], frames, 910 + i) for i, n in enumerate(twins)}
    second = {n: moments(twin, KNOWN[n], twins[n], frames, 950 + i) for i, n in enumerate(twins)}
    dark = example.Scene(scenes["still"].distance_m, *torch.zeros(2, *shape))
    black = [moments(c, {"kind": "dark"}, dark, frames, 990) for c in (camera, twin)]
    raw = [
        example.record(c, s["still"], frames, 980)[0].dcs_lsb.numpy()
        for c, s in ((camera, scenes), (twin, twins))
    ]
    p = {f"{name}: mean": same_phasors(first[name], second[name], 64) for name in ("still", "warm")}
    for name in ("still", "warm", "ambient"):
        p[f"{name}: variance"] = same_variance(first[name], second[name])
    lit = first["ambient"], second["ambient"]
    p["ambient: offset"] = same_added_offset(*zip(lit, black, strict=True), shape)
    p["bright: saturated"] = same_share(first["bright"], second["bright"])
    p["still: histogram"] = same_histogram(*raw)
    p["dark: variance"] = same_variance(*black)
    p["dark: pattern"] = same_pattern(*(r.offset_lsb.reshape(shape) for r in black))
    return {name: float(value) for name, value in p.items()}


def two_sided(distribution, statistic):
    return 2 * min(distribution.cdf(statistic), distribution.sf(statistic))


def same_phasors(first, second, shown_frames):
    """Chi-square of the differences of all pixels' phasors, in standard deviations."""
    used = (first.flagged == 0) & (second.flagged == 0)
    difference = (first.phasors - second.phasors)[:, used]
    along = np.exp(-1j * np.angle(first.phasors[:, used]))
    variance = (first.variance_lsb2 + second.variance_lsb2)[:, used] / 2
    across = (difference * along).imag ** 2 / (variance * (1 / first.frames))
    # The amplitude of the twin is that of the mean of two frequencies of `shown`.
    radial = (difference * along).real ** 2 / (
        variance * (1 / first.frames + 1 / (4 * shown_frames))
    )
    return two_sided(stats.chi2(across.size + radial.size), across.sum() + radial.sum())


def same_variance(first, second):
    """F test of the mean variances of pixels that are never saturated.

    Pixels are not equally noisy: their mean has Satterthwaite's degrees of freedom.
    """
    used = (first.flagged == 0) & (second.flagged == 0)
    variances = [r.variance_lsb2[:, used] for r in (first, second)]
    equal = [np.square(v.mean()) / np.square(v).mean() for v in variances]
    freedom = [4 * e * v.size * (first.frames - 1) for e, v in zip(equal, variances, strict=True)]
    return two_sided(stats.f(*freedom), variances[0].mean() / variances[1].mean())


def same_added_offset(first, second, shape):
    """Paired t test over pixels of what ambient light adds; each is recorded with and without."""
    sign = np.where(np.arange(shape[0]) % 2 == 0, 1.0, -1.0).repeat(shape[1])
    added = [sign * (lit.offset_lsb - dark.offset_lsb) for lit, dark in (first, second)]
    return stats.ttest_rel(*added).pvalue


def same_histogram(first, second):
    """Kolmogorov and Smirnov's test of the changes of words from one frame to the next.

    Without each pixel's offset, which is another in every imager.
    """
    changes = [np.diff(words, axis=0)[::2].ravel() for words in (first, second)]
    return stats.ks_2samp(*changes).pvalue


def same_share(first, second):
    """Shares of saturated pixels and frames, as two binomial numbers."""
    counts = [round(float(r.flagged.sum() * r.frames)) for r in (first, second)]
    total = first.flagged.size * first.frames
    table = [[count, total - count] for count in counts]
    return stats.fisher_exact(table).pvalue


def same_pattern(first, second):
    """F tests of the variances between rows and within, the smaller of both p values, doubled."""
    between = [pattern.mean(1).var(ddof=1) for pattern in (first, second)]
    within = [(pattern - pattern.mean(1)[:, None]).var() for pattern in (first, second)]
    height, width = first.shape
    return min(
        1.0,
        2
        * min(
            two_sided(stats.f(height - 1, height - 1), between[0] / between[1]),
            two_sided(stats.f(*[height * (width - 1)] * 2), within[0] / within[1]),
        ),
    )


MEASURED = (
    *("gain_lsb_per_e", "contrast", "read_noise_e", "full_well_e", "harmonic_strength"),
    *("offset_std_lsb", "offset_row_share", "offset_ambient_lsb", "offset_drift_lsb_per_k"),
    *("distance_drift_m_per_k",),
)


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_recordings_of_the_calibrated_sensor_cannot_be_told_from_the_cameras(seed):
    camera = example.hidden_camera(seed)
    found = calibrated(camera, recorded(camera))
    kind = read_config(SensorConfig, find_config("sensor", "epc660"))
    numbers = {name: found.numbers[name].value for name in MEASURED}
    measured = SensorConfig.model_validate(
        kind.model_dump() | numbers | {"calibration_temperature_k": found.temperature_k}
    )
    twin = example.Camera(measured, found.numbers["distance_offset_m"].value, seed=seed + 10)
    p = p_values(camera, twin, found)
    assert {name: value for name, value in p.items() if value < LEVEL} == {}
    # The same tests tell the camera from another of its kind.
    untold = p_values(camera, replace(twin, sensor=kind, delay_m=0.0), found)
    told = {name for name, value in untold.items() if value < LEVEL}
    assert set(p) - told <= {"dark: pattern"}  # this kind's happens to be like one camera's
