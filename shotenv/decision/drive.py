"""A drive: clips strung together, and the sensor that goes along."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.bank import Clip
from shotenv.config import EnvConfig
from shotenv.laser import NO_NETWORK, NetworkWork, ShotCost, shot_cost
from shotenv.sensor import (
    OffsetPattern,
    Purpose,
    Sensitivity,
    draw_offsets,
    imager_temperature_k,
    offset_left_lsb,
    residual_drift_m,
    sensitivity,
    stream,
)
from unwrap.signal import Shots
from unwrap.support import Range

FAMILY_STAYS = 0.5
"""Probability that the next clip is of the same family; assumed."""


@dataclass(frozen=True)
class DriveOptions:
    """What is set of a drive instead of drawn; None leaves it to chance.

    Attributes
    ----------
    families : tuple of str, optional
        Only clips of these families.
    laser_power_w, integration_s, ambient_k, power_price : float, optional
        As in `Drive`.
    """

    families: tuple[str, ...] | None = None
    laser_power_w: float | None = None
    integration_s: float | None = None
    ambient_k: float | None = None
    power_price: float | None = None


DRAWN = DriveOptions()
"""Nothing is set."""


@dataclass(frozen=True)
class Drive:
    """A batch of drives: everything about an episode that no action changes.

    Attributes
    ----------
    seed : int64 [B]
        Seed of the drive; its noise, its layout and its sensor follow from it.
    frames : int64 [B, T + 1]
        Bank frame of each step, and the one that is seen after the last.
    laser_power_w, integration_s, ambient_k : float64 [B]
        Optical power while on, time of one sample, ambient temperature.
    start_k : float64 [B]
        Laser temperature before the first frame.
    sensitivity : Sensitivity
        Electrons per light with this power and time.
    offsets : OffsetPattern
        Fixed pattern of the imager, [B, H, W].
    offset_left_lsb : float64 [B]
        Standard deviation of what the stored map of the offsets leaves, as the sensor expects it.
    drift_m : float64 [B]
        What the imager's temperature adds to every distance, compensation included, metres.
    power_price : float64 [B]
        Weight of power in the reward.
    always_four, always_eight : ShotCost
        Most that a frame of four and of eight samples costs with this laser and integration time:
        at its full power, about to trip.
    """

    seed: Tensor
    frames: Tensor
    laser_power_w: Tensor
    integration_s: Tensor
    ambient_k: Tensor
    start_k: Tensor
    sensitivity: Sensitivity
    offsets: OffsetPattern
    offset_left_lsb: Tensor
    drift_m: Tensor
    power_price: Tensor
    always_four: ShotCost
    always_eight: ShotCost

    def frame(self, step: Tensor) -> Tensor:
        """Bank frames int64 [B] at `step` [B]."""
        return self.frames.gather(1, step.unsqueeze(1)).squeeze(1)

    def is_derated(self, power_w: Tensor) -> bool:
        """Whether the power [B] that lasers emit is not the drives' own in all of the batch."""
        return not torch.equal(power_w, self.laser_power_w)


