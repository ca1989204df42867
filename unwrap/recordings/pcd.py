"""PCD files, the format of point clouds of the Point Cloud Library."""

from __future__ import annotations

import numpy as np

FIELDS = ("x", "y", "z", "intensity")


def encode_pcd(points: np.ndarray) -> bytes:
    """Binary PCD 0.7 of points float32 [N, 4]: x, y, z in metres, and the intensity.

    Source of the format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html
    """
    each = len(FIELDS)
    header = {
        "VERSION": "0.7",
        "FIELDS": " ".join(FIELDS),
        "SIZE": " ".join(["4"] * each),
        "TYPE": " ".join(["F"] * each),
        "COUNT": " ".join(["1"] * each),
        "WIDTH": len(points),
        "HEIGHT": 1,  # Points without an order.
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": len(points),
        "DATA": "binary",
    }
    lines = "".join(f"{name} {value}\n" for name, value in header.items())
    return lines.encode("ascii") + points.astype("<f4").tobytes()
