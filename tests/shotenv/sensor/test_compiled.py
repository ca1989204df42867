"""Compiled loops: the same numbers as the Python they are written in, with or without a cache."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from shotenv.decision.score import score_pixels_, sum_pixels_
from shotenv.sensor import pixel_loops
from unwrap.support import compiled
from unwrap.support.compiled import array, loop

ROWS, COLUMNS = 5, 19


@pytest.fixture
def draw():
    """Random float32 arrays in [low, high)."""
    random = np.random.default_rng(0)
    return lambda shape, low=0.0, high=1.0: random.uniform(low, high, shape).astype(np.float32)


@pytest.fixture
def light(draw):
    frames = (2, ROWS, COLUMNS)
    correlation = draw((2, 8, ROWS, COLUMNS), -0.6, 0.6)
    per_light = draw(2, 4e4, 6e4), draw(2, 1e5, 2e5)
    return pixel_loops.IncidentLight(correlation, draw(frames), draw(frames), *per_light)


@pytest.fixture
def pixel():
    return pixel_loops.Pixel(*map(np.float32, (0.8, 83.0**2, 6e4, 0.0128, 5e-5, -2048, 2047)))


def test_a_sample_is_that_of_the_python_loop_to_the_last_bit(light, pixel, draw):
    normals = draw((2, 2, ROWS, COLUMNS), -3.0, 3.0)
    pattern_lsb = draw((2, ROWS, COLUMNS), -20.0, 20.0)
    parity = np.where(draw((ROWS, COLUMNS)) < 0.5, np.float32(-1), np.float32(1))
    found = []
    for take in (pixel_loops.take_sample_, pixel_loops.take_sample_.py_func):
        words = np.zeros((2, 2, ROWS, COLUMNS), np.float32)
        saturated = np.zeros((2, ROWS, COLUMNS), bool)
        take(1, light, normals, pattern_lsb, parity, pixel, words, saturated)
        found.append((words, saturated))
    (words, saturated), (slow_words, slow_saturated) = found
    assert np.array_equal(words, slow_words) and np.array_equal(saturated, slow_saturated)
    assert 0 < saturated.mean() < 1 and words[:, 1].std() > 10 and not words[:, 0].any()


def test_scored_pixels_and_noise_are_those_of_the_python_loop(light, pixel, draw):
    truth_m = draw((2, ROWS, COLUMNS), 0.0, 40.0)
    limits = np.float32(25.0), np.float32(100.0)
    found = [np.zeros((2, ROWS, COLUMNS), bool) for _ in range(2)]
    pixel_loops.mark_scored_(light, pixel, truth_m, *limits, found[0])
    pixel_loops.mark_scored_.py_func(light, pixel, truth_m, *limits, found[1])
    assert np.array_equal(*found) and 0.1 < found[0].mean() < 0.9
    gray, per_word = (4095 * draw((2, ROWS, COLUMNS))).astype(np.uint16), draw(2)
    noise = [np.empty_like(truth_m) for _ in range(2)]
    offset = draw(2), draw(2, 0.0, 0.01), np.float32(8.0)
    pixel_loops.noise_by_gray_(gray, per_word, np.float32(3.0), *offset, noise[0])
    pixel_loops.noise_by_gray_.py_func(gray, per_word, np.float32(3.0), *offset, noise[1])
    assert np.array_equal(*noise)


def test_gray_words_are_those_of_the_python_loop(pixel, draw):
    light, normals = draw((2, ROWS, COLUMNS)), draw((2, ROWS, COLUMNS), -3.0, 3.0)
    words = [np.zeros((2, ROWS, COLUMNS), np.int32) for _ in range(2)]
    for take, into in zip(
        (pixel_loops.take_gray_, pixel_loops.take_gray_.py_func), words, strict=True
    ):
        take(light, np.float32([2e4, 1e5]), normals, pixel._replace(low_lsb=np.float32(0)), into)
    assert np.array_equal(*words) and words[0].std() > 10


def test_scores_and_features_are_those_of_the_python_loops(draw):
    frames = (2, ROWS, COLUMNS)
    truth_m, distance_m = draw(frames, 0.0, 25.0), draw(frames, 0.0, 25.0)
    distance_m[0, 0, :3] = np.nan
    valid, scored, saturated = (draw(frames) < 0.7 for _ in range(3))
    found = [np.empty((6, 2)) for _ in range(2)]
    for score, into in zip((score_pixels_, score_pixels_.py_func), found, strict=True):
        scale_m, near_m = np.float32(0.5), np.float32(3.0)
        score(distance_m, valid, truth_m, scored, scale_m, near_m, 25.0, into)
    assert np.allclose(*found, rtol=1e-12)
    maps, predicted_m = [draw(frames, 0.1, 50.0) for _ in range(3)], draw(frames, 0.0, 25.0)
    sums = [np.empty((8, 2)) for _ in range(2)]
    for sum_pixels, into in zip((sum_pixels_, sum_pixels_.py_func), sums, strict=True):
        sum_pixels(*maps, valid, saturated, truth_m, predicted_m, truth_m, np.float32(4.0), into)
    assert np.allclose(*sums, rtol=1e-12)


def test_a_loop_is_compiled_where_nothing_can_be_kept(monkeypatch):
    def refusing(function):
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(compiled, "CodeCache", refusing)
    doubled = loop(lambda number: number + number)
    assert doubled(np.float32(2.5)) == 5.0


def test_arrays_share_the_memory_of_tensors_where_they_can():
    tensor = torch.zeros(3, 4)
    array(tensor)[1, 2] = 7.0
    assert tensor[1, 2] == 7.0
    for other in (tensor.double(), tensor[:, ::2]):
        copied = array(other)
        assert copied.flags.c_contiguous and copied.dtype == np.float32
        assert np.array_equal(copied, other.numpy())
    words = torch.zeros(3, dtype=torch.uint8)
    assert array(words, None).dtype == np.uint8
