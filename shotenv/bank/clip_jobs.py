"""The clips that a bank is made of: which family, world seed and split, in which folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from shotenv.bank.files import CLIP_RECORD, CLIPS
from shotenv.config import OWN, BankConfig, Family, MountConfig, Split


@dataclass(frozen=True)
class ClipJob:
    """Everything a worker needs to render one clip.

    `way` is the number of the clip in `config.own_scene`, None where the world is drawn. `url` is
    the place where the clip is published; None where it stays in its folder.
    """

    config: BankConfig
    name: str
    family: Family | Literal["own"]
    seed: int
    split: Split
    folder: Path
    frames: int
    mount: MountConfig
    way: int | None = None
    url: str | None = None

    @property
    def stands(self) -> bool:
        """Whether the clip is rendered; its record comes with its folder, whole or not at all."""
        return (self.folder / CLIP_RECORD).is_file()


def clip_jobs(config: BankConfig, folder: Path) -> tuple[ClipJob, ...]:
    """Clips of the bank in `folder`, in the order of `BankConfig.clips`, the families in turn.

    In a scene of one's own they are the ways through it. Where a car has several cameras, each
    world or way is a clip of each.
    """
    world, own = config.world, config.own_scene
    kinds: list[tuple[Split, Family | Literal["own"], int, int | None]]
    if own is None:
        kinds = [
            (split, family, world.frames_per_clip, None)
            for split, count, families in config.clips
            for _ in range(count)
            for family in families
        ]
    else:
        kinds = [
            (clip.split, OWN, clip.frames(world.frame_rate_hz), way)
            for way, clip in enumerate(own.clips)
        ]
    jobs = []
    for number, (split, family, frames, way) in enumerate(kinds):
        for mount in world.mounts:
            camera = f"-{mount.name}" if len(world.mounts) > 1 else ""
            name = f"{number:05d}-{family}{camera}"
            where, seed = folder / CLIPS / name, config.seed + number
            jobs.append(ClipJob(config, name, family, seed, split, where, frames, mount, way))
    return tuple(jobs)
