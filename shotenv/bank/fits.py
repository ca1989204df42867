"""TODO."""

from __future__ import annotations

from shotenv.bank.frames_reader import Bank
from shotenv.config import SensorConfig

RENDERED_WITH = (
    "f1_hz",
    "f2_hz",
    "sample_period_s",
    "harmonic_strength",
    "highest_harmonic",
    "wavelength_nm",
)
"""Sensor fields that are part of the rendered light and cannot be changed afterwards."""


def check_fits(bank: Bank, sensor: SensorConfig) -> None:
    """Refuse a sensor whose frequencies or timing are not those the bank was rendered with.

    Raises
    ------
    ValueError
        Names the field, both values and the cure.
    """
    if bank.config is None:
        return
    for field in RENDERED_WITH:
        rendered, wanted = getattr(bank.config.sensor, field), getattr(sensor, field)
        if rendered != wanted:
            raise ValueError(
                f"sensor.{field} is {wanted:g}, but bank {bank.config.name} was rendered with "
                f"{rendered:g}; render a bank with this sensor"
            )
