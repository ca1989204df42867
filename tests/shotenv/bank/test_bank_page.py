"""The page on banks: its numbers are those of the configurations."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shotenv.bank.listing.contents import known_banks
from shotenv.config.bank import BankConfig
from shotenv.config.families import FAMILIES, SHIFT_FAMILIES, TRAINING_FAMILIES
from shotenv.config.reader import find_config, read_config

TEXT = (Path(__file__).parents[3] / "docs" / "bank.md").read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^(\| `(\w+)` \| \d.*)$", TEXT.partition("## Banks that come")[2], re.M))
KNOWN = {bank["name"]: bank for bank in known_banks()}
BANKS = {name: bank for name, bank in KNOWN.items() if name != "pocket"}
"""Those that a configuration describes."""


def row_of(name: str) -> str:
    """The row of the table that the configuration `name` calls for."""
    config, bank = read_config(BankConfig, find_config("bank", name)), BANKS[name]
    world, clips = config.world, [count for _, count, _ in config.clips]
    frames = [count * len(families) * world.frames_per_clip for _, count, families in config.clips]
    assert sum(frames) == bank["frames"]
    cells = [
        f"`{name}`",
        str(bank["frames"]),
        f"{bank['width']} x {bank['height']}",
        "{}, {}, {}; {}; {}".format(*clips),
        f"{world.frames_per_clip} at {world.frame_rate_hz:g} Hz",
        "{}, {}, {}; {}; {}".format(*frames),
        f"{bank['bytes'] / 1e9:.1f} GB",
    ]
    return f"| {' | '.join(cells)} |"


def test_every_bank_that_comes_along_has_a_row_and_no_other():
    assert sorted(ROWS.values()) == sorted(BANKS)


@pytest.mark.parametrize("name", BANKS)
def test_the_row_of_a_bank_says_what_its_configuration_gives(name):
    assert row_of(name) in ROWS


def test_the_page_says_how_large_the_bank_is_that_ships():
    pocket = KNOWN["pocket"]
    size = f"{pocket['width']} x {pocket['height']} pixels (of 160 x 120)"
    clips = f"{pocket['clips']} clips of every split, {pocket['bytes'] / 1e6:.1f} MB"
    assert f"{pocket['frames']} frames of {size} in {clips}" in TEXT


def test_the_families_are_as_many_as_the_page_says():
    assert "of each of five families; shift of each of four; clutter of one" in TEXT
    assert (len(FAMILIES), len(SHIFT_FAMILIES), len(TRAINING_FAMILIES)) == (5, 4, 1)
