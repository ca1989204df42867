"""Small scene files, for tests of what reads them."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from shotenv.config.own_scene import OwnSceneConfig, SurfaceConfig
from shotenv.render.surfaces import SceneFileError
from shotenv.scenes.bank_config import NOT_READ
from shotenv.scenes.scene_worlds import read_scene

STRAIGHT = {"poses": [{"time_s": 0.0, "position_m": (0.0, 0.0, 1.0)},
                      {"time_s": 1.0, "position_m": (1.0, 0.0, 1.0)}]}  # fmt: skip


def scene_config(path: Path, albedo: float | None = 0.4, **fields) -> OwnSceneConfig:
    """Configuration of the scene in a file, its one material named "default" of one albedo."""
    materials = {} if albedo is None else {"default": SurfaceConfig(albedo=albedo)}
    usual = {"clips": [STRAIGHT], "materials": materials, "file": str(path), "digest": NOT_READ}
    return OwnSceneConfig.model_validate({**usual, **fields})


def write_obj(path: Path, corners: np.ndarray, material: str | None = None) -> Path:
    points = np.asarray(corners, float).reshape(-1, 3)
    lines = ["mtllib nowhere/else.mtl"] + [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"usemtl {material}"] if material else []
    lines += [f"f {3 * i + 1}/1/1 {3 * i + 2} {3 * i + 3}" for i in range(len(points) // 3)]
    path.write_text("\n".join(lines))
    return path


def as_trimesh(corners: np.ndarray) -> trimesh.Trimesh:
    points = np.asarray(corners, float).reshape(-1, 3)
    return trimesh.Trimesh(points, np.arange(len(points)).reshape(-1, 3), process=False)


def write_mesh(path: Path, corners: np.ndarray, material: str = "default") -> Path:
    """PLY, STL or GLB."""
    mesh = as_trimesh(corners)
    if path.suffix == ".glb":
        named = trimesh.visual.material.PBRMaterial(name=material)
        uv = np.zeros((len(mesh.vertices), 2))
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=named)
    mesh.export(path)
    return path


def write_xml(path: Path, body: str) -> Path:
    path.write_text(f'<scene version="3.0.0">{body}</scene>')
    return path


def edited_glb(path: Path, change) -> Path:
    """A GLB whose JSON `change` has edited in place."""
    raw = path.read_bytes()
    length = struct.unpack("<I", raw[12:16])[0]
    content = json.loads(raw[20 : 20 + length])
    change(content)
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    rest = raw[20 + length :]
    head = struct.pack("<III", 0x46546C67, 2, 20 + len(text) + len(rest))
    path.write_bytes(head + struct.pack("<II", len(text), 0x4E4F534A) + text + rest)
    return path


def refusal(path, **fields) -> str:
    """What is said when the scene of a file is refused."""
    with pytest.raises(SceneFileError) as refused:
        read_scene(scene_config(path, **fields))
    return str(refused.value)
