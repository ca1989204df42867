"""What an imager delivers of a drive in which every frame takes eight samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.decision import Problem, drive_of_seed, noise_of
from shotenv.sensor import (
    acquire_flagged,
    imager_temperature_k,
    incident_light,
    scored_pixels,
)
from unwrap.cameras import CameraFrames
from unwrap.signal import GRAY_FULL_SCALE, SAMPLES_PER_FREQUENCY, Shots
from unwrap.support import take

BATCH = 16
"""Frames that are acquired at a time."""


@dataclass(frozen=True)
class DeliveredDrive:
    """A drive as it was recorded, F frames, and what is known of it beside.

    Attributes
    ----------
    seed : int
    family : str or None
        Of its scenes; None where they are of several.
    frames : CameraFrames
        Samples at both frequencies, gray images, times and settings.
    truth_m : float32 [F, H, W]
        True radial distance; NaN where a pixel does not count.
    offset_lsb : float32 [H, W]
        Calibrated dark offset.
    ambient_k : float
        Around the camera.
    shift_m : float
        What the imager's temperature adds to every distance, compensation included. Light is
        simulated without it, so that it is not in the samples.
    ego_speed_m_s, yaw_rate_rad_s, gray_exposure_s : float64 [F]
    """

    seed: int
    family: str | None
    frames: CameraFrames
    truth_m: Tensor
    offset_lsb: Tensor
    ambient_k: float
    shift_m: float
    ego_speed_m_s: Tensor
    yaw_rate_rad_s: Tensor
    gray_exposure_s: Tensor


@torch.inference_mode()
def deliver_drive(
    problem: Problem, seed: int, *, tick: Callable[[int], object] = lambda frames: None
) -> DeliveredDrive:
    """The drive `seed` of a problem, at the full power of its laser.

    Its samples are those of `acquire_depths`, with the drive's own noise and offsets. The frame
    that is seen after the last step is the last.

    Raises
    ------
    ValueError
        The bank has no light, but recorded samples.
    """
    bank, sensor, drive = problem.bank, problem.config.sensor, drive_of_seed(problem, seed)
    indices = drive.frames[0]
    count, truth_m = len(indices), []
    samples_lsb = torch.empty(count, Shots.EIGHT, bank.height, bank.width)
    flags = torch.empty(samples_lsb.shape, dtype=torch.bool)
    for begin in range(0, count, BATCH):
        step = torch.arange(begin, min(begin + BATCH, count))
        batch = take(drive, torch.zeros_like(step))
        exposure = bank.exposure(indices[step])
        light = incident_light(exposure, batch.sensitivity)
        samples_lsb[step], flags[step] = acquire_flagged(
            light,
            sensor,
            shots=Shots.EIGHT,
            noise=noise_of(batch, step, bank.height, bank.width),
            offsets=batch.offsets,
        )
        scored = scored_pixels(light, exposure.distance_m, sensor)
        truth_m.append(exposure.distance_m.where(scored, torch.nan))
        tick(len(step))
    by_frequency = 2, SAMPLES_PER_FREQUENCY
    temperature_k = float(imager_temperature_k(sensor, drive.ambient_k))
    rows = indices.numpy()
    families = {bank.clip_of(index).family for index in indices.tolist()}
    return DeliveredDrive(
        seed=seed,
        family=families.pop() if len(families) == 1 else None,
        frames=CameraFrames(
            samples_lsb=samples_lsb.unflatten(1, by_frequency),
            saturated=flags.any(dim=1),
            gray=bank.gray(indices).to(torch.float32) / GRAY_FULL_SCALE,
            frequencies_hz=(sensor.f1_hz, sensor.f2_hz),
            made=False,
            names=tuple(f"{frame:05d}" for frame in range(count)),
            temperature_k=(temperature_k,) * count,
            integration_s=(float(drive.integration_s),) * count,
            laser_power_w=(float(drive.laser_power_w),) * count,
            timestamp_s=tuple(frame * problem.frame_period_s for frame in range(count)),
            saturated_samples=flags.unflatten(1, by_frequency),
        ),
        truth_m=torch.cat(truth_m),
        offset_lsb=drive.offsets.calibrated_lsb[0],
        ambient_k=float(drive.ambient_k),
        shift_m=float(drive.drift_m),
        ego_speed_m_s=torch.from_numpy(bank.ego_speed_m_s[rows]),
        yaw_rate_rad_s=torch.from_numpy(bank.yaw_rate_rad_s[rows]),
        gray_exposure_s=torch.from_numpy(bank.gray_exposure_s[rows]),
    )
