"""How light goes on from a surface: mirrored, straight through, or scattered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from shotenv.render.surfaces.scene import SURFACE_OFFSET_M, Hit


@dataclass(frozen=True)
class Onward:
    """How a light path goes on from a surface, and what it keeps of its light."""

    start: Any
    direction: Any
    kept: Any
    scatters: Any
    passes: Any
    number: Any
    """The random number that chose, stretched back to [0, 1)."""

    @classmethod
    def drawn(cls, hit: Hit, direction, number, sample) -> Onward:
        """Choose among the shares of the surface by `number`, a diffuse direction by `sample`."""
        mirror, clear, diffuse = chances(hit)
        mirrors = number < mirror
        passes = ~mirrors & (number < mirror + clear)
        scatters = ~mirrors & ~passes
        scattered = mi.Frame3f(hit.normal).to_world(mi.warp.square_to_cosine_hemisphere(sample))
        mirrored = direction - 2 * dr.dot(direction, hit.normal) * hit.normal
        # One number serves this choice and the lamp's: within its share it is uniform again once
        # that share is stretched to [0, 1).
        below = dr.select(mirrors, 0, dr.select(passes, mirror, mirror + clear))
        chance = dr.select(mirrors, mirror, dr.select(passes, clear, diffuse))
        share = dr.select(mirrors, hit.mirror, dr.select(passes, hit.clear, hit.diffuse))
        return cls(
            start=dr.select(passes, dr.fma(direction, SURFACE_OFFSET_M, hit.point), hit.leave),
            direction=dr.select(passes, direction, dr.select(mirrors, mirrored, scattered)),
            kept=dr.select(scatters, hit.albedo, 1) * share / chance,
            scatters=scatters,
            passes=passes,
            number=(number - below) / chance,
        )


def chances(hit: Hit):
    """Chances of going on mirrored, straight through, and diffusely; their sum is 1.

    Whole quarters, so that of four samples always as many go each way. Half of them or more go on
    mirrored or straight through where a surface does so besides scattering: what a wet road
    mirrors is bright and sharp, what it scatters dim and smooth, so that chances in proportion to
    the shares would leave the first to luck.
    """
    mirrors, clears, scatters = hit.mirror > 0, hit.clear > 0, hit.diffuse > 0
    both = mirrors & clears
    most = both | (hit.mirror + hit.clear > hit.diffuse)
    straight = dr.select(scatters, dr.select(most, 0.75, 0.5), 1)
    straight = dr.select(mirrors | clears, straight, 0)
    lesser = dr.select(both, 0.25, 0)
    mirror = dr.select(mirrors & (~clears | (hit.mirror > hit.clear)), straight - lesser, lesser)
    return mirror, straight - mirror, 1 - straight
