"""Directions that pixels look into, by a lens or by a table of rays."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from unwrap.cameras.files import LensConfig
from unwrap.support import read_arrays

ROUNDS = 50
"""Steps of the fixed point that undoes the distortion; wide lenses converge to 1e-9 in some 20."""


def rays_of(lens: LensConfig, size: tuple[int, int], folder: Path) -> Tensor:
    """Unit vectors ahead, left and up of each pixel's centre, float64 [3, H, W].

    Radial distortion after Brown: a ray at the tangent r from the axis is seen at
    r (1 + k1 r^2 + k2 r^4 + k3 r^6).

    Parameters
    ----------
    size : (int, int)
        Rows and columns.
    folder : Path
        That `lens.rays` is relative to.

    Raises
    ------
    ValueError
        The table of rays is missing or has another shape; or the distortion folds the image, so
        that a pixel has no one direction.

    Examples
    --------
    Two pixels across 90 degrees: their centres lie half way between the middle and the edges.

    >>> ahead, left, up = rays_of(LensConfig(horizontal_fov_deg=90), (1, 2), Path())
    >>> (left / ahead).round(decimals=6).tolist()
    [[0.5, -0.5]]
    """
    height, width = size
    if lens.rays is not None:
        return _table(folder / lens.rays, size)
    if lens.focal_px is not None:
        across_px, down_px = lens.focal_px
    else:
        assert lens.horizontal_fov_deg is not None  # The description has seen to it.
        across_px = down_px = width / 2 / math.tan(math.radians(lens.horizontal_fov_deg) / 2)
    column, row = lens.center_px or ((width - 1) / 2, (height - 1) / 2)
    right = (np.arange(width) - column) / across_px * np.ones((height, 1))
    down = (np.arange(height)[:, None] - row) / down_px * np.ones(width)
    share = _undistorted(np.hypot(right, down), lens.radial)
    rays = np.stack((np.ones(size), -right * share, -down * share))
    return torch.from_numpy(rays / np.linalg.norm(rays, axis=0))


def _undistorted(seen: np.ndarray, radial: tuple[float, float, float]) -> np.ndarray:
    """True tangent over the seen one."""
    true = seen.copy()
    for _ in range(ROUNDS):
        true = seen / _factor(true, radial)
    again = true * _factor(true, radial)
    if not np.allclose(again, seen, rtol=1e-6, atol=1e-9):
        raise ValueError(
            f"lens.radial is {radial}: at {float(seen.max()):.2f}, the tangent of the image's "
            "corner, it has no one direction; expected a distortion that grows outwards"
        )
    return np.divide(true, seen, out=np.ones_like(seen), where=seen > 0)


def _factor(tangent: np.ndarray, radial: tuple[float, float, float]) -> np.ndarray:
    first, second, third = radial
    squared = tangent * tangent
    return 1 + squared * (first + squared * (second + squared * third))


def _table(path: Path, size: tuple[int, int]) -> Tensor:
    """Rays of a file with unit vectors right, down, ahead."""
    rays = read_arrays(path, "rays", ("rays",)).get("rays")
    if rays is None or rays.shape != (*size, 3) or rays.dtype.kind != "f":
        found = "nothing" if rays is None else f"{rays.dtype} {rays.shape}"
        raise ValueError(f"{path}: rays is {found}; expected floats {(*size, 3)}")
    lengths = np.linalg.norm(rays, axis=-1)
    if not np.all(np.abs(lengths - 1) < 1e-3):  # Written so that NaN is refused as well.
        raise ValueError(f"{path}: rays holds vectors that are no unit vectors, or NaN")
    right, down, ahead = np.moveaxis(rays.astype(np.float64), -1, 0)
    return torch.from_numpy(np.stack((ahead, -right, -down)))
