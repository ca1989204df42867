"""Wraps as classes: of the true distance, of the measured phase, and back to a distance."""

import pytest
import torch

from unwrap.networks.network import Settings
from unwrap.networks.toffusionnet import true_wraps
from unwrap.networks.tofsegnet import class_depth_m, wrap_classes


def test_classes_are_wraps_and_the_last_is_all_beyond():
    depth_m = torch.tensor([0.0, 6.2, 6.3, 24.9, 25.0, 30.0])
    assert wrap_classes(depth_m, Settings(classes=5)).tolist() == [0, 0, 1, 3, 4, 4]


def test_true_wraps_follow_the_measured_phase_over_a_boundary():
    true_m = torch.tensor([[[6.3, 6.2, 12.6, 29.9, 0.02]]])
    wrapped_m = torch.tensor([[[6.2, 0.05, 0.1, 0.1, 6.2]]])
    assert true_wraps(true_m, wrapped_m, Settings(classes=5)).tolist() == [[[0, 1, 2, 4, 0]]]


@pytest.mark.parametrize(
    ("probability", "expected"),
    [
        ([1.0, 0.0, 0.0], 0.5),  # certain: the middle of the class
        ([0.5, 0.5, 0.0], 1.0),  # between two: their boundary
        ([0.2, 0.7, 0.1], 1.4),
        ([0.6, 0.0, 0.4], 1.0),  # kept within the likeliest class
        ([0.25, 0.25, 0.5], 2.0),
    ],
)
def test_class_depth_is_the_expectation_within_the_likeliest_class(probability, expected):
    logits = torch.tensor(probability).clamp(min=1e-12).log()[None, :, None, None]
    depth = class_depth_m(logits + 3.0, unambiguous_m=6.25)
    assert depth.shape == (1, 1, 1)
    assert depth.item() == pytest.approx(6.25 * expected, abs=1e-4)
