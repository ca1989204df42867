"""The tables of `docs/scale.md` and its picture: what frames, drives and policies cost.

python docs/scale_page.py --measure     # measures first; best where nothing else runs
python docs/scale_page.py --measure judging comparing       # these alone, and what they need
python docs/scale_page.py

What was measured is kept in `docs/scale/growth.json`. The picture needs matplotlib.
"""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path
from typing import Any

from marked_tables import marked
from scale import costs, growth
from scale.picture import paint

from unwrap.support import write_json

DOCS = Path(__file__).parent
PAGE, NUMBERS = DOCS / "scale.md", DOCS / "scale" / "growth.json"
PICTURE = DOCS / "images" / "scale.png"


def filled(page: str, found: dict[str, Any]) -> str:
    """`page` with the tables between their marks."""
    page = marked(page, "each", costs.each(found), PAGE)
    return marked(page, "millions", costs.millions(found), PAGE)


def main() -> None:
    """Measure where asked to, then write page and picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    subjects = ", ".join(growth.SUBJECTS)
    parser.add_argument(
        "--measure", nargs="*", metavar="NAME", help=f"measure anew, all or some of {subjects}"
    )
    names = parser.parse_args().measure
    for name in names or ():
        if name not in growth.SUBJECTS:
            parser.error(f"NAME is {name!r}; expected some of {subjects}")
    if names is not None:
        kept = json.loads(NUMBERS.read_text(encoding="utf-8"))["points"] if names else None
        write_json(NUMBERS, growth.measure(partial(print, flush=True), names, kept))
    found = json.loads(NUMBERS.read_text(encoding="utf-8"))
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")
    paint(found, PICTURE)


if __name__ == "__main__":
    main()
