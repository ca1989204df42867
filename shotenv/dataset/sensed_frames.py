"""Frames of a bank as a sensor delivers them: what networks are trained and judged on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import torch
from torch import Tensor

from shotenv.bank import Bank, check_fits, require_full
from shotenv.config import EnvConfig
from shotenv.dataset.map_cache import MapCache
from shotenv.decision import Drive, draw_drive
from shotenv.sensor import (
    Exposure,
    Purpose,
    acquire,
    description_of,
    incident_light,
    noise_samples,
    sample_noise_lsb,
    scored_pixels,
    stream_seed,
)
from unwrap.depth import correct_sensed, move_depth
from unwrap.signal import GRAY_FULL_SCALE, Memory, Sensed, SensorDescription, Shots, Truth
from unwrap.support import concatenate, mapped

TruthOf = Literal["rendered", "measured"]
RECORDED_DRAW = 0
"""Draw of the eight samples that measured truth is made of: it is recorded once."""
# What the caches of one object may hold, 10^6 bytes. At 320 x 240 a drive's sensor has .6 MB of
# offset maps, which all frames of its clip share; a frame's measured truth has .4 MB and is asked
# for in every epoch: there is room for 2600 frames, more than `nearfield` has.
DRIVES_MB, MEASURED_TRUTH_MB = 64, 1000


class SensedFrames:
    """Some frames of a bank through a sensor; each draw has other noise, laser and imager.

    A draw gives every clip its own laser power, integration time, temperature and offset pattern,
    as a drive has them, and every frame its own noise; the same draw gives the same numbers,
    whatever the batch.

    Parameters
    ----------
    bank : Bank
    frames : int64 [N]
        Bank indices.
    config : EnvConfig
        Of it the sensor, the laser and the frame rate.
    range_m : float
        Truth beyond, and the sky, counts as this, metres.
    truth : "rendered" or "measured"
        The rendered distance, or the sensor's own from eight samples, where its frequencies agree.
    stride : int
        Every how many rows and columns are used.
    remembers : bool
        Whether frames with samples come with the depth of the frame before.
    gray_only : bool
        Frames are only asked for without samples, so that a bank of another sensor will do.

    Raises
    ------
    ValueError
        The bank was rendered for another sensor, now or as samples are asked for; or is thinned.
    """

    def __init__(
        self,
        bank: Bank,
        frames: Tensor,
        config: EnvConfig,
        *,
        range_m: float,
        truth: TruthOf = "rendered",
        stride: int = 1,
        remembers: bool = False,
        gray_only: bool = False,
    ) -> None:
        require_full(bank, "training and judging networks")
        if not gray_only:
            check_fits(bank, config.sensor)
        self.bank, self.frames, self.range_m = bank, frames, range_m
        self.truth_of, self.stride, self.remembers = truth, stride, remembers
        # Of a drive only the sensor is used, not its course: its frames are drawn in vain.
        self._config = config.model_copy(update={"frames_per_drive": 2})
        self.sensor: SensorDescription = description_of(config.sensor)
        self.families = [bank.clip_of(index).family for index in frames.tolist()]
        self._drive = MapCache(self._draw_drive, largest_mb=DRIVES_MB)
        self._recorded = MapCache(self._measure_truth, largest_mb=MEASURED_TRUTH_MB)

    @property
    def held_out_families(self) -> tuple[str, ...]:
        """Kinds of scene that the bank keeps from training, for its split "shift"."""
        held_out = (clip.family for clip in self.bank.clips if clip.split == "shift")
        return tuple(dict.fromkeys(held_out))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.frames)

    def batch(
        self, numbers: Sequence[int], *, draw: int, shots: Shots | None
    ) -> tuple[Sensed, Truth]:
        """The frames at `numbers` with `shots` samples each, or None; and what is true of them."""
        frames = self.frames[list(numbers)]
        sensed = self._sensed(frames, draw, shots)
        if self.remembers and shots is not None:
            sensed = replace(sensed, memory=self._memory(frames, draw, shots))
        return sensed, self._truth(frames)

    def scored(self, numbers: Sequence[int], *, draw: int) -> Tensor:
        """Pixels that count, bool [B, H, W]: truth within the range, signal to noise enough."""
        frames = self.frames[list(numbers)]
        drive = self._drives(frames, draw)
        exposure = self._exposure(frames)
        light = incident_light(exposure, drive.sensitivity)
        return scored_pixels(light, exposure.distance_m, self._config.sensor)

    def follows(self, number: int) -> bool:
        """Whether the frame at `number` comes right after the one at `number - 1`, in a clip."""
        index = int(self.frames[number])
        starts = self.bank.clip_of(index).start == index
        # Frames of a split need not be neighbours in the bank.
        return number > 0 and not starts and int(self.frames[number - 1]) == index - 1

    def warp(self, distance_m: Tensor, numbers: Sequence[int]) -> Memory:
        """Distances [B, H, W] of the frames before, as the frames at `numbers` would see them."""
        return self._warp(distance_m, self.frames[list(numbers)])

    def _warp(self, distance_m: Tensor, frames: Tensor) -> Memory:
        """By the ego motion that the bank tells; bank frames where `warp` has numbers."""
        rendered = self.bank.config
        if rendered is None:
            raise ValueError(f"bank {self.bank.folder} has no camera; its depth cannot be warped")
        period_s = 1.0 / rendered.world.frame_rate_hz
        return move_depth(
            distance_m,
            forward_m=torch.from_numpy(self.bank.ego_speed_m_s)[frames] * period_s,
            yaw_rad=torch.from_numpy(self.bank.yaw_rate_rad_s)[frames] * period_s,
            horizontal_fov_deg=rendered.camera.horizontal_fov_deg,
        )

    def _thinned(self, maps: Tensor) -> Tensor:
        # Contiguous, as compiled loops want it; a view would be copied in each of them.
        return maps[..., :: self.stride, :: self.stride].contiguous()

    def _exposure(self, frames: Tensor) -> Exposure:
        return mapped(self._thinned, self.bank.exposure(frames))

    def _draw_drive(self, draw: int, seed: int) -> Drive:
        """Laser, imager and temperature of the clip with this seed."""
        height, width = (-(-n // self.stride) for n in (self.bank.height, self.bank.width))
        own = stream_seed(Purpose.DRIVE, draw, seed)
        return draw_drive(own, self._config, self.bank.clips, height, width)

    def _drives(self, frames: Tensor, draw: int) -> Drive:
        """Of each of the frames; all frames of a clip have the same."""
        seeds = [self.bank.clip_of(index).seed for index in frames.tolist()]
        return concatenate([self._drive(draw, seed) for seed in seeds])

    def _starts(self, frames: Tensor) -> Tensor:
        """First frame of the clip of each of the frames."""
        return torch.tensor([self.bank.clip_of(index).start for index in frames.tolist()])

    def _sensed(self, frames: Tensor, draw: int, shots: Shots | None) -> Sensed:
        words, sensor = self._thinned(self.bank.gray(frames)), self._config.sensor
        gray = words.to(torch.float32) / GRAY_FULL_SCALE
        if shots is None:
            return Sensed(gray)
        check_fits(self.bank, sensor)
        exposure, drive = self._exposure(frames), self._drives(frames, draw)
        # Noise follows from the drive and the place in the clip, so not from the batch.
        places = (frames - self._starts(frames)).tolist()
        noise = noise_samples(drive.seed.tolist(), places, *gray.shape[-2:])
        exposure_s = torch.from_numpy(self.bank.gray_exposure_s)[frames]
        return Sensed(
            gray=gray,
            raw=acquire(
                incident_light(exposure, drive.sensitivity),
                sensor,
                shots=shots,
                noise=noise,
                offsets=drive.offsets,
            ),
            offset_lsb=drive.offsets.calibrated_lsb,
            noise_lsb=sample_noise_lsb(
                words,
                exposure_s,
                drive.integration_s,
                sensor,
                offset_left_lsb=drive.offset_left_lsb if shots == Shots.TWO else None,
            ),
            shift_m=drive.drift_m,
        )

    def _memory(self, frames: Tensor, draw: int, shots: Shots) -> Memory:
        """Depth of the frames before, as a network would have it that unwraps without fault."""
        starts = self._starts(frames)
        # A clip's first frame has none before: it stands in for it, and is masked below.
        before = torch.maximum(frames - 1, starts)
        sensed = self._sensed(before, draw, shots)
        depth = correct_sensed(sensed, self._true_m(before), self.sensor)
        seen = depth.valid & (frames > starts)[:, None, None]
        return self._warp(depth.distance_m.masked_fill(~seen, torch.nan), frames)

    def _truth(self, frames: Tensor) -> Truth:
        if self.truth_of == "measured":
            return concatenate([self._recorded(index) for index in frames.tolist()])
        distance_m = self._true_m(frames)
        return Truth(distance_m, torch.ones_like(distance_m, dtype=torch.bool))

    def _true_m(self, frames: Tensor) -> Tensor:
        """Rendered distance, where the sky and what is too far count as the range."""
        return self._thinned(self.bank.distance_m(frames)).clamp(max=self.range_m)

    def _measure_truth(self, index: int) -> Truth:
        """What eight samples tell of one frame, where the frequencies agree."""
        sensed = self._sensed(torch.tensor([index]), RECORDED_DRAW, Shots.EIGHT)
        depth = correct_sensed(sensed, None, self.sensor)
        return Truth(depth.distance_m.nan_to_num(0.0), depth.valid)
