"""Single rays through triangles, outside any frame: what is in the way?"""

from __future__ import annotations

from typing import Any

import numpy as np

from shotenv.render.backend import start_mitsuba


def nearest_face(
    corners: np.ndarray, origins: np.ndarray, directions: np.ndarray, lengths_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What rays meet first among triangles.

    Parameters
    ----------
    corners : [F, 3, 3]
        Triangles, metres.
    origins, directions : [N, 3]
        Start of each ray, metres, and its unit direction.
    lengths_m : [N]
        Where each ray ends.

    Returns
    -------
    distance_m : float64 [N]
        Infinite where nothing is met.
    face : int64 [N]
        Number of the triangle; -1 where nothing is met.

    Raises
    ------
    RendererError
        Mitsuba or a usable LLVM library is missing.
    """
    mi = start_mitsuba()
    # Not at the top: it needs Mitsuba with its variant chosen.
    from shotenv.render.surfaces.scene import triangle_mesh

    scene = mi.load_dict({"type": "scene", "mesh": triangle_mesh(corners)})
    start = mi.Point3f(*_columns(mi, origins))
    way = mi.Vector3f(*_columns(mi, directions))
    ray = mi.Ray3f(start, way)
    ray.maxt = mi.Float(np.asarray(lengths_m, np.float32))
    met = scene.ray_intersect_preliminary(ray, False)
    distance = met.t.numpy().astype(np.float64)
    return distance, np.where(np.isfinite(distance), met.prim_index.numpy().astype(np.int64), -1)


def _columns(mi: Any, rows: np.ndarray) -> list[Any]:
    """The x, y and z of points or directions [N, 3], on the device."""
    return [mi.Float(column) for column in np.ascontiguousarray(rows.T, np.float32)]
