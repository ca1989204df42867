"""The C files compiled and run on their test vectors, where there is a compiler."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from agents.deploy.c_source import SOURCE

FLAGS: Final = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror")


def run_self_test(files: Mapping[str, str]) -> float | None:
    """Microseconds of a choice on one core of this machine; None without a C compiler.

    Raises
    ------
    ValueError
        The files do not compile, or choose otherwise than their test vectors say.
    """
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        program = str(Path(folder) / "self_test")
        compiling = [compiler, *FLAGS, "-DSHOTENV_SELF_TEST", SOURCE, "-o", program, "-lm"]
        for words in (compiling, [program]):
            done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode:
                said = (done.stderr or done.stdout).strip().partition("\n")[0]
                raise ValueError(f"{SOURCE} fails its self-test: {said}; nothing was written")
    found = re.search(r"([\d.]+) microseconds", done.stdout)
    return float(found[1]) if found else None
