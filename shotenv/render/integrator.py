"""One launch: distance, ambient, active light and its correlation, of every pixel and instant.

Light paths start at the camera. At a surface they go on diffusely, mirrored, or straight through,
by chance in proportion to the surface's shares; sun, sky and lamps are added at each surface, and
so is the laser: by the way that the camera looks, back through all mirrors and panes, and directly.
What a mirror throws on a surface that is seen directly (a caustic) is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.config import CameraConfig
from shotenv.render.geometry import REACH_M, posed
from shotenv.render.instants import Instants
from shotenv.render.light import PassiveLight
from shotenv.render.modulation import FUNDAMENTAL, Harmonics, Modulation
from shotenv.render.pinhole import Pinhole
from shotenv.render.sampling import Lanes, Sampler
from shotenv.render.scene import SURFACE_OFFSET_M, Hit, Scene, Surroundings
from shotenv.world.geometry import World

_RETRO_COS = 0.5
"""Cosine of the steepest incidence at which surfaces retro-reflect: 60 degrees, assumed."""


@dataclass(frozen=True)
class Traced:
    """Light of T instants of one world.

    Attributes
    ----------
    distance_m : float32 [T, H, W]
        Radial distance to the first surface through the pixel's centre, metres; infinite where
        nothing is hit.
    ambient : float32 [T, H, W]
        Passive radiance, W m-2 sr-1; 0 at instants without passive light.
    active : float32 [T, H, W]
        Radiance of the laser's light, W m-2 sr-1 per watt; 0 at instants without laser.
    correlation : float32 [T, H, W]
        Sum over light paths of radiance times sum over harmonics h of
        w_h cos(h (2 pi f L / c - theta)), L the path length from laser to camera: a single bounce
        at distance d has the phase 4 pi f d / c.
    """

    distance_m: np.ndarray
    ambient: np.ndarray
    active: np.ndarray
    correlation: np.ndarray


def trace(
    world: World,
    instants: Instants,
    camera: CameraConfig,
    *,
    harmonics: Harmonics = FUNDAMENTAL,
    seed: int,
    surroundings: Surroundings | None = None,
) -> Traced:
    """Trace `camera.samples_per_pixel` paths per pixel and instant, in one kernel launch.

    The laser sits at the camera and shines evenly over the field of view. `harmonics` are those
    of the correlation, see `unwrap.signal.harmonic_weights`; `surroundings` are those of the
    same world, where frames of it have been traced before. The result depends on the arguments
    alone, bit for bit on one machine.
    """
    lanes = Lanes.of(len(instants), camera)
    eye = Pinhole(world.ego, instants, camera)
    sources = _Sources(
        eye,
        PassiveLight(world, instants),
        Modulation(instants, harmonics, lanes.instant),
        dr.gather(mi.Bool, mi.Bool(list(instants.laser)), lanes.instant),
        dr.gather(mi.Bool, mi.Bool(list(instants.passive)), lanes.instant),
    )
    surroundings = Surroundings(world) if surroundings is None else surroundings
    scene = Scene(surroundings, posed(world, surroundings.faces, instants.times_s, camera.bounces))
    sampler = Sampler(lanes, instants, camera, seed=seed)
    gathered = _follow(scene, sources, lanes, camera.bounces, sampler)
    return _collect(gathered, len(instants), camera)


@dataclass(frozen=True)
class _Sources:
    """The laser (at the eye), the passive lights, and which lanes each of them reaches."""

    eye: Pinhole
    passive: PassiveLight
    modulation: Modulation
    laser_on: Any
    passive_on: Any


@dataclass
class _Gathered:
    """What the lanes have gathered so far."""

    modulation: Modulation
    distance_m: Any
    ambient: Any
    active: Any
    correlation: Any

    def add_active(self, radiance, path_m) -> None:
        """Add laser light that came a way of `path_m` metres."""
        self.active += radiance
        self.correlation += radiance * self.modulation.at(path_m)


@dataclass(frozen=True)
class _Onward:
    """How a light path goes on from a surface, and what it keeps of its light."""

    start: Any
    direction: Any
    kept: Any
    scatters: Any
    passes: Any
    number: Any
    """The random number that chose, stretched back to [0, 1)."""

    @classmethod
    def drawn(cls, hit: Hit, direction, number, sample) -> _Onward:
        """Choose among the shares of the surface by `number`, a diffuse direction by `sample`."""
        mirror, clear, diffuse = _chances(hit)
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


LEAST_CHANCE, MOST_CHANCE = 0.5, 0.75
"""Chance, at least and at most, of going on mirrored or straight through where a surface does so
besides scattering: what a wet road mirrors is bright and sharp, what it scatters dim and smooth, so
that chances in proportion to the shares would leave the first to luck."""


def _chances(hit: Hit):
    """Chances of going on mirrored, straight through, and diffusely; their sum is 1."""
    straight = hit.mirror + hit.clear
    mixed = dr.clip(straight, LEAST_CHANCE, MOST_CHANCE)
    chance = dr.select(straight > 0, dr.select(hit.diffuse > 0, mixed, 1), 0)
    scale = dr.select(straight > 0, chance / straight, 0)
    return hit.mirror * scale, hit.clear * scale, 1 - chance


def _follow(
    scene: Scene, sources: _Sources, lanes: Lanes, bounces: int, sampler: Sampler
) -> _Gathered:
    """Walk every lane's path from the camera, adding the light of each surface hit."""
    passive, instant = sources.passive, lanes.instant
    origin, direction = sources.eye.rays(lanes, sampler.next_2d())
    hit = scene.hit(origin, direction, instant, mi.Bool(True), coherent=True)
    light = _Gathered(
        modulation=sources.modulation,
        distance_m=dr.select(hit.valid, hit.distance_m, dr.inf),
        ambient=dr.select(sources.passive_on & ~hit.valid, passive.sky(direction), 0),
        active=mi.Float(0),
        correlation=mi.Float(0),
    )
    throughput, walked_m = mi.Float(1), hit.distance_m
    # Share of the laser's light on the way that the camera looks; 0 once that way has scattered.
    # `bent`: a mirror or a diffuse surface lies behind, so that the laser shines on the next one
    # by another way than the camera looks. `seeks_sky`: a ray that meets nothing sees the sky,
    # which no aimed ray has counted already.
    way_back, bent, seeks_sky = mi.Float(1), mi.Bool(False), sources.passive_on
    # Density of having scattered to the surface, per its area: of the laser's two ways to it one.
    found = mi.Float(dr.inf)
    # A Python loop: each bounce is traced into the one kernel, which knows the first and the last.
    for bounce in range(bounces):
        laser_on, passive_on = hit.valid & sources.laser_on, hit.valid & sources.passive_on
        returned = _laser_along_view(sources.eye, hit, direction, walked_m)
        returned = dr.select(laser_on, throughput * way_back * returned, 0)
        light.add_active(returned, 2 * walked_m)
        if bounce > 0:
            lit = laser_on & bent
            radiance, leg_m = _laser_straight(scene, sources.eye, hit, instant, lit, found)
            light.add_active(throughput * radiance, walked_m + leg_m)
        if bounce + 1 < bounces:
            point = sampler.next_2d()
            radiance, way_m = _laser_by_emission(scene, sources.eye, hit, instant, point, laser_on)
            light.add_active(throughput * radiance, walked_m + way_m)
        # Faces of lamps glow for the camera and its mirrors alone: what they shine on others is
        # the `Lamp`'s, and would be counted twice.
        glow = dr.select(passive_on & (way_back > 0), hit.emission, 0)
        light.ambient += throughput * glow

        # Every lane draws all numbers at each surface, used or not, so that lanes stay in step.
        aim, which = sampler.next_2d(), sampler.next_1d()
        number, sample = sampler.next_choice(), sampler.next_2d()
        onward = _Onward.drawn(hit, direction, number, sample)
        numbers = aim, which, onward.number
        irradiance = passive.irradiance(scene, hit, instant, numbers, passive_on)
        # The surface reflects to the camera whatever way the path goes on.
        light.ambient += throughput * irradiance * hit.diffuse * hit.albedo * dr.inv_pi
        throughput *= onward.kept
        seeks_sky = passive_on & dr.select(
            onward.scatters, ~passive.sky_is_aimed_at(hit), seeks_sky | ~onward.passes
        )
        direction = onward.direction
        if bounce + 1 < bounces:
            bent |= ~onward.passes
            way_back *= dr.select(
                onward.scatters, 0, dr.select(onward.passes, hit.clear, hit.mirror)
            )
            previous, hit = hit, scene.hit(onward.start, direction, instant, hit.valid)
            walked_m += dr.norm(hit.point - previous.point)
            density = _density_by_scattering(previous, hit.point, hit.normal)
            found = dr.select(onward.scatters, density, dr.inf)
            free = dr.select(seeks_sky & ~hit.valid, 1, 0)
        else:
            # Nothing is seen of a surface beyond the last bounce: whether the sky is, is enough.
            reach = mi.Float(REACH_M)
            free = scene.transmission(onward.start, direction, reach, instant, seeks_sky)
        light.ambient += throughput * passive.sky(direction) * free
    return light


