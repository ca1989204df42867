"""Configuration of the imager."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from unwrap.signal import harmonic_weights, joint_range_m, unambiguous_range_m
from unwrap.support import Fraction, NonNegative, Positive, Range, Section, check_range

Share = Annotated[float, Field(gt=0.0, le=1.0)]
Frequency = Annotated[float, Field(ge=1e5, le=1e9)]
Kelvin = Annotated[float, Field(ge=200.0, le=450.0)]
MOST_LSB = float(2**16)
"""Full scale of the widest converter."""
# Limits of other fields are assumed: far beyond what any imager has, and such that all that is
# computed from them is finite.


ACQUISITION_FIELDS = frozenset(
    {
        "integration_s",
        "contrast",
        "offset_std_lsb",
        "offset_row_share",
        "offset_calibrated_share",
        "offset_ambient_lsb",
        "offset_drift_lsb_per_k",
        "wiggle_calibrated_share",
        "distance_drift_m_per_k",
        "drift_compensated_share",
        "calibration_temperature_k",
        "self_heating_k",
        "min_snr",
        "saturation_range_m",
        "max_range_m",
    }
)
"""Fields that are applied when a frame is acquired and corrected: a bank serves all their values.

All others are baked into the light and the gray images of a bank. They are part of its identity
(`shotenv.bank.files.folders`), and a bank that was made with another value is refused
(`shotenv.bank.check_fits`). A new field counts as baked until it is named here.
"""


class SensorConfig(Section):
    """The imager: optics, pixel, converter, timing. Every source is named in the YAML file."""

    name: str = Field(description="name of the imager")
    f1_hz: Frequency = Field(24e6, description="first modulation frequency, Hz")
    f2_hz: Frequency = Field(10e6, description="second modulation frequency, Hz")
    sample_period_s: Positive = Field(
        3.85e-3, ge=1e-7, le=1.0, description="time from one DCS to the next, s"
    )
    integration_s: Range = Field(
        (5.5e-4, 7.5e-4), description="integration time drawn per drive, s"
    )
    harmonic_strength: Fraction = Field(
        0.0, description="overtones of light and demodulation: 0 = sines, 1 = ideal squares"
    )
    highest_harmonic: int = Field(7, ge=1, le=31, description="highest odd harmonic rendered")
    wiggle_calibrated_share: Fraction = Field(
        0.95, description="share of the wiggle, the overtones' phase error, that its table removes"
    )
    distance_drift_m_per_k: NonNegative = Field(
        0.0, le=1.0, description="distance added per kelvin above the calibration temperature, m/K"
    )
    drift_compensated_share: Fraction = Field(
        0.95, description="share of the distance drift removed by the measured temperature"
    )
    calibration_temperature_k: Kelvin = Field(
        298.15, description="imager temperature at which offset and distance were calibrated, K"
    )
    self_heating_k: NonNegative = Field(
        0.0, le=100.0, description="imager temperature above ambient, K"
    )
    wavelength_nm: float = Field(940.0, ge=300.0, le=2000.0, description="laser wavelength, nm")
    f_number: float = Field(1.2, ge=0.5, le=32.0, description="lens f-number")
    lens_transmission: Share = Field(0.8, description="lens and filter transmission")
    veiling_glare: Fraction = Field(
        0.0, description="share of all light that the lens spreads over the image"
    )
    veiling_glare_width: Share = Field(
        0.25, description="standard deviation of that spread, in widths of the image"
    )
    ghost: Fraction = Field(
        0.0, description="share of all light that is mirrored through the image's centre"
    )
    ghost_width: Fraction = Field(
        0.02, description="blur of the ghost: standard deviation in widths of the image"
    )
    pixel_pitch_m: float = Field(20e-6, ge=1e-6, le=1e-3, description="pixel pitch, m")
    fill_factor: Share = Field(1.0, description="light-sensitive share of a pixel")
    quantum_efficiency: Share = Field(0.28, description="electrons per photon in band")
    contrast: Share = Field(0.85, description="demodulation contrast m")
    read_noise_e: NonNegative = Field(
        83.0, le=1e9, description="read noise of one tap, electrons rms"
    )
    full_well_e: Positive = Field(
        160e3, ge=1.0, le=1e9, description="full well of one tap, electrons"
    )
    gain_lsb_per_e: Positive = Field(
        0.0128, ge=1e-6, le=1e6, description="converter gain, LSB per electron"
    )
    adc_bits: int = Field(12, ge=8, le=16, description="bits of the converter")
    offset_std_lsb: NonNegative = Field(
        17.6, le=MOST_LSB, description="std of the tap offset pattern, LSB"
    )
    offset_row_share: Fraction = Field(0.5, description="share of offset variance common to a row")
    offset_calibrated_share: Fraction = Field(
        0.95, description="share of the pattern removed by the stored dark-offset map"
    )
    offset_ambient_lsb: NonNegative = Field(
        8.0, le=MOST_LSB, description="row-parity offset that ambient adds at a full tap, LSB"
    )
    offset_drift_lsb_per_k: NonNegative = Field(
        0.0, le=MOST_LSB, description="std of the offset pattern's change per kelvin, LSB/K"
    )
    gray_max_exposure_s: Positive = Field(
        5e-3, ge=1e-7, le=10.0, description="longest gray exposure, s"
    )
    gray_target: Share = Field(0.3, description="mean of full scale aimed at by gray exposure")
    min_snr: NonNegative = Field(
        3.0,
        le=1e6,
        description="decoded amplitude over a sample's noise below which depth is invalid",
    )
    saturation_range_m: Positive = Field(
        6.2,
        ge=1e-4,
        description="d_sat of eq. 6 and 8: wrapped distances from here on are not trusted, m",
    )
    max_range_m: Positive = Field(
        25.0, ge=1e-3, le=1e6, description="range that is unwrapped and scored, m"
    )

    @model_validator(mode="after")
    def _consistent(self) -> SensorConfig:
        check_range("integration_s", self.integration_s)
        if self.veiling_glare + self.ghost > 1.0:
            raise ValueError(
                f"veiling_glare is {self.veiling_glare:g} and ghost {self.ghost:g}: more than all "
                "light; expected a sum of at most 1"
            )
        if self.f2_hz >= self.f1_hz:
            raise ValueError(f"f2_hz is {self.f2_hz:g}; expected less than f1_hz = {self.f1_hz:g}")
        if self.highest_harmonic % 2 == 0:
            raise ValueError(f"highest_harmonic is {self.highest_harmonic}; expected an odd number")
        if self.integration_s[0] <= 0 or self.integration_s[1] >= self.sample_period_s:
            raise ValueError(
                f"integration_s is {self.integration_s}; expected 0 < t < sample_period_s = "
                f"{self.sample_period_s:g} s"
            )
        return self

    @model_validator(mode="after")
    def _demodulates_at_most_all(self) -> SensorConfig:
        # Overtones are demodulated along with the fundamental, each with its own weight.
        weights = harmonic_weights(self.harmonic_strength, self.highest_harmonic)
        demodulated = self.contrast * sum(weight for _, weight in weights)
        if demodulated > 1.0:
            raise ValueError(
                f"contrast is {self.contrast:g} and harmonic_strength {self.harmonic_strength:g}: "
                f"{demodulated:.3f} of the signal would be demodulated; expected at most 1"
            )
        return self

    @model_validator(mode="after")
    def _ranges_are_unambiguous(self) -> SensorConfig:
        wrap_m = unambiguous_range_m(self.f1_hz)
        if self.saturation_range_m > wrap_m:
            raise ValueError(
                f"saturation_range_m is {self.saturation_range_m:g}; expected at most the "
                f"unambiguous range {wrap_m:.4g} m of f1_hz = {self.f1_hz:g}"
            )
        # Beyond the joint range two frequencies are as ambiguous as one is beyond its own.
        joint_m = joint_range_m(self.f1_hz, self.f2_hz)
        if self.max_range_m > joint_m:
            raise ValueError(
                f"max_range_m is {self.max_range_m:g}; expected at most the joint range "
                f"{joint_m:.4g} m of f1_hz = {self.f1_hz:g} and f2_hz = {self.f2_hz:g}"
            )
        return self
