"""Sun, sky and lamps.

Sun and lamps are sought by a shadow ray each, the sky by further rays from the first surface, and
by those that the light paths shoot anyway from the others: what shades one of them (a roof hides
the sky) then adds no noise to the others. Deep indoors such rays would hardly ever find the sky:
from the first surface they aim at the opening, from others the sun's ray does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.render.backend import upload
from shotenv.render.instants import Instants
from shotenv.render.surfaces import REACH_M, Hit, Scene
from shotenv.world.geometry import MAX_LAMPS, Indoor, Lamp, World, rotation

_LAMP_NUMBERS = 12
"""Numbers of a lamp: three packets of four, as they are gathered."""
AHEAD_M = 6.0
"""How far ahead of the camera lamps light most of what it sees; assumed."""
FADING_SHARE = 0.15
"""Share of the distance to the first lamp that is left out, over which lamps are dimmed."""


@dataclass(frozen=True)
class _Choice:
    """The lamp kept out of those offered so far, and the irradiance that all would give."""

    total: Any
    direction: Any
    length: Any
    number: Any

    def offer(self, irradiance, direction, length) -> _Choice:
        """Keep the new lamp with probability `irradiance` over the new total.

        The random number is stretched back to [0, 1) for the next offer.
        """
        # Weighted reservoir sampling with room for one (Chao, 1982): what is offered need not be
        # known beforehand, and no table of it is kept.
        total = self.total + irradiance
        share = dr.select(total > 0, irradiance / total, 0)
        taken = self.number < share
        rest = (self.number - share) / (1 - share)
        return _Choice(
            total,
            dr.select(taken, direction, self.direction),
            dr.select(taken, length, self.length),
            dr.select(taken, self.number / share, rest),
        )


class PassiveLight:
    """Sun, sky and lamps of a world at each instant, on the device."""

    def __init__(self, world: World, instants: Instants):
        # Daylight changes little within a frame: one number for all of its instants.
        light = world.light.at(instants.times_s[0])
        # Numbers are made opaque: Dr.Jit would compile a plain one into the kernel as a constant,
        # and every world would wait for a kernel of its own.
        self._lamps = upload(np.stack([lamp_table(world, t) for t in instants.times_s]))
        self._lamp_count = dr.opaque(mi.UInt32, min(len(light.lamps), MAX_LAMPS))
        self._opening = _Openings(light.indoor)
        self._sun_irradiance = dr.opaque(mi.Float, light.sun_irradiance)
        self._sun_direction = mi.Vector3f(
            [dr.opaque(mi.Float, number) for number in light.sun_direction]
        )
        self._horizon = dr.opaque(mi.Float, light.sky_horizon)
        self._zenith = dr.opaque(mi.Float, light.sky_zenith)

    def sky(self, direction):
        """Radiance of the sky, W m-2 sr-1: linear in the sine of elevation, the horizon's below."""
        return dr.fma(self._zenith - self._horizon, dr.maximum(direction.z, 0), self._horizon)

    def sky_irradiance(self, scene: Scene, hit: Hit, instant, points, active):
        """Estimate of the sky's irradiance on a surface, W m-2, by a ray for each of `points`.

        Points of the unit square. Deep indoors the rays aim at the opening.
        """
        frame, total, aimed = mi.Frame3f(hit.normal), mi.Float(0), self.sky_is_aimed_at(hit)
        for point in points:
            scattered = frame.to_world(mi.warp.square_to_cosine_hemisphere(point))
            inward, solid_angle = self._opening.aim(hit.point, point)
            direction = dr.select(aimed, inward, scattered)
            # What a ray stands for, by what all directions above the surface do.
            share = dr.select(aimed, _projected(hit, inward, solid_angle) * dr.inv_pi, 1)
            seeks = active & (share > 0)
            free = scene.transmission(hit.leave, direction, mi.Float(REACH_M), instant, seeks)
            total += self.sky(direction) * share * free
        return total * (dr.pi / len(points))

    def sun_irradiance(self, scene: Scene, hit: Hit, instant, active):
        """Irradiance of the sun on a surface, with its shadow, W m-2."""
        sun = self._unshadowed_sun(hit)
        lit = active & (sun > 0)
        reach = mi.Float(REACH_M)
        return sun * scene.transmission(hit.leave, self._sun_direction, reach, instant, lit)

    def daylight(self, scene: Scene, hit: Hit, instant, aim, number, active):
        """Irradiance of the sun on a surface, with its shadow, W m-2; deep indoors also the sky's.

        Indoors, daylight comes through the opening: the sky is sampled there, and one of sun and
        sky is drawn in proportion to their unshadowed irradiance.
        """
        direction, solid_angle = self._opening.aim(hit.point, aim)
        sky = self.sky(direction) * _projected(hit, direction, solid_angle)
        sky = dr.select(self.sky_is_aimed_at(hit), sky, 0)
        choice = _Choice(sky, direction, mi.Float(REACH_M), number)
        sun = self._unshadowed_sun(hit)
        choice = choice.offer(sun, self._sun_direction, mi.Float(REACH_M))
        lit = active & (choice.total > 0)
        share = scene.transmission(hit.leave, choice.direction, choice.length, instant, lit)
        return choice.total * share

    def _unshadowed_sun(self, hit: Hit):
        sun = self._sun_irradiance * dr.maximum(dr.dot(hit.normal, self._sun_direction), 0)
        return dr.select(self._opening.lets_in(hit.point, self._sun_direction), sun, 0)

    def sky_is_aimed_at(self, hit: Hit):
        """Whether `daylight` holds the sky's light on this surface already."""
        return self._opening.is_far(hit.point)

    def lamps(self, scene: Scene, hit: Hit, instant, number, active):
        """Estimate of the lamps' irradiance on a surface, W m-2, from a random `number`.

        The irradiance of every lamp is computed unshadowed; one lamp is drawn in proportion, and
        only that one is tested for shadow: the estimate is the sum of all irradiances where the
        lamp is seen and 0 where it is not, so that no estimate exceeds what is possible.
        """

        def more(index, *_):
            return active & (index < self._lamp_count)

        def offer(index, *state):
            lamp = self._lamp(instant * MAX_LAMPS + index, hit, active)
            kept = _Choice(*state).offer(*lamp)
            return (index + 1, kept.total, kept.direction, kept.length, kept.number)

        # A loop on the device: unrolled in Python, every number of lamps would be another kernel.
        start = (mi.UInt32(0), mi.Float(0), mi.Vector3f(0, 0, 1), mi.Float(0), number)
        _, *state = dr.while_loop(start, more, offer, label="lamps")
        choice = _Choice(*state)
        lit = active & (choice.total > 0)
        share = scene.transmission(hit.leave, choice.direction, choice.length, instant, lit)
        return choice.total * share

    def _lamp(self, row, hit: Hit, active):
        """Irradiance, direction and length of the shadow ray of one lamp at a surface."""
        rows = [dr.gather(mi.Vector4f, self._lamps, 3 * row + i, active) for i in range(3)]
        position, axis, cutoff_cos = rows[0].xyz, rows[1].xyz, rows[1].w
        intensity, radius = rows[0].w, rows[2].x
        away = position - hit.point
        square = dr.squared_norm(away)
        distance = dr.sqrt(square)
        direction = away / dr.maximum(distance, 1e-6)
        cos_surface = dr.maximum(dr.dot(hit.normal, direction), 0)
        falloff = spot_falloff(-dr.dot(axis, direction), cutoff_cos)
        irradiance = intensity * falloff * cos_surface / (square + dr.square(radius))
        # The lamp's own housing is within its radius and throws no shadow.
        return irradiance, direction, dr.maximum(distance - radius, 0)


