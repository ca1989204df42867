"""What a bank consists of on disk: its arrays, the record of a clip, the table of contents.

A rendered bank:

<bank>/manifest.json            written last: schema, configuration, one record per clip
<bank>/clips/<clip>/clip.json   the clip's own record, with a sha256 per array file
<bank>/clips/<clip>/*.npy       one array per quantity, frames first (see `ARRAYS`); or
<bank>/clips/<clip>/*.zst       the same packed, where `storage` is float16 (see `packed.py`)

A thinned bank, one pixel of each few:

<bank>/thinned.json             written last: schema, positions, networks, configuration, clips
<bank>/arrays.npz               all arrays, frames first (see `THINNED_ARRAYS`)

A bank of recordings:

<bank>/recorded.json            written last: schema, camera, sensor, truth, one record per clip
<bank>/clips/<clip>/*.npy       one array per quantity (see `RecordedContents.arrays`)
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from shotenv.config import BankConfig, SensorConfig, Split, Storage

SCHEMA_VERSION: Final = 1
MANIFEST, CLIPS, CLIP_RECORD = "manifest.json", "clips", "clip.json"
THINNED_CONTENTS, THINNED_FILE = "thinned.json", "arrays.npz"
RECORDED_CONTENTS = "recorded.json"
PACKED_SUFFIX = ".zst"

PACKED_SHARE = 0.4
"""Of the bytes, that packed arrays take: measured .37 (docs/scale.md), and a margin."""

TruthLevel = Literal["external", "own", "none"]
"""What distances are scored against: a reference; the depth of a camera's own eight samples where
its two frequencies agree; or nothing."""


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

THINNED_ARRAYS: Mapping[str, ArraySpec] = {
    "correlation": ArraySpec("<f2", (8,), "active radiance of the pixel"),
    "active": ArraySpec("<f2", (), "active_unit"),
    "ambient": ArraySpec("<f2", (), "ambient_unit"),
    "distance": ArraySpec("<u2", (), "mm"),
    "gray": ArraySpec("<u2", (), "LSB"),
}
"""Maps of a thinned bank; what was made of its full frames comes on top."""


class ClipFacts(BaseModel):
    """What a manifest tells of a clip: where it comes from and what each frame was."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,80}$")
    family: str = Field(pattern=r"^[A-Za-z0-9_-]{1,80}$")
    seed: int
    split: Split
    frames: int = Field(ge=1)
    time_s: tuple[float, ...]
    ego_speed_m_s: tuple[float, ...]
    yaw_rate_rad_s: tuple[float, ...]
    gray_exposure_s: tuple[float, ...]

    @model_validator(mode="after")
    def _a_value_for_each_frame(self) -> Self:
        for field in ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s"):
            if len(getattr(self, field)) != self.frames:
                raise ValueError(f"{field} has {len(getattr(self, field))} values; expected frames")
        return self


class ClipRecord(ClipFacts):
    """A clip with a folder of its own, and the digest of each file in it."""

    folder: str = Field(pattern=r"^clips/[A-Za-z0-9_-]{1,80}$")
    sha256: dict[str, str]

    @model_validator(mode="after")
    def _a_digest_for_each_array(self) -> Self:
        if set(self.sha256) != set(ARRAYS):
            raise ValueError(f"sha256 names {sorted(self.sha256)}; expected {sorted(ARRAYS)}")
        return self


class TableOfContents(BaseModel):
    """What the tables of contents of all banks have.

    `height` and `width` are those of the maps that the bank holds.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = SCHEMA_VERSION
    # Where it is shown or made part of a path, it stays what it is.
    name: str = Field(pattern=r"^[^/\\\x00-\x1f\x7f]{1,200}$")
    height: int = Field(ge=1, le=4096)
    width: int = Field(ge=1, le=4096)
    config: BankConfig | None
    clips: tuple[ClipFacts, ...] = Field(min_length=1)

    @property
    def fingerprint(self) -> str:
        """Sixteen hexadecimal digits that change when any array of the bank changes."""
        raise NotImplementedError


def fingerprint_of(clips: Iterable[ClipRecord | RecordedClip]) -> str:
    """Changes when any array of the clips changes."""
    digest = hashlib.sha256()
    for clip in clips:
        digest.update(json.dumps([clip.name, sorted(clip.sha256.items())]).encode())
    return digest.hexdigest()[:16]


class Manifest(TableOfContents):
    """Table of contents of a rendered bank."""

    units: dict[str, str]
    clips: tuple[ClipRecord, ...] = Field(min_length=1)

    @property
    def storage(self) -> Storage:
        """How its arrays are stored; see `BankConfig.storage`."""
        return "float32" if self.config is None else self.config.storage

    @property
    def fingerprint(self) -> str:
        """See `TableOfContents.fingerprint`."""
        return fingerprint_of(self.clips)


class StoredNetwork(BaseModel):
    """A network whose predictions of the full frames are in a thinned bank."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[a-z0-9_]{1,80}$")
    fingerprint: str = Field(description="SHA-256 of its weights")
    macs: int = Field(ge=0, description="multiply-accumulates of a full frame")

    @property
    def distances(self) -> str:
        """Name of the array of its distances at the positions, float16 [N, H, W], metres."""
        return f"distance_{self.name}"

    @property
    def features(self) -> str:
        """Name of the array of the scene features, float32 [N, len(scene_features)]."""
        return f"features_{self.name}"


