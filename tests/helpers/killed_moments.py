"""Actions that end, as if their process were killed, at a chosen moment of their writing."""

from __future__ import annotations

import itertools
import os
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

DELETES_BY_NAME = {"os.remove", "os.rmdir"}
WRITING = {"os.mkdir", "os.rename", "shutil.rmtree", *DELETES_BY_NAME}


class Killed(BaseException):
    """Nothing catches it, and nothing that is done on its way out comes to the disk."""


class _Moment:
    """Counts steps of writing below a folder: from number `last` on none is taken any more."""

    def __init__(self, last: int | None, folder: Path) -> None:
        self._folder, self._steps, self._last = str(folder), itertools.count(), last
        self._over = False

    def step(self) -> None:
        if self._over or next(self._steps) == self._last:
            self._over = True
            raise Killed

    def watch(self, event: str, arguments: tuple) -> None:
        opens = event == "open" and (arguments[2] or 0) & (os.O_WRONLY | os.O_RDWR)
        if not (opens or event in WRITING):
            return
        if isinstance(arguments[0], int):  # Opened before, and counted then.
            return
        path = os.fsdecode(arguments[0])
        if event in DELETES_BY_NAME and arguments[1] >= 0:
            # Within a folder that is deleted with all that is in it.
            path = str(Path(f"/proc/self/fd/{arguments[1]}").readlink() / path)
        # A lock ends with its process.
        if path.startswith(self._folder) and not path.endswith(".lock"):
            self.step()

    def fsync(self, descriptor: int) -> None:
        """Without the flushing itself: the machine goes on, and what was written can be read."""
        try:
            self.step()
        except Killed:
            # As if the rest had not come to the disk.
            if stat.S_ISREG(os.fstat(descriptor).st_mode):
                os.ftruncate(descriptor, os.fstat(descriptor).st_size // 2)
            raise


_moments: list[_Moment] = []


def _watch(event: str, arguments: tuple) -> None:
    if _moments:
        _moments[-1].watch(event, arguments)


# It stays for as long as the process: a hook cannot be taken away.
sys.addaudithook(_watch)


@contextmanager
def _until(moment: _Moment) -> Iterator[None]:
    flush, os.fsync = os.fsync, moment.fsync
    _moments.append(moment)
    try:
        yield
    finally:
        _moments.pop()
        os.fsync = flush


def survives(action: Callable[[], object], moment: int | None, folder: Path) -> bool:
    """Run `action`; False where it ended at its step number `moment` of writing to `folder`.

    Steps are making, renaming and deleting files and folders, opening files to be written, and
    flushing them. Once it has ended no step is taken, so that nothing is cleaned up; of a file
    that was being flushed half is left.
    """
    try:
        with _until(_Moment(moment, folder)):
            action()
    except Killed:
        return False
    return True
