"""Values that name a class (`laser: evil.Laser`) are refused before its module is imported.

jsonargparse takes a section from a class that a value names, and imports the class's module to see
that it will not do: by then whatever stands at the top of that module has been executed.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from jsonargparse import _util

OWN = ("agents", "shotenv", "unwrap")
"""Packages of which sections are; jsonargparse looks them up by their names, too."""
_guarded: ContextVar[bool] = ContextVar("guarded", default=False)
_import_object = _util.import_object


@contextmanager
def imports_refused() -> Iterator[None]:
    """Inside, no value that this thread parses imports a module; other parsers do as before."""
    token = _guarded.set(True)
    try:
        yield
    finally:
        _guarded.reset(token)


def _import_known(name: Any, *rest: Any, **more: Any) -> Any:
    module = str(name).rpartition(".")[0]
    if _guarded.get() and not (module.partition(".")[0] in OWN and module in sys.modules):
        # What jsonargparse expects where an import fails.
        raise ImportError(f"{name!r} names a class; expected none")
    return _import_object(name, *rest, **more)


# Its modules have each taken the function from that one.
for _name, _module in list(sys.modules.items()):
    if _name.startswith("jsonargparse.") and "import_object" in vars(_module):
        vars(_module)["import_object"] = _import_known
