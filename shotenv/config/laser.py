"""Configuration of the light source: power, heat, ageing and eye safety."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from shotenv.config.sensor import Kelvin
from unwrap.support import Fraction, NonNegative, Positive, Range, Section, check_range

# Assumed limits, far beyond any light source that a time-of-flight camera has, and such that all
# that is computed from them is finite. Kelvin are those of the imager: it is one module.
MOST_W, COLDEST_K = 1e4, 200.0
Watt = Annotated[float, Field(ge=0.0, le=MOST_W, allow_inf_nan=False)]
Seconds = Annotated[float, Field(gt=0.0, ge=1e-4, le=1e6)]
KelvinPerWatt = Annotated[float, Field(ge=0.0, le=1e5, allow_inf_nan=False)]

ROOM_K = 298.15
"""25 C, at which data sheets state the efficiency of a light source."""


class LaserConfig(Section):
    """The light source: power, efficiency, electronics, heat, trip, ageing and eye safety.

    Derating, efficiency slope, junction stage, ageing and the cap for eyes are off at zero.
    """

    name: str = Field(description="name of the light source")
    optical_power_w: Range = Field((4.0, 10.0), description="mean optical power while on, W")
    efficiency: float = Field(
        0.42, gt=0.0, lt=1.0, description="optical over electrical power at 25 C"
    )
    efficiency_slope_per_k: Fraction = Field(
        0.0, description="share of 1 by which the efficiency falls per kelvin above 25 C"
    )
    derate_k: Kelvin = Field(325.0, description="optical power falls above this temperature, K")
    derate_per_k: Fraction = Field(0.0, description="share of the power lost per kelvin above")
    derate_floor: Fraction = Field(0.2, gt=0.0, description="least share of the power that stays")
    driver_power_w: Watt = Field(2.1, description="modulation driver while integrating, W")
    readout_energy_j: NonNegative = Field(0.26e-3, le=1e3, description="energy of one readout, J")
    static_power_w: Watt = Field(62e-3, description="static power of the imager, W")
    energy_per_mac_j: NonNegative = Field(1e-12, le=1e-3, description="network energy per MAC, J")
    thermal_resistance_k_per_w: KelvinPerWatt = Field(
        20.0, gt=0.0, description="case to ambient, K/W"
    )
    thermal_time_constant_s: Seconds = Field(10.0, description="R times C of the case, s")
    junction_resistance_k_per_w: KelvinPerWatt = Field(0.0, description="junction to case, K/W")
    junction_time_constant_s: Seconds = Field(1.0, description="R times C of the junction, s")
    ambient_k: Range = Field((293.15, 313.15), description="ambient temperature per drive, K")
    trip_k: Kelvin = Field(330.0, description="laser switches off at this temperature, K")
    release_k: Kelvin = Field(325.0, description="laser comes back below this temperature, K")
    ageing_exponent: float = Field(
        0.0, ge=0.0, le=10.0, description="exponent of the current in the rate of ageing"
    )
    activation_energy_ev: float = Field(
        0.0, ge=0.0, le=3.0, description="activation energy of ageing (Arrhenius), eV"
    )
    rated_power_w: Positive = Field(
        7.0, ge=1e-3, le=MOST_W, description="optical power that the life is rated at, W"
    )
    rated_k: Kelvin = Field(333.15, description="junction temperature of the rated life, K")
    eye_limit_w: Watt = Field(0.0, description="cap of the average optical power, W")
    eye_window_s: NonNegative = Field(0.0, le=1e6, description="averaging time of that cap, s")

    @model_validator(mode="after")
    def _consistent(self) -> LaserConfig:
        check_range("optical_power_w", self.optical_power_w)
        check_range("ambient_k", self.ambient_k)
        if not 0 < self.optical_power_w[0] <= self.optical_power_w[1] <= MOST_W:
            raise ValueError(
                f"optical_power_w is {self.optical_power_w}; expected above 0 W and at most "
                f"{MOST_W:g}"
            )
        if not self.ambient_k[0] >= COLDEST_K:
            raise ValueError(f"ambient_k is {self.ambient_k}; expected at least {COLDEST_K:g} K")
        # A laser that trips at an ambient above its release would never come back.
        if not self.ambient_k[1] < self.release_k < self.trip_k:
            raise ValueError(
                f"release_k is {self.release_k:g}; expected above the hottest ambient_k "
                f"{self.ambient_k[1]:g} and below trip_k {self.trip_k:g}"
            )
        return self

    @model_validator(mode="after")
    def _effects_possible(self) -> LaserConfig:
        # A parameter at zero switches its effect off, and then the others need not make sense.
        lost = self.efficiency_slope_per_k * max(self.trip_k - ROOM_K, 0.0)
        if lost >= self.efficiency:
            raise ValueError(
                f"efficiency_slope_per_k is {self.efficiency_slope_per_k:g}, which takes {lost:g} "
                f"off the efficiency of {self.efficiency:g} up to trip_k {self.trip_k:g}; "
                "expected something to be left"
            )
        if self.derate_per_k and self.derate_k >= self.trip_k:
            raise ValueError(
                f"derate_k is {self.derate_k:g}; expected below trip_k {self.trip_k:g}, "
                "where the laser is off"
            )
        # The junction sits on the case; were it the slower one, it would not be a stage of its own.
        slowest_s = self.thermal_time_constant_s
        if self.junction_resistance_k_per_w and self.junction_time_constant_s >= slowest_s:
            raise ValueError(
                f"junction_time_constant_s is {self.junction_time_constant_s:g}; expected less "
                f"than that of the case, thermal_time_constant_s {slowest_s:g}"
            )
        if self.eye_limit_w and not self.eye_window_s:
            raise ValueError(
                f"eye_window_s is 0; expected the averaging time of eye_limit_w "
                f"{self.eye_limit_w:g} W, in s"
            )
        return self
