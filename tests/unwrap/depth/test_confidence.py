"""Calibration error against closed forms and a slow reference; temperatures against known ones."""

import math

import pytest
import torch

from unwrap.depth.confidence import (
    expected_calibration_error,
    fit_temperature,
    golden_section,
    reliability,
)


def slow_error(confidence: list[float], right: list[bool], bins: int) -> float:
    total = 0.0
    for i in range(bins):
        low, high = i / bins, (i + 1) / bins
        members = [
            k
            for k, value in enumerate(confidence)
            if low <= value < high or (i == bins - 1 and value == 1.0)
        ]
        if members:
            mean = sum(confidence[k] for k in members) / len(members)
            hits = sum(right[k] for k in members) / len(members)
            total += len(members) / len(confidence) * abs(mean - hits)
    return total


@pytest.mark.parametrize("bins", [1, 8, 16])
def test_equals_a_slow_reference(bins):
    generator = torch.Generator().manual_seed(0)
    # Binary fractions: no value lies within rounding of an edge by chance.
    confidence = torch.randint(0, 1025, (30, 20), generator=generator) / 1024
    right = torch.rand(30, 20, generator=generator) < confidence**2
    expected = slow_error(confidence.flatten().tolist(), right.flatten().tolist(), bins)
    assert expected > 0.05
    assert expected_calibration_error(confidence, right, bins=bins) == pytest.approx(expected)


def test_certain_and_always_wrong_is_one_and_always_right_is_zero():
    certain = torch.ones(7)
    assert expected_calibration_error(certain, torch.zeros(7).bool()) == 1.0
    assert expected_calibration_error(certain, torch.ones(7).bool()) == 0.0


def test_squared_accuracy_errs_by_a_sixth():
    """Confidence uniform, accuracy its square: the integral of p - p^2 over 0..1 is 1 / 6."""
    generator = torch.Generator().manual_seed(1)
    confidence = torch.rand(400_000, generator=generator)
    right = torch.rand(400_000, generator=generator) < confidence**2
    assert expected_calibration_error(confidence, right) == pytest.approx(1 / 6, abs=2e-3)
    honest = torch.rand(400_000, generator=generator) < confidence
    assert expected_calibration_error(confidence, honest) < 5e-3


def test_table_tells_each_bin():
    confidence = torch.tensor([0.1, 0.2, 0.9, 1.0])
    table = reliability(confidence, torch.tensor([False, True, True, True]), bins=4)
    assert table.share.tolist() == [0.5, 0.0, 0.0, 0.5]
    assert table.confidence[[0, 3]].tolist() == pytest.approx([0.15, 0.95])
    assert table.accuracy[[0, 3]].tolist() == [0.5, 1.0]
    assert table.accuracy[1:3].isnan().all()
    assert table.expected_error == pytest.approx(0.5 * 0.35 + 0.5 * 0.05)


@pytest.mark.parametrize(
    ("confidence", "right", "bins", "message"),
    [
        (torch.rand(3), torch.ones(4).bool(), 15, "one shape"),
        (torch.rand(0), torch.ones(0).bool(), 15, "not empty"),
        (torch.rand(3), torch.ones(3), 15, "right is torch.float32"),
        (torch.tensor([0.5, 1.1]), torch.ones(2).bool(), 15, "outside"),
        (torch.tensor([0.5, math.nan]), torch.ones(2).bool(), 15, "NaN"),
        (torch.rand(3), torch.ones(3).bool(), 0, "bins is 0"),
    ],
)
def test_bad_input_is_named(confidence, right, bins, message):
    with pytest.raises(ValueError, match=message):
        expected_calibration_error(confidence, right, bins=bins)


@pytest.mark.parametrize("temperature", [0.3, 1.0, 4.0])
def test_temperature_of_over_and_under_confident_logits_is_found(temperature):
    generator = torch.Generator().manual_seed(2)
    honest = 2 * torch.randn(40_000, 5, generator=generator)
    target = torch.multinomial(honest.softmax(1), 1, generator=generator).squeeze(1)
    logits = honest * temperature
    assert fit_temperature(logits, target) == pytest.approx(temperature, rel=0.03)


def test_temperature_makes_over_confident_logits_honest():
    generator = torch.Generator().manual_seed(3)
    honest = torch.randn(40_000, 5, generator=generator)
    target = torch.multinomial(honest.softmax(1), 1, generator=generator).squeeze(1)
    logits = 5 * honest

    def error(temperature):
        confidence, likeliest = (logits / temperature).softmax(1).max(1)
        return expected_calibration_error(confidence, likeliest == target)

    assert error(1.0) > 0.3
    assert error(fit_temperature(logits, target)) < 0.01


def test_logits_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="logits"):
        fit_temperature(torch.tensor([[1.0, math.inf]]), torch.tensor([0]))
    with pytest.raises(ValueError, match="logits"):
        fit_temperature(torch.zeros(0, 3), torch.zeros(0).long())


@pytest.mark.parametrize("least", [0.11, 3.0, 19.0])
def test_golden_section_finds_the_minimum_of_a_bent_parabola(least):
    found = golden_section(lambda x: abs(x - least) ** 1.5, 0.1, 20.0)
    assert found == pytest.approx(least, rel=1e-3)
