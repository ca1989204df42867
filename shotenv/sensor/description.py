"""A configured sensor as the correction knows it, which may be a real camera as well."""

from __future__ import annotations

import math

from shotenv.config import SensorConfig
from shotenv.sensor.gray import dark_variance_lsb2
from unwrap.signal import (
    SensorDescription,
    WiggleTable,
    candidate_spacing_m,
    harmonic_weights,
    wiggle_of,
)

TRUSTED_SPACING = 0.4
"""Two frequencies are trusted where they agree within this share of their candidates' spacing;
the value is assumed.

At half the spacing the next pair of wraps would agree as well; see `unwrap.depth.unwrap_dual`.
"""


def description_of(sensor: SensorConfig) -> SensorDescription:
    """What the correction must know of `sensor`: frequencies, ranges, noise, stored calibration.

    Of the optics and the converter it knows nothing: samples and their noise come in LSB.
    """
    spacing_m = candidate_spacing_m(sensor.f1_hz, sensor.f2_hz, sensor.max_range_m)
    return SensorDescription(
        f1_hz=sensor.f1_hz,
        f2_hz=sensor.f2_hz,
        max_range_m=sensor.max_range_m,
        saturation_range_m=sensor.saturation_range_m,
        noise_lsb=math.sqrt(dark_variance_lsb2(sensor)),
        min_snr=sensor.min_snr,
        max_residual_m=TRUSTED_SPACING * spacing_m,
        wiggle=stored_wiggle(sensor),
    )


def stored_wiggle(sensor: SensorConfig) -> tuple[WiggleTable, WiggleTable] | None:
    """Tables of both frequencies as a bench would measure them, in part; None without overtones."""
    if not sensor.harmonic_strength * sensor.wiggle_calibrated_share:
        return None
    table = wiggle_of(harmonic_weights(sensor.harmonic_strength, sensor.highest_harmonic))
    known = table.scaled(sensor.wiggle_calibrated_share)
    return known, known
