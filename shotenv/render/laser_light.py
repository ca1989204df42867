"""The laser's light on a surface: along the view, straight, and by way of other surfaces.

Light over two surfaces is sought from both ends. From the laser: what it shines on is a set of
points that all pixels share, and each pixel sums the light of many of them. From the surface: a
scattered ray may end where the laser shines. Both ways to the same point are weighted by how
likely each finds it (multiple importance sampling with the balance heuristic, Veach and Guibas
1995): points lie dense near the laser, scattered rays in narrow corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from shotenv.render.instants import Instants
from shotenv.render.pinhole import Pinhole
from shotenv.render.sampling import plane_sequence
from shotenv.render.surfaces import REACH_M, SURFACE_OFFSET_M, Hit, Scene

POINTS = 4096
"""Points that the laser shines on, at each instant: more than a hundred times those of a pixel."""
POINTS_PER_PATH = 12
"""How many of them light each surface that a path meets. Their sum costs arithmetic only; one ray
asks for the shadow of all."""
_RETRO_COS = 0.5
"""Cosine of the steepest incidence at which surfaces retro-reflect: 60 degrees, assumed."""


def along_view(hit: Hit, intensity, direction, distance_m):
    """Radiance per watt of the laser's light that came the way that the camera looks.

    Mirrors fold that way and panes dim it, but nothing else can stand on it. Surfaces that it
    meets steeply enough retro-reflect.
    """
    cosine = -dr.dot(hit.normal, direction)
    retro = dr.select(cosine > _RETRO_COS, hit.retro, 0)
    return _reflected(hit, intensity, cosine, distance_m) * (1 + retro)


def straight(scene: Scene, eye: Pinhole, hit: Hit, instant, active, found):
    """Radiance per watt of the laser's light that came straight, and its distance.

    `found` is the density, per area, of having found the surface by scattering from another one
    that the laser's points light too; infinite where no such way leads there.
    """
    intensity, direction, distance = eye.laser(hit.point, instant)
    cosine = dr.maximum(dr.dot(hit.normal, direction), 0)
    radiance = _reflected(hit, intensity, cosine, distance)
    lit = active & (radiance > 0)
    length = distance - SURFACE_OFFSET_M
    share = scene.transmission(hit.leave, direction, length, instant, lit)
    emitted = POINTS_PER_PATH * intensity * cosine / dr.square(distance)
    # The points are the first surfaces that the laser meets: behind a pane there are none.
    weight = dr.select((share == 1) & (found < dr.inf), found / (found + emitted), 1)
    return dr.select(lit, radiance * share * weight, 0), dr.minimum(distance, REACH_M)


def density_by_scattering(hit: Hit, chance, point, normal):
    """Density, per area of a surface at `point`, of a path that scatters from `hit`, m-2.

    `chance` is that of going on diffusely.
    """
    way = point - hit.point
    # Points of one corner may lie on each other.
    square = dr.maximum(dr.squared_norm(way), 1e-8)
    direction = way * dr.rsqrt(square)
    leaving = dr.maximum(dr.dot(hit.normal, direction), 0)
    arriving = dr.maximum(-dr.dot(normal, direction), 0)
    return chance * dr.inv_pi * leaving * arriving / square


@dataclass(frozen=True)
class LitPoints:
    """Points that the laser shines on: `POINTS` at each instant, the same directions at all.

    Attributes
    ----------
    places, faces : flat device arrays, four numbers for each point
        Position and density per area of the laser's photons (m-2); normal towards the laser and
        reflected share over pi, times photons over points drawn there.
    """

    places: Any
    faces: Any

    @classmethod
    def shone_on(cls, scene: Scene, eye: Pinhole, instants: Instants, seed: int) -> LitPoints:
        """Shoot the laser's rays, in a small launch of its own."""
        lane = dr.arange(mi.UInt32, len(instants) * POINTS)
        instant = lane // POINTS
        laser_on = dr.gather(mi.Bool, mi.Bool(list(instants.laser)), instant)
        sequence = plane_sequence(POINTS, seed)
        origin, direction, drawn = eye.emitted(sequence, lane % POINTS, instant)
        hit = scene.hit(origin, direction, instant, laser_on, coherent=True)
        intensity = eye.intensity(direction, instant)
        cosine = -dr.dot(hit.normal, direction)
        per_area = dr.select(hit.valid, intensity * cosine / dr.square(hit.distance_m), 0)
        share = hit.diffuse * hit.albedo * dr.inv_pi * intensity / drawn
        n, p = hit.normal, hit.leave
        points = cls(
            dr.ravel(mi.Vector4f(p.x, p.y, p.z, per_area)),
            dr.ravel(mi.Vector4f(n.x, n.y, n.z, share)),
        )
        dr.eval(points.places, points.faces)
        return points

    def light(self, scene, eye, hit, chance, walked_m, instant, modulation, numbers, active):
        """Radiance per watt of a surface in the light of the points, and its correlation.

        Parameters
        ----------
        chance : float
            That the light path goes on diffusely from the surface, for the weights.
        walked_m : float
            Way from the surface back to the camera, metres.
        numbers : first point of those taken, and a number in [0, 1)
            The latter chooses the point whose shadow is looked for.
        """
        first, number = numbers
        albedo = hit.diffuse * hit.albedo * dr.inv_pi
        reach = chance * dr.inv_pi
        row, laser = instant * POINTS, eye.position(instant)

        def one(index):
            """Radiance by one point were nothing between, its direction, and both distances."""
            at = row + (first + index) % POINTS
            place = dr.gather(mi.Vector4f, self.places, at, active)
            face = dr.gather(mi.Vector4f, self.faces, at, active)
            way = place.xyz - hit.leave
            square = dr.maximum(dr.squared_norm(way), 1e-8)
            scale = dr.rsqrt(square)
            leaving = dr.maximum(dr.dot(hit.normal, way) * scale, 0)
            arriving = dr.maximum(-dr.dot(face.xyz, way) * scale, 0)
            facing = leaving * arriving / square
            density = dr.fma(POINTS_PER_PATH, place.w, reach * facing)
            radiance = albedo * facing * face.w * place.w / dr.maximum(density, 1e-20)
            path_m = walked_m + square * scale + dr.norm(place.xyz - laser)
            return radiance, way * scale, square * scale, path_m

        def more(index, *_):
            return active & (index < POINTS_PER_PATH)

        def add(index, total, correlation, kept, number):
            radiance, *_, path_m = one(index)
            total += radiance
            # One point is kept, in proportion to its light (Chao, 1982).
            share = dr.select(total > 0, radiance / total, 0)
            taken = number < share
            return (
                index + 1,
                total,
                correlation + radiance * modulation.at(path_m),
                dr.select(taken, index, kept),
                dr.select(taken, number / share, (number - share) / (1 - share)),
            )

        start = (mi.UInt32(0), mi.Float(0), mi.Float(0), mi.UInt32(0), mi.Float(number))
        _, total, correlation, kept, _ = dr.while_loop(start, more, add, label="laser's points")
        _, direction, length_m, path_m = one(kept)
        lit = active & (total > 0)
        free = scene.transmission(hit.leave, direction, length_m - SURFACE_OFFSET_M, instant, lit)
        # The sum of all, less what the shadow takes, estimated by the one: nothing is left to
        # chance where nothing stands between, which is nearly everywhere.
        shaded = dr.select(free == 1, 0, total)
        return total - shaded, correlation - shaded * modulation.at(path_m)


def _reflected(hit: Hit, intensity, cosine, distance_m):
    """Radiance that a surface reflects diffusely of a point source."""
    return hit.diffuse * hit.albedo * dr.inv_pi * intensity * cosine / dr.square(distance_m)
