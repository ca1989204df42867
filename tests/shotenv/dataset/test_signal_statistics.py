"""Statistics of a bank's light, against closed forms on a bank of one bounce."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import torch

from agents.cli.entry import main
from shotenv.bank import KeptPredictions, open_bank
from shotenv.dataset import light_statistics
from shotenv.dataset.signal_statistics import autocorrelation
from shotenv.sensor import electrons_per_radiance_second

LASER = {"laser_power_w": 2.0, "integration_s": 5e-4}


def test_autocorrelation_of_noise_is_white_and_of_its_mean_over_four_a_triangle():
    noise = np.random.default_rng(0).standard_normal(200_000)
    assert autocorrelation([noise])["1"] == pytest.approx(0.0, abs=0.01)
    smooth = autocorrelation([np.convolve(noise, np.ones(4) / 4, "valid")])
    assert smooth["1"] == pytest.approx(0.75, abs=0.01)
    assert smooth["2"] == pytest.approx(0.5, abs=0.01)
    assert smooth["4"] == pytest.approx(0.0, abs=0.01)


def test_autocorrelation_compares_within_a_series_only():
    """Two clips, each constant: nothing changes within either, however short."""
    assert autocorrelation([np.zeros(3), np.ones(3)]) == {"1": 1.0, "2": 1.0}
    # What is unknown is in no pair.
    assert autocorrelation([np.array([np.nan, 0.0, 0.0, 0.0]), np.ones(3)]) == {"1": 1.0, "2": 1.0}
    assert autocorrelation([np.ones(3)]) == {}
    assert autocorrelation([]) == {}


def test_statistics_follow_the_formulas(tiny_bank, sensor):
    bank = open_bank(tiny_bank)
    found = light_statistics(bank, "test", sensor, **LASER)
    clips = bank.splits("test")
    assert set(found) == {"all", *(clip.family for clip in clips)}
    frames = torch.cat([torch.arange(c.start, c.start + c.frames) for c in clips])
    exposure, per_light = bank.exposure(frames), electrons_per_radiance_second(sensor)
    signal = exposure.active.double() * per_light * math.prod(LASER.values())
    ambient = exposure.ambient.double() * per_light * LASER["integration_s"]
    ratio = sensor.contrast * signal / (signal + ambient + 2 * sensor.read_noise_e**2).sqrt()
    near = (exposure.distance_m > 4.5) & (exposure.distance_m < 5.5)
    expected = np.median(ratio[near].numpy())
    assert found["all"]["snr_at_m"]["5"] == pytest.approx(expected, rel=1e-5)
    gray = bank.gray(frames).double() / 4095
    assert found["all"]["gray_mean"] == pytest.approx(float(gray.mean()), rel=1e-6)
    dark = float((gray < 0.01).double().mean())
    assert found["all"]["gray_dark_share"] == pytest.approx(dark, abs=1e-6)
    assert found["all"]["frames"] == sum(one["frames"] for k, one in found.items() if k != "all")
    assert found["all"]["persistence"] == {}


def test_a_stronger_laser_saturates_more(tiny_bank, sensor):
    bank = open_bank(tiny_bank)
    shares = [
        light_statistics(bank, "test", sensor, laser_power_w=power, integration_s=1e-3)["all"][
            "saturated_share"
        ]
        for power in (1.0, 1000.0, 1e6)
    ]
    assert shares[0] < shares[1] < shares[2] <= 1.0


def test_errors_of_a_prediction_that_is_right_do_not_correlate(tiny_bank, sensor):
    bank = open_bank(tiny_bank)
    truth = bank.distance_m(torch.arange(len(bank)))
    right = KeptPredictions(truth, torch.ones_like(truth))
    found = light_statistics(bank, "test", sensor, **LASER, kept=right)
    assert found["all"]["persistence"] == {}
    wrong = KeptPredictions(truth * 0.5, torch.ones_like(truth))
    found = light_statistics(bank, "test", sensor, **LASER, kept=wrong)
    assert set(found["all"]["persistence"]) == {"1", "2"}, "clips of four frames"


def test_the_command_writes_what_it_prints(tiny_bank, tiny_unwrapper, tmp_path, capsys):
    path = tmp_path / "light.json"
    words = ["bank", "light", tiny_bank, "--network", tiny_unwrapper, "--json", str(path)]
    assert main(words) == 0
    found = json.loads(path.read_text(encoding="utf-8"))
    assert f"{found['all']['frames']}" in capsys.readouterr().out
    assert 0.0 <= found["all"]["saturated_share"] <= 1.0


def test_refuses_an_unknown_split(tiny_bank, capsys):
    assert main(["bank", "light", tiny_bank, "--split", "dev"]) == 1
    assert "dev" in capsys.readouterr().err
