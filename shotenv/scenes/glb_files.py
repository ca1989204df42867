"""Triangles and names of materials of GLB files.

A GLB is JSON and one block of numbers. Of the JSON only what tells triangles is handed on: images,
textures and files elsewhere are neither needed nor opened.
"""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from shotenv.render.surfaces import SceneFileError
from shotenv.scenes.bodies import NO_MATERIAL, Body
from shotenv.scenes.mesh_files import check_count

MAGIC, JSON_CHUNK, NUMBERS_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
LARGEST_JSON_BYTES = 64 * 2**20
DEEPEST_NODE = 64
MOST_NODES = 100_000
MOST_BYTES_A_FACE = 400
"""Of the numbers: corners with normals, colours and several texture coordinates."""
TRIANGLES = 4
"""glTF's number of the mode in which three corners are a triangle."""
KEPT = ("asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers")


def read_glb(path: Path, most_faces: int) -> list[Body]:
    """Bodies of a GLB file, posed by its nodes.

    Raises
    ------
    SceneFileError
        It is damaged, needs files or extensions beside it, or has too many faces.
    """
    if (size := path.stat().st_size) > LARGEST_JSON_BYTES + MOST_BYTES_A_FACE * most_faces:
        raise SceneFileError(f"{path} has {size} bytes; too many for most_faces = {most_faces}")
    try:
        content, numbers = _chunks(path)
        faces, names = _checked(path, content)
        check_count(path, faces, most_faces)
        scene: Any = trimesh.load_scene(
            io.BytesIO(_packed(content, names, numbers)), file_type="glb", process=False
        )
        bodies = [
            _body(scene, node, names)
            for node in scene.graph.nodes_geometry
            if hasattr(scene.geometry[scene.graph[node][1]], "faces")
        ]
    except SceneFileError:
        raise
    # Readers of damaged files raise whatever they stumble over.
    except Exception as error:
        raise SceneFileError(f"{path} cannot be read as GLB: {error!r}") from None
    check_count(path, sum(len(body.corners) for body in bodies), most_faces)
    return bodies


def _chunks(path: Path) -> tuple[dict[str, Any], bytes]:
    """JSON and numbers of the file."""
    with path.open("rb") as file:
        magic, version, _ = struct.unpack("<III", file.read(12))
        length, kind = struct.unpack("<II", file.read(8))
        if (magic, version, kind) != (MAGIC, 2, JSON_CHUNK) or length > LARGEST_JSON_BYTES:
            raise SceneFileError(f"{path} is no GLB of version 2")
        content = json.loads(file.read(length))
        head, numbers = file.read(8), file.read()
    if head and struct.unpack("<II", head)[1] != NUMBERS_CHUNK:
        raise SceneFileError(f"{path} has a chunk that is no block of numbers")
    return content, numbers


def _checked(path: Path, content: dict[str, Any]) -> tuple[int, list[str]]:
    """Faces of all nodes, and the names of the materials, of a file that needs nothing else."""
    for buffer in content.get("buffers", ()):
        if "uri" in buffer:
            raise SceneFileError(
                f"{path} keeps numbers in {str(buffer['uri'])[:60]!r}; expected all in the file "
                "itself"
            )
    if needed := content.get("extensionsRequired"):
        raise SceneFileError(f"{path} needs the extensions {', '.join(needed)}; expected none")
    faces_of_mesh = [
        sum(_faces(path, content, primitive) for primitive in mesh["primitives"])
        for mesh in content.get("meshes", ())
    ]
    nodes = content.get("nodes", [])
    faces, met = 0, 0
    scene = content.get("scenes", [{}])[content.get("scene", 0)]
    waiting = [(number, 1) for number in scene.get("nodes", ())]
    while waiting:
        number, depth = waiting.pop()
        met += 1
        # A node within itself, or shared again and again, would never end.
        if depth > DEEPEST_NODE or met > MOST_NODES:
            raise SceneFileError(
                f"{path} has nodes more than {DEEPEST_NODE} deep or more than {MOST_NODES}"
            )
        node = nodes[number]
        faces += faces_of_mesh[node["mesh"]] if "mesh" in node else 0
        waiting += [(child, depth + 1) for child in node.get("children", ())]
    unnamed = enumerate(content.get("materials", ()))
    return faces, [str(m.get("name") or f"material_{number}") for number, m in unnamed]


def _faces(path: Path, content: dict[str, Any], primitive: dict[str, Any]) -> int:
    """Faces that a primitive promises."""
    if primitive.get("mode", TRIANGLES) != TRIANGLES:
        raise SceneFileError(
            f"{path} has a mesh of mode {primitive['mode']}; expected triangles (mode {TRIANGLES})"
        )
    corners = primitive.get("indices", primitive["attributes"]["POSITION"])
    return int(content["accessors"][corners]["count"]) // 3


def _packed(content: dict[str, Any], names: list[str], numbers: bytes) -> bytes:
    """A GLB of the same triangles whose materials are bare numbers into `names`."""
    kept = {key: content[key] for key in KEPT if key in content}
    kept["materials"] = [{"name": str(number)} for number in range(len(names))]
    text = json.dumps(kept).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), JSON_CHUNK) + text
    chunks += struct.pack("<II", len(numbers), NUMBERS_CHUNK) + numbers
    return struct.pack("<III", MAGIC, 2, 12 + len(chunks)) + chunks


def _body(scene: Any, node: str, names: list[str]) -> Body:
    """The mesh of a node, where the nodes above put it."""
    to_world, geometry = scene.graph[node]
    mesh = scene.geometry[geometry]
    points = np.asarray(mesh.vertices, np.float64) @ to_world[:3, :3].T + to_world[:3, 3]
    faces = np.asarray(mesh.faces)
    # A mirroring turns outside in.
    faces = faces[:, ::-1] if np.linalg.det(to_world[:3, :3]) < 0 else faces
    number = str(getattr(getattr(mesh.visual, "material", None), "name", None))
    known = number.isdecimal() and int(number) < len(names)
    return Body(str(node), names[int(number)] if known else NO_MATERIAL, points[faces])
