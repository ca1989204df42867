"""Gray images and true depths of a bank folder, as tensors for training.

A bank is a folder with `manifest.json` and one folder per clip::

    manifest.json               {"clips": [{"name", "family", "split", "folder", ...}, ...], ...}
    <folder>/gray.npy           uint16  [F, H, W]     passive gray image, 0 .. 4095
    <folder>/distance_m.npy     float32 [F, H, W]     true radial distance, inf for the sky
    <folder>/correlation.npy    float32 [F, 8, H, W]  noise-free samples (not read here)
    <folder>/active.npy, ambient.npy   float32 [F, H, W]  light (not read here)

Arrays are memory mapped and never unpickled.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset, Sampler

from unwrap.splits import RANDOM_SPLITS, random_split

SplitBy = Literal["clip", "frame"]
GRAY_FULL_SCALE = 4095
"""Largest word of the 12-bit gray image."""


@dataclass(frozen=True)
class Augmentation:
    """How training images are varied.

    Attributes
    ----------
    flip_horizontal, flip_vertical : bool
        Mirror half of the images about that axis. The paper does both; upside down, a road
        camera's image no longer tells where the ground is.
    contrast : float
        Gray is raised to a power drawn from [1 / (1 + contrast), 1 + contrast].
    brightness : float
        Gray is multiplied by a factor drawn from the same kind of interval, then clipped at 1.
    """

    flip_horizontal: bool = True
    flip_vertical: bool = False
    contrast: float = 0.2
    brightness: float = 0.3

    def __call__(
        self, gray: Tensor, depth_m: Tensor, *, generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Vary gray [B, 1, H, W] in [0, 1] and its depth [B, H, W] alike; fresh tensors."""
        batch = len(gray)
        sideways, upside = torch.rand(2, batch, generator=generator) < 0.5
        exponent, factor = 2 * torch.rand(2, batch, generator=generator) - 1
        if self.flip_horizontal:
            gray, depth_m = _flip(gray, sideways, -1), _flip(depth_m, sideways, -1)
        if self.flip_vertical:
            gray, depth_m = _flip(gray, upside, -2), _flip(depth_m, upside, -2)
        gamma = (1 + self.contrast) ** exponent.to(gray.device)
        gain = (1 + self.brightness) ** factor.to(gray.device)
        gray = gray ** gamma[:, None, None, None] * gain[:, None, None, None]
        return gray.clamp(0, 1), depth_m


def _flip(images: Tensor, chosen: Tensor, axis: int) -> Tensor:
    chosen = chosen.to(images.device).reshape(-1, *[1] * (images.ndim - 1))
    return torch.where(chosen, images.flip(axis), images)


class BankFrames(Dataset):
    """Every frame of one split of a bank: (gray, depth_m).

    Gray is float32 [1, H, W] in [0, 1]; depth float32 [H, W] in metres, no farther than `range_m`
    (also the sky).

    Parameters
    ----------
    bank : Path
        Folder of the bank.
    split : str
        "train", "validation", "test" or "shift".
    range_m : float
        Distance at which truth is clamped, metres.
    by : "clip" or "frame"
        Whole clips, as the manifest assigns them; or the paper's `random_split` of all frames
        but those of the shift split.

    Raises
    ------
    ValueError
        No manifest, no clip of that split, or a clip whose arrays are missing or misshapen; the
        message names the file.
    """

    def __init__(self, bank: Path, split: str, range_m: float, *, by: SplitBy = "clip"):
        self.range_m = range_m
        splits = (split,) if by == "clip" else RANDOM_SPLITS
        clips = [clip for clip in read_clips(bank) if clip["split"] in splits]
        if not clips or (by == "frame" and split not in RANDOM_SPLITS):
            raise ValueError(
                f"{bank}: no {by} of split {split!r}; render more clips or pick another bank"
            )
        frames = [
            (bank / clip["folder"], frame, clip["family"])
            for clip in clips
            for frame in range(len(open_array(bank / clip["folder"] / "gray.npy", np.uint16)))
        ]
        if by == "frame":
            frames = [frames[number] for number in random_split(len(frames))[split]]
        self._frames = [(folder, frame) for folder, frame, _ in frames]
        self.families = [family for *_, family in frames]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._frames)

    def __getitem__(self, index: int) -> tuple[Tensor, Tensor]:
        """Gray and depth of one frame."""
        folder, frame = self._frames[index]
        gray = open_array(folder / "gray.npy", np.uint16)[frame].astype(np.float32)
        distance = open_array(folder / "distance_m.npy", np.float32)[frame]
        depth_m = np.minimum(distance, np.float32(self.range_m))
        return torch.from_numpy(gray / GRAY_FULL_SCALE)[None], torch.from_numpy(depth_m)


def read_clips(bank: Path) -> list[dict[str, Any]]:
    """Clips that the manifest of `bank` lists.

    Raises
    ------
    ValueError
        The manifest is missing or damaged, or names a folder outside the bank.
    """
    path = bank / "manifest.json"
    try:
        clips = json.loads(path.read_text())["clips"]
        known = [
            {key: str(clip[key]) for key in ("name", "family", "split", "folder")} for clip in clips
        ]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: not the manifest of a bank ({error}); render the bank") from None
    root = bank.resolve()
    for clip in known:
        if not (root / clip["folder"]).resolve().is_relative_to(root):
            raise ValueError(f"{path}: clip folder {clip['folder']!r} lies outside the bank")
    return known


def open_array(path: Path, dtype: type) -> np.ndarray:
    """Memory-mapped [F, H, W] array of a clip.

    Raises
    ------
    ValueError
        Missing, damaged, pickled, or of another type or number of dimensions.
    """
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise ValueError(f"{path}: unreadable ({error}); render the bank again") from None
    if array.dtype != dtype or array.ndim != 3:
        raise ValueError(
            f"{path}: {array.dtype} with {array.ndim} dimensions; expected "
            f"{np.dtype(dtype)} [F, H, W]"
        )
    return array


class EpochShuffle(Sampler[int]):
    """A new order of `length` items each epoch that depends on seed and epoch alone."""

    def __init__(self, length: int, seed: int):
        self.length, self.seed, self.epoch = length, seed, 0

    def set_epoch(self, epoch: int) -> None:
        """Choose the order; the training loop calls this before each epoch."""
        self.epoch = epoch

    def __iter__(self) -> Iterator[int]:
        """Indices in this epoch's order."""
        return iter(
            np.random.default_rng((self.seed, self.epoch)).permutation(self.length).tolist()
        )

    def __len__(self) -> int:
        """Number of items."""
        return self.length
