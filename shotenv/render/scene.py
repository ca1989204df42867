"""Triangles on the ray-tracing side: two acceleration structures and what a hit tells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.render.device import upload
from shotenv.render.geometry import REACH_M, Geometry
from shotenv.render.texture import noise_texture

SURFACE_OFFSET_M = 1e-3
"""How far from a surface a ray leaves it, so that it does not hit the surface itself."""


@dataclass(frozen=True)
class Hit:
    """Where rays meet a surface; wavefront values, finite but meaningless where not `valid`.

    `normal` faces the ray, `leave` is `point` lifted off the surface along it.
    """

    valid: Any
    distance_m: Any
    point: Any
    normal: Any
    leave: Any
    albedo: Any
    retro: Any
    emission: Any


class Scene:
    """A `Geometry` on the device, ready for rays.

    What stands still is traced in world coordinates, what moves in those of its instant's tile;
    the nearer of the two hits counts.
    """

    def __init__(self, geometry: Geometry):
        self._static = _mitsuba_scene(geometry.static)
        self._moving = _mitsuba_scene(geometry.moving)
        self._tile = upload(geometry.tile_m)
        self._normals = upload(geometry.normals)
        self._surface = upload(geometry.surface)
        self._uv = upload(geometry.uv)
        self._noise = mi.Texture2f(
            mi.TensorXf(noise_texture()[..., None]), wrap_mode=dr.WrapMode.Repeat
        )
        self._static_faces = dr.opaque(mi.UInt32, len(geometry.static))
        self._moving_faces = dr.opaque(mi.UInt32, len(geometry.moving) // len(geometry.tile_m))

    def hit(self, origin, direction, instant, active, coherent: bool = False) -> Hit:
        """Nearest surface along each ray, within `REACH_M`; neighbouring rays may be alike."""
        tile = dr.gather(mi.Vector3f, self._tile, instant, active)
        ray = _ray(origin, direction, mi.Float(REACH_M))
        still = self._static.ray_intersect_preliminary(ray, coherent, active)
        ray = _ray(origin + tile, direction, dr.minimum(still.t, REACH_M))
        moved = self._moving.ray_intersect_preliminary(ray, coherent, active)
        moves = moved.t < still.t
        nearest = dr.minimum(still.t, moved.t)
        valid = active & (nearest < REACH_M)
        distance = dr.select(valid, nearest, 0)
        first = dr.select(moves, self._static_faces, 0)
        posed_face = dr.select(moves, moved.prim_index, still.prim_index) + first
        face = posed_face - dr.select(moves, instant * self._moving_faces, 0)
        corner_weight = dr.select(moves, moved.prim_uv, still.prim_uv)
        normal = dr.gather(mi.Vector4f, self._normals, posed_face, valid).xyz
        normal = dr.select(dr.dot(normal, direction) > 0, -normal, normal)
        low, high, retro, emission = dr.gather(mi.Vector4f, self._surface, face, valid)
        noise = self._noise_at(face, corner_weight, valid)
        point = dr.fma(direction, distance, origin)
        return Hit(
            valid=valid,
            distance_m=distance,
            point=point,
            normal=normal,
            leave=dr.fma(normal, SURFACE_OFFSET_M, point),
            albedo=dr.select(valid, dr.fma(high - low, noise, low), 0),
            retro=retro,
            emission=emission,
        )

    def visible(self, origin, direction, length, instant, active):
        """Whether nothing stands on each ray within `length` (at most `REACH_M`)."""
        tile = dr.gather(mi.Vector3f, self._tile, instant, active)
        length = dr.minimum(length, REACH_M)
        blocked = self._static.ray_test(_ray(origin, direction, length), False, active)
        free = active & ~blocked
        return free & ~self._moving.ray_test(_ray(origin + tile, direction, length), False, free)

    def _noise_at(self, face, corner_weight, active):
        first = dr.gather(mi.Vector4f, self._uv, 2 * face, active)
        rest = dr.gather(mi.Vector4f, self._uv, 2 * face + 1, active)
        along, across = corner_weight
        u = first[0] + along * first[2] + across * rest[0]
        v = first[1] + along * first[3] + across * rest[1]
        return self._noise.eval(mi.Point2f(u, v), active)[0]


def _ray(origin, direction, length):
    ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))
    ray.maxt = length
    return ray


def _mitsuba_scene(corners: np.ndarray):
    return mi.load_dict({"type": "scene", "mesh": triangle_mesh(corners)})


def triangle_mesh(corners: np.ndarray, bsdf: Any = None, **attributes: np.ndarray) -> Any:
    """A Mitsuba mesh of triangles [F, 3, 3] that share no corners.

    `attributes` such as `face_albedo` or `vertex_texcoords` are flattened; those of faces have
    one channel.
    """
    faces = len(corners)
    properties = mi.Properties()
    if bsdf is not None:
        properties["bsdf"] = bsdf
    textured = "vertex_texcoords" in attributes
    mesh = mi.Mesh("triangles", 3 * faces, faces, properties, has_vertex_texcoords=textured)
    for name in attributes:
        if name.startswith("face_"):
            mesh.add_attribute(name, 1, np.zeros(faces, np.float32))
    values = mi.traverse(mesh)
    for name, array in {"vertex_positions": corners, **attributes}.items():
        values[name] = mi.Float(np.ascontiguousarray(array, np.float32).ravel())
    values["faces"] = dr.arange(mi.UInt32, 3 * faces)
    values.update()
    return mesh
