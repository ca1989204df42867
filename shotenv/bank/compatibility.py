"""Whether a sensor and a frame rate are those that a bank was made for."""

from __future__ import annotations

from shotenv.bank.bank import Bank
from shotenv.bank.recorded_bank import RecordedBank
from shotenv.config import ACQUISITION_FIELDS, SensorConfig

BAKED_FIELDS = tuple(
    field
    for field in SensorConfig.model_fields
    if field not in ACQUISITION_FIELDS and field != "name"
)
"""Fields of the sensor that the light or the gray images of a bank were made with.

Of the light: frequencies, timing, overtones, and the exposure that blurs ambient light. Of the gray
images, which the laser has no part in: everything from the lens to the converter. The name alone
is compared by nobody.
"""


THINNED_FIELDS = ("max_range_m",)
"""Fields that a thinned bank's scene features were made with; a rendered bank's are made anew."""


def check_fits(bank: Bank, sensor: SensorConfig, *, frame_rate_hz: float | None = None) -> None:
    """Refuse a sensor or a frame rate that is not the one the bank was rendered for.

    Fields that are applied when a frame is acquired (`shotenv.config.ACQUISITION_FIELDS`) may have
    any value; of a thinned bank all but `THINNED_FIELDS`. An imported bank does not tell what it
    was made with, and fits everything.

    Parameters
    ----------
    frame_rate_hz
        Frames per second where frames are played in their order; None where each stands alone.

    Raises
    ------
    ValueError
        Names the field, both values and the cure.
    """
    if isinstance(bank, RecordedBank):
        check_recorded(bank, sensor, frame_rate_hz)
    if bank.config is None:
        return
    for field in BAKED_FIELDS:
        rendered, wanted = getattr(bank.config.sensor, field), getattr(sensor, field)
        if rendered != wanted:
            raise ValueError(
                f"sensor.{field} is {wanted:g}, but bank {bank.name} was rendered with "
                f"{rendered:g}; render a bank with this sensor"
            )
    for field in THINNED_FIELDS if bank.is_thinned else ():
        made_with, wanted = getattr(bank.config.sensor, field), getattr(sensor, field)
        if made_with != wanted:
            raise ValueError(
                f"sensor.{field} is {wanted:g}, but scene features of bank {bank.name} were made "
                f"with {made_with:g}; choose that, or a rendered bank such as starter"
            )
    rendered_hz = bank.config.world.frame_rate_hz
    if frame_rate_hz not in (None, rendered_hz):
        raise ValueError(
            f"frame_rate_hz is {frame_rate_hz:g}, but bank {bank.name} was rendered at "
            f"{rendered_hz:g}; ask for that, or render a bank at this frame rate"
        )


def check_recorded(bank: RecordedBank, sensor: SensorConfig, frame_rate_hz: float | None) -> None:
    """Refuse frequencies, bits or a frame rate with which a bank's recordings were not made.

    Raises
    ------
    ValueError
        Names the field and both values.
    """
    about, own = bank.manifest, bank.manifest.sensor
    # Without samples at f2 it may be any.
    fields = ("f1_hz", *(("f2_hz",) if about.samples == 8 else ()), "adc_bits")
    values = [(f"sensor.{name}", getattr(sensor, name), getattr(own, name)) for name in fields]
    if frame_rate_hz is not None:
        values.append(("frame_rate_hz", frame_rate_hz, about.frame_rate_hz))
    for name, wanted, recorded in values:
        if wanted != recorded:
            raise ValueError(
                f"{name} is {wanted:g}, but bank {bank.name} was recorded with {recorded:g}; "
                f"{bank.folder / 'env.yaml'} is a configuration that fits"
            )
