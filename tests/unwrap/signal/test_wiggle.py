"""Wiggle and its table: closed forms, a noisy bench, storage, damaged files."""

from __future__ import annotations

import json
import math

import pytest
import torch

from unwrap.signal.decoding import BELOW_TWO_PI, TWO_PI, decode
from unwrap.signal.frames import PhaseFrame
from unwrap.signal.shots import harmonic_weights
from unwrap.signal.wiggle import (
    WiggleTable,
    correlation_samples,
    measure_wiggle,
    read_wiggle,
    wiggle_of,
    wrap_phase,
    write_wiggle,
)

PERIOD = torch.arange(20_000, dtype=torch.float64) * (TWO_PI / 20_000)


def apart(a, b):
    """Signed difference of phases, in [-pi, pi)."""
    return torch.remainder(a - b + math.pi, TWO_PI) - math.pi


def removed_by(table, phase_rad):
    """Phase error that the table removes from decoded phases."""
    frame = PhaseFrame(phase_rad, torch.ones_like(phase_rad), None)
    return apart(phase_rad, table.corrected(frame).phase_rad)


def decoded(phase_rad, weights, count=4):
    return decode(correlation_samples(phase_rad, weights)[:count].unsqueeze(-2))


def test_weights_are_those_of_a_triangle():
    assert harmonic_weights(0.0, 7) == ((1, 1.0),)
    assert harmonic_weights(0.5, 1) == ((1, 1.0),)
    assert harmonic_weights(0.5, 5) == ((1, 1.0), (3, 0.5 / 9), (5, 0.5 / 25))
    # All harmonics together are 8 / pi^2 parts of a triangle of height 1.
    phase = PERIOD[::20]
    many = correlation_samples(phase, harmonic_weights(1.0, 2001))[0] * 8 / math.pi**2
    triangle = 1 - 2 / math.pi * torch.acos(torch.cos(phase))
    assert (many - triangle).abs().max() < 5e-4


@pytest.mark.parametrize("wrong", [(-0.1, 7), (1.1, 7), (math.nan, 7), (0.5, 4), (0.5, 0)])
def test_impossible_harmonics_are_refused(wrong):
    with pytest.raises(ValueError, match=r"strength|highest"):
        harmonic_weights(*wrong)


@pytest.mark.parametrize("count", [2, 4])
def test_ideal_squares_wiggle_by_the_closed_form(count):
    """At most 0.0711 rad, rms 0.0509, four cycles per period; the table removes it."""
    weights = harmonic_weights(1.0, 501)
    frame = decoded(PERIOD, weights, count)
    error = apart(frame.phase_rad[0], PERIOD)
    assert float(error.abs().max()) == pytest.approx(0.0711, abs=1e-4)
    assert float(error.square().mean().sqrt()) == pytest.approx(0.0509, abs=1e-4)
    assert int(torch.fft.rfft(error)[1:].abs().argmax()) + 1 == 4
    corrected = wiggle_of(weights).corrected(frame)
    assert apart(corrected.phase_rad[0], PERIOD).abs().max() < 3e-4
    assert corrected.amplitude is frame.amplitude


def test_the_curve_of_a_triangle_is_its_arc_tangent():
    """Within a quadrant the decoded phase is atan(x / (1 - x)), x = 2 phi / pi."""
    phase = torch.linspace(0.01, math.pi / 2 - 0.01, 200, dtype=torch.float64)
    x = 2 * phase / math.pi
    found = decoded(phase, harmonic_weights(1.0, 2001)).phase_rad[0]
    assert (found - torch.atan2(x, 1 - x)).abs().max() < 1e-3
    table = wiggle_of(harmonic_weights(1.0, 2001))
    assert (removed_by(table, found) - (found - phase)).abs().max() < 3e-4


@pytest.mark.parametrize("weights", [harmonic_weights(1.0, 7), harmonic_weights(0.3, 31)])
def test_a_noisy_bench_measures_the_same_table(weights):
    """Known distances over one period, 2 % noise on every sample, many pixels."""
    generator = torch.Generator().manual_seed(1)
    true = TWO_PI * torch.rand(1_500_000, generator=generator)
    samples = correlation_samples(true, weights)
    noisy = samples + 0.02 * torch.randn(samples.shape, generator=generator)
    table = measure_wiggle(decode(noisy.unsqueeze(-2)).phase_rad[0], true, bins=128)
    left = apart(table.corrected(decoded(PERIOD, weights)).phase_rad[0], PERIOD)
    assert left.abs().max() < 1.5e-3
    assert left.square().mean().sqrt() < 5e-4


