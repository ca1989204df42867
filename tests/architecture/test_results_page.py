"""What the page of a study says, and what it says of one that is too small to count."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def script():
    """The script docs/results_page.py."""
    path = Path(__file__).parents[2] / "docs" / "results_page.py"
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def row(value, *, gap=True):
    told = {"iqm": value, "low": value - 0.1, "high": value + 0.1, "mean": value, "median": value}
    names = ("error_at_half_energy", "energy_at_equal_error", "return")
    return {name: {**told, "seeds": [value] * 5} for name in (*names, *["gap_closed"][: int(gap)])}


def found(seeds):
    beside = {"probability": 0.7, "low": 0.6, "high": 0.8, "significant": True}
    even = {"probability": 0.5, "low": 0.3, "high": 0.7, "significant": False}
    table = {
        "bank": "0123456789abcdef",
        "env": {"bank": "pocket", "frames_per_drive": 256},
        **{"price": 0.09, "clips": 30, "drives": 24, "best": "regression"},
        "rows": {"cycle": row(0.9, gap=False), "ridge": row(0.6), "regression": row(0.5)},
        "improvement": {"regression": {"ridge": even, "cycle": beside}},
        "fronts": {},
    }
    return {
        "plan": {
            "seeds": seeds,
            "ablations": {"no_heat": {"policy": "regression", "unseen": ["temperature"]}},
            "study": {"drives": 24, "confidence": 0.95},
        },
        "seconds": 7200.0,
        "versions": {"shotenv": "0.1.0"},
        "presets": {"hot": table},
    }


def test_the_page_ranks_rows_and_says_where_there_is_no_difference(script):
    text = script.page(found([0, 1, 2, 3, 4]), "images/results.png", "make it")
    first, second, third = (
        text.index(f"| {name} | 5") for name in ("regression", "ridge", "cycle")
    )
    assert first < second < third
    assert "50 % (30 to 70), no significant difference |" in text
    assert "70 % (60 to 80) |" in text
    assert "| cycle | 5 | - | 0.90 m (0.80 to 1.00)" in text, "no gap without an optimum"
    assert "`pocket` (digest `0123456789abcdef`)" in text and "2.0 hours" in text
    assert "no heat: regression that is not shown temperature" in text
    assert "only show that the study works" not in text


def test_the_page_of_few_seeds_says_that_it_does_not_count(script):
    text = script.page(found([0]), "images/results.png", "make it")
    assert "only show that the study works:** 1 training seeds" in text


def test_undominated_points_rise_in_energy_and_fall_in_error(script):
    assert script.undominated([30, 10, 20, 20], [1.0, 5.0, 3.0, 6.0]) == ([10, 20, 30], [5, 3, 1])
    assert script.undominated([10, 20], [1.0, 2.0]) == ([10], [1.0])
