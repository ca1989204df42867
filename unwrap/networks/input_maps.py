"""Maps that networks are given: of the gray image, of the samples, of remembered depth.

Each function makes some channels of a network's input, [B, maps, H, W]. With eight samples only the
first four are looked at, so that the maps tell what 2- and 4-DCS frames tell.
"""

from __future__ import annotations

import torch
from torch import Tensor

from unwrap.signal import Memory, Sensed, SensorDescription, first_phase, sample_noise_lsb

DARKEST = 1e-3
"""Gray level added before the logarithm, about four steps of a 12-bit converter."""
FULL_LOGARITHM = 8.0
"""ln(1 + signal-to-noise) of the strongest signals, about 3000 : 1."""


def gray_maps(gray: Tensor) -> Tensor:
    """[B, 1, H, W] in [0, 1] -> [B, 3, H, W]: gray, its logarithm, and the row, all in [-1, 1].

    The logarithm turns exposure into an offset and opens the shadows; the row tells where the
    horizon of a camera in its usual attitude is.
    """
    height, width = gray.shape[-2:]
    row = torch.linspace(-1.0, 1.0, height, device=gray.device, dtype=gray.dtype)
    rows = row[None, None, :, None].expand(len(gray), 1, height, width)
    # ln(0.001) = -6.9 and ln(1.001) = 0, over 3.5 and plus 1: about -1 to 1.
    logarithm = (gray + DARKEST).log() / 3.5 + 1.0
    features = torch.cat((2.0 * gray - 1.0, logarithm, rows), 1)
    # The order in memory in which convolutions are fastest on processors.
    return features.contiguous(memory_format=torch.channels_last)


def log_snr(signal_to_noise: Tensor) -> Tensor:
    """Logarithm of signal-to-noise ratios from 0 to about 3000, scaled to [-1, 1].

    Examples
    --------
    >>> log_snr(torch.tensor([0.0, 2980.0]))
    tensor([-1.0000,  1.0000])
    """
    return signal_to_noise.log1p() * (2 / FULL_LOGARITHM) - 1.0


def phase_maps(sensed: Sensed, sensor: SensorDescription) -> Tensor:
    """Cosine and sine of the phase at f1, amplitude over noise (`log_snr`), and saturation.

    The phase is given by its unit vector, which does not jump where the phase wraps.

    Returns
    -------
    float32 [B, 4, H, W]
        The first two in [-1, 1], the third in about [-1, 1]; the last 0 or 1.

    Raises
    ------
    ValueError
        There are no samples.
    """
    frame = first_phase(sensed, sensor)
    ratio = frame.amplitude / sample_noise_lsb(sensed, sensor)
    saturated = sensed.require_raw().saturated.to(ratio)
    maps = (frame.phase_rad.cos(), frame.phase_rad.sin(), log_snr(ratio), saturated)
    return torch.stack(maps, 1)


def memory_maps(memory: Memory | None, like: Tensor, range_m: float) -> Tensor:
    """Remembered distance over `range_m`, and where there is one: [B, 2, H, W]; zeros without.

    `like` [B, H, W] gives shape, type and device where there is no memory.
    """
    if memory is None:
        return torch.zeros_like(like).unsqueeze(1).repeat(1, 2, 1, 1)
    return torch.stack((memory.distance_m * (memory.known / range_m), memory.known), 1)