class _Openings:
    """Where daylight enters a roofed box: a rectangle in the plane of its far end, one in its near.

    Without a box nothing is indoors; an opening that is not there has no area and lets in nothing.
    """

    def __init__(self, indoor: Indoor | None):
        low, high = (indoor.low, indoor.high) if indoor else ((1.0,) * 3, (0.0,) * 3)
        self._low, self._high = _opaque_point(low), _opaque_point(high)
        self._far = _Rectangle(high[0], indoor and indoor.opening)
        self._near = _Rectangle(low[0], indoor and indoor.entrance)

    def _is_indoors(self, point):
        return dr.all(point > self._low) & dr.all(point < self._high)

    def is_far(self, point):
        """Whether a point is indoors, and so far in that rays at random would miss the openings."""
        wide = dr.maximum(self._far.solid_angle(point), self._near.solid_angle(point))
        return self._is_indoors(point) & (wide < 1)

    def aim(self, point, sample):
        """Direction to a point of an opening drawn evenly, and the solid angle it stands for."""
        far, near = self._far.solid_angle(point), self._near.solid_angle(point)
        # The wider one is drawn more often; the random number is stretched back to [0, 1).
        share = dr.select(far + near > 0, far / (far + near), 1)
        ahead = sample.x < share
        stretched = dr.select(ahead, sample.x / share, (sample.x - share) / (1 - share))
        sample = mi.Point2f(stretched, sample.y)
        away = dr.select(ahead, self._far.at(sample), self._near.at(sample)) - point
        # Points in the opening itself would divide by zero.
        square = dr.maximum(dr.squared_norm(away), 1e-6)
        direction = away * dr.rsqrt(square)
        facing = dr.maximum(dr.select(ahead, direction.x, -direction.x), 0)
        area = dr.select(ahead, self._far.area / share, self._near.area / (1 - share))
        return direction, area * facing / square

    def lets_in(self, point, direction):
        """Whether a point is outdoors, or a ray from it in this direction leaves by an opening."""
        out = (self._far.is_met(point, direction) & (direction.x > 0)) | (
            self._near.is_met(point, direction) & (direction.x < 0)
        )
        return ~self._is_indoors(point) | out


