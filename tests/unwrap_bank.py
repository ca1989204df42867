"""A bank folder of the documented layout with a floor and a wall, for the unwrapping tests."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

HEIGHT, WIDTH, FRAMES = 48, 64, 2


def write_bank(
    root: Path, train: int = 4, validation: int = 1, test: int = 1, shift: int = 0
) -> Path:
    """Write gray images that darken with distance, and their distances; the sky is infinite."""
    random = np.random.default_rng(0)
    clips = []
    counts = {"train": train, "validation": validation, "test": test, "shift": shift}
    for split, count in counts.items():
        for index in range(count):
            folder = f"clips/{split}-{index}"
            write_clip(root / folder, random)
            clips.append({"name": folder, "family": "garage", "split": split, "folder": folder})
    (root / "manifest.json").write_text(json.dumps({"clips": clips}))
    return root


def write_clip(folder: Path, random: np.random.Generator) -> None:
    """A wall at a drawn distance over a floor seen from 1 m above."""
    folder.mkdir(parents=True)
    down = np.linspace(-0.5, 0.5, HEIGHT)[:, None] * np.ones((FRAMES, 1, WIDTH))
    wall_m = random.uniform(3, 22, size=(FRAMES, 1, 1))
    distance = np.minimum(1 / np.maximum(down, 1e-3), wall_m).astype(np.float32)
    distance[:, :4] = np.inf
    gray = 1 / (1 + np.minimum(distance, 40) / 3) + random.normal(0, 0.01, distance.shape)
    np.save(folder / "gray.npy", (4095 * gray.clip(0, 1)).astype(np.uint16))
    np.save(folder / "distance_m.npy", distance)
