"""The paper's split: frames drawn at random, whatever clip they come from."""

from __future__ import annotations

import numpy as np

RANDOM_SPLITS = ("train", "validation", "test")
FEWEST_FRAMES = 10
"""So that a tenth of them is at least one."""


def random_split(frames: int, *, seed: int = 0) -> dict[str, np.ndarray]:
    """Frame numbers 0..frames-1 dealt at random into train, validation and test, 80/10/10.

    Neighbouring frames of a clip look alike, so scores on such a test set flatter; it is there to
    compare with results that were got this way.

    Parameters
    ----------
    frames : int
        At least `FEWEST_FRAMES`, so that no part is empty.
    seed : int
        The same numbers give the same split on any machine.

    Returns
    -------
    dict of int64 arrays
        Ascending; each frame is in exactly one of `RANDOM_SPLITS`.

    Raises
    ------
    ValueError
        Too few frames.
    """
    if frames < FEWEST_FRAMES:
        raise ValueError(f"frames is {frames}; a random split needs at least {FEWEST_FRAMES}")
    tenth = round(frames / 10)
    order = np.random.default_rng(seed).permutation(frames)
    parts = np.split(order, (frames - 2 * tenth, frames - tenth))
    return {name: np.sort(part) for name, part in zip(RANDOM_SPLITS, parts, strict=True)}