class _Rectangle:
    """A rectangle across x; (lower, upper) corner (y, z), or None for one without area."""

    def __init__(self, x: float, corners: Any):
        low, high = corners or ((0.0, 0.0), (0.0, 0.0))
        self._from, self._to = _opaque_point((x, *low)), _opaque_point((x, *high))
        self._size = self._to - self._from
        self.area = self._size.y * self._size.z

    def at(self, sample):
        """Its point at two shares of its sides."""
        return self._from + self._size * mi.Vector3f(0, sample.x, sample.y)

    def solid_angle(self, point):
        """About how wide it looks from a point: area over the square of the distance."""
        away = self._from + self._size * 0.5 - point
        return self.area / dr.maximum(dr.squared_norm(away), 1e-6)

    def is_met(self, point, direction):
        """Whether the line through a point in a direction crosses it."""
        # Rays along the wall divide by 0: they cross at infinity or NaN, and neither is inside.
        crossing = point + (self._from.x - point.x) / direction.x * direction
        inside = (crossing.y > self._from.y) & (crossing.y < self._to.y)
        return inside & (crossing.z > self._from.z) & (crossing.z < self._to.z)


def _projected(hit: Hit, direction, solid_angle):
    """Irradiance by radiance of a part of the sky; none is below the horizon."""
    cosine = dr.maximum(dr.dot(hit.normal, direction), 0)
    return dr.select(direction.z > 0, cosine * solid_angle, 0)


def _opaque_point(numbers):
    return mi.Point3f([dr.opaque(mi.Float, float(number)) for number in numbers])


def spot_falloff(cos_axis, cutoff_cos):
    """Intensity towards an angle from the axis: a smooth step from 0 at the cutoff to 1 ahead."""
    # A cutoff of -1 shines everywhere, and the step from 0 to 1 would have no room.
    t = dr.clip((cos_axis - cutoff_cos) / (1 - cutoff_cos), 0, 1)
    return dr.select(cutoff_cos <= -1, 1, t * t * (3 - 2 * t))


def lamp_table(world: World, time_s: float) -> np.ndarray:
    """Rows [MAX_LAMPS, 12]: position, intensity, axis, cutoff cosine, radius, zeros.

    Lamps that ride with the camera or are carried have moved rigidly with it since time 0. Of more
    lamps than rows, those nearest to what the camera sees shine, the last of them dimmed the more,
    the nearer the first one that is left out: in a long drive none comes on at once.
    """
    # Rows of lamps that are not there stay 0; the loop over lamps stops before them.
    table = np.zeros((MAX_LAMPS, _LAMP_NUMBERS), np.float32)
    lamps = [(lamp, *_lamp_pose(world, lamp, time_s)) for lamp in world.light.lamps]
    dimmed = nearest_lamps(world, [place for *_, place in lamps], time_s)
    for row, (index, share) in zip(table, dimmed, strict=False):
        lamp, turn, position = lamps[index]
        axis = turn @ lamp.direction
        row[:3], row[3] = position, share * lamp.share_on(time_s) * lamp.intensity_w_sr
        row[4:7], row[7] = axis / np.linalg.norm(axis), lamp.cutoff_cos
        row[8] = lamp.radius_m
    return table


def nearest_lamps(
    world: World, places: Sequence[np.ndarray], time_s: float
) -> list[tuple[int, float]]:
    """Numbers of the at most `MAX_LAMPS` lamps that shine, nearest first, and by which share."""
    if len(places) <= MAX_LAMPS:
        return [(index, 1.0) for index in range(len(places))]
    camera = world.ego.at(time_s)
    # The camera looks ahead: lamps a little before it light more of what it sees.
    seen = np.add(camera.position_m, rotation(camera) @ (AHEAD_M, 0.0, 0.0))
    away = np.linalg.norm(np.array(places) - seen, axis=1)
    away[[lamp.rides for lamp in world.light.lamps]] = 0.0
    order = np.argsort(away, kind="stable")
    limit = away[order[MAX_LAMPS]]
    share = np.clip((limit - away) / (FADING_SHARE * limit), 0.0, 1.0)
    return [(int(index), float(share[index])) for index in order[:MAX_LAMPS]]


def _lamp_pose(world: World, lamp: Lamp, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Rotation [3, 3] from the axes that a lamp is described in to the world's, and its place."""
    position = np.asarray(lamp.position_m)
    if lamp.carrier is not None:
        carrier = world.moving[lamp.carrier].motion.at(time_s)
        return rotation(carrier), rotation(carrier) @ position + carrier.position_m
    if lamp.rides:
        start, camera = world.ego.at(0.0), world.ego.at(time_s)
        turn = rotation(camera) @ rotation(start).T
        return turn, turn @ (position - start.position_m) + camera.position_m
    return np.eye(3), position
