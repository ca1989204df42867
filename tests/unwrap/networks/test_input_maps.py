"""What networks are given, against closed forms."""

from __future__ import annotations

import math

import pytest
import torch
from peer_scenes import SENSOR, SPEED_OF_LIGHT_M_S, UNAMBIGUOUS_M, samples, steps

from unwrap.networks.input_maps import gray_maps, log_snr, phase_maps
from unwrap.signal.frames import RawFrame
from unwrap.signal.sensed import Sensed, wrapped_distance_m


@pytest.mark.parametrize("shots", [2, 4, 8])
def test_phase_maps_are_the_phase_vector_the_ratio_and_the_saturation(shots):
    distance_m = steps(12, 16)
    raw = samples(distance_m, 150.0, shots)
    raw.saturated[0, 3, 4] = True
    noise_lsb = torch.linspace(0.5, 30.0, 16).expand_as(distance_m)
    maps = phase_maps(Sensed(torch.zeros_like(distance_m), raw, noise_lsb=noise_lsb), SENSOR)
    phase = 4 * math.pi * SENSOR.f1_hz / SPEED_OF_LIGHT_M_S * distance_m.double()
    expected = torch.stack(
        (phase.cos(), phase.sin(), (1 + 150.0 / noise_lsb.double()).log() / 4 - 1), 1
    )
    torch.testing.assert_close(maps[:, :3].double(), expected, atol=1e-4, rtol=0)
    assert maps.dtype == torch.float32 and maps.shape == (2, 4, 12, 16)
    assert torch.equal(maps[:, 3], raw.saturated.float()) and maps[:, 3].sum() == 1


def test_known_offset_and_drift_are_removed_and_noise_falls_back_to_that_in_the_dark():
    distance_m = steps(12, 16)
    gray, shift_m = torch.zeros_like(distance_m), torch.tensor([0.3, -0.2], dtype=torch.float64)
    offset_lsb = torch.linspace(-20, 20, 16).expand_as(distance_m)
    moved = samples(distance_m - shift_m.view(-1, 1, 1), 150.0, 2)
    raw = RawFrame(moved.dcs_lsb + offset_lsb.unsqueeze(1), moved.saturated)
    found = phase_maps(Sensed(gray, raw, offset_lsb=offset_lsb, shift_m=shift_m), SENSOR)
    expected = phase_maps(Sensed(gray, samples(distance_m, 150.0, 2)), SENSOR)
    torch.testing.assert_close(found, expected, atol=1e-4, rtol=0)
    dark = math.log1p(150.0 / SENSOR.noise_lsb) / 4 - 1
    torch.testing.assert_close(expected[:, 2], torch.full_like(gray, dark))


def test_wrapped_distance_lies_within_one_unambiguous_range():
    distance_m = steps(12, 16)
    found = wrapped_distance_m(Sensed(distance_m, samples(distance_m, 150.0, 4)), SENSOR)
    torch.testing.assert_close(found, distance_m.remainder(UNAMBIGUOUS_M), atol=1e-4, rtol=0)


def test_compression_grows_and_stays_near_one():
    ratios = torch.tensor([0.0, 1.0, 30.0, 1000.0, 3000.0])
    values = log_snr(ratios)
    assert (values.diff() > 0).all()
    assert values[0] == -1.0 and values[-1] == pytest.approx(1.0, abs=0.01)


def test_frames_without_samples_are_refused():
    with pytest.raises(ValueError, match=r"sensed\.raw is None; expected 2, 4 or 8 samples"):
        phase_maps(Sensed(torch.zeros(1, 8, 8)), SENSOR)


def test_gray_maps_are_gray_its_logarithm_and_the_row_within_one():
    gray = torch.tensor([0.0, 0.5, 1.0]).expand(2, 1, 5, 3)
    maps = gray_maps(gray)
    assert maps.shape == (2, 3, 5, 3)
    assert maps[0, 0, 0].tolist() == [-1.0, 0.0, 1.0]
    assert maps[0, 1, 0].diff().min() > 0 and maps.abs().max() <= 1.001
    assert maps[0, 2, :, 0].tolist() == [-1.0, -0.5, 0.0, 0.5, 1.0]
