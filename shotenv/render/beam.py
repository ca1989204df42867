"""The laser's emission profile: radiant intensity over direction, and directions drawn from it.

Directions are in the camera's axes: ahead, to the left, up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.config import CameraConfig
from shotenv.render.backend import upload

_CELLS = 256
"""Cells, across and up and down, by which directions are drawn."""
_TABLE_NODES = 2048
"""Even steps to which a table over angle is brought; 0.04 degrees at most."""
_NODES = np.polynomial.legendre.leggauss(48)
"""Nodes and weights on [-1, 1], exact for polynomials of degree 95."""


class Profile:
    """Emission profile of one camera's laser as it is configured, of any brightness."""

    def __init__(self, camera: CameraConfig):
        self._emission = camera.emission
        self._half_rad = tuple(math.atan(extent) for extent in camera.half_extents)
        if camera.emission.profile == "table":
            angles = np.radians(camera.emission.angle_deg)
            steps = np.linspace(0, angles[-1], _TABLE_NODES)
            self._table = upload(np.interp(steps, angles, camera.emission.intensity))

    def relative(self, ahead, left, up):
        """Relative radiant intensity towards a unit direction; 0 backwards."""
        emission, (across, down) = self._emission, self._half_rad
        softness = math.radians(emission.edge_softness_deg)
        angle = dr.atan2(dr.sqrt(left * left + up * up), ahead)
        if emission.profile == "flat":
            # Even over the rectangle that the image is: one pair of edges times the other.
            shape = _edge(left, ahead, across, softness) * _edge(up, ahead, down, softness)
        elif emission.profile == "gaussian":
            shape = dr.exp2(-dr.square(angle * (2 / math.radians(emission.fwhm_deg))))
        else:
            place = angle * ((_TABLE_NODES - 1) / math.radians(emission.angle_deg[-1]))
            node = dr.minimum(mi.UInt32(place), _TABLE_NODES - 2)
            low, high = (dr.gather(mi.Float, self._table, node + i) for i in range(2))
            shape = dr.lerp(low, high, place - mi.Float(node))
            shape = dr.select(place <= _TABLE_NODES - 1, shape, 0)
        return dr.select(ahead > 0, shape, 0)

    def of_directions(self, axes: np.ndarray) -> np.ndarray:
        """`relative` towards unit directions [N, 3] of NumPy."""
        return self.relative(*(upload(column) for column in axes.T)).numpy().astype(np.float64)


class Beam:
    """The laser's light on the device: a profile that emits one watt per watt."""

    def __init__(self, camera: CameraConfig):
        self._profile = Profile(camera)
        self._per_sr = dr.opaque(mi.Float, 1 / emitted_sr(camera))

    def intensity(self, ahead, left, up):
        """Radiant intensity towards a unit direction, W sr-1 per watt.

        It is at once the density, per solid angle, of the laser's photons.
        """
        return self._profile.relative(ahead, left, up) * self._per_sr


def _edge(side, ahead, half_rad: float, softness_rad: float):
    """1 inside half a field of view and 0 outside, a smooth step of this width in between."""
    if softness_rad == 0:
        return dr.select(dr.abs(side) <= math.tan(half_rad) * ahead, 1, 0)
    angle = dr.atan2(dr.abs(side), ahead)
    t = dr.clip((half_rad - angle) / softness_rad + 0.5, 0, 1)
    return t * t * (3 - 2 * t)


@dataclass(frozen=True)
class Directions:
    """N directions of the laser's light.

    Attributes
    ----------
    axes : float32 [N, 3]
        Unit vectors: ahead, left, up.
    per_sr : float32 [N]
        Density with which each was drawn, sr-1.
    """

    axes: np.ndarray
    per_sr: np.ndarray


