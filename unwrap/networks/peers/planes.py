"""What the peer networks share: samples as input maps, agreement with the measured phase."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from unwrap.depth import nearest_wraps
from unwrap.networks import Prediction, log_snr
from unwrap.signal import (
    SAMPLES_PER_FREQUENCY,
    Sensed,
    SensorDescription,
    first_phase,
    sample_noise_lsb,
    unambiguous_range_m,
    wrapped_distance_m,
)

PLANES = SAMPLES_PER_FREQUENCY + 3
"""Maps of `sample_planes`: four samples, amplitude, saturation, how many samples."""


def sample_planes(sensed: Sensed, sensor: SensorDescription) -> Tensor:
    """Samples at f1 over their amplitude, and what says how far to trust them.

    The samples are made anew with the phase corrected for wiggle and drift: D_k is
    A cos(phi - k pi / 2), plus half the sum of D_k and its opposite, D_k+2, which is 0 but for
    noise, motion and saturation. Two samples have no opposites, and leave the third and fourth
    map 0.

    Returns
    -------
    float32 [B, 7, H, W]
        Four samples over amplitude, in about [-2, 2]; amplitude over noise, see
        `unwrap.networks.input_maps.log_snr`; saturation, 0 or 1; 1 with four samples, 0 with two.
    """
    frame, noise, raw = (
        first_phase(sensed, sensor),
        sample_noise_lsb(sensed, sensor),
        sensed.require_raw(),
    )
    samples = raw.dcs_lsb[:, :SAMPLES_PER_FREQUENCY]
    # Maps 0 to 3 are the samples, 4 the amplitude, 5 the saturation, 6 how many samples there are.
    planes = frame.phase_rad.new_zeros(len(samples), PLANES, *samples.shape[-2:])
    for k in range(samples.shape[1]):
        planes[:, k] = (frame.phase_rad - k * (math.pi / 2)).cos()
    if samples.shape[1] == SAMPLES_PER_FREQUENCY:
        if sensed.offset_lsb is not None:
            samples = samples - sensed.offset_lsb.unsqueeze(-3)
        # Rolled by two, each sample meets its opposite.
        common = (samples + samples.roll(2, 1)) / 2
        planes[:, :4] += (common / (frame.amplitude + noise).unsqueeze(1)).clamp(-1, 1)
        planes[:, 6] = 1.0
    planes[:, 4] = log_snr(frame.amplitude / noise)
    planes[:, 5] = raw.saturated
    return planes.contiguous(memory_format=torch.channels_last)


def with_agreement(distance_m: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
    """A regressed distance, with its agreement with the measured phase as confidence.

    The confidence is 1 where the distance is a wrap candidate of the phase and 0 halfway between
    two, where the nearest candidate is a matter of chance; 0 as well below the first.
    """
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    wrapped_m = wrapped_distance_m(sensed, sensor)
    wraps = nearest_wraps(distance_m, wrapped_m, unambiguous_m)
    gap = (distance_m - wrapped_m) / unambiguous_m - wraps
    return Prediction(distance_m, (1 - 2 * gap.abs()).clamp(min=0))
