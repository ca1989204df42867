"""A drive: clips strung together, and the sensor that goes along."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor

from shotenv.bank import Clip, ClipSettings
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
    recorded: Callable[[Clip], ClipSettings] | None = None,
) -> Drive:
    """The drive of `seed`, a batch of one.

    Laser power, integration time and the price of power are drawn log-uniformly, the ambient
    temperature uniformly, and the laser starts between ambient and the temperature at which it
    would be released.
    `network` is what networks compute in a frame; it counts in `Drive.always_eight`. What
    `options` set replaces what was drawn and shifts nothing else.
    `recorded` tells the settings of clips that a camera recorded, which are those of the drive.

    Raises
    ------
    ValueError
        An option sets what was recorded.
    """
    # A stream for each purpose: a longer layout does not change the laser that is drawn.
    layout, body = stream(Purpose.DRIVE, seed, 0), stream(Purpose.DRIVE, seed, 1)
    if options.families is not None:
        clips = [clip for clip in clips if clip.family in options.families]
    # One frame more than are played: the last step, too, is followed by an observation.
    length, own = config.frames_per_drive + 1, None
    if recorded is None:
        frames = chain_clips(clips, length, generator=layout)
    else:
        frames, own = chain_recorded(clips, length, recorded, seed=seed, generator=layout)
        options = with_recorded(options, own)
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
    drift_m = residual_drift_m(config.sensor, imager_k)
    if own is not None:
        # What the stored map leaves is in the words.
        known_lsb = own.offset_lsb.unsqueeze(0)
        offsets, drift_m = (
            OffsetPattern(known_lsb, known_lsb),
            torch.full_like(drift_m, own.shift_m),
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
        drift_m=drift_m,
        power_price=_chosen(options.power_price, _log_uniform(config.reward.power, unit[4:5])),
        always_four=always_four,
        always_eight=always_eight,
    )


def chain_clips(
    clips: Sequence[Clip], length: int, *, generator: torch.Generator, first: Clip | None = None
) -> Tensor:
    """Bank frames int64 [length] of randomly chosen clips, each played to its end.

    The first clip begins at any of its frames, so that drives meet their cuts at different steps;
    those that follow are played from their start. The next clip is of the same family with
    probability `FAMILY_STAYS`, else of any; no clip follows itself where there is a choice.
    `first` is the first clip where that is not left to chance.
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
        begins = last is None
        last = first if begins and first else pool[int(choice * len(pool))]
        # The last clip is cut off where the drive ends.
        skipped = int(begin * last.frames) if begins else 0
        frames.extend(range(last.start + skipped, last.start + last.frames))
    return torch.tensor(frames[:length])


def chain_recorded(
    clips: Sequence[Clip],
    length: int,
    settings: Callable[[Clip], ClipSettings],
    *,
    seed: int,
    generator: torch.Generator,
) -> tuple[Tensor, ClipSettings]:
    """Bank frames int64 [length] of clips with the same settings, and these.

    The first clip is the one that has the drive's own seed, if there is one, else drawn: a drive
    that was simulated and recorded is played again as it was. A clip that is long enough is not
    left; of others only those that were recorded alike are strung together.
    """
    choice, begin = torch.rand(2, dtype=torch.float64, generator=generator).tolist()
    pool = [clip for clip in clips if clip.seed == seed] or list(clips)
    first = pool[int(choice * len(pool))]
    own, spare = settings(first), first.frames - length
    if spare >= 0:
        start = first.start + int(begin * (spare + 1))
        return torch.arange(start, start + length), own
    alike = [clip for clip in clips if settings(clip).is_like(own)]
    return chain_clips(alike, length, generator=generator, first=first), own


def with_recorded(options: DriveOptions, own: ClipSettings) -> DriveOptions:
    """Options of a drive with what was recorded.

    Raises
    ------
    ValueError
        An option sets laser power, integration time or ambient temperature.
    """
    names = [field.name for field in fields(ClipSettings) if hasattr(options, field.name)]
    for name in names:
        if getattr(options, name) is not None:
            raise ValueError(
                f"{name} is {getattr(options, name)!r}; expected none, as drives of recordings "
                f"have the recorded one ({getattr(own, name):g})"
            )
    return replace(options, **{name: getattr(own, name) for name in names})


def _chosen(value: float | None, drawn: Tensor) -> Tensor:
    return drawn if value is None else torch.full_like(drawn, value)


def _uniform(bounds: Range, unit: Tensor) -> Tensor:
    return bounds[0] + unit * (bounds[1] - bounds[0])


def _log_uniform(bounds: Range, unit: Tensor) -> Tensor:
    low, high = bounds
    # A price may be 0, which has no logarithm; its range is then that number alone.
    return low * (high / low) ** unit if low < high else torch.full_like(unit, low)
