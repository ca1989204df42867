"""From a scene's file and its configuration to worlds."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np

from shotenv.config import OWN, LightsConfig, MountConfig, OwnSceneConfig, SurfaceConfig
from shotenv.render.surfaces import SceneFileError
from shotenv.scenes.bodies import Body, FoundLights
from shotenv.scenes.glb_files import read_glb
from shotenv.scenes.mesh_files import check_count, read_mesh
from shotenv.scenes.ways import motion_of
from shotenv.scenes.xml_scenes import read_xml
from shotenv.world.geometry import (
    MAX_LAMPS,
    Lamp,
    Light,
    Material,
    Mesh,
    World,
    lights,
    meshes,
    mounted,
)

FORMATS = (".xml", ".ply", ".obj", ".stl", ".glb")
FARTHEST_M = 1e6
"""Of corners; beyond, a float32 tells no decimetres, and nothing is seen from afar anyway."""
FLAT_SHARE = 0.9
"""Length of the sum of its faces' areas as vectors, over their sum, from which a lamp is flat."""
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From x right, y up to x ahead, z up: a quarter turn about x."""


@dataclass(frozen=True)
class OwnScene:
    """What stands still in a scene, and what lights it."""

    static: Mesh
    light: Light

    @property
    def digest(self) -> str:
        """Changes with any triangle, surface or light."""
        digest = hashlib.sha256(json.dumps(asdict(self.light), sort_keys=True).encode())
        for field in fields(Mesh):
            if field.name != "kinds":
                digest.update(np.ascontiguousarray(getattr(self.static, field.name)).tobytes())
        return digest.hexdigest()


def own_world(scene: OwnScene, config: OwnSceneConfig, way: int, mount: MountConfig) -> World:
    """World of clip number `way`, seen by the camera that `mount` fixes to the car."""
    ego = mounted(motion_of(config.clips[way]), mount)
    return World(OWN, way, scene.static, (), scene.light, ego)


# Corners that are infinite are refused in the end, by the name of their body.
@np.errstate(invalid="ignore", over="ignore")
def read_scene(config: OwnSceneConfig) -> OwnScene:
    """The scene in the file of `config`.

    Raises
    ------
    SceneFileError
        It cannot be read, has no faces, too many or broken ones, or holds what cannot be mapped.
    """
    path = Path(config.file)
    try:
        return _read_scene(path, config)
    except SceneFileError as error:
        # Some tell of a part of the file alone.
        if path.name in str(error):
            raise
        raise SceneFileError(f"{path}: {error}") from None


def _read_scene(path: Path, config: OwnSceneConfig) -> OwnScene:
    if path.suffix.lower() not in FORMATS or not path.is_file():
        raise SceneFileError(f"scene is {path}; expected a file of {', '.join(FORMATS)}")
    suffix, found = path.suffix.lower(), FoundLights()
    if suffix == ".xml":
        bodies, found = read_xml(path, config.most_faces, config.unit_m)
    elif suffix == ".glb":
        bodies = read_glb(path, config.most_faces)
    else:
        bodies = read_mesh(path, config.most_faces)
    # glTF defines its axes; other formats leave them open.
    up = config.up or ("y" if suffix == ".glb" else "z")
    turn = Y_UP if up == "y" else np.eye(3)
    placed = [
        replace(body, corners=config.unit_m * body.corners @ turn.T)
        for body in bodies
        if len(body.corners)
    ]
    _check(path, placed, config.most_faces)
    surfaces = _surfaces(path, placed, config.materials)
    parts = [
        meshes.soup(body.corners, _material(surface))
        for body, surface in zip(placed, surfaces, strict=True)
    ]
    glowing = [
        _lamp_of(body, surface.emission)
        for body, surface in zip(placed, surfaces, strict=True)
        if surface.emission > 0
    ]
    light = _light(path, found, config.lights, turn, config.unit_m, glowing)
    return OwnScene(meshes.join(parts), light)


def _check(path: Path, bodies: list[Body], most_faces: int) -> None:
    """Refuse scenes without faces, with too many, or with broken ones."""
    faces = sum(len(body.corners) for body in bodies)
    if faces == 0:
        raise SceneFileError(f"{path} has no geometry; expected at least one triangle")
    check_count(path, faces, most_faces)
    for body in bodies:
        # Not `> FARTHEST_M`, which is false for NaN.
        broken = ~(np.abs(body.corners) <= FARTHEST_M).all(axis=(1, 2))
        if broken.any():
            raise SceneFileError(
                f"{body.name} in {path} has {broken.sum()} faces with corners that are NaN or "
                f"beyond {FARTHEST_M:g} m, the first of them face {broken.argmax()}; expected "
                "numbers within that"
            )


def _surfaces(
    path: Path, bodies: list[Body], table: dict[str, SurfaceConfig]
) -> list[SurfaceConfig]:
    """Surface of each body: the table's, or else what the file itself tells."""
    found = [table.get(body.material, body.surface) for body in bodies]
    missing = {
        body.material: body.reason
        for body, surface in zip(bodies, found, strict=True)
        if surface is None
    }
    if missing:
        names = "; ".join(f"{name!r} ({reason})" for name, reason in missing.items())
        raise SceneFileError(
            f"{path} has materials that cannot be mapped: {names}. Expected an entry for each in "
            "the table of materials"
        )
    # The table says what a surface reflects, the file whether it glows.
    return [
        surface.model_copy(update={"emission": max(surface.emission, body.radiance)})
        for body, surface in zip(bodies, found, strict=True)
        if surface is not None
    ]


