"""Frames as networks see them: what the sensor delivers, and the truth to learn from.

For the words of the masks (`valid`, `known`, ...) see `unwrap.signal.frames`.
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from unwrap.signal.calibrated import decode_at
from unwrap.signal.decoding import distance_m
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import PhaseFrame, RawFrame


@dataclass(frozen=True)
class Memory:
    """Depth of the previous frame, moved to where its points are seen now; batch B.

    Attributes
    ----------
    distance_m : float32 [B, H, W]
        Metres; 0 where nothing is remembered.
    known : float32 [B, H, W]
        1 where something is remembered, else 0: a number, since it is a map that networks see.
    """

    distance_m: Tensor
    known: Tensor


@dataclass(frozen=True)
class Sensed:
    """What a sensor delivers of B frames.

    Attributes
    ----------
    gray : float32 [B, H, W]
        Passive gray image in [0, 1].
    raw : RawFrame or None
        2, 4 or 8 samples; None where no sample was taken.
    offset_lsb : float32 [B, H, W] or None
        Stored dark-offset map.
    noise_lsb : float32 [B, H, W] or None
        Standard deviation of one sample, estimated by the sensor.
    shift_m : float64 [B] or None
        Added to the wrapped distances, see `unwrap.signal.calibrated.decode_at`.
    memory : Memory or None
        Of the frame before.
    """

    gray: Tensor
    raw: RawFrame | None = None
    offset_lsb: Tensor | None = None
    noise_lsb: Tensor | None = None
    shift_m: Tensor | None = None
    memory: Memory | None = None

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.gray)

    def require_raw(self) -> RawFrame:
        """The samples.

        Raises
        ------
        ValueError
            There are none.
        """
        if self.raw is None:
            raise ValueError("sensed.raw is None; expected 2, 4 or 8 samples")
        return self.raw


@dataclass(frozen=True)
class Truth:
    """What a network is to predict of B frames.

    Attributes
    ----------
    distance_m : float32 [B, H, W]
        Radial distance, metres, clamped at the network's range (the sky, too); 0 where unknown.
    known : bool [B, H, W]
        Everywhere for rendered truth; where the frequencies agree for a sensor's own.
    """

    distance_m: Tensor
    known: Tensor


def first_phase(sensed: Sensed, sensor: SensorDescription) -> PhaseFrame:
    """Phase and amplitude [B, H, W] at f1, corrected by offset, wiggle and shift."""
    return decode_at(
        0, sensed.require_raw(), sensor, offset_lsb=sensed.offset_lsb, shift_m=sensed.shift_m
    )


def wrapped_distance_m(sensed: Sensed, sensor: SensorDescription) -> Tensor:
    """Distance [B, H, W] within one unambiguous range of f1, metres."""
    return distance_m(first_phase(sensed, sensor).phase_rad, sensor.f1_hz)


def sample_noise_lsb(sensed: Sensed, sensor: SensorDescription) -> Tensor | float:
    """Standard deviation of one sample, LSB: the sensor's estimate, else its noise in the dark."""
    return sensor.noise_lsb if sensed.noise_lsb is None else sensed.noise_lsb


def is_strong(amplitude: Tensor, noise_lsb: Tensor | float, sensor: SensorDescription) -> Tensor:
    """Where the decoded amplitude over the noise of one sample reaches `min_snr`, bool.

    How often noise alone does, see `SensorDescription.min_snr`.

    Examples
    --------
    >>> import torch
    >>> is_strong(torch.tensor([2.9, 3.0]), 1.0, SensorDescription(min_snr=3.0))
    tensor([False,  True])
    """
    # A product: the quotient is NaN where neither signal nor noise is.
    return amplitude >= noise_lsb * sensor.min_snr


def wrapped_and_valid(sensed: Sensed, sensor: SensorDescription) -> tuple[Tensor, Tensor]:
    """Wrapped distance [B, H, W] in metres, and where it is valid, bool.

    Valid is what is strong and not saturated, as with two and four samples in `unwrap.correct`.
    """
    frame = first_phase(sensed, sensor)
    strong = is_strong(frame.amplitude, sample_noise_lsb(sensed, sensor), sensor)
    return distance_m(frame.phase_rad, sensor.f1_hz), strong & ~sensed.require_raw().saturated
