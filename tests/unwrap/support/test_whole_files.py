"""Files and folders are there whole or not at all, and what a killed process left goes."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from unwrap.support.files import building_folder, replacing, unfinished, write_text
from unwrap.support.whole_files import open_regular

PROGRAM = """
import os, signal, sys
from pathlib import Path
from unwrap.support.files import building_folder, replacing
path = Path(sys.argv[2])
with {"file": replacing, "folder": building_folder}[sys.argv[1]](path) as half:
    half.write(b"half") if sys.argv[1] == "file" else (half / "half").touch()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def names(folder) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_what_a_killed_process_left_half_written_goes_with_the_next(tmp_path, kind):
    path = tmp_path / "results [1].json"
    words = [sys.executable, "-c", PROGRAM, kind, str(path)]
    assert subprocess.run(words).returncode == -signal.SIGKILL
    (left,) = names(tmp_path)
    assert left.startswith(".results [1].json.")
    if kind == "file":
        write_text(path, "whole")
    else:
        with building_folder(path):
            pass
    assert names(tmp_path) == [path.name]


def test_what_others_are_at_stays(tmp_path):
    path = tmp_path / "results.json"
    # Of this very process, which is alive; and of another machine, which it knows nothing of.
    own, elsewhere = unfinished(path), tmp_path / ".results.json.0000abcd-1-12345678"
    for place in (own, elsewhere):
        place.touch()
    write_text(path, "whole")
    assert names(tmp_path) == sorted((own.name, elsewhere.name, path.name))


def test_a_failure_leaves_what_was_there(tmp_path):
    path = tmp_path / "results.json"
    write_text(path, "before")
    with pytest.raises(KeyboardInterrupt), replacing(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert path.read_text() == "before" and names(tmp_path) == [path.name]


@pytest.mark.parametrize("name", ["-n", "line\nbreak", "ä" * 120, "x" * 255, " "])
def test_odd_names_are_written(tmp_path, name):
    write_text(tmp_path / name, "whole")
    assert names(tmp_path) == [name]


def test_a_full_disk_is_told_with_the_file(tmp_path):
    path = tmp_path / "results.json"
    with pytest.raises(OSError, match=r"No space left.*results\.json"), replacing(path):
        raise OSError(28, "No space left on device")
    assert names(tmp_path) == []


def test_a_folder_is_no_regular_file_and_stays_closed(tmp_path):
    with pytest.raises(ValueError, match="not a regular file"):
        open_regular(tmp_path)
    # Not by their number: what others have left open may be closed meanwhile.
    assert tmp_path not in [fd.resolve() for fd in Path("/proc/self/fd").iterdir()]
