"""Triangles on the ray-tracing side: two acceleration structures and what a hit tells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.render.backend import only_where, upload
from shotenv.render.surfaces.geometry import REACH_M, Posed, faces_of
from shotenv.render.surfaces.texture import noise_texture
from shotenv.world.geometry import World

SURFACE_OFFSET_M = 1e-3
"""How far from a surface a ray leaves it, so that it does not hit the surface itself: a hundred
roundings of float32 at 100 m, and still sixteen on the farthest tiles."""


@dataclass(frozen=True)
class Hit:
    """Where rays meet a surface; wavefront values, finite but meaningless where not `valid`.

    `normal` faces the ray, `leave` is `point` lifted off the surface along it. Of the light,
    `mirror` is mirrored, `clear` passes straight through, `diffuse` is the rest.
    """

    valid: Any
    distance_m: Any
    point: Any
    normal: Any
    leave: Any
    albedo: Any
    retro: Any
    emission: Any
    mirror: Any
    clear: Any
    diffuse: Any


@dataclass(frozen=True)
class _Near:
    """The nearest triangle on each ray: its face at that instant's pose, and in the tables."""

    valid: Any
    distance_m: Any
    posed_face: Any
    face: Any
    corner_weight: Any


class Surroundings:
    """What no time changes in a world, on the device: good for every frame of it."""

    def __init__(self, world: World):
        self.faces = faces = faces_of(world)
        self.scene = _mitsuba_scene(faces.corners[: faces.still])
        self.count = dr.opaque(mi.UInt32, faces.still)
        self.surface = upload(faces.surface)
        self.uv = upload(faces.uv)
        self.noise = mi.Texture2f(
            mi.TensorXf(noise_texture()[..., None]), wrap_mode=dr.WrapMode.Repeat
        )


