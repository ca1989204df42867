"""What the scripts that write tables into a page share: the marks, and numbers with intervals.

A table stands between `<!-- name -->` and `<!-- end -->`; the rest of the page is written by hand.
"""

from __future__ import annotations

import re
from collections.abc import Mapping


def marked(page: str, name: str, table: str, where: object) -> str:
    """`page` with `table` between the marks of `name`.

    Parameters
    ----------
    where : Path or str
        The page's file, for the message.

    Raises
    ------
    ValueError
        There is no such place, or more than one.
    """
    text = f"<!-- {name} -->\n\n{table}\n\n<!-- end -->"
    # A function, since a replacement's backslashes would be read as groups.
    page, count = re.subn(
        rf"<!-- {name} -->\n.*?<!-- end -->", lambda _: text, page, flags=re.DOTALL
    )
    if count != 1:
        raise ValueError(f"{where} has {count} places for the table {name!r}; expected one")
    return page


def said(one: Mapping[str, float], scale: float, digits: int, unit: str) -> str:
    """Mean and interval, as `41 (38 to 45) %`."""
    mean, low, high = (f"{scale * one[key]:.{digits}f}" for key in ("mean", "low", "high"))
    return f"{mean} ({low} to {high}){unit}"
