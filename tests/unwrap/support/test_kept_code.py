"""Machine code on disk is that of the present function, whatever happened to the files before."""

from __future__ import annotations

import pickle
import subprocess
import sys

import pytest

from unwrap.support.compiled import CodeFiles

PROGRAM = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np, work
values = np.zeros(3, np.float32)
work.add_(values, work.Step(np.float32(1)))
print(values[0], sum(work.add_.stats.cache_hits.values()))
"""
WORK = """
from typing import NamedTuple
import numpy as np
from unwrap.support import loop
{step}
@loop
def add_(values, step):
    for i in range(len(values)):
        values[i] += step.size * np.float32({size})
"""
STEP = "class Step(NamedTuple):\n    size: np.float32\n"


@pytest.fixture
def files(tmp_path):
    return CodeFiles(tmp_path, "work.add_-7.py311", "first")


def test_code_comes_back_by_what_it_is_of(files):
    assert files.load(("float32",)) is None
    files.save(("float32",), b"code")
    files.save(("float64",), b"other")
    assert files.load(("float32",)) == b"code" and files.load(("float64",)) == b"other"


def test_code_of_another_version_is_neither_taken_nor_kept(files, tmp_path):
    files.save(("float32",), b"code")
    (tmp_path / "work.add_more-9.py311.0.0.nbc").touch()
    later = CodeFiles(tmp_path, "work.add_-7.py311", "second")
    assert later.load(("float32",)) is None
    later.save(("float32",), b"new")
    assert later.load(("float32",)) == b"new" and files.load(("float32",)) is None
    assert len(list(tmp_path.iterdir())) == 2, "that of another function stays"


@pytest.mark.parametrize(
    "content", [b"", b"no pickle", pickle.dumps(b"code")[:-3], b"cgone_module\nGone\n."]
)
def test_what_cannot_be_read_is_compiled_anew(files, tmp_path, content):
    files.save(("float32",), b"code")
    (path,) = tmp_path.iterdir()
    path.write_bytes(content)
    assert files.load(("float32",)) is None


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path):
    (tmp_path / "file").touch()
    CodeFiles(tmp_path / "file", "work", "first").save(("float32",), b"code")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.slow
def test_a_class_in_a_signature_may_move(tmp_path):
    """Between processes: compiled, loaded, compiled anew after the move, and loaded."""

    def told() -> str:
        words = [sys.executable, "-c", PROGRAM, str(tmp_path)]
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()

    (tmp_path / "work.py").write_text(WORK.format(step=STEP, size=1))
    assert [told(), told()] == ["1.0 0", "1.0 1"]
    (tmp_path / "steps.py").write_text(f"from typing import NamedTuple\nimport numpy as np\n{STEP}")
    (tmp_path / "work.py").write_text(WORK.format(step="from steps import Step", size=2))
    assert [told(), told()] == ["2.0 0", "2.0 1"]
