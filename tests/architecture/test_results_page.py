"""What the page of a study says, and what it says of one that is too small to count."""

from __future__ import annotations

import sys
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
    # Its parts lie beside it, as Python finds them for a script.
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


def row(value, *, gap=True):
    told = {"iqm": value, "low": value - 0.1, "high": value + 0.1, "mean": value, "median": value}
    names = (
        *("error_at_half_energy", "energy_saved_at_equal_error"),
        *("energy_saved_at_10_percent_more", "return"),
    )
    names = (*names, "depth_mae_m", "laser_energy_share")
    seeds = [value - 0.02, *[value] * 3, value + 0.02]
    return {name: {**told, "seeds": seeds} for name in (*names, *["gap_closed"][: int(gap)])}


def difference(value, *, significant):
    return {
        **{"difference": value, "low": value - 0.2, "high": value + 0.2},
        "significant": significant,
    }


def found(seeds):
    beside = {"probability": 0.7, "low": 0.6, "high": 0.8, "significant": True}
    even = {"probability": 0.5, "low": 0.3, "high": 0.7, "significant": False}
    table = {
        "bank": "0123456789abcdef",
        "env": {"bank": "pocket", "frames_per_drive": 256},
        **{
            "price": 0.09,
            "clips": 30,
            "drives": 24,
            "best": "regression",
            "ablations": ["no_gray"],
        },
        "rows": {"cycle": row(0.9, gap=False), "ridge": row(0.6), "regression": row(0.5)},
        "kinds": {"cycle": "rule", "ridge": "learned", "regression": "learned"},
        "improvement": {"regression": {"ridge": even, "cycle": beside, "no_heat": even}},
        "differences": {
            "no_heat": {"error_at_half_energy": difference(0.05, significant=False)},
            "ridge": {"error_at_half_energy": difference(-0.1, significant=False)},
            "cycle": {"error_at_half_energy": difference(-0.4, significant=True)},
        },
        "fronts": {},
    }
    one = {"clips": 7, "rows": dict(table["rows"])}
    table["groups"] = {"family": {"night_road": one}, "ego_speed": {"0.0 to 1.9 m/s": one}}
    return {
        "plan": {
            "seeds": seeds,
            "ablations": {
                "no_heat": {"policy": "regression", "unseen": ["temperature"], "agent": {}},
                "greedy": {
                    "policy": "regression",
                    "unseen": [],
                    "agent": {"regression": {"horizon": 1}},
                },
            },
            "transfer": {
                "source": "hot",
                "tables": {
                    "away": {"preset": "hot", "split": "shift", "env": {}},
                    "dim": {
                        "preset": "hot",
                        "split": None,
                        "env": {"laser": {"optical_power_w": [1.0, 1.0]}},
                    },
                },
            },
            "study": {"drives": 24, "confidence": 0.95},
        },
        "seconds": 7200.0,
        "versions": {"shotenv": "0.1.0"},
        "presets": {"hot": table},
        "transfer": {"away": table, "dim": table},
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
    assert "*no heat*: regression that is not shown temperature" in text
    assert "*greedy*: regression with `regression.horizon` 1" in text
    assert "0.50 m (0.40 to 0.60) | 0.48 to 0.52 m |" in text, "spread of the seeds"
    assert "only show that the study works" not in text
    assert text.startswith("# Results\n\nOn `hot`, **regression**") and "than no heat" not in text


def test_the_page_of_few_seeds_says_that_it_does_not_count(script):
    text = script.page(found([0]), "images/results.png", "make it")
    assert "only show that the study works:** 1 training seeds" in text


def test_undominated_points_rise_in_energy_and_fall_in_error(script):
    undominated = sys.modules["results.picture"].undominated
    assert undominated([30, 10, 20, 20], [1.0, 5.0, 3.0, 6.0]) == ([10, 20, 30], [5, 3, 1])
    assert undominated([10, 20], [1.0, 2.0]) == ([10], [1.0])


def test_the_page_begins_with_what_wins_and_by_how_much(script):
    first = script.page(found([0, 1, 2, 3, 4]), "images/results.png", "make it").split("\n\n")[1]
    assert first.startswith("On `hot`, **regression**, a learned scheduler, errs least at half")
    assert "0.40 m less (0.20 to 0.60) than cycle, the best rule" in first
    assert "0.10 m less (-0.10 to 0.30) than ridge: no significant difference" in first


def test_the_page_tells_of_groups_and_of_other_places(script):
    text = script.page(found([0, 1, 2, 3, 4]), "images/results.png", "make it")
    assert "| night road | 7 | 0.50 m (0.40 to 0.60), 50 % | 0.90 m (0.80 to 1.00) |" in text
    assert "| 0.0 to 1.9 m/s | 7 |" in text
    assert "- `away`: preset `hot`; clips of split shift (night road); 30 clips" in text
    assert "- `dim`: preset `hot`; `laser.optical_power_w` 1; 30 clips" in text
    # The winner, and what does not differ from it significantly.
    assert (
        "| `dim` | 0.90 m (0.80 to 1.00) | **0.60 m (0.50 to 0.70)** | **0.50 m (0.40 to 0.60)** |"
    ) in text


def test_a_study_without_a_transfer_has_no_such_section(script):
    alone = found([0, 1, 2, 3, 4]) | {"transfer": {}}
    assert "Elsewhere" not in script.page(alone, "images/results.png", "make it")


def test_zeros_have_no_sign(script):
    told = {"iqm": -0.001, "low": -0.004, "high": 0.02}
    assert (
        sys.modules["results.rows"].interval({"gap_closed": told}, "gap_closed", "%")
        == "0 % (0 to 2)"
    )