def _density_by_scattering(hit: Hit, point, normal):
    """Density, per area of a surface at `point`, of scattering from `hit` to that point, m-2."""
    way = point - hit.point
    # Points of one corner may lie on each other.
    square = dr.maximum(dr.squared_norm(way), 1e-8)
    direction = way * dr.rsqrt(square)
    leaving = dr.maximum(dr.dot(hit.normal, direction), 0)
    arriving = dr.maximum(-dr.dot(normal, direction), 0)
    *_, diffuse = _chances(hit)
    return diffuse * dr.inv_pi * leaving * arriving / square


def _laser_along_view(eye: Pinhole, hit: Hit, direction, distance_m):
    """Radiance per watt of the laser's light that came the way that the camera looks.

    Mirrors fold that way and panes dim it, but nothing else can stand on it. Surfaces that it
    meets steeply enough retro-reflect.
    """
    cosine = -dr.dot(hit.normal, direction)
    retro = dr.select(cosine > _RETRO_COS, hit.retro, 0)
    return _reflected(hit, eye.intensity, cosine, distance_m) * (1 + retro)


def _laser_straight(scene: Scene, eye: Pinhole, hit: Hit, instant, active, found):
    """Radiance per watt of the laser's light that came straight, and its distance.

    `found` is the density, per area, of having found the surface by scattering, infinite where no
    other way leads there. Where the laser could have found it by its own emission, both ways are
    weighted by their densities (balance heuristic, Veach and Guibas 1995).
    """
    intensity, direction, distance = eye.laser(hit.point, instant)
    cosine = dr.maximum(dr.dot(hit.normal, direction), 0)
    radiance = _reflected(hit, intensity, cosine, distance)
    lit = active & (radiance > 0)
    length = distance - SURFACE_OFFSET_M
    share = scene.transmission(hit.leave, direction, length, instant, lit)
    emitted = eye.emission_density(direction, instant) * cosine / dr.square(distance)
    # Emission stops at the first surface, so that behind a pane it finds nothing.
    weight = dr.select((share == 1) & (found < dr.inf), found / (found + emitted), 1)
    return dr.select(lit, radiance * share * weight, 0), dr.minimum(distance, REACH_M)


