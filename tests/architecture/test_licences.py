"""The page of licences names every dependency, and explains each licence that asks for more."""

from __future__ import annotations

import re

import licences_table
from packaging.requirements import Requirement

STRONG = re.compile(r"(?<!L)GPL|GNU (Affero )?General Public")


def listed() -> dict[str, tuple[str, str]]:
    """Version and licence of each package of the page."""
    _, _, table = licences_table.PAGE.read_text(encoding="utf-8").partition("## All packages")
    cells = [line.strip("| ").split(" | ") for line in table.splitlines() if line.startswith("| ")]
    return {licences_table.key(name): (version, licence) for name, version, licence, _ in cells[1:]}


def test_every_dependency_is_on_the_page():
    own, extras = licences_table.project()
    names = {
        licences_table.key(Requirement(line).name)
        for lines in (own, *extras.values())
        for line in lines
    }
    assert names - {"shotenv"} <= set(listed())


def test_every_licence_is_told_and_none_forbids_mit_use():
    licences = {name: licence for name, (_, licence) in listed().items()}
    assert [name for name, licence in licences.items() if licence in ("", "not told")] == []
    copyleft = {n for n, licence in licences.items() if licences_table.COPYLEFT.search(licence)}
    assert copyleft <= set(licences_table.WHY)
    # Strong copyleft would reach whatever is handed on with it.
    assert [name for name, licence in licences.items() if STRONG.search(licence)] == []


def test_constraints_pin_what_the_page_tells():
    """A package that is updated in one of the two is in the other as well."""
    root = licences_table.PAGE.parents[1]
    lines = (root / "constraints.txt").read_text().splitlines()
    pins = dict(line.split("==") for line in lines if "==" in line)
    pinned = {licences_table.key(name): version for name, version in pins.items()}
    told = {name: version for name, (version, _) in listed().items()}
    assert set(told) - set(pinned) <= {"setuptools"}
    assert {name: told[name] for name in told if name in pinned} == {
        name: version for name, version in pinned.items() if name in told
    }
