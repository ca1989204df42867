"""The tables of `docs/scale.md` and its picture: what frames, drives and policies cost.

python docs/scale_page.py --measure     # measures first; best where nothing else runs
python docs/scale_page.py

What was measured is kept in `docs/scale/growth.json`. The picture needs matplotlib.
"""

from __future__ import annotations

import argparse
import json
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
    parser.add_argument("--measure", action="store_true", help="measure anew")
    if parser.parse_args().measure:
        write_json(NUMBERS, growth.measure(print))
    found = json.loads(NUMBERS.read_text(encoding="utf-8"))
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")
    paint(found, PICTURE)


if __name__ == "__main__":
    main()
