"""Noise as a function of seed, frame, sample, tap and pixel: its distribution and independence."""

from __future__ import annotations

import math
from itertools import islice

import numpy as np
import pytest
import torch

from shotenv.sensor import noise_samples
from shotenv.sensor.noise import draw_noise
from shotenv.sensor.normals import BLOCK, fill_normals_, normal_pair

SIDE = 500


@pytest.fixture(scope="module")
def normals():
    """Four million of one frame, [sample, tap, pixel], float64."""
    return draw_noise(3, 4, 8, SIDE, SIDE).flatten(2).double()


def cumulative(values: torch.Tensor) -> torch.Tensor:
    return 0.5 * torch.special.erfc(-values / math.sqrt(2.0))


def test_moments_are_those_of_the_standard_normal(normals):
    error = 1.0 / math.sqrt(normals.numel())
    # Standard errors of the mean powers of a normal: sqrt of 1, 2, 15 and 96 over the number.
    for power, expected, spread in ((1, 0.0, 1.0), (2, 1.0, 1.42), (3, 0.0, 3.88), (4, 3.0, 9.8)):
        assert float((normals**power).mean()) == pytest.approx(expected, abs=4 * spread * error)


def test_the_distribution_is_normal_by_kolmogorov_and_smirnov(normals):
    for tap in normals.flatten(0, 1):
        found = cumulative(tap.sort().values)
        expected = (torch.arange(len(tap), dtype=torch.float64) + 0.5) / len(tap)
        # 1.95 / sqrt(n) is exceeded once in 1000.
        assert float((found - expected).abs().max()) < 1.95 / math.sqrt(len(tap))


def test_tails_are_as_thick_as_they_should_be(normals):
    for limit in (2.0, 3.0, 4.0, 4.5):
        expected = normals.numel() * float(torch.tensor(limit / math.sqrt(2.0)).double().erfc())
        for found in ((normals > limit).sum(), (normals < -limit).sum()):
            assert abs(float(found) - expected / 2) < 4.5 * math.sqrt(expected / 2)
    # The words that lie farthest out, and those nearest to zero.
    assert normal_pair(np.uint32(0), np.uint32(0))[0] == pytest.approx(6.66, abs=0.01)
    assert normal_pair(np.uint32(2**32 - 1), np.uint32(7)) == (0.0, 0.0)


def test_neighbours_are_independent(normals):
    ordered = normals.view(8, 2, SIDE, SIDE)
    flat = ordered[:4].reshape(-1)
    others = {
        "tap": (ordered[:, 0], ordered[:, 1]),
        "sample": (ordered[:-1], ordered[1:]),
        "pixel": (ordered[..., :-1], ordered[..., 1:]),
        "row": (ordered[..., :-1, :], ordered[..., 1:, :]),
        "frame": (flat, draw_noise(3, 5, 4, SIDE, SIDE).double().flatten()),
        "seed": (flat, draw_noise(4, 4, 4, SIDE, SIDE).double().flatten()),
        # Seeds that differ in their upper half alone.
        "high seed": (flat, draw_noise(3 + (1 << 40), 4, 4, SIDE, SIDE).double().flatten()),
    }
    for name, (one, other) in others.items():
        bound = 4.5 / math.sqrt(one.numel())
        assert abs(float((one * other).mean())) < bound, name
        # Squares too: a dependence of the size alone leaves products at zero.
        assert abs(float(((one**2 - 1) * (other**2 - 1)).mean())) < 2 * bound, name


def test_a_frame_has_the_same_noise_in_every_batch_and_as_a_prefix():
    seeds, frames = [7, 8, 1 << 62], [0, 5, 2**31]
    together = list(islice(noise_samples(seeds, frames, 40, 60), 8))
    for row, (seed, frame) in enumerate(zip(seeds, frames, strict=True)):
        for shots in (2, 4, 8):
            alone = draw_noise(seed, frame, shots, 40, 60)
            assert torch.equal(alone, torch.stack([sample[row] for sample in together[:shots]]))


def test_words_are_those_of_philox_as_published():
    """Known answers of Random123 for Philox-4x32-10, and the same loop run by Python."""
    words = np.zeros((4, BLOCK), np.uint32)
    normals = np.empty((2, 1, 2, 1), np.float32)
    zero = np.zeros(1, np.int64)
    fill_normals_(0, zero, zero, 0, words, normals)
    assert [f"{word:08x}" for word in words[:, 0]] == [
        "6627e8d5",
        "e169c58d",
        "bc57ac4c",
        "9b00dbd8",
    ]
    # A block more than one, and a part of one.
    found, slow = (np.empty((2, 1, 2, BLOCK + 3), np.float32) for _ in range(2))
    seeds, frames = np.array([-5]), np.array([9])
    fill_normals_(1, seeds, frames, 2, words, found)
    with np.errstate(over="ignore"):
        fill_normals_.py_func(1, seeds.astype(np.uint64), frames, 2, words, slow)
    assert np.array_equal(found, slow)
