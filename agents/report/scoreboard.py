"""The picture of a match: the frame to take, both sides' score, energy and heat, the last frame."""

from __future__ import annotations

import numpy as np

from agents.evaluation import Match, Tally
from unwrap.pictures import (
    FAINT,
    GRAY,
    LARGE_PX,
    SMALL_PX,
    ColorMap,
    column,
    enlarged,
    line,
    paint,
    text,
)

KEYS_LINE = "keys: 2, 4, 8 samples from now on; space pauses; q ends"
ZERO_C_K = 273.15
NOW_PX = 240
"""Least width of the gray image of the frame that is to be taken."""


def match_picture(match: Match, rival: str, words: str = KEYS_LINE) -> np.ndarray:
    """Picture uint8 [h, w, 3] of a match against the policy named `rival`."""
    # The square root brightens the shadows.
    gray = paint(np.sqrt(match.now()), ColorMap(0.0, 1.0, "full scale", GRAY, (0, 0, 0)))
    heading = f"frame {match.person.frames} of {match.frames}"
    told = column(
        [
            text(heading, LARGE_PX),
            *(text(one, SMALL_PX) for one in lines_of("you", match.person)),
            *(text(one, SMALL_PX) for one in lines_of(rival, match.rival)),
            text(words, SMALL_PX, FAINT),
        ]
    )
    top = np.asarray(line([enlarged(gray, NOW_PX), told], gap=12))
    below = match.env.render()
    assert below is not None  # a match renders
    width = max(top.shape[1], below.shape[1])
    return np.vstack([_widened(top, width), _widened(below, width)])


def lines_of(name: str, tally: Tally) -> tuple[str, str]:
    """What one side has come to, in two lines."""
    numbers = tally.numbers
    counts = " / ".join(str(count) for count in tally.taken[1:])
    return (
        f"{name}: score {numbers['return']:+.2f}, laser {numbers['laser_energy_j']:.2f} J, "
        f"{tally.temperature_k - ZERO_C_K:.1f} C",
        f"    2/4/8 samples in {counts} frames, laser off in {tally.taken[0]}; "
        f"error {numbers['depth_mae_m']:.2f} m",
    )


def _widened(picture: np.ndarray, width: int) -> np.ndarray:
    """`picture` with white at its right."""
    missing = width - picture.shape[1]
    return np.pad(picture, ((0, 0), (0, missing), (0, 0)), constant_values=255)
