"""What a bank consists of on disk: its arrays, the record of a clip, the table of contents.

<bank>/manifest.json            written last: schema, configuration, one record per clip
<bank>/clips/<clip>/clip.json   the clip's own record, with a sha256 per array file
<bank>/clips/<clip>/*.npy       one array per quantity, frames first (see `ARRAYS`)
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from shotenv.config import BankConfig, Split

SCHEMA_VERSION: Final = 1
MANIFEST, CLIPS, CLIP_RECORD = "manifest.json", "clips", "clip.json"


class BankError(ValueError):
    """A bank that is missing, damaged or cannot be written; the message names file and cure."""


@dataclass(frozen=True)
class ArraySpec:
    """One array of a clip: its type, the shape of one frame (before height and width), its unit."""

    dtype: str
    channels: tuple[int, ...]
    unit: str

    def frame_bytes(self, height: int, width: int) -> int:
        """Bytes of one frame."""
        return int(np.prod((*self.channels, height, width))) * np.dtype(self.dtype).itemsize


ARRAYS: Mapping[str, ArraySpec] = {
    "correlation": ArraySpec("float32", (8,), "W m-2 sr-1 W-1"),
    "active": ArraySpec("float32", (), "W m-2 sr-1 W-1"),
    "ambient": ArraySpec("float32", (), "W m-2 sr-1"),
    "distance_m": ArraySpec("float32", (), "m"),
    "gray": ArraySpec("uint16", (), "LSB"),
}


class ClipRecord(BaseModel):
    """What the manifest tells of a clip: where it comes from and what each frame was."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,80}$")
    family: str = Field(pattern=r"^[A-Za-z0-9_-]{1,80}$")
    seed: int
    split: Split
    frames: int = Field(ge=1)
    folder: str = Field(pattern=r"^clips/[A-Za-z0-9_-]{1,80}$")
    time_s: tuple[float, ...]
    ego_speed_m_s: tuple[float, ...]
    yaw_rate_rad_s: tuple[float, ...]
    gray_exposure_s: tuple[float, ...]
    sha256: dict[str, str]

    @model_validator(mode="after")
    def _complete(self) -> ClipRecord:
        for field in ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s"):
            if len(getattr(self, field)) != self.frames:
                raise ValueError(f"{field} has {len(getattr(self, field))} values; expected frames")
        if set(self.sha256) != set(ARRAYS):
            raise ValueError(f"sha256 names {sorted(self.sha256)}; expected {sorted(ARRAYS)}")
        return self


class Manifest(BaseModel):
    """The bank's table of contents."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = SCHEMA_VERSION
    name: str
    height: int = Field(ge=1, le=4096)
    width: int = Field(ge=1, le=4096)
    units: dict[str, str]
    config: BankConfig | None
    clips: tuple[ClipRecord, ...] = Field(min_length=1)

    @property
    def fingerprint(self) -> str:
        """Sixteen hexadecimal digits that change when any array of the bank changes."""
        digest = hashlib.sha256()
        for clip in self.clips:
            digest.update(json.dumps([clip.name, sorted(clip.sha256.items())]).encode())
        return digest.hexdigest()[:16]


def frame_bytes(height: int, width: int) -> int:
    """Bytes that one frame takes on disk."""
    return sum(spec.frame_bytes(height, width) for spec in ARRAYS.values())
