"""The random split of frames."""

import numpy as np
import pytest

from unwrap.training.splits import FEWEST_FRAMES, RANDOM_SPLITS, random_split


@pytest.mark.parametrize("frames", [FEWEST_FRAMES, 11, 64, 2000, 2048])
def test_every_frame_is_in_exactly_one_part_of_80_10_10(frames):
    parts = random_split(frames)
    assert tuple(parts) == RANDOM_SPLITS
    assert np.array_equal(np.sort(np.concatenate(list(parts.values()))), np.arange(frames))
    for name, share in zip(RANDOM_SPLITS, (0.8, 0.1, 0.1), strict=True):
        assert abs(len(parts[name]) - share * frames) <= 1
        assert (np.diff(parts[name]) > 0).all()


def test_the_seed_alone_decides():
    first, again, other = random_split(100), random_split(100, seed=0), random_split(100, seed=1)
    assert all(np.array_equal(first[name], again[name]) for name in RANDOM_SPLITS)
    assert not np.array_equal(first["test"], other["test"])


def test_a_random_split_leaks_neighbours_and_that_is_its_point():
    frames_per_clip = 8
    parts = random_split(2000)
    clips = {name: set((part // frames_per_clip).tolist()) for name, part in parts.items()}
    assert len(clips["test"] & clips["train"]) > 0.9 * len(clips["test"])


def test_too_few_frames_are_refused():
    with pytest.raises(ValueError, match=r"frames is 9; .* at least 10"):
        random_split(9)
