"""Passive light in band: sun, sky and lamps.

Numbers are for 940 +- 15 nm: irradiance W m-2, radiance W m-2 sr-1, radiant intensity W sr-1.
Direct sun is ASTM G173's 11.6 W m-2 (air mass 1.5), scaled with air mass by Meinel's clearness
law; sky radiances are assumed ranges. Lamps are told as their makers tell them, in lm, cd, lx and
cd m-2, and `IN_BAND_W_PER_LM` has what their kind gives in band for it: a street that LED lamps
light well is dark to the sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from shotenv.world.geometry.materials import log_uniform
from shotenv.world.geometry.model import Lamp, Light
from unwrap.support import Range

G173_IRRADIANCE = 11.6
"""Direct sun of ASTM G173 in band, W m-2, at the air mass below."""
G173_AIR_MASS = 1.5
LOW_SUN_RAD = np.radians(15.0)
"""Elevation below which the sun counts as low."""
DUSK_RADIANCE = 5e-3
"""Radiance of the sky below which lamps are lit, W m-2 sr-1."""
NIGHT_SKY: Range = (5e-7, 1e-5)
"""Radiance of the sky by night, W m-2 sr-1, over decades. Assumed: airglow is of the order of the
lower end, a full moon's sky is the day's by its 400,000, and towns add to both."""
TWILIGHT: Range = (2e-3, 3e-2)
"""Radiance of the sky when a dusk begins, W m-2 sr-1; assumed."""
FASTEST_FADING_PER_S = 0.6
BRIGHTEST_FACE = 2.0
"""Radiance at which lamp faces are capped, W m-2 sr-1: about a white wall in the sun."""

LampKind = Literal["led", "halogen", "incandescent", "fluorescent", "sodium", "metal_halide"]

IN_BAND_W_PER_LM: dict[LampKind, float] = {
    # Planck at 3000 K and at 2700 K over CIE's photopic luminosity. Tungsten emits about 14 % less
    # at 940 nm than in the green, for the same temperature; that is ignored.
    "halogen": 9.8e-4,
    "incandescent": 1.42e-3,
    # All assumed. The spectrum of LEDs ends before 800 nm but for a faint tail; discharges in
    # mercury, in sodium (high pressure) and in metal halides have lines in the near infrared.
    "led": 1e-6,
    "fluorescent": 5e-6,
    "sodium": 2e-5,
    "metal_halide": 1e-4,
}
"""Power within 940 +- 15 nm for each lumen, W lm-1. The sun's is about 1e-4."""


@dataclass(frozen=True)
class Lighting:
    """How bright lamps of a place or a vehicle are to the eye, and which kinds of lamps they are.

    Attributes
    ----------
    amount : (low, high)
        Flux (lm), intensity (cd), illuminance (lx) or luminance (cd m-2), drawn log-uniformly.
    shares : mapping
        How often a lamp is of a kind; they add up to 1.
    """

    amount: Range
    shares: Mapping[LampKind, float]

    def draw_kind(self, rng: np.random.Generator) -> LampKind:
        """Kind of a lamp."""
        kinds = tuple(self.shares)
        return kinds[rng.choice(len(kinds), p=tuple(self.shares.values()))]

    def draw_in_band(self, rng: np.random.Generator) -> float:
        """A lamp's kind and amount are drawn: W for lm, W sr-1 for cd, W m-2 for lx, and so on."""
        return IN_BAND_W_PER_LM[self.draw_kind(rng)] * log_uniform(rng, self.amount)


LOW_BEAM = Lighting((400.0, 1000.0), {"led": 0.5, "halogen": 0.5})
"""Flux that leaves one head lamp, lm, about half of its source's (UNECE R37: 1000 lm for H4's low
beam, 1500 for H7); range and shares assumed."""


def sun_irradiance(elevation_rad: float) -> float:
    """Direct sun in band on a surface that faces it, clear air, W m-2; at most G173's.

    Transmission 0.7 ** (air mass ** 0.678) (Meinel and Meinel, 1976), relative to air mass 1.5;
    air mass by Kasten and Young (1989), which holds down to the horizon.
    """
    degrees = np.degrees(elevation_rad)
    air_mass = 1.0 / (np.sin(elevation_rad) + 0.50572 * (degrees + 6.07995) ** -1.6364)
    relative = 0.7 ** (air_mass**0.678 - G173_AIR_MASS**0.678)
    return float(G173_IRRADIANCE * min(1.0, relative))


def direction(azimuth_rad: float, elevation_rad: float) -> tuple[float, float, float]:
    """Unit vector from azimuth (from x towards y) and elevation."""
    level = np.cos(elevation_rad)
    return (
        float(level * np.cos(azimuth_rad)),
        float(level * np.sin(azimuth_rad)),
        float(np.sin(elevation_rad)),
    )


def sunny(rng: np.random.Generator, low_share: float = 0.3) -> Light:
    """Sun and a blue sky; the sun is low with probability `low_share`."""
    return low_sun(rng) if rng.random() < low_share else high_sun(rng)