class ThinnedContents(TableOfContents):
    """Table of contents of a thinned bank."""

    config: BankConfig
    source: str = Field(description="fingerprint of the bank that it was made from")
    every: int = Field(ge=2, description="one pixel is drawn from each cell of so many squared")
    seed: int = Field(ge=0, description="that the positions were drawn with")
    rows: tuple[tuple[int, ...], ...] = Field(description="of the full frame, [H, W]")
    columns: tuple[tuple[int, ...], ...] = Field(description="of the full frame, [H, W]")
    scene_features: tuple[str, ...]
    probe: tuple[float, ...] = Field(description="their values on a made-up frame, by formula")
    networks: tuple[StoredNetwork, ...] = Field(min_length=1)
    # Powers of two: they round nothing.
    active_unit: float = Field(gt=0, description="what is stored as 1, W m-2 sr-1 W-1")
    ambient_unit: float = Field(gt=0, description="what is stored as 1, W m-2 sr-1")
    sha256: str = Field(description="of the file of arrays")

    @model_validator(mode="after")
    def _a_probe_of_each_feature(self) -> Self:
        if len(self.probe) != len(self.scene_features):
            raise ValueError(f"probe has {len(self.probe)} values; expected one per scene feature")
        return self

    @property
    def fingerprint(self) -> str:
        """See `TableOfContents.fingerprint`."""
        return self.sha256[:16]


class RecordedClip(ClipFacts):
    """A recording with a folder of its own: what it was made with, and the digest of each file."""

    folder: str = Field(pattern=r"^clips/[A-Za-z0-9_-]{1,80}$")
    source: str = Field(description="file that it was imported from")
    laser_power_w: float = Field(gt=0, description="optical power while on, W")
    integration_s: float = Field(gt=0, description="time of one sample, s")
    ambient_k: float = Field(gt=0, description="ambient temperature, K")
    shift_m: float = Field(description="added to every distance, m")
    sha256: dict[str, str]


class RecordedContents(TableOfContents):
    """Table of contents of a bank of recordings."""

    camera: str = Field(description="name of the camera's description")
    sensor: SensorConfig = Field(description="what the camera counts as")
    samples: Literal[4, 8] = Field(description="of a frame: at f1, and at f2")
    words: Literal["int16", "float32"] = Field(description="type of the samples, LSB")
    made: bool = Field(description="whether samples were made of phasors")
    truth: TruthLevel
    frame_rate_hz: float = Field(gt=0)
    clips: tuple[RecordedClip, ...] = Field(min_length=1)

    @property
    def fingerprint(self) -> str:
        """See `TableOfContents.fingerprint`."""
        return fingerprint_of(self.clips)

    def arrays(self, frames: int) -> dict[str, tuple[str, tuple[int, ...]]]:
        """Type and shape of each array of a clip of so many frames.

        Bit k of "saturated" is set where sample k is no sample. "distance_m" is there with external
        truth; NaN where there is no reference.
        """
        size = (self.height, self.width)
        found = {
            "words": (self.words, (frames, self.samples, *size)),
            "saturated": ("uint8", (frames, *size)),
            "gray": ("uint16", (frames, *size)),
            "offset_lsb": ("float32", size),
        }
        if self.truth == "external":
            found["distance_m"] = ("float32", (frames, *size))
        return found

    @model_validator(mode="after")
    def _eight_samples_for_their_own_truth(self) -> Self:
        if self.truth == "own" and self.samples != 8:
            raise ValueError(f"truth is 'own' of {self.samples} samples; expected 8")
        return self

    @model_validator(mode="after")
    def _a_digest_for_each_array(self) -> Self:
        for clip in self.clips:
            if set(clip.sha256) != set(self.arrays(clip.frames)):
                raise ValueError(
                    f"sha256 of clip {clip.name} names {sorted(clip.sha256)}; expected "
                    f"{sorted(self.arrays(clip.frames))}"
                )
        return self


def array_file(name: str, storage: Storage) -> str:
    """Name of the file of array `name` in a clip's folder."""
    return f"{name}{PACKED_SUFFIX if storage == 'float16' else '.npy'}"


def frame_bytes(height: int, width: int, storage: Storage = "float32") -> int:
    """Bytes that one frame takes on disk; packed, about so many."""
    mapped = sum(spec.frame_bytes(height, width) for spec in ARRAYS.values())
    return mapped if storage == "float32" else round(PACKED_SHARE * mapped)
