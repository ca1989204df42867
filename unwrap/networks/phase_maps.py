"""What networks see of correlation samples: phase, amplitude and saturation of each pixel at f1.

With eight samples only the first four are looked at, so that these maps tell what the 2- and
4-DCS frames tell.
"""

from __future__ import annotations

import torch
from torch import Tensor

from unwrap.signal import Sensed, SensorDescription, first_phase, noise_of, samples_of

FULL_LOGARITHM = 8.0
"""ln(1 + signal-to-noise) of the strongest signals, about 3000 : 1."""


def compressed(signal_to_noise: Tensor) -> Tensor:
    """Logarithm of ratios from 0 to about 3000, scaled to [-1, 1].

    >>> compressed(torch.tensor([0.0, 2980.0]))
    tensor([-1.0000,  1.0000])
    """
    return signal_to_noise.log1p() * (2 / FULL_LOGARITHM) - 1.0


def phase_maps(sensed: Sensed, sensor: SensorDescription) -> Tensor:
    """Cosine and sine of the phase, compressed amplitude over noise, and saturation.

    The phase is given by its vector, which does not jump where it wraps.

    Returns
    -------
    float32 [B, 4, H, W]
        The first two in [-1, 1], the third in about [-1, 1], see `compressed`; the last 0 or 1.

    Raises
    ------
    ValueError
        There are no samples.
    """
    frame = first_phase(sensed, sensor)
    ratio = frame.amplitude / noise_of(sensed, sensor)
    saturated = samples_of(sensed).saturated.to(ratio)
    maps = (frame.phase_rad.cos(), frame.phase_rad.sin(), compressed(ratio), saturated)
    return torch.stack(maps, 1)
