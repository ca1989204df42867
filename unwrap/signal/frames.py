"""The values that pass between sensor, decoder and unwrapper: frozen, batch first.

Masks over pixels are bool [B, H, W], and each word for one means the same everywhere:

saturated : a tap was full or the converter overflowed in any sample.
strong : decoded amplitude over a sample's noise reaches `SensorDescription.min_snr`.
valid : strong and not saturated, and what else a method asks for; the distance may be used.
known : the true, or the remembered, distance of the pixel is known.
unclamped : the true distance is the pixel's own, and not the largest that a network predicts.
scored : pixels that an error, a loss or a score counts, as its docstring says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from torch import Tensor

from unwrap.signal.shots import Shots


@dataclass(frozen=True)
class RawFrame:
    """What the sensor delivers for one acquisition.

    Attributes
    ----------
    dcs_lsb : float32 [B, n, H, W]
        Differential correlation samples in least significant bits, signed (the word of the
        converter minus its mid-scale), n = 2, 4 or 8. Clipped to the converter's range.
    saturated : bool [B, H, W]
        A tap reached its full well or a word left the converter's range in any sample.
    """

    dcs_lsb: Tensor
    saturated: Tensor

    @property
    def shots(self) -> Shots:
        """Number of samples."""
        return Shots(self.dcs_lsb.shape[-3])


@dataclass(frozen=True)
class PhaseFrame:
    """Samples of one modulation frequency, decoded.

    Attributes
    ----------
    phase_rad : float32 [..., H, W]
        Phase in [0, 2 pi).
    amplitude : float32 [..., H, W]
        Amplitude of the correlation, in the unit of the samples.
    residual : float32 [..., H, W] or None
        max(|D0 + D2|, |D1 + D3|), near zero unless the pixel moved, saturated or clipped;
        None with two samples, which cannot tell.
    """

    phase_rad: Tensor
    amplitude: Tensor
    residual: Tensor | None


@dataclass(frozen=True)
class DepthFrame:
    """Unwrapped depth.

    Attributes
    ----------
    distance_m : float32 [B, H, W]
        Radial distance in metres; where not `valid` the best guess there is (the network's
        prediction), or NaN where there is none.
    valid : bool [B, H, W]
        Strong and not saturated; of eight samples without a prediction also strong at f2, and the
        frequencies agree.
    phase_rad : float32 [B, H, W]
        Phase at f1 in [0, 2 pi), the wrapped map that the distance was unwrapped from.
    amplitude : float32 [B, H, W]
        Amplitude of the correlation at f1, in the unit of the samples.
    residual : float32 [B, H, W] or None
        Of the opposite samples at f1, see `PhaseFrame`; None with two samples.
    unambiguous_m : float
        Unambiguous range at f1, metres.
    """

    distance_m: Tensor
    valid: Tensor
    phase_rad: Tensor
    amplitude: Tensor
    residual: Tensor | None
    unambiguous_m: float

    @property
    def wrapped_m(self) -> Tensor:
        """Distance within one unambiguous range of f1, float32 [B, H, W], metres."""
        # As `unwrap.signal.decoding.distance_m`, which cannot be imported: it imports this module.
        return self.phase_rad * (self.unambiguous_m / (2 * math.pi))

    @property
    def wraps(self) -> Tensor:
        """Whole unambiguous ranges at f1 in `distance_m`, int64 [B, H, W]; 0 where that is NaN."""
        return self.distance_m.mul(1 / self.unambiguous_m).nan_to_num_().long()
