"""Noise that recordings tell of themselves: known noise, offsets, motion and saturation."""

import math

import pytest
import torch

from unwrap.recordings.camera import camera_of
from unwrap.recordings.sample_noise import noise_of, opposite_samples_noise_lsb
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame

HEIGHT, WIDTH = 60, 80


def camera(noise_lsb=None):
    return camera_of(
        SensorDescription(noise_lsb=1.5),
        bits=12,
        unwrapper="none",
        merge="nearest",
        horizontal_fov_deg=60.0,
        noise_lsb=noise_lsb,
    )


def recorded(count, noise_lsb, *, seed=0):
    """A wall with a pattern of offsets; the noise is a map [H, W]."""
    generator = torch.Generator().manual_seed(seed)
    offset = 30.0 * torch.randn(HEIGHT, WIDTH, generator=generator)
    phase = torch.linspace(0, 6, WIDTH).expand(HEIGHT, WIDTH)
    angles = torch.stack([phase - (k % 4) * math.pi / 2 for k in range(count)])
    noise = noise_lsb * torch.randn(count, HEIGHT, WIDTH, generator=generator)
    samples = (200.0 * angles.cos() + offset + noise).round()
    return RawFrame(samples[None], torch.zeros(1, HEIGHT, WIDTH, dtype=torch.bool))


@pytest.mark.parametrize("count", [4, 8])
def test_opposite_samples_tell_the_noise_whatever_light_and_offsets_are(count):
    """A bright upper half, 12 LSB of ambient shot noise, over a dark one of 2 LSB."""
    noise_lsb = torch.full((HEIGHT, WIDTH), 2.0)
    noise_lsb[: HEIGHT // 2] = 12.0
    found = noise_of(recorded(count, noise_lsb), camera())
    assert found.source == "opposite samples"
    upper, lower = found.noise_lsb[0, : HEIGHT // 2 - 6], found.noise_lsb[0, HEIGHT // 2 + 6 :]
    assert float(upper.mean()) == pytest.approx(12.0, rel=0.05)
    assert float(lower.mean()) == pytest.approx(math.hypot(2.0, math.sqrt(1 / 12)), rel=0.05)
    assert float(upper.std()) < 0.15 * 12.0


def test_an_edge_that_moved_and_saturated_pixels_hardly_count():
    raw = recorded(4, torch.full((HEIGHT, WIDTH), 3.0))
    samples, saturated = raw.dcs_lsb.clone(), raw.saturated.clone()
    samples[:, 2:, :, 40:43] += 150.0
    samples[:, 1, :20, :20], saturated[:, :20, :20] = 2047.0, True
    found = opposite_samples_noise_lsb(RawFrame(samples, saturated))[0]
    assert bool(found[:14, :14].isnan().all()) and bool(found[21:, :].isfinite().all())
    assert float(found[30, 41]) < 1.6 * 3.0
    assert float(noise_of(RawFrame(samples, saturated), camera()).noise_lsb[0, 0, 0]) == 1.5


def test_two_samples_tell_nothing_and_who_corrects_is_believed():
    raw = recorded(2, torch.full((HEIGHT, WIDTH), 9.0))
    unknown, told = noise_of(raw, camera()), noise_of(raw, camera(7.0))
    assert unknown.source == "dark noise" and bool((unknown.noise_lsb == 1.5).all())
    assert told.source == "told" and bool((told.noise_lsb == 7.0).all())
    four = noise_of(recorded(4, torch.full((HEIGHT, WIDTH), 9.0)), camera(7.0))
    assert four.source == "told" and bool((four.noise_lsb == 7.0).all())


def test_a_recording_without_noise_has_that_of_rounding():
    raw = RawFrame(torch.zeros(1, 4, 20, 20), torch.zeros(1, 20, 20, dtype=torch.bool))
    found = opposite_samples_noise_lsb(raw)
    torch.testing.assert_close(found, torch.full_like(found, 1 / math.sqrt(12)))
