"""The tables of storage are those of what was measured."""

from __future__ import annotations

import json

import storage_table


def test_the_page_has_what_was_measured():
    found = json.loads(storage_table.NUMBERS.read_text(encoding="utf-8"))
    page = storage_table.PAGE.read_text(encoding="utf-8")
    assert page == storage_table.filled(page, found)
    found["sizes"][0]["bytes"] *= 2
    found["playing"][0]["packed"] *= 2
    assert page != storage_table.filled(page, found)
