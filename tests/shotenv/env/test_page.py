"""The page of the environment shows the tables that the code makes."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from shotenv.env.reset_options import KNOWN

DOCS = Path(__file__).parents[3] / "docs"


def test_the_page_shows_the_tables_of_the_code():
    """`python docs/environment_tables.py` writes them."""
    spec = spec_from_file_location("environment_tables", DOCS / "environment_tables.py")
    assert spec is not None and spec.loader is not None
    tables = module_from_spec(spec)
    spec.loader.exec_module(tables)
    page = tables.PAGE.read_text(encoding="utf-8")
    assert page == tables.filled(page)


def test_the_page_tells_of_every_option():
    page = (DOCS / "environment.md").read_text(encoding="utf-8")
    assert [name for name in KNOWN if f"\n| `{name}` |" not in page] == []
