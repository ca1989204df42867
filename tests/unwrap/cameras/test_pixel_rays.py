"""Directions of pixels: pinholes, distortion undone, tables."""

from pathlib import Path

import numpy as np
import pytest

from unwrap.cameras.files import LensConfig
from unwrap.cameras.pixel_rays import rays_of

SIZE = (24, 32)


def test_a_field_of_view_is_that_of_the_outer_edges():
    ahead, left, up = rays_of(LensConfig(horizontal_fov_deg=90), SIZE, Path()).numpy()
    np.testing.assert_allclose(ahead**2 + left**2 + up**2, 1.0)
    # Pixel centres: half a pixel within the edge at 45 degrees.
    np.testing.assert_allclose((left / ahead)[:, 0], 1 - 1 / 32)
    np.testing.assert_allclose((up / ahead)[0], (1 - 1 / 24) * 24 / 32)


def test_distortion_is_undone():
    radial = (-0.25, 0.05, 0.01)
    lens = LensConfig(focal_px=(30.0, 28.0), center_px=(15.0, 12.5), radial=radial)
    ahead, left, up = rays_of(lens, SIZE, Path()).numpy()
    right, down = -left / ahead, -up / ahead
    squared = right**2 + down**2
    factor = 1 + radial[0] * squared + radial[1] * squared**2 + radial[2] * squared**3
    columns = 15.0 + 30.0 * right * factor
    rows = 12.5 + 28.0 * down * factor
    np.testing.assert_allclose(columns, np.arange(32) * np.ones((24, 1)), atol=1e-5)
    np.testing.assert_allclose(rows, np.arange(24)[:, None] * np.ones(32), atol=1e-5)


def test_distortion_that_folds_the_image_is_refused():
    lens = LensConfig(focal_px=(10.0, 10.0), radial=(-0.5, 0.0, 0.0))
    with pytest.raises(ValueError, match="no one direction"):
        rays_of(lens, SIZE, Path())


def test_a_table_of_rays(tmp_path):
    rays = np.zeros((*SIZE, 3), np.float32)
    rays[..., 0], rays[..., 2] = 0.6, 0.8
    np.save(tmp_path / "rays.npy", rays)
    ahead, left, up = rays_of(LensConfig(rays="rays.npy"), SIZE, tmp_path).numpy()
    np.testing.assert_allclose((ahead[0, 0], left[0, 0], up[0, 0]), (0.8, -0.6, 0.0), atol=1e-7)
    for wrong, says in ((rays[:5], "expected floats"), (2 * rays, "no unit vectors")):
        np.save(tmp_path / "rays.npy", wrong)
        with pytest.raises(ValueError, match=says):
            rays_of(LensConfig(rays="rays.npy"), SIZE, tmp_path)
