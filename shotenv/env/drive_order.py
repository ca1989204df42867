"""Which drive an environment plays next: always a new one, or the same few again and again."""

from __future__ import annotations

from typing import Any

import numpy as np


def drive_seed(generator: np.random.Generator) -> int:
    """Seed of a new drive."""
    # Seeds of drives are kept in int64 tensors, so they stay below 2^63.
    return int(generator.integers(2**62))


def check_drives(drives: Any) -> int | None:
    """Number of drives that come again and again, or None for new ones.

    Raises
    ------
    ValueError
        It is neither None nor a whole number of at least 1.
    """
    if drives is None:
        return None
    if isinstance(drives, bool) or not isinstance(drives, int | np.integer) or drives < 1:
        raise ValueError(
            f"drives is {drives!r}; expected None (always new drives) or a whole number of at "
            "least 1 (the same drives again and again)"
        )
    return int(drives)


class DriveOrder:
    """Seeds of the drives of one environment, one after another.

    Without `drives` every drive is new. With it they are the drives of seeds 0 to `drives` - 1,
    the same whatever the environment's seed, which decides their order alone: each comes once in
    a round, and every round has an order of its own.
    """

    def __init__(self, drives: int | None = None) -> None:
        self.drives = drives
        self._left: list[int] = []

    def next_seed(self, generator: np.random.Generator) -> int:
        """Seed of the next drive, by the environment's own random numbers."""
        if self.drives is None:
            return drive_seed(generator)
        if not self._left:
            self._left = generator.permutation(self.drives).tolist()
        return self._left.pop()
