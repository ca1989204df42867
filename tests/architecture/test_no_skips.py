"""In continuous integration a test that is skipped has failed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import no_skips
import pytest

TESTS = Path(__file__).parents[1]
SKIPPING = """
import pytest

def test_of_what_is_missing():
    pytest.importorskip("nothing_of_this_name")

@pytest.mark.skipif(True, reason="of no use here")
def test_marked():
    pass

def {excused}():
    pytest.skip("said why")

@pytest.mark.xfail(reason="known")
def test_known_to_fail():
    assert False

def test_sound():
    pass
"""
WHOLE_FILE = "import pytest\npytest.importorskip('nothing_of_this_name')\ndef test(): pass\n"


def outcome_of(source: str, folder: Path, **variables: str) -> str:
    """Summary of pytest on a file of tests, with the plugin, in an environment with `variables`."""
    (folder / "test_made.py").write_text(source)
    environment = {k: v for k, v in os.environ.items() if k not in ("CI", "PYTEST_ADDOPTS")}
    environment |= {"PYTHONPATH": str(TESTS / "helpers"), "COLUMNS": "300", **variables}
    command = [sys.executable, "-m", "pytest", "-rfE", "-p", "no_skips", "-c", os.devnull]
    done = subprocess.run(
        [*command, "--rootdir", folder, folder], env=environment, capture_output=True, text=True
    )
    return done.stdout


def test_a_skip_fails_in_continuous_integration_unless_it_is_excused(tmp_path):
    source = SKIPPING.format(excused=next(iter(no_skips.MAY_BE_SKIPPED)))
    assert "1 passed, 3 skipped, 1 xfailed" in outcome_of(source, tmp_path)
    told = outcome_of(source, tmp_path, CI="true")
    assert "1 failed, 1 passed, 1 skipped, 1 xfailed, 1 error" in told
    assert re.search(r"nothing_of_this_name.*nothing is skipped unless no_skips\.py", told)
    assert "of no use here" in told


def test_a_skipped_file_fails_in_continuous_integration(tmp_path):
    assert "1 skipped" in outcome_of(WHOLE_FILE, tmp_path)
    assert "1 error" in outcome_of(WHOLE_FILE, tmp_path, CI="true")


@pytest.mark.parametrize("name", no_skips.MAY_BE_SKIPPED)
def test_what_is_excused_exists(name):
    assert any(f"def {name}(" in path.read_text("utf-8") for path in TESTS.rglob("test_*.py"))
