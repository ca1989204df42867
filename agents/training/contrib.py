"""Learners of sb3-contrib, which is asked for only where one of them is."""

from __future__ import annotations

from typing import Any


def contrib_learner(name: str, algorithm: str) -> Any:
    """The class `name` of sb3-contrib, for `agent.algorithm` `algorithm`.

    Raises
    ------
    ImportError
        It is not installed.
    """
    try:
        import sb3_contrib
    except ImportError:
        raise ImportError(
            f"agent.algorithm {algorithm} needs sb3-contrib, which is not installed: "
            "pip install sb3-contrib"
        ) from None
    return getattr(sb3_contrib, name)
