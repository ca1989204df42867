"""Full well of a tap, from pixels that are saturated in some frames and not in others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from unwrap.calibration.moments import Moments

Array = np.ndarray
MOST_FLAGGED = 0.5
"""Share of frames: in pixels that are saturated more often, samples are cut off themselves."""
LEAST_PIXELS = 4
NEAR_LIMIT = 0.98
"""Share of the converter's range beyond which its overflow, and not a full tap, flags a pixel."""
REACH = 0.1
"""Of the search around the charges of these pixels."""
HALVINGS = 20


def taps_e(
    recording: Moments,
    offset_lsb: Array,
    amplitude_lsb: Array,
    ambient_e: Array,
    gain_lsb_per_e: float,
    contrast: float,
) -> Array:
    """Mean charge of both taps in every sample, electrons [2, K, 4, P]: (S + B +- D / g) / 2.

    Parameters
    ----------
    offset_lsb, ambient_e : [P]
    amplitude_lsb : [K, P]
        Of the fundamental, A = g m S.
    """
    signal = amplitude_lsb[:, None] / (gain_lsb_per_e * contrast)
    difference = (recording.mean_lsb - offset_lsb) / gain_lsb_per_e
    return np.stack([signal + ambient_e + sign * difference for sign in (1, -1)]) / 2


def expected_flags(charges_e: Tensor, deviation_e: Tensor, full_well_e: float) -> float:
    """Sum over pixels of the share of frames in which a tap is full.

    A frame is flagged unless all taps of all samples stay below the full well; [T, P] both.
    """
    below = torch.special.log_ndtr((full_well_e - charges_e) / deviation_e).sum(0)
    return float(-torch.expm1(below).sum())


def full_well_e(
    recordings: Sequence[Moments], charges_e: Sequence[Array], read_noise_e: float, bits: int
) -> float:
    """Full well of one tap, electrons: with it as many flags are expected as there are.

    Over pixels of which fewer than `MOST_FLAGGED` frames are saturated. A charge q is read with
    variance q + sigma_r^2. By bisection; NaN where fewer than `LEAST_PIXELS` are saturated in some
    frames.

    Parameters
    ----------
    charges_e : [2, K, 4, P] of each recording
        See `taps_e`.
    bits : int
        Of the converter.
    """
    limit = NEAR_LIMIT * 2 ** (bits - 1)
    taps, shares = [], []
    for recording, charges in zip(recordings, charges_e, strict=True):
        within = np.abs(recording.mean_lsb).max((0, 1)) < limit
        used = (recording.flagged < MOST_FLAGGED) & within
        taps.append(charges.reshape(-1, charges.shape[-1])[:, used])
        shares.append(recording.flagged[used])
    seen = np.concatenate(shares) if shares else np.zeros(0)
    if np.count_nonzero(seen) < LEAST_PIXELS:
        return float("nan")
    charges = np.concatenate(taps, -1)
    largest = charges.max(0)
    middle = float(largest[seen > 0].mean())
    # Far below the full well nothing is flagged and nothing expected.
    near = largest > (1 - REACH) * middle
    chosen = torch.from_numpy(charges[:, near])
    deviation = (chosen.clamp(min=0) + read_noise_e**2).sqrt()
    low, high, flags = (1 - REACH) * middle, (1 + REACH) * middle, float(seen[near].sum())
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        too_low = expected_flags(chosen, deviation, middle) > flags
        low, high = (middle, high) if too_low else (low, middle)
    return middle
