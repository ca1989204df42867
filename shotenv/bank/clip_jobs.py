"""The clips that a bank is made of: which family, world seed and split, in which folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shotenv.bank.layout import CLIP_RECORD, CLIPS
from shotenv.config import BankConfig, Family, Split


@dataclass(frozen=True)
class ClipJob:
    """Everything a worker needs to render one clip."""

    config: BankConfig
    name: str
    family: Family
    seed: int
    split: Split
    folder: Path

    @property
    def stands(self) -> bool:
        """Whether the clip is rendered; its record comes with its folder, whole or not at all."""
        return (self.folder / CLIP_RECORD).is_file()


def clip_jobs(config: BankConfig, folder: Path) -> tuple[ClipJob, ...]:
    """Clips of the bank in `folder`, in the order of `BankConfig.clips`, the families in turn."""
    kinds = [
        (split, family)
        for split, count, families in config.clips
        for _ in range(count)
        for family in families
    ]
    names = [f"{number:05d}-{family}" for number, (_, family) in enumerate(kinds)]
    return tuple(
        ClipJob(config, name, family, config.seed + number, split, folder / CLIPS / name)
        for number, (name, (split, family)) in enumerate(zip(names, kinds, strict=True))
    )
