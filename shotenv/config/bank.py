"""Configuration of a bank: worlds, the camera that looks at them, number of clips."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator

from shotenv.config.emission import EmissionConfig
from shotenv.config.families import (
    FAMILIES,
    SHIFT_FAMILIES,
    TRAINING_FAMILIES,
    Family,
    Split,
)
from shotenv.config.mounts import MountConfig
from shotenv.config.own_scene import OwnSceneConfig
from shotenv.config.sensor import SensorConfig
from unwrap.support import NonNegative, Positive, Range, Section, check_range

HIGHEST_SPEED_M_S = 60.0
"""Of the ego: faster than any car that a sensor of 25 m would be put on."""

MOST_FRAMES, MOST_CLIPS = 4096, 10**6
"""Of one clip; of a split and family (assumed: more would not fit on any disk)."""

Storage = Literal["float32", "float16"]


class CameraConfig(Section):
    """Image geometry, the laser beside the lens, and the instants that are rendered."""

    width: int = Field(160, ge=16, le=1280, description="pixels across")
    height: int = Field(120, ge=16, le=960, description="pixels down")
    horizontal_fov_deg: float = Field(60.0, gt=5, lt=150, description="horizontal field of view")
    samples_per_pixel: int = Field(
        4, ge=1, le=4096, description="camera rays per pixel and instant"
    )
    gray_instants: int = Field(4, ge=1, le=16, description="instants that make the gray image")
    bounces: int = Field(2, ge=1, le=8, description="surface hits of a light path")
    gray_filter_m: NonNegative = Field(
        0.3,
        le=100.0,
        description="reach of the gray light's filter along a plane, m; 0 filters nothing",
    )
    emission: EmissionConfig = EmissionConfig()

    @property
    def half_extents(self) -> tuple[float, float]:
        """Tangents of half the horizontal and half the vertical field of view; square pixels."""
        across = math.tan(math.radians(self.horizontal_fov_deg) / 2)
        return across, across * self.height / self.width

    @model_validator(mode="after")
    def _emission_covers_the_view(self) -> CameraConfig:
        across, down = self.half_extents
        wider = math.degrees(math.atan(max(across, down)))
        self.emission.check_covers(wider, math.degrees(math.atan(math.hypot(across, down))))
        return self


class WorldConfig(Section):
    """Which worlds are drawn and how a clip moves through them."""

    families: tuple[Family, ...] = Field(FAMILIES, min_length=1, description="scene families")
    speed_m_s: Range = Field(
        (0.0, 15.0), description="ego speed, m/s; it stands and reverses only if the first is 0"
    )
    frame_rate_hz: Positive = Field(
        10.0, ge=1e-3, le=1e4, description="frames per second of a clip"
    )
    frames_per_clip: int = Field(16, ge=1, le=MOST_FRAMES, description="frames of one clip")
    mounts: tuple[MountConfig, ...] = Field(
        (MountConfig(),), min_length=1, description="sensor modules of the car, a clip for each"
    )

    @model_validator(mode="after")
    def _consistent(self) -> WorldConfig:
        check_range("speed_m_s", self.speed_m_s)
        low, high = self.speed_m_s
        if low < 0 or high > HIGHEST_SPEED_M_S:
            raise ValueError(
                f"speed_m_s is ({low:g}, {high:g}); expected speeds from 0 to {HIGHEST_SPEED_M_S:g}"
            )
        names = [mount.name for mount in self.mounts]
        if len(set(names)) < len(names):
            raise ValueError(f"mounts are named {', '.join(names)}; expected each name once")
        return self


class BankConfig(Section):
    """A bank of rendered clips: which worlds, how many of each family per split."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_-]{1,80}$", description="name of the bank and of its folder"
    )
    sensor: SensorConfig
    camera: CameraConfig = CameraConfig()
    world: WorldConfig = WorldConfig()
    seed: int = Field(0, ge=0, le=2**62, description="first world seed; clip i has seed + i")
    train_clips: int = Field(8, ge=0, le=MOST_CLIPS, description="training clips of each family")
    validation_clips: int = Field(
        3, ge=0, le=MOST_CLIPS, description="validation clips of each family"
    )
    test_clips: int = Field(3, ge=0, le=MOST_CLIPS, description="test clips of each family")
    shift_clips: int = Field(0, ge=0, le=MOST_CLIPS, description="clips of each held-out family")
    shift_mean_speed_m_s: NonNegative = Field(
        0.3, description="mean ego speed over a clip of a held-out family is at least this, m/s"
    )
    clutter_clips: int = Field(
        0,
        ge=0,
        le=MOST_CLIPS,
        description="further training clips, of the family for training only",
    )
    storage: Storage = Field(
        "float32",
        description="arrays on disk: float32, mapped into memory; or float16, compressed",
    )
    own_scene: OwnSceneConfig | None = Field(
        None, description="scene of a file in place of drawn ones; `--scene` makes it"
    )

    @property
    def clips(self) -> tuple[tuple[Split, int, tuple[Family, ...]], ...]:
        """Clips in their order: split, number of clips of each of its families, those families."""
        seen = self.world.families
        # Held-out clips come after those of the known families, and clutter last, so that numbers
        # and seeds of what is judged on do not depend on what is added.
        return (
            ("train", self.train_clips, seen),
            ("validation", self.validation_clips, seen),
            ("test", self.test_clips, seen),
            ("shift", self.shift_clips, SHIFT_FAMILIES),
            ("train", self.clutter_clips, TRAINING_FAMILIES),
        )

    @model_validator(mode="after")
    def _consistent(self) -> BankConfig:
        if not any(count for _, count, _ in self.clips):
            raise ValueError(
                "train_clips, validation_clips, test_clips, shift_clips and clutter_clips are all "
                "0; expected at least one clip"
            )
        # Clips of a family in two splits would let what is held out be learnt.
        held_out = sorted(set(self.world.families) & set(SHIFT_FAMILIES))
        if self.shift_clips and held_out:
            raise ValueError(
                f"world.families has {', '.join(held_out)}, which shift_clips = "
                f"{self.shift_clips} holds out; expected other families, or shift_clips = 0"
            )
        only_trained_on = sorted(set(self.world.families) & set(TRAINING_FAMILIES))
        if only_trained_on:
            raise ValueError(
                f"world.families has {', '.join(only_trained_on)}, which is for training only; "
                "expected other families, and clutter_clips for its clips"
            )
        fastest_m_s = self.world.speed_m_s[1]
        if self.shift_clips and self.shift_mean_speed_m_s > fastest_m_s:
            raise ValueError(
                f"shift_mean_speed_m_s is {self.shift_mean_speed_m_s:g}; expected at most the "
                f"upper end of world.speed_m_s, {fastest_m_s:g}"
            )
        return self
