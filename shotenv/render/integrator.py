"""One launch: distance, ambient, active light and its correlation, of every pixel and instant.

Light paths start at the camera. At a surface they go on diffusely, mirrored, or straight through,
by chance in proportion to the surface's shares; sun, sky and lamps are added at each surface, and
so is the laser: by the way that the camera looks, back through all mirrors and panes, directly, and
by the points that it shines on.
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
from shotenv.render.instants import Instants
from shotenv.render.irradiance_filter import SoftLight, filtered
from shotenv.render.laser_light import (
    POINTS,
    POINTS_PER_PATH,
    LitPoints,
    along_view,
    density_by_scattering,
    straight,
)
from shotenv.render.light import PassiveLight
from shotenv.render.modulation import FUNDAMENTAL, Harmonics, Modulation
from shotenv.render.pinhole import Pinhole
from shotenv.render.sampling import Lanes, Sampler
from shotenv.render.surfaces import REACH_M, SURFACE_OFFSET_M, Hit, Scene, Surroundings, posed
from shotenv.world.geometry import World

VIEW_RAYS = 3
"""Rays of each path through its pixel for the laser's direct return: it is most of its light, and
where an edge crosses a pixel, its share of the pixel decides the distance."""
SKY_RAYS = 3
"""Rays of each path to the sky from the first surface that is seen."""


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

    The laser sits at the camera and shines as `camera.emission` says. `harmonics` are those of
    the correlation, see `unwrap.signal.harmonic_weights`; `surroundings` are those of the
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
    points = LitPoints.shone_on(scene, eye, instants, seed) if camera.bounces > 1 else None
    gathered = _follow(scene, sources, points, lanes, camera, sampler)
    distance_m = _true_distance(scene, eye, len(instants), camera)
    return _collect(gathered, distance_m, instants, camera)


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
    ambient: Any
    active: Any
    correlation: Any
    soft: Any
    first: Hit

    def add_ambient(self, radiance, soft=False) -> None:
        """Add passive light; `soft` is what its filter may average with that of neighbours."""
        if self.soft is None:
            self.ambient += radiance
        else:
            self.ambient += dr.select(soft, 0, radiance)
            self.soft += dr.select(soft, radiance, 0)

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


def _chances(hit: Hit):
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


def _follow(
    scene: Scene,
    sources: _Sources,
    points: LitPoints | None,
    lanes: Lanes,
    camera: CameraConfig,
    sampler: Sampler,
) -> _Gathered:
    """Walk every lane's path from the camera, adding the light of each surface hit.

    `points` are needed where paths have more than one surface.
    """
    passive, instant, bounces = sources.passive, lanes.instant, camera.bounces
    eye = sources.eye
    place, *further = sampler.in_pixel(VIEW_RAYS)
    origin, direction = eye.rays(lanes, place)
    intensity, share = eye.intensity(direction, instant), 1 / (1 + len(further))
    hit = scene.hit(origin, direction, instant, mi.Bool(True), coherent=True)
    light = _Gathered(
        modulation=sources.modulation,
        ambient=dr.select(sources.passive_on & ~hit.valid, passive.sky(direction), 0),
        active=mi.Float(0),
        correlation=mi.Float(0),
        soft=mi.Float(0) if camera.gray_filter_m else None,
        first=hit,
    )
    for place in further:
        _add_first_return(light, scene, sources, lanes, place, share)
    throughput, walked_m = mi.Float(1), hit.distance_m
    # Share of the laser's light on the way that the camera looks; 0 once that way has scattered.
    # `bent`: a mirror or a diffuse surface lies behind, so that the laser shines on the next one
    # by another way than the camera looks. `seeks_sky`: a ray that meets nothing sees the sky,
    # which no aimed ray has counted already.
    way_back, bent, seeks_sky = mi.Float(1), mi.Bool(False), sources.passive_on
    # Whether the first surface has scattered: what comes then changes little between pixels.
    soft = mi.Bool(False)
    # Density of having scattered to the surface, per its area: of the laser's two ways to it one.
    found = mi.Float(dr.inf)
    # A Python loop: each bounce is traced into the one kernel, which knows the first and the last.
    for bounce in range(bounces):
        laser_on, passive_on = hit.valid & sources.laser_on, hit.valid & sources.passive_on
        returned = along_view(hit, intensity, direction, walked_m)
        returned = dr.select(laser_on, throughput * way_back * returned, 0)
        if bounce == 0:
            returned *= share
        light.add_active(returned, 2 * walked_m)
        if bounce > 0:
            lit = laser_on & bent
            radiance, leg_m = straight(scene, eye, hit, instant, lit, found)
            light.add_active(throughput * radiance, walked_m + leg_m)
        if points is not None and bounce + 1 < bounces:
            chosen = sampler.next_block(POINTS_PER_PATH, POINTS), sampler.next_1d()
            *_, diffuse = _chances(hit)
            active, correlation = points.light(
                scene, eye, hit, diffuse, walked_m, instant, light.modulation, chosen, laser_on
            )
            light.active += dr.select(laser_on, throughput * active, 0)
            light.correlation += dr.select(laser_on, throughput * correlation, 0)
        # Faces of lamps glow for the camera and its mirrors alone: what they shine on others is
        # the `Lamp`'s, and would be counted twice.
        glow = dr.select(passive_on & (way_back > 0), hit.emission, 0)
        light.add_ambient(throughput * glow)

        # Every lane draws all numbers at each surface, used or not, so that lanes stay in step.
        aim, which = sampler.next_2d(), sampler.next_1d()
        number, sample = sampler.next_choice(), sampler.next_2d()
        onward = _Onward.drawn(hit, direction, number, sample)
        if bounce == 0:
            sky_points = sampler.next_points(SKY_RAYS)
            sky = passive.sky_irradiance(scene, hit, instant, sky_points, passive_on)
            light.add_ambient(sky * hit.diffuse * hit.albedo * dr.inv_pi, soft=True)
            daylight = passive.sun_irradiance(scene, hit, instant, passive_on)
        else:
            daylight = passive.daylight(scene, hit, instant, aim, which, passive_on)
        lamps = passive.lamps(scene, hit, instant, onward.number, passive_on)
        # The surface reflects to the camera whatever way the path goes on.
        direct = throughput * (daylight + lamps) * hit.diffuse * hit.albedo * dr.inv_pi
        light.add_ambient(direct, soft)
        if bounce == 0:
            soft = onward.scatters
        throughput *= onward.kept
        seeks_sky = passive_on & dr.select(
            onward.scatters,
            ~passive.sky_is_aimed_at(hit) & (bounce > 0),
            seeks_sky | ~onward.passes,
        )
        direction = onward.direction
        if bounce + 1 < bounces:
            bent |= ~onward.passes
            way_back *= dr.select(
                onward.scatters, 0, dr.select(onward.passes, hit.clear, hit.mirror)
            )
            previous, hit = hit, scene.hit(onward.start, direction, instant, hit.valid)
            walked_m += dr.norm(hit.point - previous.point)
            *_, diffuse = _chances(previous)
            density = density_by_scattering(previous, diffuse, hit.point, hit.normal)
            found = dr.select(onward.scatters, density, dr.inf)
            free = dr.select(seeks_sky & ~hit.valid, 1, 0)
        else:
            # Nothing is seen of a surface beyond the last bounce: whether the sky is, is enough.
            reach = mi.Float(REACH_M)
            free = scene.transmission(onward.start, direction, reach, instant, seeks_sky)
        light.add_ambient(throughput * passive.sky(direction) * free, soft)
    return light


def _add_first_return(
    light: _Gathered, scene: Scene, sources: _Sources, lanes: Lanes, place, share: float
) -> None:
    """Add a share of what the surface on another ray of the pixel returns of the laser directly."""
    eye, instant = sources.eye, lanes.instant
    origin, direction = eye.rays(lanes, place)
    hit = scene.hit(origin, direction, instant, sources.laser_on, coherent=True)
    returned = along_view(hit, eye.intensity(direction, instant), direction, hit.distance_m)
    light.add_active(dr.select(hit.valid, returned, 0) * share, 2 * hit.distance_m)


def _true_distance(scene: Scene, eye: Pinhole, instants: int, camera: CameraConfig):
    """Distance through the centres of all pixels at all instants; the same for every seed."""
    lanes = Lanes.of(instants, camera.model_copy(update={"samples_per_pixel": 1}))
    origin, direction = eye.rays(lanes, mi.Point2f(0.5, 0.5))
    return scene.distance_m(origin, direction, lanes.instant)


def _collect(light: _Gathered, distance_m: Any, instants: Instants, camera: CameraConfig) -> Traced:
    """Mean over the samples of each pixel."""
    samples = camera.samples_per_pixel
    first = dr.arange(mi.UInt32, len(distance_m)) * samples
    soft = None if light.soft is None else SoftLight.of(light.soft, light.first)
    # The launch; the sums read other lanes, and so make a second, small kernel.
    dr.eval(distance_m, light.ambient, light.active, light.correlation, soft)
    images = [
        distance_m,
        *(
            _sum(values, first, samples) / samples
            for values in (light.ambient, light.active, light.correlation)
        ),
    ]
    dr.eval(images)
    shape = (-1, camera.height, camera.width)
    traced = Traced(*(image.numpy().reshape(shape) for image in images))
    passive = np.flatnonzero(instants.passive)
    if soft is not None and len(passive):
        traced.ambient[passive] += filtered(soft, passive, camera)
    return traced


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
