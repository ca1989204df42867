"""One launch: distance, ambient, active light and its correlation, of every pixel and instant.

Light paths start at the camera. At a surface they go on diffusely, mirrored, or straight through,
by chance in proportion to the surface's shares; sun, sky and lamps are added at each surface, and
so is the laser: by the way that the camera looks, back through all mirrors and panes, directly, and
by the points that it shines on.
What a mirror throws on a surface that is seen directly (a caustic) is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
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
from shotenv.render.sampling import Lanes, Sampler, pixel_sums
from shotenv.render.surfaces import (
    REACH_M,
    Hit,
    Onward,
    Scene,
    Surroundings,
    chances,
    posed,
)
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


@dataclass
class _Path:
    """Where a light path from the camera is, and what it keeps of the light that it meets there."""

    instant: Any
    hit: Hit
    direction: Any
    walked_m: Any
    seeks_sky: Any
    """Whether the sky is counted where the way onward meets nothing."""
    throughput: Any
    way_back: Any
    """Share of the laser's light on the way that the camera looks; 0 once that has scattered."""
    bent: Any
    """Whether a mirror or a diffuse surface lies behind, so that the laser shines on the surface by
    another way than the camera looks."""
    soft: Any
    """Whether the first surface has scattered: what comes then changes little between pixels."""
    found: Any
    """Density of having scattered to the surface, per its area: of the laser's two ways to it one;
    infinite where the path has not scattered."""

    def arrive(self, scene: Scene, onward: Onward) -> None:
        """Go on to the next surface."""
        previous = self.hit
        self.bent |= ~onward.passes
        self.way_back *= dr.select(
            onward.scatters, 0, dr.select(onward.passes, previous.clear, previous.mirror)
        )
        self.hit = hit = scene.hit(onward.start, self.direction, self.instant, previous.valid)
        self.walked_m += dr.norm(hit.point - previous.point)
        *_, diffuse = chances(previous)
        density = density_by_scattering(previous, diffuse, hit.point, hit.normal)
        self.found = dr.select(onward.scatters, density, dr.inf)


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
    place, *further = sampler.in_pixel(VIEW_RAYS)
    origin, direction = sources.eye.rays(lanes, place)
    intensity = sources.eye.intensity(direction, instant)
    hit = scene.hit(origin, direction, instant, mi.Bool(True), coherent=True)
    light = _Gathered(
        modulation=sources.modulation,
        ambient=dr.select(sources.passive_on & ~hit.valid, passive.sky(direction), 0),
        active=mi.Float(0),
        correlation=mi.Float(0),
        soft=mi.Float(0) if camera.gray_filter_m else None,
        first=hit,
    )
    share = 1 / (1 + len(further))
    for place in further:
        _add_first_return(light, scene, sources, lanes, place, share)
    path = _Path(
        instant,
        hit,
        direction,
        hit.distance_m,
        seeks_sky=sources.passive_on,
        throughput=mi.Float(1),
        way_back=mi.Float(1),
        bent=mi.Bool(False),
        soft=mi.Bool(False),
        found=mi.Float(dr.inf),
    )
    # A Python loop: each bounce is traced into the one kernel, which knows the first and the last.
    for bounce in range(bounces):
        first, last = bounce == 0, bounce + 1 == bounces
        laser_on = path.hit.valid & sources.laser_on
        returned = along_view(path.hit, intensity, path.direction, path.walked_m)
        returned = dr.select(laser_on, path.throughput * path.way_back * returned, 0)
        light.add_active(returned * (share if first else 1), 2 * path.walked_m)
        if not first:
            lit = laser_on & path.bent
            radiance, leg_m = straight(scene, sources.eye, path.hit, instant, lit, path.found)
            light.add_active(path.throughput * radiance, path.walked_m + leg_m)
        if points is not None and not last:
            _add_lit_points(light, scene, sources, points, path, sampler)
        onward = _add_passive(light, scene, sources, path, sampler, first=first)
        # Where a surface scatters, rays may have been aimed at the sky; from the first some were.
        seeks_sky = dr.select(
            onward.scatters,
            mi.Bool(False) if first else ~passive.sky_is_aimed_at(path.hit),
            path.seeks_sky | ~onward.passes,
        )
        path.seeks_sky = path.hit.valid & sources.passive_on & seeks_sky
        path.soft = onward.scatters if first else path.soft
        path.throughput *= onward.kept
        path.direction = onward.direction
        if not last:
            path.arrive(scene, onward)
            free = dr.select(path.seeks_sky & ~path.hit.valid, 1, 0)
        else:
            # Nothing is seen of a surface beyond the last bounce: whether the sky is, is enough.
            reach = mi.Float(REACH_M)
            free = scene.transmission(onward.start, path.direction, reach, instant, path.seeks_sky)
        light.add_ambient(path.throughput * passive.sky(path.direction) * free, path.soft)
    return light


def _add_lit_points(
    light: _Gathered,
    scene: Scene,
    sources: _Sources,
    points: LitPoints,
    path: _Path,
    sampler: Sampler,
) -> None:
    """Add what the surface reflects of the points that the laser shines on."""
    hit, instant, laser_on = path.hit, path.instant, path.hit.valid & sources.laser_on
    chosen = sampler.next_block(POINTS_PER_PATH, POINTS), sampler.next_1d()
    *_, diffuse = chances(hit)
    active, correlation = points.light(
        scene, sources.eye, hit, diffuse, path.walked_m, instant, light.modulation, chosen, laser_on
    )
    light.active += dr.select(laser_on, path.throughput * active, 0)
    light.correlation += dr.select(laser_on, path.throughput * correlation, 0)


def _add_passive(
    light: _Gathered,
    scene: Scene,
    sources: _Sources,
    path: _Path,
    sampler: Sampler,
    *,
    first: bool,
) -> Onward:
    """Add what the surface glows and reflects of sun, sky and lamps; returns the way onward."""
    passive, hit, instant = sources.passive, path.hit, path.instant
    passive_on = hit.valid & sources.passive_on
    # Faces of lamps glow for the camera and its mirrors alone: what they shine on others is
    # the `Lamp`'s, and would be counted twice.
    glow = dr.select(passive_on & (path.way_back > 0), hit.emission, 0)
    light.add_ambient(path.throughput * glow)

    # Every lane draws all numbers at each surface, used or not, so that lanes stay in step.
    aim, which = sampler.next_2d(), sampler.next_1d()
    number, sample = sampler.next_choice(), sampler.next_2d()
    onward = Onward.drawn(hit, path.direction, number, sample)
    if first:
        to_sky = sampler.next_points(SKY_RAYS)
        sky = passive.sky_irradiance(scene, hit, instant, to_sky, passive_on)
        light.add_ambient(sky * hit.diffuse * hit.albedo * dr.inv_pi, soft=True)
        daylight = passive.sun_irradiance(scene, hit, instant, passive_on)
    else:
        daylight = passive.daylight(scene, hit, instant, aim, which, passive_on)
    irradiance = daylight + passive.lamps(scene, hit, instant, onward.number, passive_on)
    # The surface reflects to the camera whatever way the path goes on.
    reflected = path.throughput * irradiance * hit.diffuse * hit.albedo * dr.inv_pi
    light.add_ambient(reflected, path.soft)
    return onward


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
            pixel_sums(values, first, samples) / samples
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
