"""Temperature of the imager: measured distance drifts with it, and most of that is compensated.

The imager's temperature is a constant of a drive, ambient plus self-heating, and not the laser's:
what is measured in a frame then does not depend on what was measured before.

The drift is a delay between light and demodulation: every phase of frequency f grows by
4 pi f drift / c. It is applied to decoded phases (`unwrap.depth.correct`) and not to samples. For a
sine both are the same rotation of the quadratures; with overtones a delay cannot be computed from
the samples that a bank stores, and rotating them would turn the wiggle with them.
"""

from __future__ import annotations

from torch import Tensor

from shotenv.config import SensorConfig


def imager_temperature_k(sensor: SensorConfig, ambient_k: Tensor) -> Tensor:
    """Temperature of the imager, of the shape of `ambient_k`, kelvin."""
    return ambient_k + sensor.self_heating_k


def distance_drift_m(sensor: SensorConfig, imager_k: Tensor) -> Tensor:
    """Distance that the warm imager measures too much, before any compensation, metres."""
    return sensor.distance_drift_m_per_k * (imager_k - sensor.calibration_temperature_k)


def residual_drift_m(sensor: SensorConfig, imager_k: Tensor) -> Tensor:
    """What the compensation by the measured temperature leaves of the drift, metres."""
    return (1.0 - sensor.drift_compensated_share) * distance_drift_m(sensor, imager_k)
