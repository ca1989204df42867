"""The table of features, and the page that shows it."""

from __future__ import annotations

from pathlib import Path

from shotenv.decision.features import FEATURES, SEEN_FEATURES, TOLD
from unwrap.signal.shots import Shots

PAGE = Path(__file__).parents[3] / "docs" / "environment.md"
HEAD = "| feature | unit | meaning |\n|---|---|---|\n"


def test_every_feature_has_a_name_of_its_own_a_unit_and_a_meaning():
    names = [feature.name for feature in FEATURES]
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() for name in names)
    assert all(feature.unit and feature.meaning for feature in FEATURES)


def test_the_page_shows_the_table_of_features():
    """Whoever changes the table copies the lines that pytest shows as missing."""
    rows = "".join(f"| `{f.name}` | {f.unit} | {f.meaning} |\n" for f in FEATURES)
    _, head, rest = PAGE.read_text(encoding="utf-8").partition(HEAD)
    shown, _, _ = rest.partition("\n\n")
    assert head and shown + "\n" == rows


def test_what_each_number_of_samples_tells():
    names = [feature.name for feature in SEEN_FEATURES]
    assert not TOLD[0].any() and TOLD[Shots.EIGHT].all()
    untold = {
        shots: [name for name, told in zip(names, TOLD[shots], strict=True) if not told]
        for shots in Shots
    }
    regrets = ["regret_of_two", "regret_of_four"]
    assert untold == {
        Shots.TWO: ["residual", "two_from_four", *regrets],
        Shots.FOUR: regrets,
        Shots.EIGHT: [],
    }
