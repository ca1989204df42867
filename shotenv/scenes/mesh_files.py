"""Triangles of PLY, OBJ and STL files.

Counts are looked at first: a file that promises more faces than are taken, or more than its bytes
can hold, is refused before memory is taken for them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import trimesh

from shotenv.render.surfaces import SceneFileError
from shotenv.scenes.bodies import NO_MATERIAL, Body

LONGEST_HEADER = 2**16
"""Bytes of a PLY header; usual ones have a few hundred."""
MOST_BYTES_A_FACE = 400
"""Of a text file, with its share of the vertices, normals and comments."""
STL_HEADER, STL_FACE = 84, 50
"""Bytes of a binary STL before its faces, and of each face."""


def read_mesh(path: Path, most_faces: int) -> list[Body]:
    """Bodies of a PLY, OBJ or STL file.

    Raises
    ------
    SceneFileError
        It is damaged, or has more faces than `most_faces`.
    """
    return (
        read_obj(path, most_faces) if path.suffix.lower() == ".obj" else [_mesh(path, most_faces)]
    )


def check_count(path: Path, faces: int, most_faces: int) -> None:
    """Refuse a file of too many faces."""
    if faces > most_faces:
        raise SceneFileError(
            f"{path} has {faces} faces; expected at most most_faces = {most_faces}"
        )


def _mesh(path: Path, most_faces: int) -> Body:
    """The one body of a PLY or STL file, neither of which has materials."""
    kind = path.suffix.lower().removeprefix(".")
    (_check_ply if kind == "ply" else _check_stl)(path, most_faces)
    try:
        with path.open("rb") as file:
            # Without a resolver, no other file is read.
            mesh = trimesh.load_mesh(file, file_type=kind, process=False, skip_materials=True)
        corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces)]
    # Readers of damaged files raise whatever they stumble over.
    except Exception as error:
        raise SceneFileError(f"{path} cannot be read as {kind.upper()}: {error!r}") from None
    check_count(path, len(corners), most_faces)
    return Body(path.name, NO_MATERIAL, corners)


def _check_ply(path: Path, most_faces: int) -> None:
    """Refuse a PLY file by its header."""
    with path.open("rb") as file:
        header, found, _ = file.read(LONGEST_HEADER).partition(b"end_header")
    if not header.startswith(b"ply") or not found:
        raise SceneFileError(f"{path} has no PLY header of at most {LONGEST_HEADER} bytes")
    size = path.stat().st_size
    counts: dict[str, int] = {}
    for line in header.decode("ascii", "replace").splitlines():
        words = line.split()
        if words[:1] != ["element"]:
            continue
        if len(words) != 3 or not words[2].isdecimal() or len(words[2]) > 18:
            raise SceneFileError(f"{path} has the header line {line!r}; expected a count")
        counts[words[1]] = int(words[2])
    check_count(path, counts.get("face", 0), most_faces)
    for name, count in counts.items():
        # The shortest element takes a byte.
        if count > size:
            raise SceneFileError(f"{path} promises {count} of {name} in {size} bytes; damaged")
        if count > 3 * most_faces:
            raise SceneFileError(
                f"{path} has {count} of {name}; expected at most 3 most_faces = {3 * most_faces}"
            )


def _check_stl(path: Path, most_faces: int) -> None:
    """Refuse an STL file by its size and, where it is binary, by its count."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(STL_HEADER)
    count = int.from_bytes(header[80:84], "little")
    if len(header) == STL_HEADER and size == STL_HEADER + STL_FACE * count:
        check_count(path, count, most_faces)
    elif header.lstrip().startswith(b"solid"):
        check_size(path, most_faces)
    else:
        raise SceneFileError(f"{path} promises {count} faces in {size} bytes; damaged")


def check_size(path: Path, most_faces: int) -> None:
    """Refuse a text file that is longer than its faces can need."""
    size, most = path.stat().st_size, 4096 + MOST_BYTES_A_FACE * most_faces
    if size > most:
        raise SceneFileError(
            f"{path} has {size} bytes; expected at most {most} with most_faces = {most_faces}"
        )


def read_obj(path: Path, most_faces: int) -> list[Body]:
    """Bodies of an OBJ file, one for each material that it uses.

    Its material library is not read: the names are enough, and it may name any file.
    """
    check_size(path, most_faces)
    points: list[list[float]] = []
    faces: dict[str, list[tuple[int, int, int]]] = {}
    material, count = NO_MATERIAL, 0
    with path.open(encoding="utf-8", errors="replace") as lines:
        for number, words in enumerate(_joined(lines), 1):
            try:
                if words[:1] == ["v"]:
                    points.append([float(word) for word in words[1:4]])
                    if len(points) > 3 * most_faces:
                        raise SceneFileError(
                            f"{path} has more vertices than 3 most_faces = {3 * most_faces}"
                        )
                elif words[:1] == ["usemtl"]:
                    material = " ".join(words[1:]) or NO_MATERIAL
                elif words[:1] == ["f"]:
                    ring = [_index(word, len(points)) for word in words[1:]]
                    fan = [(ring[0], b, c) for b, c in itertools.pairwise(ring[1:])]
                    faces.setdefault(material, []).extend(fan)
                    count += len(fan)
                    check_count(path, count, most_faces)
            except (ValueError, IndexError) as error:
                if isinstance(error, SceneFileError):
                    raise
                said = " ".join(words)[:60]
                raise SceneFileError(f"{path}, line {number}: {said!r} cannot be read") from None
    if any(len(point) != 3 for point in points):
        raise SceneFileError(f"{path} has a vertex without three coordinates")
    place = np.array(points, np.float64).reshape(-1, 3)
    return [Body(path.name, name, place[np.array(own)]) for name, own in faces.items() if own]


def _joined(lines: Iterable[str]) -> Iterable[list[str]]:
    """Words of each line without its comment; a backslash at its end joins the next to it."""
    before = ""
    for line in lines:
        text = before + line.partition("#")[0].rstrip()
        before = text[:-1] if text.endswith("\\") else ""
        if not before:
            yield text.split()


def _index(word: str, known: int) -> int:
    """Number, from 0, of a vertex that a face names from 1, or from the last by negative ones."""
    given = int(word.partition("/")[0])
    index = given - 1 if given > 0 else known + given
    # Vertices stand before the faces that use them.
    if not 0 <= index < known or given == 0:
        raise IndexError(given)
    return index
