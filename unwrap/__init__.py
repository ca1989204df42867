"""From raw samples of an indirect time-of-flight sensor to depth. Usable alone."""

from __future__ import annotations

from typing import Any

_PUBLIC = ("Prediction", "SensorDescription", "Unwrapper", "correct", "load_unwrapper")

__all__ = list(_PUBLIC)


def __getattr__(name: str) -> Any:
    """Public names, imported on first use so that `import unwrap` loads no torch."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import unwrap.unwrapper

    return getattr(unwrap.unwrapper, name)
