"""When light is gathered for a frame: the instants that one launch of the integrator renders.

A frame takes eight samples one after the other, and everything moves in between; before them the
gray exposure is averaged over a few instants. All are rendered in one launch, since each launch
costs its start and its copies, which on a small image weigh beside the rays.
"""

from __future__ import annotations

from dataclasses import dataclass

from shotenv.config import CameraConfig, SensorConfig
from unwrap.signal import Shots, demodulation_phase_rad, frequency_index, sample_times_s


@dataclass(frozen=True)
class Instants:
    """T instants, each with its own camera pose and its own poses of what moves.

    Attributes
    ----------
    times_s : tuple of float, T
        Times in the clip, seconds.
    laser, passive : tuple of bool, T
        Whether the laser, and whether sun, sky and lamps are rendered at the instant.
    draw : tuple of int, T
        Instants with the same number share their random numbers, so that they differ by what
        moved and not by Monte Carlo noise. Counted from 0.
    frequency_hz, theta_rad : tuple of float, T
        Modulation frequency of the laser and phase of the demodulation signal.
    """

    times_s: tuple[float, ...]
    laser: tuple[bool, ...]
    passive: tuple[bool, ...]
    draw: tuple[int, ...]
    frequency_hz: tuple[float, ...]
    theta_rad: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.times_s)


def frame_instants(
    time_s: float,
    camera: CameraConfig,
    sensor: SensorConfig,
    *,
    gray_exposure_s: float | None = None,
) -> Instants:
    """Instants of a frame that starts at `time_s`: eight samples, then the gray exposure.

    The samples start at the times of `unwrap.signal.sample_times_s`; the gray instants are the
    midpoints of equal parts of the gray exposure (None: the longest), which ends where the first
    sample starts.
    """
    samples = [time_s + t for t in sample_times_s(Shots.EIGHT, sensor.sample_period_s)]
    frequencies_hz = (sensor.f1_hz, sensor.f2_hz)
    sample_hz = [frequencies_hz[frequency_index(k)] for k in range(len(samples))]
    theta_rad = [demodulation_phase_rad(k) for k in range(len(samples))]
    gray_count = camera.gray_instants
    exposure_s = sensor.gray_max_exposure_s if gray_exposure_s is None else gray_exposure_s
    gray = [time_s - exposure_s * (i + 0.5) / gray_count for i in range(gray_count)]
    laser = (True,) * len(samples) + (False,) * gray_count
    unmodulated = (0.0,) * gray_count
    return Instants(
        times_s=(*samples, *gray),
        laser=laser,
        passive=tuple(not on for on in laser),
        # Samples of one frame differ by what moved, and by the sensor's noise, not by Monte Carlo
        # noise: that would be as large, and look like motion. Gray instants are averaged: theirs
        # should differ.
        draw=(0,) * len(samples) + tuple(range(gray_count)),
        frequency_hz=(*sample_hz, *unmodulated),
        theta_rad=(*theta_rad, *unmodulated),
    )
