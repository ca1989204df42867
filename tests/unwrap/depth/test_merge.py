"""Merge rules against a slow reference, and where they differ."""

import math

import pytest
import torch

from unwrap.depth.merge import merge_nearest, merge_regression, merge_segmentation

RANGE, SATURATION = 6.25, 6.0


def merge_slowly(rule, predicted, wrapped):
    """Eq. 6, eq. 8 or the nearest candidate, one pixel at a time."""
    merged = torch.empty_like(wrapped)
    for index, d_m1 in enumerate(wrapped.view(-1).tolist()):
        p = predicted.view(-1)[index].item()
        count = {
            "floor": lambda p=p: math.floor(p / RANGE),
            "class": lambda p=p: p,
            "nearest": lambda p=p, d=d_m1: max(0, round((p - d) / RANGE)),
        }[rule]()
        beyond = p * RANGE if rule == "class" else p
        merged.view(-1)[index] = count * RANGE + d_m1 if d_m1 < SATURATION else beyond
    return merged


@pytest.fixture
def maps():
    generator = torch.Generator().manual_seed(5)
    return 30 * torch.rand(16, 16, generator=generator), RANGE * torch.rand(
        16, 16, generator=generator
    )


@pytest.mark.parametrize(
    ("rule", "merge"), [("floor", merge_regression), ("nearest", merge_nearest)]
)
def test_equals_the_slow_reference(maps, rule, merge):
    predicted, wrapped = maps
    merged = merge(predicted, wrapped, RANGE, SATURATION)
    torch.testing.assert_close(merged, merge_slowly(rule, predicted, wrapped))


def test_segmentation_equals_the_slow_reference(maps):
    wraps = (maps[0] / RANGE).long()
    merged = merge_segmentation(wraps, maps[1], RANGE, SATURATION)
    torch.testing.assert_close(merged, merge_slowly("class", wraps, maps[1]))


def test_nearest_is_right_where_the_prediction_errs_by_less_than_half_a_range():
    truth = torch.linspace(0, 24.9, 4000)
    # Half a range is 3.125.
    for error in (-3.1, 0.0, 3.1):
        predicted = (truth + error).clamp(min=0)
        merged = merge_nearest(predicted, truth % RANGE, RANGE, RANGE + 1)
        torch.testing.assert_close(merged, truth, rtol=0, atol=1e-5)


def test_floor_errs_where_prediction_and_truth_lie_on_either_side_of_a_wrap():
    predicted, truth = torch.tensor([[6.1]]), torch.tensor([[6.4]])
    merged = merge_regression(predicted, truth % RANGE, RANGE, SATURATION)
    torch.testing.assert_close(merged, truth - RANGE)


def test_nearest_is_never_negative():
    merged = merge_nearest(torch.tensor([[0.1]]), torch.tensor([[5.9]]), RANGE, SATURATION)
    torch.testing.assert_close(merged, torch.tensor([[5.9]]))


def test_middle_of_a_class_gives_the_class_with_either_rule():
    wrapped = torch.linspace(0.01, 5.99, 50).reshape(5, 10)
    for wraps in range(5):
        middle = torch.full_like(wrapped, (wraps + 0.5) * RANGE)
        for merge in (merge_regression, merge_nearest):
            merged = merge(middle, wrapped, RANGE, SATURATION)
            torch.testing.assert_close(merged, wraps * RANGE + wrapped)
