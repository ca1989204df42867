"""A bank, open for reading, indexed by frame; and the one that has every pixel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from shotenv.bank.clip_arrays import ClipArrays, MappedClips, PackedClips
from shotenv.bank.files import (
    ARRAYS,
    BankError,
    Manifest,
    TableOfContents,
    TruthLevel,
    read_manifest,
)
from shotenv.config import TRAINING_FAMILIES, Split
from shotenv.sensor import Exposure
from unwrap.signal import Shots
from unwrap.training import RANDOM_SPLITS, random_split


@dataclass(frozen=True)
class Clip:
    """A run of consecutive frames: `start` is the bank index of the first."""

    name: str
    family: str
    seed: int
    split: Split
    start: int
    frames: int


@dataclass(frozen=True)
class BankFrame:
    """One frame with everything the bank knows about it.

    Attributes
    ----------
    exposure : Exposure
        Batch of one.
    gray : uint16 [H, W]
        Passive gray image, 12 bits.
    clip : Clip
        Where the frame belongs.
    time_s, ego_speed_m_s, yaw_rate_rad_s, gray_exposure_s : float
        Time in the clip; speed along the camera's heading and its yaw rate; exposure time of the
        gray image.
    """

    exposure: Exposure
    gray: Tensor
    clip: Clip
    time_s: float
    ego_speed_m_s: float
    yaw_rate_rad_s: float
    gray_exposure_s: float


class Bank(ABC):
    """Frames of many clips, indexed 0..len-1, clip after clip.

    `RenderedBank` has every pixel of its frames, `ThinnedBank` one of each few.

    Examples
    --------
    >>> bank = open_bank("starter")                                     # doctest: +SKIP
    >>> bank.frame(0).exposure.distance_m.shape                         # doctest: +SKIP
    torch.Size([1, 120, 160])
    """

    def __init__(self, folder: Path, manifest: TableOfContents) -> None:
        self.folder, self.manifest = Path(folder).resolve(), manifest
        starts = np.cumsum([0] + [clip.frames for clip in self.manifest.clips]).tolist()
        self.clips = tuple(
            Clip(c.name, c.family, c.seed, c.split, start, c.frames)
            for c, start in zip(self.manifest.clips, starts, strict=False)
        )
        # For each frame of the bank the number of its clip.
        self._clip_of_frame = np.repeat(np.arange(len(self.clips)), [c.frames for c in self.clips])
        self.time_s = self._per_frame("time_s")
        self.ego_speed_m_s = self._per_frame("ego_speed_m_s")
        self.yaw_rate_rad_s = self._per_frame("yaw_rate_rad_s")
        self.gray_exposure_s = self._per_frame("gray_exposure_s")

    def __reduce__(self):
        # Another process opens the files for itself.
        return (type(self), (self.folder,))

    def __len__(self) -> int:
        return len(self._clip_of_frame)

    @property
    def name(self) -> str:
        """What the bank is called."""
        return self.manifest.name

    @property
    def config(self):
        """Configuration the bank was rendered from, or None for an imported one."""
        return self.manifest.config

    @property
    def every(self) -> int:
        """One pixel of each square of so many down and across is there."""
        return 1

    @property
    def is_thinned(self) -> bool:
        """Whether pixels lack their neighbours."""
        return self.every > 1

    @property
    def height(self) -> int:
        """Pixels down."""
        return self.manifest.height

    @property
    def width(self) -> int:
        """Pixels across."""
        return self.manifest.width

    @property
    def is_recorded(self) -> bool:
        """Whether a camera delivered its frames; see `WordBank`."""
        return False

    @property
    def answers(self) -> tuple[Shots, ...]:
        """Acquisitions that frames can be taken with, ascending; of light all."""
        return tuple(Shots)

    @property
    def truth_level(self) -> TruthLevel:
        """What distances are scored against; rendered light knows."""
        return "external"

    @property
    def fingerprint(self) -> str:
        """Changes when any array of the bank changes."""
        return self.manifest.fingerprint

    def splits(self, split: str) -> tuple[Clip, ...]:
        """Clips of one split; "all" gives those of the families that are trained *and* tested on.

        "train" has those of the families for training only as well, where there are any.

        Raises
        ------
        BankError
            The bank has no clip in that split.
        """
        if split == "all":
            chosen = tuple(
                clip
                for clip in self.clips
                if clip.split != "shift" and clip.family not in TRAINING_FAMILIES
            )
        else:
            chosen = tuple(clip for clip in self.clips if clip.split == split)
        if not chosen:
            known = ", ".join(dict.fromkeys(clip.split for clip in self.clips))
            raise BankError(
                f"split is {split!r}, but bank {self.folder} only has {known}; choose "
                "one of these, or render a bank with clips of that split"
            )
        return chosen

    def frames(self, split: str, *, by: Literal["clip", "frame"] = "clip", seed: int = 0) -> Tensor:
        """Indices int64 [N] of the frames of one split, ascending.

        Parameters
        ----------
        split : str
            As in `splits`.
        by : "clip" or "frame"
            Those of whole clips; or the paper's random split, 80/10/10 of the frames of "all", in
            which neighbouring frames come to lie on both sides.
        seed : int
            Of the random split.

        Raises
        ------
        BankError
            The bank has no frame in that split.
        """
        if by == "clip":
            return _indices(self.splits(split))
        if split not in RANDOM_SPLITS:
            raise BankError(f"split is {split!r}; by frame, expected one of {RANDOM_SPLITS}")
        pool = _indices(self.splits("all"))
        return pool[torch.from_numpy(random_split(len(pool), seed=seed)[split])]

    def clip_of(self, index: int) -> Clip:
        """Clip that frame `index` belongs to."""
        return self.clips[self._clip_of_frame[self._checked(index)]]

    def frame(self, index: int) -> BankFrame:
        """Frame `index` with its metadata; IndexError outside 0..len-1."""
        index = self._checked(index)
        one = torch.tensor([index])
        return BankFrame(
            exposure=self.exposure(one),
            gray=self.gray(one)[0],
            clip=self.clip_of(index),
            time_s=float(self.time_s[index]),
            ego_speed_m_s=float(self.ego_speed_m_s[index]),
            yaw_rate_rad_s=float(self.yaw_rate_rad_s[index]),
            gray_exposure_s=float(self.gray_exposure_s[index]),
        )

    @abstractmethod
    def exposure(self, indices: Tensor) -> Exposure:
        """Noise-free light of the frames `indices` [B]."""

    @abstractmethod
    def distance_m(self, indices: Tensor) -> Tensor:
        """True radial distances float32 [B, H, W] of the frames `indices` [B], metres."""

    @abstractmethod
    def gray(self, indices: Tensor) -> Tensor:
        """Gray images uint16 [B, H, W] of the frames `indices` [B]."""

    def _per_frame(self, field: str) -> np.ndarray:
        return np.concatenate([np.asarray(getattr(clip, field)) for clip in self.manifest.clips])

    def _gathered(self, arrays: ClipArrays, name: str, indices: Sequence[int]) -> Tensor:
        """Array `name` of the frames `indices`, stacked; of a single one nothing is copied."""
        # Frame by frame: each lies in one piece in its clip's file, and only that is read.
        clips = [int(self._clip_of_frame[index]) for index in indices]
        frames = [
            arrays.frame(clip, name, index - self.clips[clip].start)
            for clip, index in zip(clips, indices, strict=True)
        ]
        return frames[0] if len(frames) == 1 else torch.cat(frames)

    def _checked(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame index is {index}; expected 0..{len(self) - 1}")
        return index


class RenderedBank(Bank):
    """A bank that has every pixel, memory-mapped or packed: see `BankConfig.storage`."""

    manifest: Manifest

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, read_manifest(Path(folder)))
        folders = [self.folder / clip.folder for clip in self.manifest.clips]
        if self.manifest.storage == "float32":
            self._arrays: ClipArrays = MappedClips(folders)
        else:
            self._arrays = PackedClips(folders, (self.height, self.width))

    def exposure(self, indices: Tensor) -> Exposure:
        """See `Bank.exposure`."""
        rows = indices.tolist()
        light = (name for name in ARRAYS if name != "gray")
        return Exposure(**{name: self._gathered(self._arrays, name, rows) for name in light})

    def distance_m(self, indices: Tensor) -> Tensor:
        """See `Bank.distance_m`."""
        return self._gathered(self._arrays, "distance_m", indices.tolist())

    def gray(self, indices: Tensor) -> Tensor:
        """See `Bank.gray`."""
        return self._gathered(self._arrays, "gray", indices.tolist())


def require_full(bank: Bank, what: str) -> None:
    """Refuse a thinned bank for `what`, which looks at pixels beside each other.

    Raises
    ------
    BankError
        Names the bank, what is asked of it, and the cure.
    """
    if bank.is_thinned:
        raise BankError(
            f"bank {bank.name} holds every {_ordinal(bank.every)} pixel; {what} needs neighbours: "
            "choose a rendered bank such as starter"
        )


def _ordinal(number: int) -> str:
    """2nd, 3rd, 4th, ..., 11th, ..., 22nd."""
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{'th' if number % 100 in (11, 12, 13) else ending}"


def _indices(clips: tuple[Clip, ...]) -> Tensor:
    return torch.cat([torch.arange(clip.start, clip.start + clip.frames) for clip in clips])