def test_a_sine_has_no_wiggle_and_a_delay_is_measured():
    assert max(map(abs, wiggle_of(harmonic_weights(0.0, 7)).error_rad)) < 1e-12
    table = measure_wiggle(torch.remainder(PERIOD + 0.3, TWO_PI), PERIOD, bins=16)
    assert table.error_rad == pytest.approx([0.3] * 16, abs=1e-9)


def test_a_share_of_the_table_leaves_the_rest():
    weights = harmonic_weights(1.0, 7)
    table, frame = wiggle_of(weights), decoded(PERIOD, weights)
    before = apart(frame.phase_rad[0], PERIOD)
    for share in (0.0, 0.75, 1.0):
        left = apart(table.scaled(share).corrected(frame).phase_rad[0], PERIOD)
        assert (left - (1 - share) * before).abs().max() < 3e-4


@pytest.mark.parametrize("errors", [(0.0, 0.1, -0.2, 0.3), (0.0, 0.1, -0.2, 0.3, 0.2)])
def test_the_table_is_linear_between_its_entries_and_periodic(errors):
    """Whether a phase is given in [0, 2 pi) or in [-pi, pi], and with an odd number of entries."""
    table, bin_rad = WiggleTable(errors), TWO_PI / len(errors)
    places = torch.tensor([0.0, 0.5, 1.0, 1.25, 3.0])
    expected = torch.tensor([0.0, 0.05, 0.1, 0.025, 0.3])
    found = removed_by(table, places * bin_rad)
    torch.testing.assert_close(found, expected, rtol=0, atol=2e-6)
    last = removed_by(table, torch.tensor([len(errors) - 0.5]) * bin_rad)
    assert float(last) == pytest.approx(errors[-1] / 2, abs=2e-6)
    below_zero = (places - len(errors)) * bin_rad
    turned = (table.turns_of(below_zero[below_zero >= -math.pi]) - 1.0) * TWO_PI
    assert len(turned)
    torch.testing.assert_close(
        below_zero[-len(turned) :] - turned, expected[-len(turned) :], rtol=0, atol=2e-6
    )
    assert removed_by(table, torch.tensor([[BELOW_TWO_PI]])).abs().max() < 1e-5


def test_wrapped_phases_stay_below_two_pi():
    phase = torch.tensor([-1e-9, -1.0, 0.0, TWO_PI, 7.0, BELOW_TWO_PI])
    found = wrap_phase(phase.clone())
    assert found.min() >= 0 and found.max() <= BELOW_TWO_PI
    assert apart(found, phase).abs().max() < 1e-6


def test_tables_come_back_from_disk(tmp_path):
    tables = {24e6: wiggle_of(harmonic_weights(1.0, 7)), 10e6: WiggleTable((0.0, 0.1, 0.0, -0.1))}
    write_wiggle(tmp_path / "wiggle.json", tables)
    assert read_wiggle(tmp_path / "wiggle.json") == tables


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[]",
        '{"wiggle": 3}',
        '{"wiggle": [{"frequency_hz": 1e6}]}',
        json.dumps({"wiggle": [{"frequency_hz": 1e6, "error_rad": [0.0, 9.0, 0.0, 0.0]}]}),
        json.dumps({"wiggle": [{"frequency_hz": 1e6, "error_rad": [0.0, math.nan, 0.0, 0.0]}]}),
        "[" * 100_000,
    ],
)
def test_damaged_tables_are_refused(tmp_path, content):
    path = tmp_path / "wiggle.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"wiggle\.json"):
        read_wiggle(path)


def test_other_bad_input_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"missing\.json"):
        read_wiggle(tmp_path / "missing.json")
    with pytest.raises(ValueError, match="at least 4"):
        WiggleTable((0.0, 0.1))
    with pytest.raises(ValueError, match="true_rad"):
        measure_wiggle(PERIOD, PERIOD[1:])
    with pytest.raises(ValueError, match="NaN"):
        measure_wiggle(PERIOD * math.nan, PERIOD)
    half = PERIOD[: len(PERIOD) // 2]
    with pytest.raises(ValueError, match=r"from 180\.0 to 202\.5 degrees"):
        measure_wiggle(half, half, bins=16)
