"""Means and variances of recordings that are read piece by piece."""

from __future__ import annotations

import numpy as np
import pytest

from unwrap.calibration import MomentsInPieces, Setting, moments_of

DARK = Setting("dark", "a.npz")


def frames(count=11, seed=0):
    """Samples far from zero, whose squares float32 could not hold; flags and gray words."""
    draw = np.random.default_rng(seed)
    samples = (1e4 + draw.normal(0, 3, (count, 2, 4, 3, 5))).astype(np.float32)
    return samples, draw.random((count, 3, 5)) < 0.3, draw.normal(500, 4, (count, 3, 5))


@pytest.mark.parametrize("cuts", [(), (4,), (1, 2, 10)])
@pytest.mark.parametrize("cut_off", [False, True])
def test_pieces_are_as_all_frames_at_once(cuts, cut_off):
    samples, saturated, gray = frames()
    gathered = MomentsInPieces("a.npz", cut_off=cut_off)
    for part in np.split(np.arange(len(samples)), cuts):
        gathered.add(samples[part], saturated[part], gray[part])
    found = gathered.of(DARK)
    # numpy's own, of a masked array: a pixel's saturated frames are left out or not.
    out = saturated[:, None, None] & np.ones_like(samples, bool) & cut_off
    kept = np.ma.array(samples.astype(np.float64), mask=out)
    np.testing.assert_allclose(found.mean_lsb, kept.mean(0).reshape(2, 4, 15), rtol=1e-12)
    variance = kept.var(0, ddof=1).mean(1).reshape(2, 15)
    np.testing.assert_allclose(found.variance_lsb2, variance, rtol=1e-9)
    np.testing.assert_allclose(found.gray_variance, gray.var(0, ddof=1).ravel(), rtol=1e-9)
    assert found.frames == 11
    np.testing.assert_array_equal(found.flagged, saturated.mean(0).ravel())
    if not cut_off:
        whole = moments_of(DARK, samples, saturated, gray)
        np.testing.assert_allclose(found.variance_lsb2, whole.variance_lsb2, rtol=1e-12)


def test_a_single_frame_has_no_variance_and_a_recording_may_have_no_gray():
    samples, saturated, _ = frames(1)
    found = moments_of(DARK, samples, saturated)
    assert np.isnan(found.variance_lsb2).all() and found.gray_mean is None


def test_a_pixel_that_is_always_full_has_no_mean_of_its_own():
    samples, saturated, _ = frames()
    saturated[:, 0, 0] = True
    gathered = MomentsInPieces("a.npz", cut_off=True)
    gathered.add(samples, saturated)
    found = gathered.of(DARK)
    assert found.flagged[0] == 1.0 and (found.mean_lsb[..., 0] == 0.0).all()
    # No NaN: one dead pixel must not take the mean over all pixels with it.
    assert (found.variance_lsb2[:, 0] == 0.0).all()
