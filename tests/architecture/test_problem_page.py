"""What the page and the README say there is to win is what was measured, and every goal holds."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from agents.evaluation.acceptance import judged
from shotenv.config import configs_dir


@pytest.fixture(scope="module")
def script():
    """The script docs/problem_page.py, which writes both."""
    path = Path(__file__).parents[2] / "docs" / "problem_page.py"
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_says_what_was_measured(script):
    assert script.PAGE.read_text(encoding="utf-8") == script.page(
        script.measured(), script.kept(script.LEARNERS)
    )


def test_the_readme_says_what_was_measured(script):
    text, found = script.README.read_text(encoding="utf-8"), script.measured()["default"]
    assert text == script.filled_readme(text, found)
    found["error_at_half_energy"]["clairvoyant"]["mean"] += 0.1
    assert text != script.filled_readme(text, found)


def test_a_readme_without_a_place_for_the_table_is_named(script):
    with pytest.raises(ValueError, match="has 0 places for the table"):
        script.filled_readme("# shotenv\n", script.measured()["default"])


def test_every_goal_of_the_default_problem_holds(script):
    found = script.measured()["default"]
    assert found["holds"] and len(found["goals"]) >= 9
    assert all(goal["holds"] for goal in found["goals"].values())


def test_the_goals_are_those_of_today(script):
    """Numbers that were judged by other goals must be measured again."""
    explained = {"any": 0.0}  # not kept: its goal is what it leaves
    for preset, found in script.measured().items():
        again = judged({**found, "frame_explains": explained}, heat_binds=preset == "hot")
        bounds = {n: (g["least"], g.get("most")) for n, g in again["goals"].items()}
        assert bounds == {n: (g["least"], g.get("most")) for n, g in found["goals"].items()}


def test_every_preset_is_on_the_page(script):
    presets = {path.stem for path in (configs_dir() / "env").glob("*.yaml")}
    assert presets == set(script.PRESETS)


def test_plain_learners_were_measured_to_beat_every_fixed_choice(script):
    runs = script.kept(script.LEARNERS)["runs"]
    assert {run["algorithm"] for run in runs} == {"PPO", "DQN"}
    assert all(one["low"] > 0.0 for run in runs for one in run["over"].values())
