"""A bank of recordings on disk: what cameras delivered, memory-mapped."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor

from shotenv.bank.bank import Clip
from shotenv.bank.clip_arrays import MappedClips
from shotenv.bank.files import RecordedContents, TruthLevel, read_recorded_contents
from shotenv.bank.word_bank import ClipSettings, WordBank
from unwrap.signal import RawFrame, Shots


class RecordedBank(WordBank):
    """Recordings that `shotenv bank import` has put in one order and unit.

    Raises
    ------
    BankError
        A file is missing or damaged.
    """

    manifest: RecordedContents

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, read_recorded_contents(Path(folder)))
        folders = [self.folder / clip.folder for clip in self.manifest.clips]
        self._arrays = MappedClips(folders, self.manifest.arrays(1))
        self._records = {clip.name: clip for clip in self.manifest.clips}

    @property
    def truth_level(self) -> TruthLevel:
        """See `WordBank.truth_level`."""
        return self.manifest.truth

    @property
    def answers(self) -> tuple[Shots, ...]:
        """See `WordBank.answers`."""
        return tuple(shots for shots in Shots if shots <= self.manifest.samples)

    def words(self, frames: Tensor, shots: Shots) -> RawFrame:
        """See `WordBank.words`."""
        rows = frames.tolist()
        samples = self._gathered(self._arrays, "words", rows)[:, :shots]
        flags = self._gathered(self._arrays, "saturated", rows)
        return RawFrame(samples.to(torch.float32), (flags & (2**shots - 1)) != 0)

    def settings(self, clip: Clip) -> ClipSettings:
        """See `WordBank.settings`."""
        about = self._records[clip.name]
        return ClipSettings(
            laser_power_w=about.laser_power_w,
            integration_s=about.integration_s,
            ambient_k=about.ambient_k,
            shift_m=about.shift_m,
            offset_lsb=self._arrays[self.clips.index(clip)]["offset_lsb"],
        )

    def distance_m(self, indices: Tensor) -> Tensor:
        """See `WordBank.distance_m`; NaN everywhere without external truth."""
        if self.truth_level != "external":
            return torch.full((len(indices), self.height, self.width), torch.nan)
        return self._gathered(self._arrays, "distance_m", indices.tolist())

    def gray(self, indices: Tensor) -> Tensor:
        """See `Bank.gray`."""
        return self._gathered(self._arrays, "gray", indices.tolist())
