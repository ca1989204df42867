"""The physics page: every test it names and every file it links exists."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "physics.md"
TEXT = PAGE.read_text(encoding="utf-8")
NAMED_TESTS = sorted(set(re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", TEXT)))
CLOSING = {"Formula and measurement", "What is left out"}
IMAGES = PAGE.parent / "images" / "physics"


@cache
def functions_of(path: str) -> set[str]:
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def headings() -> dict[str, str]:
    """Text of each section by its heading."""
    _, *sections = re.split(r"^## ", TEXT, flags=re.MULTILINE)
    return {section.partition("\n")[0]: section for section in sections}


@pytest.mark.parametrize(("path", "name"), NAMED_TESTS)
def test_named_tests_exist(path, name):
    assert name in functions_of(path)


def test_linked_files_exist_and_every_figure_is_shown():
    links = {link for link in re.findall(r"\]\(([^)#]+)\)", TEXT) if "://" not in link}
    assert [link for link in links if not (PAGE.parent / link).exists()] == []
    shown = {Path(link).name for link in links if link.startswith("images/physics/")}
    assert shown == {path.name for path in IMAGES.iterdir()}
    assert all(path.stat().st_size < 120_000 for path in IMAGES.iterdir())


def test_every_effect_has_a_figure_and_a_proof():
    effects = {k: v for k, v in headings().items() if k not in CLOSING}
    assert len(effects) >= 15
    for name, section in effects.items():
        assert "](images/physics/" in section, name
        assert "\nProof: `tests/" in section, name


def test_the_table_of_numbers_is_filled():
    rows = headings()["Formula and measurement"].count("\n| ")
    assert rows > 20
