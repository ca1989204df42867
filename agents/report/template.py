"""Pages from templates, in the style of `page.css`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import jinja2
from plotly.offline import get_plotlyjs

CANNOT_SHOW: Final = (KeyError, IndexError, TypeError, jinja2.UndefinedError)
"""What results of another version raise on their way into a page."""


ROOM: Final = Path(__file__).parent


def page_of(template: str | Path, **values: Any) -> str:
    """A template of this room, or a file, filled in.

    `values` are escaped unless it says that they are safe; what it includes is of this room.
    """
    path = ROOM / template
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader((path.parent, ROOM)),
        autoescape=True,
        undefined=jinja2.StrictUndefined,  # by default a misspelt name would print nothing
    )
    # All 4 MB of plotly: pages are read without a network.
    return environment.get_template(path.name).render(plotly=get_plotlyjs(), **values)