def draw_directions(camera: CameraConfig, points: np.ndarray) -> Directions:
    """Directions in proportion to the profile, by points [N, 2] of the unit square.

    Evenly spread points give evenly spread directions: both coordinates are stretched by the
    inverse of their distribution (over azimuth, then over the sine of elevation).
    """
    grid = _grid(camera)
    column = np.searchsorted(grid.columns, points[:, 0], side="right")
    left_of = np.concatenate([[0.0], grid.columns])
    mass = left_of[column + 1] - left_of[column]
    along = (points[:, 0] - left_of[column]) / mass
    # Cells of all columns are one rising list, so that one search finds the row in its column.
    target = left_of[column] + points[:, 1] * mass
    cell = np.searchsorted(grid.cells, target, side="right")
    cell = np.clip(cell, column * _CELLS, (column + 1) * _CELLS - 1)
    below = np.concatenate([[0.0], grid.cells])
    share = below[cell + 1] - below[cell]
    upward = (target - below[cell]) / share
    size = 2 / _CELLS
    azimuth = grid.azimuth_rad * ((column + along) * size - 1)
    sine = grid.sine * ((cell % _CELLS + upward) * size - 1)
    cosine = np.sqrt(np.maximum(1 - sine**2, 0))
    axes = np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine], axis=1)
    # Azimuth and the sine of elevation are a map of the sphere that keeps areas.
    area = size**2 * grid.azimuth_rad * grid.sine
    return Directions(axes.astype(np.float32), (share / area).astype(np.float32))


@dataclass(frozen=True)
class _Grid:
    """Cumulative shares of columns [C] and, column by column, of all cells [C * C]."""

    azimuth_rad: float
    sine: float
    columns: np.ndarray
    cells: np.ndarray


@lru_cache(maxsize=8)
def _grid(camera: CameraConfig) -> _Grid:
    azimuth_rad, elevation_rad = _reach_rad(camera)
    sine = math.sin(elevation_rad)
    # Four looks into each cell, so that none that a hard edge crosses counts as dark.
    looks = (np.arange(2 * _CELLS) + 0.5) / _CELLS - 1
    azimuth, height = np.meshgrid(azimuth_rad * looks, sine * looks, indexing="ij")
    cosine = np.sqrt(1 - height**2)
    axes = np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), height], axis=-1)
    seen = Profile(camera).of_directions(axes.reshape(-1, 3))
    seen = seen.reshape(_CELLS, 2, _CELLS, 2).max(axis=(1, 3))
    # The brightest of its neighbours: nothing that shines lies in a cell that is never drawn.
    padded = np.pad(seen, 1)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    cells = np.cumsum(windows.max(axis=(2, 3)).ravel(), dtype=np.float64)
    cells /= cells[-1]
    return _Grid(azimuth_rad, sine, cells[_CELLS - 1 :: _CELLS], cells)


def _reach_rad(camera: CameraConfig) -> tuple[float, float]:
    """Largest azimuth and elevation that a profile shines to."""
    emission = camera.emission
    if emission.profile == "flat":
        softness = math.radians(emission.edge_softness_deg) / 2
        across, down = (math.atan(extent) + softness for extent in camera.half_extents)
        return across, down
    widest = math.radians(emission.angle_deg[-1]) if emission.profile == "table" else math.pi / 2
    return widest, widest


@lru_cache(maxsize=8)
def emitted_sr(camera: CameraConfig) -> float:
    """Integral of a camera's relative profile over all directions, sr.

    By Gauss and Legendre's rule between the angles where the profile has its corners.
    """
    emission = camera.emission
    if emission.profile == "flat":
        softness = math.radians(emission.edge_softness_deg) / 2
        (x, x_weight), (y, y_weight) = (
            _nodes((0.0, max(half - softness, 0.0), half + softness))
            for half in map(math.atan, camera.half_extents)
        )
        left, up = (a.ravel() for a in np.meshgrid(np.tan(x), np.tan(y), indexing="ij"))
        square = 1 + left**2 + up**2
        axes = np.stack([np.ones_like(left), left, up], axis=1) / np.sqrt(square)[:, None]
        weight = (1 + left**2) * (1 + up**2) * square**-1.5
        # One quarter of the image stands for all four.
        weight *= 4 * np.outer(x_weight, y_weight).ravel()
    else:
        corners: tuple[float, ...] = (0.0, math.pi / 2)
        if emission.profile == "table":
            corners = tuple(math.radians(angle) for angle in emission.angle_deg)
        angle, weight = _nodes(corners)
        axes = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
        weight = weight * 2 * np.pi * np.sin(angle)
    return float(Profile(camera).of_directions(axes) @ weight)


def _nodes(corners: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of all intervals between `corners`."""
    edges = np.array(corners)
    centre, half = (edges[1:] + edges[:-1]) / 2, (edges[1:] - edges[:-1]) / 2
    place, weight = _NODES
    nodes = centre[:, None] + half[:, None] * place
    return nodes.ravel(), (half[:, None] * weight).ravel()