def draw_drive(
    seed: int,
    config: EnvConfig,
    clips: Sequence[Clip],
    height: int,
    width: int,
    *,
    network: NetworkWork = NO_NETWORK,
    options: DriveOptions = DRAWN,
) -> Drive:
    """The drive of `seed`, a batch of one.

    Laser power, integration time and the price of power are drawn log-uniformly, the ambient
    temperature uniformly, and the laser starts between ambient and the temperature at which it
    would be released.
    `network` is what networks compute in a frame; it counts in `Drive.always_eight`. What
    `options` set replaces what was drawn and shifts nothing else.
    """
    # A stream for each purpose: a longer layout does not change the laser that is drawn.
    layout, body = stream(Purpose.DRIVE, seed, 0), stream(Purpose.DRIVE, seed, 1)
    if options.families is not None:
        clips = [clip for clip in clips if clip.family in options.families]
    # One frame more than are played: the last step, too, is followed by an observation.
    frames = chain_clips(clips, config.frames_per_drive + 1, generator=layout)
    # Laser power, integration time, ambient, start temperature and price, whatever their ranges
    # are: a range of no width does not shift the others.
    unit = torch.rand(5, dtype=torch.float64, generator=body)
    laser_power_w = _log_uniform(config.laser.optical_power_w, unit[0:1])
    integration_s = _log_uniform(config.sensor.integration_s, unit[1:2])
    ambient_k = _uniform(config.laser.ambient_k, unit[2:3])
    # All are drawn in any case, so that one that is set does not shift the others.
    laser_power_w = _chosen(options.laser_power_w, laser_power_w)
    integration_s = _chosen(options.integration_s, integration_s)
    ambient_k = _chosen(options.ambient_k, ambient_k)
    imager_k = imager_temperature_k(config.sensor, ambient_k)
    offsets = draw_offsets(
        config.sensor,
        height,
        width,
        generator=stream(Purpose.OFFSETS, seed),
        imager_k=float(imager_k),
    )
    # The most there is: the reward's terms must not leave 0..1 however warm the laser is.
    always_four, always_eight = (
        shot_cost(
            torch.tensor([int(shots)]),
            config.laser,
            optical_power_w=laser_power_w,
            temperature_k=torch.full_like(laser_power_w, config.laser.trip_k),
            integration_s=integration_s,
            frame_period_s=1.0 / config.frame_rate_hz,
            network=network,
        )
        for shots in (Shots.FOUR, Shots.EIGHT)
    )
    return Drive(
        seed=torch.tensor([seed]),
        frames=frames.unsqueeze(0),
        laser_power_w=laser_power_w,
        integration_s=integration_s,
        ambient_k=ambient_k,
        start_k=ambient_k + unit[3:4] * (config.laser.release_k - ambient_k),
        sensitivity=sensitivity(config.sensor, laser_power_w, integration_s),
        offsets=offsets,
        offset_left_lsb=offset_left_lsb(config.sensor, imager_k),
        drift_m=residual_drift_m(config.sensor, imager_k),
        power_price=_chosen(options.power_price, _log_uniform(config.reward.power, unit[4:5])),
        always_four=always_four,
        always_eight=always_eight,
    )


def chain_clips(clips: Sequence[Clip], length: int, *, generator: torch.Generator) -> Tensor:
    """Bank frames int64 [length] of randomly chosen clips, each played to its end.

    The first clip begins at any of its frames, so that drives meet their cuts at different steps;
    those that follow are played from their start. The next clip is of the same family with
    probability `FAMILY_STAYS`, else of any; no clip follows itself where there is a choice.
    """
    begin = float(torch.rand((), dtype=torch.float64, generator=generator))
    frames: list[int] = []
    last: Clip | None = None
    while len(frames) < length:
        # Both are always drawn, so that the layout's stream keeps step whatever is chosen.
        stays, choice = torch.rand(2, dtype=torch.float64, generator=generator).tolist()
        others = [clip for clip in clips if clip is not last] or list(clips)
        same_family = [clip for clip in others if last and clip.family == last.family]
        pool = same_family if same_family and stays < FAMILY_STAYS else others
        first = last is None
        last = pool[int(choice * len(pool))]
        # The last clip is cut off where the drive ends.
        skipped = int(begin * last.frames) if first else 0
        frames.extend(range(last.start + skipped, last.start + last.frames))
    return torch.tensor(frames[:length])


def _chosen(value: float | None, drawn: Tensor) -> Tensor:
    return drawn if value is None else torch.full_like(drawn, value)


def _uniform(bounds: Range, unit: Tensor) -> Tensor:
    return bounds[0] + unit * (bounds[1] - bounds[0])


def _log_uniform(bounds: Range, unit: Tensor) -> Tensor:
    low, high = bounds
    # A price may be 0, which has no logarithm; its range is then that number alone.
    return low * (high / low) ** unit if low < high else torch.full_like(unit, low)
