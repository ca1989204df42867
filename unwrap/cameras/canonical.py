"""Samples as a camera orders them to D_k = + m S cos(phi - k pi / 2), k = 0..3.

Four samples in quadrature are only put in order, so that their words stay what they were. Others,
three phases or the parts of a phasor, are fitted by a phasor (and an offset), from which four
samples are made: cos, sin, -cos, -sin. Opposite ones then agree by construction, and tell neither
motion nor noise.
"""

from __future__ import annotations

import numpy as np

from unwrap.cameras.files import SamplesConfig

QUADRATURE = (0.0, 90.0, 180.0, 270.0)


def canonical(planes: np.ndarray, samples: SamplesConfig) -> tuple[np.ndarray, bool]:
    """Canonical samples [..., 2 or 4, H, W] of the planes of one frequency, and if they are made.

    Parameters
    ----------
    planes : float32 [..., P, H, W]
        Samples in LSB, in the stored order.

    Examples
    --------
    >>> planes = np.array([10.0, 30.0, 20.0, 40.0]).reshape(4, 1, 1)
    >>> found, made = canonical(planes, SamplesConfig(phase_deg=(0, 180, 90, 270)))
    >>> found.ravel().tolist(), made
    ([10.0, 20.0, 30.0, 40.0], False)
    """
    if (places := quadrature_order(samples)) is not None:
        return planes[..., places, :, :], False
    cosine, sine = np.moveaxis(_fitted(planes, samples), -3, 0)
    return np.stack((cosine, sine, -cosine, -sine), axis=-3), True


def in_order(saturated: np.ndarray, samples: SamplesConfig) -> np.ndarray:
    """Which canonical samples [..., 2 or 4, H, W] are saturated, of planes bool [..., P, H, W].

    Of a phasor that is made of several planes a saturated one spoils all four.
    """
    if (places := quadrature_order(samples)) is not None:
        return saturated[..., places, :, :]
    return np.repeat(saturated.any(axis=-3, keepdims=True), len(QUADRATURE), axis=-3)


def quadrature_order(samples: SamplesConfig) -> list[int] | None:
    """Planes that are the canonical samples, in their order; None where they have to be made."""
    phases = samples.phases_deg
    if samples.kind == "samples":
        for wanted in (QUADRATURE, QUADRATURE[:2]):
            if sorted(phases) == list(wanted):
                return [phases.index(phase) for phase in wanted]
    return None


def _fitted(planes: np.ndarray, samples: SamplesConfig) -> np.ndarray:
    """Real and imaginary part [..., 2, H, W] of the phasor that fits the planes best."""
    angles = np.deg2rad(samples.phases_deg)
    columns = [np.cos(angles), np.sin(angles)]
    if samples.kind == "samples":
        columns.append(np.ones_like(angles))  # The pixel's offset, common to its samples.
    weights = np.linalg.pinv(np.stack(columns, axis=-1))[:2]
    return np.einsum("qp,...phw->...qhw", weights, planes).astype(np.float32)
