"""Refuses ways that no car drives: through walls, from within solid bodies, faster than 60 m/s."""

from __future__ import annotations

import math

import numpy as np

from shotenv.config import HIGHEST_SPEED_M_S
from shotenv.render.surfaces import nearest_face
from shotenv.world.geometry import Motion

STEP_S = 0.02
"""Time between the places that are looked at: at most 1.2 m apart."""
LOOKS = 64
"""Directions in which a camera looks for whether it is inside a body."""
FAR_M = 1e4


def check_way(camera: Motion, duration_s: float, corners: np.ndarray, title: str) -> None:
    """Refuse the way of a camera among triangles.

    Parameters
    ----------
    camera : Motion
    duration_s : float
        Length of the clip, from 0 s.
    corners : [F, 3, 3]
        Triangles, counter-clockwise seen from outside, metres.
    title : str
        What the way is called in messages.

    Raises
    ------
    ValueError
        It is faster than `HIGHEST_SPEED_M_S`, goes through a triangle, or runs inside a closed
        body.
    """
    times = np.linspace(0.0, duration_s, max(2, math.ceil(duration_s / STEP_S) + 1))
    places = np.array([camera.at(time).position_m for time in times])
    steps = np.diff(places, axis=0)
    length_m = np.linalg.norm(steps, axis=1)
    _check_speed(times, length_m, title)
    moving = length_m > 0
    if moving.any():
        starts, ways = places[:-1][moving], steps[moving] / length_m[moving, None]
        distance_m, face = nearest_face(corners, starts, ways, length_m[moving])
        met = face >= 0
        if met.any():
            first = met.argmax()
            raise ValueError(
                f"{title} goes through a surface at "
                f"{_said(starts[first] + ways[first] * distance_m[first])} m, "
                f"{times[:-1][moving][first]:.2f} s after its start; expected free space"
            )
    _check_outside(places[:: max(1, len(places) // 64)], corners, title)


def _check_speed(times: np.ndarray, length_m: np.ndarray, title: str) -> None:
    speed = length_m / np.diff(times)
    if speed.max() > HIGHEST_SPEED_M_S:
        raise ValueError(
            f"{title} moves at {speed.max():.1f} m/s {times[speed.argmax()]:.2f} s after its "
            f"start; expected at most {HIGHEST_SPEED_M_S:g} m/s"
        )


def _check_outside(places: np.ndarray, corners: np.ndarray, title: str) -> None:
    """Refuse places from which every look ends at the back of a face."""
    # Directions spread evenly: a spiral on the sphere.
    z = 1 - (2 * np.arange(LOOKS) + 1) / LOOKS
    turn = np.pi * (1 + math.sqrt(5)) * np.arange(LOOKS)
    looks = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], 1)
    origins, ways = np.repeat(places, LOOKS, axis=0), np.tile(looks, (len(places), 1))
    _, face = nearest_face(corners, origins, ways, np.full(len(ways), FAR_M))
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(u, v)[face]
    behind = (face >= 0) & ((normal * ways).sum(axis=1) > 0)
    inside = behind.reshape(len(places), LOOKS).all(axis=1)
    if inside.any():
        raise ValueError(
            f"{title} is inside a closed body at {_said(places[inside.argmax()])} m; expected a "
            "way outside, or, where the body is a room, faces that look inwards (`flip_normals`)"
        )


def _said(place: np.ndarray) -> str:
    return "(" + ", ".join(f"{number:.2f}" for number in place) + ")"
