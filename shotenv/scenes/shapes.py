"""Mitsuba's shapes without a file of their own, as triangles with outward corners."""

from __future__ import annotations

import numpy as np
import trimesh

from shotenv.render.surfaces import Part, SceneFileError

TOLERANCE_M = 2.5e-4
"""How far a round body's triangles may lie within the round one: far below the 1 mm of a phase."""
FINEST_SPHERE, MOST_SECTIONS = 7, 4096
"""Divisions of an icosphere (327680 faces) and sections of a circle at most."""


def triangles_of(shape: Part, unit_m: float) -> np.ndarray:
    """Corners float64 [F, 3, 3], in the file's units, of a rectangle, cube, sphere, ... .

    Raises
    ------
    SceneFileError
        A shape that has no counterpart here.
    """
    turn = shape.values.get("to_world", np.eye(4))
    tolerance = TOLERANCE_M / unit_m
    if shape.plugin == "rectangle":
        corners = _square()
    elif shape.plugin == "cube":
        corners = np.array(trimesh.creation.box(extents=(2.0, 2.0, 2.0)).triangles)
    elif shape.plugin == "sphere":
        corners = _sphere(shape, turn, tolerance)
    elif shape.plugin == "disk":
        corners = _disk(_sections(_stretch(turn), tolerance))
    elif shape.plugin == "cylinder":
        corners = _cylinder(shape, turn, tolerance)
    else:
        raise SceneFileError(
            f"{shape.title} cannot be mapped; expected rectangle, cube, sphere, disk, cylinder, "
            "ply, obj or stl"
        )
    return corners


def placed(shape: Part, corners: np.ndarray) -> np.ndarray:
    """Corners moved by the shape's transform, outside out unless its normals are flipped."""
    turn = shape.values.get("to_world", np.eye(4))
    moved = corners @ turn[:3, :3].T + turn[:3, 3]
    mirrored = np.linalg.det(turn[:3, :3]) < 0
    return moved[:, ::-1] if mirrored != bool(shape.values.get("flip_normals")) else moved


def _square() -> np.ndarray:
    ring = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float64)
    return ring[np.array([(0, 1, 2), (0, 2, 3)])]


def _sphere(shape: Part, turn: np.ndarray, tolerance: float) -> np.ndarray:
    radius = float(shape.values.get("radius", 1.0))
    centre = np.array(shape.values.get("center", (0.0, 0.0, 0.0)))
    # Each division halves the angle between corners, 63.4 degrees at first; a triangle's middle
    # lies some 0.6 of it from its corners.
    sag = 1.0 - np.cos(0.6 * np.radians(63.4) / 2.0 ** np.arange(FINEST_SPHERE + 1))
    fine = np.flatnonzero(radius * _stretch(turn) * sag <= tolerance)
    detail = int(fine[0]) if len(fine) else FINEST_SPHERE
    ball = trimesh.creation.icosphere(subdivisions=detail, radius=radius)
    return np.array(ball.triangles) + centre


def _disk(sections: int) -> np.ndarray:
    angle = np.linspace(0.0, 2 * np.pi, sections + 1)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return np.stack([np.zeros_like(rim[1:]), rim[:-1], rim[1:]], axis=1)


def _cylinder(shape: Part, turn: np.ndarray, tolerance: float) -> np.ndarray:
    """An open tube, as Mitsuba's are."""
    start = np.array(shape.values.get("p0", (0.0, 0.0, 0.0)))
    end = np.array(shape.values.get("p1", (0.0, 0.0, 1.0)))
    radius = float(shape.values.get("radius", 1.0))
    axis = end - start
    side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    side *= radius / np.linalg.norm(side)
    across = np.cross(axis / np.linalg.norm(axis), side)
    angle = np.linspace(0.0, 2 * np.pi, _sections(radius * _stretch(turn), tolerance) + 1)[:, None]
    low = start + np.cos(angle) * side + np.sin(angle) * across
    a, b, c, d = low[:-1], low[1:], low[1:] + axis, low[:-1] + axis
    return np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3, 3)


def _stretch(turn: np.ndarray) -> float:
    """Largest factor by which a transform stretches a length."""
    return float(np.linalg.norm(turn[:3, :3], ord=2))


def _sections(radius: float, tolerance: float) -> int:
    """Sides of a polygon in a circle that leaves it by at most the tolerance."""
    within = max(1.0 - tolerance / max(radius, 1e-12), np.cos(np.pi / 8))
    return min(int(np.ceil(np.pi / np.arccos(within))), MOST_SECTIONS)