def _laser_by_emission(scene: Scene, eye: Pinhole, hit: Hit, instant, sample, active):
    """Radiance per watt of the surface `hit` in the light of a point that the laser shines on.

    And the length of the way from the laser over that point. The other half of `_laser_straight`:
    surfaces near the laser, which scattering finds by rare luck, are found here by plenty.
    """
    origin, direction, per_sr = eye.emitted(sample, instant)
    lit = scene.hit(origin, direction, instant, active)
    way = lit.leave - hit.leave
    length = dr.norm(way)
    toward = way / length
    cosine = dr.maximum(-dr.dot(lit.normal, direction), 0)
    emitted = per_sr * cosine / dr.square(lit.distance_m)
    found = _density_by_scattering(hit, lit.point, lit.normal)
    *_, diffuse = _chances(hit)
    radiance = _reflected(lit, eye.intensity, cosine, lit.distance_m)
    # Scattering keeps hit.diffuse * hit.albedo per density / chance.
    radiance *= hit.diffuse * hit.albedo * found / (diffuse * (found + emitted))
    seen = active & lit.valid & (radiance > 0)
    share = scene.transmission(hit.leave, toward, length - SURFACE_OFFSET_M, instant, seen)
    return dr.select(seen & (share == 1), radiance, 0), lit.distance_m + length


def _reflected(hit: Hit, intensity, cosine, distance_m):
    """Radiance that a surface reflects diffusely of a point source."""
    return hit.diffuse * hit.albedo * dr.inv_pi * intensity * cosine / dr.square(distance_m)


def _collect(light: _Gathered, instants: int, camera: CameraConfig) -> Traced:
    """Mean over the samples of each pixel; distances are those of sample 0, through its centre."""
    samples = camera.samples_per_pixel
    first = dr.arange(mi.UInt32, instants * camera.width * camera.height) * samples
    # The launch; the sums read other lanes, and so make a second, small kernel.
    dr.eval(light.distance_m, light.ambient, light.active, light.correlation)
    images = [
        dr.gather(mi.Float, light.distance_m, first),
        *(
            _sum(values, first, samples) / samples
            for values in (light.ambient, light.active, light.correlation)
        ),
    ]
    dr.eval(images)
    shape = (instants, camera.height, camera.width)
    return Traced(*(image.numpy().reshape(shape) for image in images))


def _sum(values, first, count: int):
    """Sums of `count` neighbours, halves on halves: what `dr.block_sum` gives, but sooner.

    On two cores, three sums of 12 instants of 160 x 120 pixels and 4 samples take 0.2 ms, against
    14 ms by `dr.block_sum`. Of 4 samples both give the same to the last bit, down to the sign of
    zero.
    """
    parts = [dr.gather(mi.Float, values, first + i) for i in range(count)]
    while len(parts) > 1:
        half = (len(parts) + 1) // 2
        parts = [reduce(add, parts[i::half]) for i in range(half)]
    return dr.select(parts[0] == 0, 0, parts[0])
