"""Pages from the templates of this room."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import jinja2
from plotly.offline import get_plotlyjs

CANNOT_SHOW: Final = (KeyError, IndexError, TypeError, jinja2.UndefinedError)
"""What results of another version raise on their way into a page."""


def page_of(name: str, **values: Any) -> str:
    """The template `name` filled in; `values` are escaped unless it says that they are safe."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,  # by default a misspelt name would print nothing
    )
    # All 4 MB of plotly: pages are read without a network.
    return environment.get_template(name).render(plotly=get_plotlyjs(), **values)