class Scene:
    """A world at each of its instants, on the device, ready for rays.

    What stands still is traced in world coordinates, what moves in those of its instant's tile;
    the nearer of the two hits counts. Two structures, because the still one is built once for all
    frames of a world, and the moving one for each frame.
    """

    def __init__(self, surroundings: Surroundings, posed: Posed):
        self._still, beside = surroundings, surroundings.scene
        self._moving = _mitsuba_scene(posed.corners.reshape(-1, 3, 3), beside=beside)
        self._tile = upload(posed.tile_m)
        normals = np.concatenate([surroundings.faces.normals, posed.normals.reshape(-1, 4)])
        self._normals = upload(normals)
        self._has_panes = dr.opaque(mi.Bool, len(posed.panes) > 0)
        # A mesh cannot be empty; because of `_has_panes` no ray is tested with this stand-in.
        panes = posed.panes if len(posed.panes) else posed.corners[0, :1]
        self._panes = _mitsuba_scene(panes, beside=beside)
        self._moving_faces = dr.opaque(mi.UInt32, posed.corners.shape[1])

    def hit(self, origin, direction, instant, active, coherent: bool = False) -> Hit:
        """Nearest surface along each ray, within `REACH_M`; neighbouring rays may be alike."""
        near = self._nearest(origin, direction, mi.Float(REACH_M), instant, active, coherent)
        valid, face = near.valid, near.face
        distance = dr.select(valid, near.distance_m, 0)
        normal = dr.gather(mi.Vector4f, self._normals, near.posed_face, valid).xyz
        # Both sides of a surface are alike; its normal is turned towards the ray.
        normal = dr.select(dr.dot(normal, direction) > 0, -normal, normal)
        low, high, retro, emission = dr.gather(mi.Vector4f, self._still.surface, face, valid)
        first, rest = (
            dr.gather(mi.Vector4f, self._still.uv, 2 * face + i, valid) for i in range(2)
        )
        along, across = near.corner_weight
        u = first[0] + along * first[2] + across * rest[0]
        v = first[1] + along * first[3] + across * rest[1]
        noise = self._still.noise.eval(mi.Point2f(u, v), valid)[0]
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
            mirror=rest[2],
            clear=rest[3],
            diffuse=1 - rest[2] - rest[3],
        )

    def distance_m(self, origin, direction, instant):
        """Distance to the nearest surface along each of neighbouring rays; infinite at none."""
        active = mi.Bool(True)
        near = self._nearest(origin, direction, mi.Float(REACH_M), instant, active, coherent=True)
        return dr.select(near.valid, near.distance_m, dr.inf)

    def transmission(self, origin, direction, length, instant, active):
        """Share of the light that comes through `length` metres of each ray (at most `REACH_M`).

        1 where nothing stands on the ray, 0 where something opaque does; panes let their clear
        share through.
        """
        tile = dr.gather(mi.Vector3f, self._tile, instant, active)
        length = dr.minimum(length, REACH_M)
        # Shadow rays that stop at the first face are cheap; most meet nothing or something opaque.
        # Only those that met something where there are panes are asked what they met.
        blocked = self._still.scene.ray_test(_ray(origin, direction, length), False, active)
        free = active & ~blocked
        free &= ~self._moving.ray_test(_ray(origin + tile, direction, length), False, free)
        behind = active & ~free & self._has_panes

        def through():
            meets = self._panes.ray_test(_ray(origin + tile, direction, length), False, behind)
            share = self._through_panes(origin, direction, length, instant, meets)
            return dr.select(meets, share, 0)

        return dr.select(free, 1, only_where(behind, through))

    def _through_panes(self, origin, direction, length, instant, active):
        """Product of the clear shares of all surfaces on each ray, walked one by one."""

        def onward(share, start, left_m, walking):
            near = self._nearest(start, direction, left_m, instant, walking)
            clear = dr.gather(mi.Float, self._still.uv, 8 * near.face + 7, near.valid)
            step_m = near.distance_m + SURFACE_OFFSET_M
            share = dr.select(near.valid, share * clear, share)
            walking &= near.valid & (share > 0) & (step_m < left_m)
            return share, dr.fma(direction, step_m, start), left_m - step_m, walking

        state = (mi.Float(1), mi.Point3f(origin), mi.Float(length), mi.Bool(active))
        return dr.while_loop(state, lambda *state: state[-1], onward, label="panes")[0]

    def _nearest(self, origin, direction, length, instant, active, coherent=False) -> _Near:
        tile = dr.gather(mi.Vector3f, self._tile, instant, active)
        ray = _ray(origin, direction, length)
        still = self._still.scene.ray_intersect_preliminary(ray, coherent, active)
        # No further than what stands still: `moved.t` is infinite where nothing moves before it.
        ray = _ray(origin + tile, direction, dr.minimum(still.t, length))
        moved = self._moving.ray_intersect_preliminary(ray, coherent, active)
        moves = moved.t < still.t
        distance = dr.minimum(still.t, moved.t)
        first = dr.select(moves, self._still.count, 0)
        posed_face = dr.select(moves, moved.prim_index, still.prim_index) + first
        return _Near(
            valid=active & (distance < length),
            distance_m=distance,
            posed_face=posed_face,
            face=posed_face - dr.select(moves, instant * self._moving_faces, 0),
            corner_weight=dr.select(moves, moved.prim_uv, still.prim_uv),
        )


def _ray(origin, direction, length):
    ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))
    ray.maxt = length
    return ray


def _mitsuba_scene(corners: np.ndarray, beside: Any = None):
    """Triangles [F, 3, 3], ready for rays; in one kernel with `beside`, another such scene."""
    parts: dict[str, Any] = {"type": "scene", "mesh": triangle_mesh(corners)}
    # OptiX traces rays of several scenes in one kernel only where they share a binding table; for
    # a processor that would be time lost.
    if beside is not None and mi.variant().startswith("cuda"):
        parts["parent_scene"] = beside
    return mi.load_dict(parts)


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
