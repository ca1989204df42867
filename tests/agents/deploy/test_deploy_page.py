"""The page on cameras shows the formulas of the code."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from shotenv.decision.features import FEATURE_NAMES

DOCS = Path(__file__).parents[3] / "docs"


def test_the_page_shows_every_feature_with_its_formula():
    """`python docs/deploy_table.py` writes them."""
    spec = spec_from_file_location("deploy_table", DOCS / "deploy_table.py")
    assert spec is not None and spec.loader is not None
    table = module_from_spec(spec)
    spec.loader.exec_module(table)
    assert tuple(name for name, *_ in table.formulas()) == FEATURE_NAMES
    page = table.PAGE.read_text(encoding="utf-8")
    assert page == table.filled(page)
