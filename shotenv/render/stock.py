"""The same world as a stock Mitsuba scene, so that Mitsuba's own integrators can render it.

Nothing of the sensor is made with it: tests compare the integrator with it, benchmarks race it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np

from shotenv.config import CameraConfig
from shotenv.render.surfaces import faces_of, noise_texture, posed, triangle_mesh
from shotenv.world.geometry import Light, Pose, World, rotation

_NEAR_CLIP_M = 1e-5
"""Mitsuba's camera rays start on the near plane, by default 1 cm ahead, and a time-resolved film
would find every path shorter by that."""
_FILM = {"type": "hdrfilm", "pixel_format": "luminance"}


def stock_scene(
    world: World,
    time_s: float,
    camera: CameraConfig,
    film: Mapping[str, Any] = _FILM,
    **emitters: Mapping[str, Any],
) -> Any:
    """A Mitsuba scene of `world` at `time_s`: surfaces, sun, a uniform sky, the camera.

    The sky has its zenith radiance everywhere; surfaces are diffuse; there are no lamps and no
    laser but the `emitters` given.
    """
    description = {
        "type": "scene",
        "triangles": _triangles(world, time_s),
        "sensor": _sensor(world.ego.at(time_s), camera, film),
        **_emitters(world.light),
        **emitters,
    }
    return mi.load_dict(description)


def stock_path(camera: CameraConfig) -> Any:
    """Mitsuba's path integrator for as many surface hits as the camera's light paths have."""
    # `max_depth` counts path segments and not surfaces; no Russian roulette, as we have none.
    return mi.load_dict({"type": "path", "max_depth": camera.bounces + 1, "rr_depth": 1000})


def _triangles(world: World, time_s: float) -> Any:
    faces = faces_of(world)
    moving = posed(world, faces, (time_s,), bounces=1)
    corners = np.concatenate([world.static.corners, moving.corners[0] - moving.tile_m[0]])
    first, along, across = np.split(faces.uv[:, :6], 3, axis=1)
    low, high, *_ = faces.surface.T
    return triangle_mesh(
        corners,
        mi.load_dict(_noise_bsdf()),
        vertex_texcoords=np.stack([first, first + along, first + across], axis=1),
        face_low=low,
        face_high=high,
    )


def _noise_bsdf() -> dict[str, Any]:
    """Diffuse on both sides, its albedo between a face's two by the noise texture."""

    def diffuse(attribute: str) -> dict[str, Any]:
        return {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": attribute}}

    noise = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(noise_texture()[..., None]),
        "raw": True,
        "wrap_mode": "repeat",
    }
    blend = {"type": "blendbsdf", "weight": noise, "a": diffuse("face_low")}
    return {"type": "twosided", "bsdf": {**blend, "b": diffuse("face_high")}}


def _sensor(pose: Pose, camera: CameraConfig, film: Mapping[str, Any]) -> dict[str, Any]:
    ahead, _, up = rotation(pose).T
    eye = np.asarray(pose.position_m)
    size = {"width": camera.width, "height": camera.height, "rfilter": {"type": "box"}}
    return {
        "type": "perspective",
        "fov": camera.horizontal_fov_deg,
        "fov_axis": "x",
        "near_clip": _NEAR_CLIP_M,
        "to_world": mi.ScalarTransform4f().look_at(
            origin=eye.tolist(), target=(eye + ahead).tolist(), up=up.tolist()
        ),
        "film": {**film, **size},
        "sampler": {"type": "independent"},
    }


def _emitters(light: Light) -> dict[str, Any]:
    """Sun and sky, without those that are dark: the path integrator would aim at them too."""
    away = [-component for component in light.sun_direction]
    sun = {"type": "directional", "direction": away, "irradiance": light.sun_irradiance}
    sky = {"type": "constant", "radiance": light.sky_zenith}
    lit = {"sun": light.sun_irradiance > 0, "sky": light.sky_zenith > 0}
    return {name: emitter for name, emitter in (("sun", sun), ("sky", sky)) if lit[name]}