def low_sun(rng: np.random.Generator) -> Light:
    """Sun at 2.5 to 15 degrees: long shadows; the sky is darker overhead, bright at the horizon."""
    return _sun_and_sky(rng, (2.5, 15.0), zenith=(0.12, 0.3), brighter=(1.4, 2.2))


def high_sun(rng: np.random.Generator) -> Light:
    """Sun at 15 to 60 degrees, more or less haze, and a sky that is brighter at the horizon."""
    return _sun_and_sky(rng, (15.0, 60.0), zenith=(0.3, 0.45), brighter=(1.1, 1.4))


def _sun_and_sky(
    rng: np.random.Generator, elevation_deg: Range, zenith: Range, brighter: Range
) -> Light:
    """Sun through haze from any side; the horizon is `brighter` times as bright as the zenith."""
    elevation, haze = np.radians(rng.uniform(*elevation_deg)), rng.uniform(0.0, 0.35)
    overhead = rng.uniform(*zenith)
    return Light(
        sun_irradiance=sun_irradiance(elevation) * (1.0 - haze),
        sun_direction=direction(rng.uniform(-np.pi, np.pi), elevation),
        sky_zenith=overhead,
        sky_horizon=overhead * rng.uniform(*brighter),
        lamps=(),
    )


def overcast(rng: np.random.Generator) -> Light:
    """No sun; the sky is up to three times brighter overhead than at the horizon (CIE overcast)."""
    zenith = log_uniform(rng, (0.2, 1.0))
    # Any unit vector will do for a sun that is not there.
    return Light(0.0, (0.0, 0.0, 1.0), zenith, zenith / rng.uniform(1.8, 3.0), ())


def night(rng: np.random.Generator) -> Light:
    """A dark sky, a little brighter at the horizon, and often the ego's own head lights."""
    sky = log_uniform(rng, NIGHT_SKY)
    lamps = ego_headlights(rng) if rng.random() < 0.75 else ()
    return Light(0.0, (0.0, 0.0, 1.0), sky, 1.5 * sky, lamps)


def dusk(rng: np.random.Generator, night: Light, duration_s: float) -> Light:
    """Twilight that falls to a night's darkness within a clip, or towards it.

    Nature takes half an hour for it. Clips show in seconds what drives go through, but no faster
    than `FASTEST_FADING_PER_S`, so that neighbouring frames still differ little.
    """
    brighter = log_uniform(rng, TWILIGHT) / night.sky_zenith
    fading = min(np.log(brighter) / duration_s, FASTEST_FADING_PER_S)
    # In a short clip it does not get as dark as the night in which it ends otherwise.
    return replace(
        night,
        sky_zenith=night.sky_zenith * brighter,
        sky_horizon=night.sky_horizon * brighter,
        fading_per_s=float(fading),
    )


def switched_on(rng: np.random.Generator, light: Light, duration_s: float) -> Light:
    """The lamps of a dusk: street lamps come on all at once, the ego's when its driver thinks so.

    Others who drive have theirs on.
    """
    street, own = rng.uniform(0.1, 0.8) * duration_s, rng.uniform(-0.3, 0.7) * duration_s
    lamps = tuple(
        lamp
        if lamp.carrier is not None
        else replace(lamp, on_s=float(own if lamp.rides else street))
        for lamp in light.lamps
    )
    return replace(light, lamps=lamps)


def is_dark(light: Light) -> bool:
    """Whether the sky is so dark that streets, windows and vehicles have their lamps on."""
    return light.sky_zenith < DUSK_RADIANCE


def ego_headlights(rng: np.random.Generator) -> tuple[Lamp, ...]:
    """Two head lights beside the camera, alike."""
    # Aimed 3 degrees down, with nothing beyond 26 degrees.
    cutoff = float(np.cos(0.45))
    intensity = low_beam_intensity(rng, cutoff)
    return tuple(
        Lamp((0.2, y, 0.65), intensity, 0.1, direction(0.0, -0.05), cutoff, rides=True)
        for y in (-0.65, 0.65)
    )


def low_beam_intensity(rng: np.random.Generator, cutoff_cos: float) -> float:
    """Intensity on the axis of a head lamp, W sr-1, whose cone ends at a cosine from it.

    All of its flux is in the cone: with the 10 to 40 kcd that real head lamps have in a few
    degrees, so wide a cone would give several times the flux of its bulb.
    """
    # The smooth step of a `Lamp` has half of the cone's solid angle as its integral.
    return LOW_BEAM.draw_in_band(rng) / (np.pi * (1.0 - cutoff_cos))


def face_radiance(intensity_w_sr: float, area_m2: float) -> float:
    """Radiance of a lamp's own face, capped so that it stays of the order of a sunlit wall."""
    return min(intensity_w_sr / area_m2, BRIGHTEST_FACE)


def intensity_above(rng: np.random.Generator, lighting: Lighting, height_m: float) -> float:
    """Intensity, W sr-1, of a lamp whose illuminance (lx) straight below is drawn."""
    return lighting.draw_in_band(rng) * height_m**2
