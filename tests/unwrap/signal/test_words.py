"""Converter words: mid-scale, overflow, flags; and back."""

from __future__ import annotations

import pytest
import torch

from unwrap.signal.words import from_words, mid_scale, overflow, to_words


def frames(*words, dtype=torch.int32):
    return torch.tensor(words, dtype=dtype).view(1, 4, 1, -1)


@pytest.mark.parametrize("dtype", [torch.uint16, torch.int32, torch.int64])
def test_words_are_samples_above_mid_scale(dtype):
    raw = from_words(frames(2048, 2049, 1, 4094, dtype=dtype))
    assert raw.dcs_lsb.flatten().tolist() == [0.0, 1.0, -2047.0, 2046.0]
    assert raw.dcs_lsb.dtype == torch.float32
    assert not raw.saturated.any()
    assert torch.equal(to_words(raw.dcs_lsb), frames(2048, 2049, 1, 4094))
    assert (mid_scale(12), mid_scale(16)) == (2048, 32768)


def test_a_word_below_1_or_above_4094_overflows():
    words = frames(2048, 0, 2048, 1, 4095, 2048, 4094, 2048)
    assert overflow(words).flatten().tolist() == [False, True, False, False, True] + [False] * 3
    assert from_words(words).saturated.flatten().tolist() == [True, True]
    assert from_words(frames(1, 4094, 1, 4094)).saturated.item() is False


def test_the_sensor_s_own_flags_count():
    flags = torch.tensor([[[False, True]]])
    words = frames(*[2048] * 8)
    assert torch.equal(from_words(words, saturated=flags).saturated, flags)


def test_samples_beyond_the_range_become_overflowing_words():
    assert to_words(torch.tensor([-1e9, -2048.0, 0.4, 2047.0, 1e9])).tolist() == [
        0,
        0,
        2048,
        4095,
        4095,
    ]
    assert overflow(to_words(torch.tensor([1e9, 0.0]), bits=16), bits=16).tolist() == [True, False]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (torch.zeros(1, 4, 2, 2), "float32"),
        (torch.zeros(1, 3, 2, 2, dtype=torch.int32), "shape"),
        (torch.zeros(4, 2, 2, dtype=torch.int32), "shape"),
        (torch.zeros(1, 4, 0, 2, dtype=torch.int32), "shape"),
        (torch.full((1, 4, 2, 2), 4096), "4096"),
        (torch.full((1, 4, 2, 2), -1), "-1"),
    ],
)
def test_bad_words_are_refused(words, named):
    with pytest.raises(ValueError, match=named):
        from_words(words)


@pytest.mark.parametrize(
    "flags", [torch.zeros(1, 3, 2, dtype=torch.bool), torch.zeros(1, 1, 2, dtype=torch.uint8)]
)
def test_flags_that_do_not_fit_are_refused(flags):
    with pytest.raises(ValueError, match="saturated"):
        from_words(frames(*[2048] * 8), saturated=flags)
