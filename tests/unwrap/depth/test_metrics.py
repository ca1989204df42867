"""Depth metrics by hand, and which pixels and images count."""

import math

import pytest
import torch

from unwrap.depth.metrics import METRICS, depth_metrics


def test_one_pixel_by_hand():
    metrics = depth_metrics(
        torch.tensor([[[5.0]]]), torch.tensor([[[4.0]]]), torch.ones(1, 1, 1) > 0
    )
    expected = {
        "mae_m": 1.0,
        "rmse_m": 1.0,
        "irmse_per_km": 1000 * (1 / 4 - 1 / 5),
        "abs_rel": 1 / 4,
        "sq_rel_kitti": 1 / 16,
        "sq_rel_eigen": 1 / 4,
        "silog": 0.0,
        "within_0p1m": 0.0,
        "within_0p5m": 0.0,
        "p95_m": 1.0,
    }
    assert metrics == pytest.approx(expected)


def test_two_pixels_by_hand():
    truth = torch.tensor([[[2.0, 10.0]]])
    metrics = depth_metrics(truth + torch.tensor([0.05, -2.0]), truth, torch.ones(1, 1, 2) > 0)
    assert metrics["rmse_m"] == pytest.approx(math.sqrt((0.05**2 + 4) / 2))
    assert metrics["within_0p1m"] == metrics["within_0p5m"] == 0.5
    # Interpolated between the two errors, 0.05 and 2.
    assert metrics["p95_m"] == pytest.approx(0.05 + 0.95 * 1.95)
    logs = math.log(2 / 2.05), math.log(10 / 8)
    assert metrics["silog"] == pytest.approx(100 * abs(logs[0] - logs[1]) / 2, rel=1e-5)


def test_a_common_factor_leaves_only_silog_at_zero():
    truth = torch.linspace(1, 20, 64).reshape(1, 8, 8)
    metrics = depth_metrics(1.1 * truth, truth, truth > 0)
    assert metrics["silog"] == pytest.approx(0, abs=1e-3)
    assert metrics["abs_rel"] == pytest.approx(0.1, rel=1e-5)


def test_mean_is_over_images_and_not_over_pixels():
    truth = torch.full((2, 1, 4), 5.0)
    prediction = truth + torch.tensor([1.0, 3.0])[:, None, None]
    valid = torch.tensor([[[True, True, True, True]], [[True, False, False, False]]])
    assert depth_metrics(prediction, truth, valid)["mae_m"] == pytest.approx(2.0)


def test_invalid_pixels_and_empty_images_do_not_count():
    truth = torch.full((2, 1, 2), 5.0)
    prediction = truth + 1
    prediction[0, 0, 0] = math.nan
    truth[0, 0, 0] = math.inf
    valid = torch.tensor([[[False, True]], [[False, False]]])
    assert depth_metrics(prediction, truth, valid)["mae_m"] == pytest.approx(1.0)


def test_nothing_valid_gives_nan():
    metrics = depth_metrics(torch.ones(1, 2, 2), torch.ones(1, 2, 2), torch.zeros(1, 2, 2) > 0)
    assert tuple(metrics) == tuple(METRICS)
    assert all(math.isnan(value) for value in metrics.values())


def test_refuses_unequal_shapes_and_a_mask_that_is_none():
    with pytest.raises(ValueError, match="expected one shape"):
        depth_metrics(torch.ones(1, 2, 2), torch.ones(1, 2, 3), torch.ones(1, 2, 2) > 0)
    with pytest.raises(ValueError, match=r"torch\.bool"):
        depth_metrics(torch.ones(1, 2, 2), torch.ones(1, 2, 2), torch.ones(1, 2, 2))
