"""Arguments with which each registered environment can be made in a test."""

from __future__ import annotations

from collections.abc import Mapping


def kwargs_of(env_id: str, tiny_kwargs: Mapping[str, object]) -> dict[str, object]:
    """Those of the tiny bank, but for held-out families, of which it has no clip."""
    if "Shift" in env_id:
        return {"bank": "pocket", "frames_per_drive": tiny_kwargs["frames_per_drive"]}
    return dict(tiny_kwargs)
