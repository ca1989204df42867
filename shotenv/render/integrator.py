"""One launch: distance, ambient, active light and its phasors for every pixel of every instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.config import CameraConfig
from shotenv.render.geometry import REACH_M, geometry_at
from shotenv.render.instants import Instants
from shotenv.render.light import PassiveLight
from shotenv.render.pinhole import Pinhole
from shotenv.render.sampling import Lanes, Sampler
from shotenv.render.scene import SURFACE_OFFSET_M, Hit, Scene
from shotenv.world.model import World

SPEED_OF_LIGHT_M_S = 299_792_458.0
_RETRO_COS = 0.5


@dataclass(frozen=True)
class Traced:
    """Light of T instants of one world, F modulation frequencies.

    Attributes
    ----------
    distance_m : float32 [T, H, W]
        Radial distance through the pixel's centre, metres; infinite where nothing is hit.
    ambient : float32 [T, H, W]
        Passive radiance, W m-2 sr-1; 0 at instants without passive light.
    active : float32 [T, H, W]
        Radiance of the laser's light, W m-2 sr-1 per watt; 0 at instants without laser.
    phasor : complex64 [F, T, H, W]
        Sum over light paths of radiance times exp(i 2 pi f L / c), L the path length from laser
        to camera: its phase for a single bounce at distance d is 4 pi f d / c.
    """

    distance_m: np.ndarray
    ambient: np.ndarray
    active: np.ndarray
    phasor: np.ndarray


def trace(
    world: World,
    instants: Instants,
    camera: CameraConfig,
    frequencies_hz: Sequence[float],
    *,
    seed: int,
) -> Traced:
    """Trace `camera.samples_per_pixel` paths per pixel and instant, in one kernel launch.

    The laser sits at the camera and shines evenly over the field of view. The result depends on
    the arguments alone, bit for bit on one machine.
    """
    lanes = Lanes.of(len(instants), camera)
    eye = Pinhole(world.ego, instants, camera)
    lights = _Lights(
        eye,
        PassiveLight(world, instants),
        dr.gather(mi.Bool, mi.Bool(list(instants.laser)), lanes.instant),
        dr.gather(mi.Bool, mi.Bool(list(instants.passive)), lanes.instant),
    )
    scene = Scene(geometry_at(world, instants.times_s, camera.bounces))
    light = _follow(
        scene, lights, lanes, camera, frequencies_hz, Sampler(lanes, instants, camera, seed=seed)
    )
    return _collect(light, lanes, len(instants), camera)


@dataclass(frozen=True)
class _Lights:
    """The laser (at the eye), the passive lights, and which lanes each of them reaches."""

    eye: Pinhole
    passive: PassiveLight
    laser_on: Any
    passive_on: Any


@dataclass
class _Light:
    """What the lanes have gathered so far."""

    distance_m: Any
    ambient: Any
    active: Any
    phasor: list[Any]

    def add_active(self, radiance, path_m, frequencies_hz: Sequence[float]) -> None:
        """Add laser light that came a way of `path_m` metres."""
        self.active += radiance
        for index, frequency_hz in enumerate(frequencies_hz):
            sine, cosine = dr.sincos(path_m * (dr.two_pi * frequency_hz / SPEED_OF_LIGHT_M_S))
            self.phasor[index] += mi.Vector2f(radiance * cosine, radiance * sine)


def _follow(
    scene: Scene,
    lights: _Lights,
    lanes: Lanes,
    camera: CameraConfig,
    frequencies_hz: Sequence[float],
    sampler: Sampler,
) -> _Light:
    """Walk every lane's path from the camera, adding the light of each surface hit."""
    eye, passive, instant = lights.eye, lights.passive, lanes.instant
    origin, direction = eye.rays(lanes, sampler.next_2d())
    hit = scene.hit(origin, direction, instant, mi.Bool(True), coherent=True)
    seen = dr.select(hit.valid, hit.emission, passive.sky(direction))
    light = _Light(
        distance_m=dr.select(hit.valid, hit.distance_m, dr.inf),
        ambient=dr.select(lights.passive_on, seen, 0),
        active=mi.Float(0),
        phasor=[mi.Vector2f(0) for _ in frequencies_hz],
    )
    throughput, walked_m = mi.Float(1), hit.distance_m
    for bounce in range(camera.bounces):
        laser = _laser(scene, eye, hit, instant, hit.valid & lights.laser_on, bounce == 0)
        light.add_active(throughput * laser[0], walked_m + laser[1], frequencies_hz)
        throughput *= hit.albedo
        passive_on = hit.valid & lights.passive_on
        irradiance = passive.daylight(scene, hit, instant, sampler, passive_on)
        irradiance += passive.lamps(scene, hit, instant, sampler.next_1d(), passive_on)
        onward = mi.Frame3f(hit.normal).to_world(
            mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        )
        seeks_sky = passive_on & ~passive.sky_is_aimed_at(hit)
        if bounce + 1 < camera.bounces:
            previous, hit = hit, scene.hit(hit.leave, onward, instant, hit.valid)
            walked_m += dr.norm(hit.point - previous.point)
            free = seeks_sky & ~hit.valid
        else:
            free = scene.visible(hit.leave, onward, mi.Float(REACH_M), instant, seeks_sky)
        sky = dr.select(free, passive.sky(onward), 0)
        light.ambient += throughput * dr.fma(irradiance, dr.inv_pi, sky)
    return light


def _laser(scene: Scene, eye: Pinhole, hit: Hit, instant, active, first: bool):
    """Radiance per watt that a surface reflects of the laser's light, and its distance to it.

    The laser is at the camera: the first hit sees it without a shadow ray, and retro-reflects.
    """
    intensity, direction, distance = eye.laser(hit.point, instant)
    cos_surface = dr.maximum(dr.dot(hit.normal, direction), 0)
    radiance = hit.albedo * dr.inv_pi * intensity * cos_surface / dr.square(distance)
    lit = active & (radiance > 0)
    if first:
        radiance *= 1 + dr.select(cos_surface > _RETRO_COS, hit.retro, 0)
    else:
        lit &= scene.visible(hit.leave, direction, distance - SURFACE_OFFSET_M, instant, lit)
    return dr.select(lit, radiance, 0), dr.minimum(distance, REACH_M)


def _collect(light: _Light, lanes: Lanes, instants: int, camera: CameraConfig) -> Traced:
    """Mean over the samples of each pixel; distances are those of sample 0."""
    samples, frequencies = camera.samples_per_pixel, len(light.phasor)
    flat = [part for phasor in light.phasor for part in phasor]
    dr.eval(light.distance_m, light.ambient, light.active, flat)
    centre = dr.arange(mi.UInt32, instants * camera.width * camera.height) * samples
    shape = (instants, camera.height, camera.width)

    def mean(values) -> np.ndarray:
        return (dr.block_sum(values, samples) / samples).numpy().reshape(shape)

    parts = np.stack([mean(part) for part in flat]) if flat else np.empty((0, *shape))
    return Traced(
        distance_m=dr.gather(mi.Float, light.distance_m, centre).numpy().reshape(shape),
        ambient=mean(light.ambient),
        active=mean(light.active),
        phasor=(parts[0::2] + 1j * parts[1::2]).astype(np.complex64).reshape(frequencies, *shape),
    )
