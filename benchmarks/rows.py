"""What a benchmark reports: a ratio, the bound that it is to keep, and a note with the numbers."""

from __future__ import annotations

import operator
from typing import Any

KEPT = {"<=": operator.le, ">=": operator.ge}


def row(name: str, ratio: float, bound: str, goal: float, note: str) -> dict[str, Any]:
    """One row; it holds where `ratio` `bound` `goal`, the bound being "<=" or ">="."""
    return {
        "name": name,
        "ratio": ratio,
        "bound": bound,
        "goal": goal,
        "holds": KEPT[bound](ratio, goal),
        "note": note,
    }


def printed(one: dict[str, Any]) -> str:
    """A row in two lines."""
    verdict = "holds" if one["holds"] else "MISSED"
    goal = f"goal {one['bound']} {one['goal']:<5}"
    return f"{one['name']:45} {one['ratio']:6.2f}  {goal} {verdict}\n    {one['note']}"
