"""Passive light that changes little from pixel to pixel, averaged where neighbours share a plane.

What the sky and other surfaces shine on a matte surface is gathered from all sides by a few rays,
and errs most of all passive light, but changes slowly along a plane. Averaged is its irradiance,
so that texture stays, and over a bounded length, so that shadows where things touch stay too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.config import CameraConfig
from shotenv.render.sampling import pixel_sums
from shotenv.render.surfaces import Hit

REACH_PX = 3
"""Farthest neighbours, in rows and in columns."""
PLANE_M = 0.01
"""Largest distance of a point from the plane of another."""
SAME_NORMAL = 0.999
"""Least cosine between normals of one plane."""


@dataclass(frozen=True)
class SoftLight:
    """Radiance of each lane that its first surface reflects of light from all around.

    That is the sky's, and all that comes by way of a second surface.
    """

    radiance: Any
    reflectance: Any
    """Radiance of the surface by the irradiance on it, times pi."""
    normal: Any
    point: Any

    @classmethod
    def of(cls, radiance, first: Hit) -> SoftLight:
        """`radiance` of surfaces `first`."""
        normal = dr.select(first.valid, first.normal, 0)
        return cls(radiance, first.diffuse * first.albedo, normal, first.point)


@dataclass(frozen=True)
class _Pixels:
    """Means of pixels and the planes that they show."""

    radiance: Any
    reflectance: Any
    normal: Any
    point: Any
    plane: Any
    """Whether all samples of the pixel lie in one plane."""

    @classmethod
    def of(cls, soft: SoftLight, first, samples: int) -> _Pixels:
        normal, point = _vectors(soft.normal, first), _vectors(soft.point, first)
        plane = mi.Bool(True)
        for sample in range(1, samples):
            own_normal, own_point = (_vectors(v, first + sample) for v in (soft.normal, soft.point))
            plane &= _in_plane(normal, point, own_normal, own_point)
        # A lone sample is in its plane, but where nothing is hit its normal is zero.
        plane &= dr.squared_norm(normal) > 0
        radiance, reflectance = (
            pixel_sums(values, first, samples) / samples
            for values in (soft.radiance, soft.reflectance)
        )
        return cls(radiance, reflectance, normal, point, plane)


def filtered(soft: SoftLight, instants: np.ndarray, camera: CameraConfig) -> np.ndarray:
    """Mean radiance of each pixel, float32 [N, H, W], at N of the rendered `instants`.

    The pixel's reflectance times the irradiance over its neighbours: those within `REACH_PX`
    whose samples lie in the same plane, and no farther than `camera.gray_filter_m` metres.
    """
    height, width, samples = camera.height, camera.width, camera.samples_per_pixel
    count = height * width
    place = dr.arange(mi.UInt32, len(instants) * count)
    # From a list: NumPy's memory would be borrowed, and its alignment makes another kernel.
    instant = dr.gather(mi.UInt32, mi.UInt32(instants.tolist()), place // count)
    first = (instant * count + place % count) * samples
    pixels = _Pixels.of(soft, first, samples)
    dr.eval(pixels)
    row, column = mi.Int32(place // width % height), mi.Int32(place % width)
    bound = dr.square(dr.opaque(mi.Float, camera.gray_filter_m))
    radiance, reflects = mi.Float(pixels.radiance), mi.Float(pixels.reflectance)
    steps = range(-REACH_PX, REACH_PX + 1)
    for down, across in ((d, a) for d in steps for a in steps if d or a):
        near_row, near_column = row + down, column + across
        near = pixels.plane & (near_row >= 0) & (near_row < height)
        near &= (near_column >= 0) & (near_column < width)
        other = mi.UInt32(mi.Int32(place) + (down * width + across))
        near &= dr.gather(mi.Bool, pixels.plane, other, near)
        point = _vectors(pixels.point, other, near)
        near &= dr.squared_norm(point - pixels.point) < bound
        near &= _in_plane(pixels.normal, pixels.point, _vectors(pixels.normal, other, near), point)
        radiance += dr.gather(mi.Float, pixels.radiance, other, near)
        reflects += dr.gather(mi.Float, pixels.reflectance, other, near)
    image = dr.select(reflects > 0, pixels.reflectance * radiance / reflects, 0)
    return image.numpy().reshape(len(instants), height, width)


def _vectors(values, index, active=True):
    """Vectors of other lanes."""
    return type(values)(*(dr.gather(mi.Float, part, index, active) for part in values))


def _in_plane(normal, point, other_normal, other_point):
    """Whether a point and its normal are of the plane of another."""
    apart_m = dr.abs(dr.dot(normal, other_point - point))
    return (dr.dot(normal, other_normal) > SAME_NORMAL) & (apart_m < PLANE_M)
