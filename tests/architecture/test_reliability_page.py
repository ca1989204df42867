"""The page of what must not break says what was measured, and names tests that exist."""

from __future__ import annotations

import json
import subprocess
import sys
import time

import pytest

from reliability import page as pages, rows
from reliability.page import MEASUREMENTS, PAGE, PROMISES, page
from reliability.rows import KEPT, ROOT, Progress, Row

NEITHER = {
    12: "no machine of continuous integration has a GPU: the page says what was measured once",
}
"""Promises that neither tests hold nor a file tells of, and why."""
ROW = Row(9, "a million steps", {"growth, MB": 1.25, "curve": [1.0, 2.0]}, True, 61.0)


def test_the_page_is_that_of_what_is_kept():
    assert PAGE.read_text(encoding="utf-8") == page()


def test_every_file_is_of_a_measurement_that_exists():
    assert {path.stem for path in KEPT.glob("*.json")} <= set(MEASUREMENTS)


@pytest.mark.parametrize("number", PROMISES)
def test_named_tests_exist(number):
    missing = [name for name in PROMISES[number].tests if not (ROOT / name).exists()]
    assert missing == []


def test_every_promise_is_held_by_tests_or_measured():
    measured = {
        row["promise"]
        for path in KEPT.glob("*.json")
        for row in json.loads(path.read_text())["rows"]
    }
    assert list(PROMISES) == list(range(1, 16)) and measured <= set(PROMISES)
    held = {number for number, promise in PROMISES.items() if promise.tests}
    assert set(PROMISES) - held - measured == set(NEITHER)


def test_what_is_kept_comes_back_and_is_shown(monkeypatch, tmp_path):
    monkeypatch.setattr(rows, "KEPT", tmp_path / "kept")
    monkeypatch.setattr(pages, "MEASUREMENTS", ("rows",))
    broken = Row(10, "a worker stopped", {"named after, s": 11}, False, 12.0)
    rows.keep("rows", [ROW, broken], 73.0)
    kept = rows.kept("rows")
    assert kept["rows"] == [ROW, broken] and kept["command"] == "python -m reliability rows"
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["rows.json"]
    text = page()
    assert "| `rows` | a million steps | growth, MB: 1.25; curve: 1, 2 | yes | 61 s |" in text
    assert "| named after, s: 11 | **no** | 12 s |" in text.replace("a worker stopped ", "")
    assert "| 1.2 min | " in text


def test_an_interrupted_measurement_goes_on(monkeypatch, tmp_path):
    monkeypatch.setattr(rows, "KEPT", tmp_path)
    said, asked = [], []

    def measured(broken: bool) -> list[Row]:
        progress = Progress(say=said.append, parts=rows.parts_of("rows"))

        def second() -> Row:
            asked.append("second")
            if broken:
                raise OSError("no such device")
            return ROW

        def first() -> Row:
            asked.append("first")
            return ROW

        return [progress.row(9, "first", first), progress.row(9, "second", second)]

    found = measured(broken=True)
    assert found[0] == ROW and not found[1].holds
    assert found[1].found == {"could not be measured": "OSError: no such device"}
    rows.keep("rows", found, 1.0)
    # A process that was killed as it wrote.
    with rows.parts_of("rows").open("a") as file:
        file.write('\n["second", {"promi')
    assert measured(broken=False) == [ROW, ROW]
    assert asked == ["first", "second", "second"]
    rows.keep("rows", [ROW, ROW], 1.0)
    assert [path.name for path in tmp_path.iterdir()] == ["rows.json"]


def test_what_parts_took_before_counts(tmp_path):
    first, again = (Progress(say=print, parts=tmp_path / "rows.parts") for _ in range(2))
    first.part("walk", lambda: time.sleep(0.05))
    assert first.before_s == []
    again.part("walk", lambda: pytest.fail("done before"))
    assert 0.05 <= sum(again.before_s) < 5.0


def test_a_trial_is_small():
    assert Progress().size(100, 2) == 100 and Progress(quick=True).size(100, 2) == 2


def test_what_is_no_measurement_is_refused_by_name():
    run = [sys.executable, "-m", "reliability", "nothing"]
    done = subprocess.run(run, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and "NAME is 'nothing'; expected one of" in done.stderr