def _material(surface: SurfaceConfig) -> Material:
    albedo = surface.albedo
    low, high = albedo if isinstance(albedo, tuple) else (albedo, albedo)
    rest = surface.model_dump(exclude={"albedo"})
    return Material(albedo_low=low, albedo_high=high, **rest)


def _lamp_of(body: Body, radiance: float) -> Lamp:
    """The lamp that lights other things as a glowing body does, seen from afar.

    Flat bodies shine from their front like a Lambertian disk of their area: as bright along their
    axis, at any distance, and with its flux. Others shine evenly to all sides.
    """
    corners = body.corners
    area = meshes.area_vectors(corners) / 2
    each = np.linalg.norm(area, axis=1)
    whole, front = float(each.sum()), area.sum(axis=0)
    if whole == 0:
        raise SceneFileError(f"{body.name} glows, but its faces have no area")
    x, y, z = (float(n) for n in (corners.mean(axis=1) * each[:, None]).sum(axis=0) / whole)
    if np.linalg.norm(front) > FLAT_SHARE * whole:
        axis = front / np.linalg.norm(front)
        ahead = (float(axis[0]), float(axis[1]), float(axis[2]))
        return Lamp((x, y, z), radiance * whole, math.sqrt(whole / math.pi), ahead, cutoff_cos=0.0)
    # A convex body shows a quarter of its surface, in the mean (Cauchy). Its own faces, within the
    # lamp's radius, throw no shadow.
    size = float(np.linalg.norm(corners - (x, y, z), axis=-1).max())
    return Lamp((x, y, z), radiance * whole / 4, size)


def _light(
    path: Path,
    found: FoundLights,
    told: LightsConfig,
    turn: np.ndarray,
    unit_m: float,
    glowing: list[Lamp],
) -> Light:
    """Lights of the file, of the configuration and of glowing bodies together."""
    suns = [(irradiance, _unit(-turn @ np.asarray(way))) for irradiance, way in found.suns]
    if told.sun:
        angles = math.radians(told.sun.azimuth_deg), math.radians(told.sun.elevation_deg)
        suns.append((told.sun.irradiance, lights.direction(*angles)))
    skies = [(radiance, radiance) for radiance in found.skies]
    if told.sky:
        skies.append((told.sky.zenith, told.sky.horizon))
    for name, lit in (("suns", suns), ("skies", skies)):
        if len(lit) > 1:
            raise SceneFileError(f"{path} and its lights have {len(lit)} {name}; expected one")
    lamps = [
        replace(lamp, position_m=_point(unit_m * turn @ np.asarray(lamp.position_m)))
        for lamp in found.lamps
    ]
    lamps += glowing
    lamps += [
        Lamp(
            lamp.position_m,
            lamp.intensity_w_sr,
            lamp.radius_m,
            _unit(np.array(lamp.direction)),
            -1.0 if lamp.cutoff_deg == 180.0 else math.cos(math.radians(lamp.cutoff_deg)),
            lamp.rides,
        )
        for lamp in told.lamps
    ]
    if len(lamps) > MAX_LAMPS:
        raise SceneFileError(
            f"{path} and its lights have {len(lamps)} lamps, glowing bodies among them; expected "
            f"at most {MAX_LAMPS}"
        )
    (irradiance, to_sun), (zenith, horizon) = (
        (suns or [(0.0, (0.0, 0.0, 1.0))])[0],
        (skies or [(0.0, 0.0)])[0],
    )
    return Light(irradiance, to_sun, zenith, horizon, tuple(lamps))


def _unit(vector: np.ndarray) -> tuple[float, float, float]:
    return _point(vector / np.linalg.norm(vector))


def _point(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(number) for number in vector)
    return x, y, z
