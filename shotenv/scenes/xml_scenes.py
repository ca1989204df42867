"""Mitsuba's scenes: bodies with what their BSDFs tell, and lights.

Taken are triangles, round bodies, diffuse surfaces of one number, suns (`directional`), skies
(`constant`), point lamps and surfaces that glow (`area`). The file's cameras, integrators and
films are not looked at. Everything else is refused by name.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shotenv.config import SurfaceConfig
from shotenv.render.surfaces import Part, SceneFileError, file_within, parse_mitsuba
from shotenv.scenes.bodies import NO_MATERIAL, Body, FoundLights
from shotenv.scenes.mesh_files import check_count, read_mesh
from shotenv.scenes.shapes import placed, triangles_of
from shotenv.world.geometry import Lamp

LOOKED_OVER = ("bsdf", "sensor", "integrator", "film", "sampler", "texture")
"""Kinds of parts at the top that are no bodies or lights: BSDFs and textures come with shapes."""
MESH_FILES = ("ply", "obj", "stl")
POINT_RADIUS_M = 0.01
"""Of a point lamp: its light stays finite closer than that."""


def read_xml(path: Path, most_faces: int, unit_m: float) -> tuple[list[Body], FoundLights]:
    """Bodies and lights of a Mitsuba scene.

    Raises
    ------
    SceneFileError
        It cannot be read, or has what cannot be mapped.
    """
    bodies: list[Body] = []
    lights = FoundLights()
    faces = 0
    for part in parse_mitsuba(path):
        if part.kind == "shape":
            body = _body(path, part, most_faces, unit_m)
            bodies.append(body)
            faces += len(body.corners)
            check_count(path, faces, most_faces)
        elif part.kind == "emitter":
            _add_light(lights, part)
        elif part.kind not in LOOKED_OVER:
            raise SceneFileError(f"{part.title} cannot be mapped; take it out of {path.name}")
    return bodies, lights


def _body(path: Path, shape: Part, most_faces: int, unit_m: float) -> Body:
    bsdf, radiance = None, 0.0
    for part in shape.parts.values():
        if part.kind == "bsdf":
            bsdf = part
        elif part.kind == "emitter" and part.plugin == "area":
            radiance = _number(part, "radiance", 1.0)
        elif part.kind not in ("sensor",):
            raise SceneFileError(f"{part.title} of {shape.title} cannot be mapped")
    if shape.plugin in MESH_FILES:
        name = str(shape.values.get("filename", ""))
        file = file_within(path.parent, name, path)
        corners = np.concatenate([b.corners for b in read_mesh(file, most_faces)] or [_no_faces()])
    else:
        corners = triangles_of(shape, unit_m)
    surface, reason = _surface(bsdf) if bsdf else (None, f"{shape.title} has no BSDF")
    material = _material_name(bsdf) if bsdf else NO_MATERIAL
    corners = placed(shape, corners)
    return Body(shape.title, material, corners, surface, radiance, reason)


def _no_faces() -> np.ndarray:
    return np.zeros((0, 3, 3))


def _material_name(bsdf: Part) -> str:
    """The id of a BSDF, or of the first one within it that has one."""
    while not bsdf.name:
        inner = [part for part in bsdf.parts.values() if part.kind == "bsdf"]
        if len(inner) != 1:
            return NO_MATERIAL
        bsdf = inner[0]
    return bsdf.name


def _surface(bsdf: Part) -> tuple[SurfaceConfig | None, str]:
    """What a BSDF tells of a surface here, or why it does not."""
    if bsdf.plugin == "twosided" and len(bsdf.parts) == 1:
        return _surface(next(iter(bsdf.parts.values())))
    if bsdf.plugin != "diffuse":
        return None, f"{bsdf.title} has no counterpart"
    if texture := bsdf.parts.get("reflectance"):
        return None, f"the {texture.title} of {bsdf.title} has no counterpart"
    albedo = bsdf.values.get("reflectance", 0.5)  # As Mitsuba's.
    if not isinstance(albedo, float | int):
        return None, f"the colour of {bsdf.title} does not tell its albedo at 940 nm"
    if not 0.0 <= albedo <= 1.0:
        raise SceneFileError(f"{bsdf.title} has reflectance {albedo:g}; expected 0 to 1")
    return SurfaceConfig(albedo=float(albedo)), ""


def _add_light(lights: FoundLights, emitter: Part) -> None:
    add = EMITTERS.get(emitter.plugin)
    if add is None:
        raise SceneFileError(
            f"{emitter.title} cannot be mapped; expected {', '.join(EMITTERS)} or area, or lights "
            "in the file of the path"
        )
    add(lights, emitter)


def _add_sun(lights: FoundLights, emitter: Part) -> None:
    turn = _to_world(emitter)
    x, y, z = (float(n) for n in emitter.values.get("direction", turn[:3, 2]))
    if not (x or y or z):
        raise SceneFileError(f"direction of {emitter.title} is (0, 0, 0); expected a vector")
    lights.suns.append((_number(emitter, "irradiance", 1.0), (x, y, z)))


def _add_sky(lights: FoundLights, emitter: Part) -> None:
    lights.skies.append(_number(emitter, "radiance", 1.0))


def _add_lamp(lights: FoundLights, emitter: Part) -> None:
    place = np.array(emitter.values.get("position", _to_world(emitter)[:3, 3]))
    x, y, z = (float(number) for number in place)
    intensity = _number(emitter, "intensity", 1.0)
    lights.lamps.append(Lamp((x, y, z), intensity, radius_m=POINT_RADIUS_M))


EMITTERS: dict[str, Callable[[FoundLights, Part], None]] = {
    "directional": _add_sun,
    "constant": _add_sky,
    "point": _add_lamp,
}
"""Emitters of whole scenes that have a counterpart; `area` ones belong to shapes."""


def _to_world(part: Part) -> np.ndarray:
    return part.values.get("to_world", np.eye(4))


def _number(part: Part, name: str, usual: float) -> float:
    """A number of a light in the sensor's band."""
    value: Any = part.values.get(name, usual)
    if name in part.parts or not isinstance(value, float | int) or not 0 <= value < np.inf:
        raise SceneFileError(
            f"{name} of {part.title} is a texture, a colour or no finite number; expected one "
            "number, in the sensor's band"
        )
    return float(value)
