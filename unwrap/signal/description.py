"""What unwrapping must know of a sensor."""

from __future__ import annotations

from dataclasses import dataclass

from unwrap.signal.wiggle import WiggleTable


@dataclass(frozen=True)
class SensorDescription:
    """Frequencies, ranges, noise and stored calibration of a sensor.

    Attributes
    ----------
    f1_hz, f2_hz : float
        Modulation frequencies.
    max_range_m : float
        Range that eight samples are unwrapped over.
    saturation_range_m : float
        d_sat of eq. 6 and 8: wrapped distances from here on are not trusted.
    noise_lsb : float
        Standard deviation of one sample in the dark, used where no better estimate is given.
    min_snr : float
        Decoded amplitude over the noise of one sample below which a pixel is invalid. Noise alone
        reaches k with probability exp(-k^2 / 2) in two samples, whose amplitude is as noisy as
        they are, and exp(-k^2) in four: 1.1 % and .01 % at 3.
    max_residual_m : float
        Disagreement of the two frequencies above which they are not trusted: the pixel is merged
        with the prediction, or invalid without one. With 24 and 10 MHz candidates within 25 m lie
        2.5 m apart, so that 1.25 m is the most there is.
    wiggle : tuple of two WiggleTable, or None
        Stored phase errors at f1 and f2.
    """

    f1_hz: float = 24e6
    f2_hz: float = 10e6
    max_range_m: float = 25.0
    saturation_range_m: float = 6.2
    noise_lsb: float = 1.5
    min_snr: float = 3.0
    max_residual_m: float = 1.0
    wiggle: tuple[WiggleTable, WiggleTable] | None = None
