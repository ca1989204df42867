"""Near-infrared albedos of the things in a world.

Albedo ranges are in band (940 nm). Asphalt, concrete, soil, foliage, skin, clothes, white paint,
black car paint, tyres and retro-reflectors are the values of the project's physics notes; grass,
bark, plaster, brick, metal, glass, coloured paint and the rest are assumed from the same kind of
tables (dyes and most colour pigments are bright in the near infrared). Mirrored shares are assumed
too: of the order of Fresnel reflection, larger where things are mostly seen at a grazing angle.
None is calibrated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from unwrap.support import Range


@dataclass(frozen=True)
class Material:
    """One surface: diffuse albedo where the noise texture is 0 and 1, and what it adds.

    Attributes
    ----------
    albedo_low, albedo_high : float
        Diffuse albedo in band, 0..1.
    texture_m : float
        Length after which the noise texture repeats, metres.
    offset : float
        Shift of the texture in its own unit, so that equal objects do not look the same.
    retro : float
        Retro-reflection, times the Lambertian return.
    emission : float
        Radiance of the face itself, W m-2 sr-1.
    mirror, clear : float
        Shares of the light that are mirrored and that pass straight through, together at most 1;
        the rest meets the diffuse surface. Emission is not divided.

    Raises
    ------
    ValueError
        A share is negative, or both together exceed 1.
    """

    albedo_low: float
    albedo_high: float
    texture_m: float = 1.0
    offset: float = 0.0
    retro: float = 0.0
    emission: float = 0.0
    mirror: float = 0.0
    clear: float = 0.0

    def __post_init__(self) -> None:
        if self.mirror < 0 or self.clear < 0 or self.mirror + self.clear > 1:
            raise ValueError(
                f"mirror is {self.mirror:g} and clear is {self.clear:g}; expected shares of at "
                "least 0 that add up to at most 1"
            )

    def glowing(self, radiance: float) -> Material:
        """The same surface, lit from within with `radiance` in W m-2 sr-1."""
        return replace(self, emission=radiance)


@dataclass(frozen=True)
class Finish:
    """A kind of surface: the range its albedo is drawn from, and its texture.

    Attributes
    ----------
    albedo : (low, high)
        Mean albedo of an object, drawn uniformly.
    contrast : float
        Relative swing of the texture about the mean.
    texture_m : float
        Length after which the texture repeats, metres.
    retro : (low, high)
        Retro-reflection, drawn log-uniformly; (0, 0) for none.
    mirror, clear : (low, high)
        Shares of the light that are mirrored and that pass straight through.
    """

    albedo: Range
    contrast: float
    texture_m: float
    retro: Range = (0.0, 0.0)
    mirror: Range = (0.0, 0.0)
    clear: Range = (0.0, 0.0)

    def draw(self, rng: np.random.Generator) -> Material:
        """Material of one object."""
        mean = rng.uniform(*self.albedo)
        swing = self.contrast * mean
        retro = log_uniform(rng, self.retro) if self.retro[1] > 0 else 0.0
        return Material(
            albedo_low=max(0.0, mean - swing),
            albedo_high=min(1.0, mean + swing),
            texture_m=self.texture_m * rng.uniform(0.8, 1.25),
            offset=rng.uniform(),
            retro=retro,
            mirror=rng.uniform(*self.mirror),
            clear=rng.uniform(*self.clear),
        )


def log_uniform(rng: np.random.Generator, bounds: Range) -> float:
    """Draw whose logarithm is uniform between the logarithms of two positive bounds."""
    return float(np.exp(rng.uniform(np.log(bounds[0]), np.log(bounds[1]))))


# Mean albedo, swing of the texture about it, length after which the texture repeats in metres.
ASPHALT = Finish((0.08, 0.20), 0.40, 2.5)
CONCRETE = Finish((0.30, 0.40), 0.25, 3.0)
PAVING = Finish((0.25, 0.40), 0.30, 1.2)
SOIL = Finish((0.25, 0.35), 0.40, 2.0)
GRASS = Finish((0.35, 0.55), 0.45, 1.5)
FOLIAGE = Finish((0.40, 0.60), 0.50, 0.8)
BARK = Finish((0.20, 0.35), 0.50, 0.6)
SKIN = Finish((0.35, 0.60), 0.05, 0.5)
HAIR = Finish((0.05, 0.25), 0.30, 0.2)
# Most dyes absorb nothing in the near infrared: cloth is bright there, whatever its colour.
CLOTHES = Finish((0.30, 0.70), 0.25, 0.5)
DARK_CLOTHES = Finish((0.08, 0.35), 0.25, 0.5)
LEATHER = Finish((0.05, 0.20), 0.20, 0.3)
WHITE_PAINT = Finish((0.70, 0.85), 0.10, 1.0)
# Glass beads in the paint throw light back; drivers at night see it by them.
ROAD_PAINT = Finish((0.55, 0.80), 0.25, 0.8, retro=(2.0, 10.0))
BLACK_CAR_PAINT = Finish((0.03, 0.08), 0.10, 2.0, mirror=(0.04, 0.08))
COLOUR_CAR_PAINT = Finish((0.15, 0.60), 0.08, 2.0, mirror=(0.04, 0.08))
WHITE_CAR_PAINT = Finish((0.65, 0.80), 0.05, 2.0, mirror=(0.04, 0.08))
TYRE = Finish((0.03, 0.05), 0.20, 0.3)
RUBBER = Finish((0.04, 0.08), 0.20, 0.5)
# Opaque: windows that nothing is to be seen through, and that need not be traced through.
GLASS = Finish((0.02, 0.06), 0.30, 3.0, mirror=(0.06, 0.15))
CLEAR_GLASS = Finish((0.02, 0.10), 0.30, 3.0, mirror=(0.06, 0.12), clear=(0.65, 0.85))
TINTED_GLASS = Finish((0.02, 0.06), 0.30, 3.0, mirror=(0.06, 0.12), clear=(0.15, 0.60))
WATER = Finish((0.04, 0.10), 0.30, 2.0, mirror=(0.30, 0.60))
COATED_FLOOR = Finish((0.25, 0.45), 0.15, 3.0, mirror=(0.02, 0.10))
SNOW = Finish((0.80, 0.90), 0.06, 1.5)
UPHOLSTERY = Finish((0.10, 0.45), 0.20, 0.5)
GRAVEL = Finish((0.20, 0.40), 0.50, 2.2)
ROCK = Finish((0.20, 0.40), 0.40, 0.7)
LEAF_LITTER = Finish((0.25, 0.45), 0.55, 2.4)
PLASTIC = Finish((0.15, 0.70), 0.08, 1.0, mirror=(0.02, 0.04))
MACHINE_PAINT = Finish((0.35, 0.65), 0.15, 1.0, mirror=(0.02, 0.05))
METAL = Finish((0.30, 0.60), 0.15, 0.8)
DARK_METAL = Finish((0.08, 0.20), 0.20, 0.8)
BRICK = Finish((0.30, 0.50), 0.30, 0.9)
PLASTER = Finish((0.45, 0.75), 0.15, 3.0)
WOOD = Finish((0.35, 0.60), 0.30, 0.7)
CARDBOARD = Finish((0.45, 0.65), 0.15, 0.6)
# Times the Lambertian return: lamp housings send some light back, sheets of beads or prisms most of
# it, in a narrow cone about the way that it came.
LENS = Finish((0.30, 0.50), 0.20, 0.2, retro=(5.0, 30.0))
RETRO_SHEET = Finish((0.40, 0.60), 0.05, 1.0, retro=(100.0, 1000.0))
PLATE_SHEET = Finish((0.50, 0.70), 0.10, 0.3, retro=(50.0, 200.0))
