"""The page of the results table: what it says of a run follows from the run."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from shotenv.config.reader import find_config, read_config
from shotenv.config.sensor import SensorConfig
from shotenv.sensor.description import description_of
from unwrap.comparison.table_page import COLUMNS, render_page
from unwrap.comparison.table_trainings import TableConfig
from unwrap.signal.description import SensorDescription

DOCS = Path(__file__).parents[3] / "docs"
OTHER = TableConfig(
    bank="garden", sensor="own", stride=3, width=16, epochs=3, networks=("phasenet", "tofregnet")
)
SENSOR = SensorDescription(f1_hz=60e6, f2_hz=25e6, max_range_m=12.5, min_snr=3.0)


def row(method, split="clip", frames=7.0):
    scores = {key: 0.5 for key, _, _ in COLUMNS}
    return {
        "method": method, "shots": 4, "merge": "none", "frames": frames, "split": split,
        "truth": "rendered", **scores,
    }  # fmt: skip


@pytest.fixture(scope="module")
def page():
    rows = [row("PhaseNet (Spoorthi et al. 2019)"), row("TofRegNet with our loss")]
    return render_page(OTHER, SENSOR, rows)


def test_nothing_of_another_run_stands_on_a_page(page):
    for foreign in ("2048", "72.8", "77.9", "78.8", "24 MHz", "table-small", "nearfield", "epc660"):
        assert foreign not in page, foreign
    for absent in (
        "TofSegNet",
        "Crabb",
        "Agresti",
        "Held-out",
        "held-out",
        "measured",
        "by *frame*",
    ):
        published = page.index("## As published")
        assert absent not in page[:published], absent


def test_the_page_tells_what_was_run(page):
    assert "60 MHz map (2.5 m)" in page and "truth within 12.5 m" in page
    assert "every third row and column" in page
    assert "### Split by clip, rendered truth: 7 frames" in page
    assert "| PhaseNet (Spoorthi et al. 2019) | phase |" in page and "| TofRegNet | gray" in page
    assert "small budget" in page
    assert "small budget" not in render_page(TableConfig(), SENSOR, [row("TofRegNet")])


def test_the_configuration_on_the_page_is_the_one_that_was_run(page):
    listed = yaml.safe_load(re.search(r"```yaml\n(.*?)```", page, re.DOTALL)[1])
    assert TableConfig(**listed) == OTHER


def test_held_out_families_and_other_splits_are_told_of_where_there_are_any():
    rows = [
        row("TofRegNet", split=split, frames=n) for split, n in (("frame", 20.0), ("shift", 4.0))
    ]
    page = render_page(OTHER, SENSOR, rows)
    assert "### Held-out families, rendered truth: 4 frames" in page
    assert "by *frame*" in page and "and held-out families." in page


def test_the_page_in_the_documentation_is_made_of_its_numbers():
    made = json.loads((DOCS / "unwrapping.json").read_text(encoding="utf-8"))
    config = TableConfig(**made["config"])
    sensor = description_of(read_config(SensorConfig, find_config("sensor", config.sensor)))
    page = render_page(config, replace(sensor, min_snr=made["min_snr"]), made["rows"])
    assert page == (DOCS / "unwrapping.md").read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", page) if "://" not in link]
    assert len(links) >= 5 and all((DOCS / link).exists() for link in links)
