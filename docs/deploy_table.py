"""The table of `docs/deploy.md`, from the code: what a camera computes for each feature.

`python docs/deploy_table.py` writes it into the page; a test compares them.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from marked_tables import marked

import shotenv.decision

PAGE = Path(__file__).with_name("deploy.md")
FEATURES = Path(shotenv.decision.__file__).with_name("features.py")
SOURCES = {"SCENE_FEATURES": "scene", "SEEN_FEATURES": "last samples", "STATE_FEATURES": "state"}


def formulas() -> Iterator[tuple[str, str, str, str]]:
    """Name, source, meaning and formula of each feature, in order."""
    for node in ast.parse(FEATURES.read_text(encoding="utf-8")).body:
        if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)):
            continue
        source = SOURCES.get(node.targets[0].id)
        if source is None or not isinstance(node.value, ast.Tuple):
            continue
        for call in node.value.elts:
            if isinstance(call, ast.Call) and isinstance(call.args[3], ast.Lambda):
                name, _, meaning = (ast.literal_eval(part) for part in call.args[:3])
                yield name, source, meaning, ast.unparse(call.args[3].body)


def filled(page: str) -> str:
    """`page` with the table between its marks."""
    lines = ["| | feature | from | meaning | formula |", "|---|---|---|---|---|"]
    for number, (name, source, meaning, formula) in enumerate(formulas()):
        lines.append(f"| {number} | `{name}` | {source} | {meaning} | `{formula}` |")
    return marked(page, "features", "\n".join(lines), PAGE)


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
