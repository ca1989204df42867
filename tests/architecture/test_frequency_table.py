"""The table of networks at other frequencies says what was measured, and can be measured again."""

from __future__ import annotations

import json
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
import torch

from shotenv.sensor.exposure import Exposure
from unwrap.signal.decoding import decode, distance_m
from unwrap.signal.frequencies import unambiguous_range_m

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "correct_and_export.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def script():
    """The script docs/frequency_table.py."""
    path = DOCS / "frequency_table.py"
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def kept(script):
    return json.loads(script.KEPT.read_text(encoding="utf-8"))


def test_the_page_says_what_was_measured(script, kept):
    assert script.filled(PAGE, kept) == PAGE
    with pytest.raises(ValueError, match="has 0 places for the table"):
        script.filled("# Depth\n", kept)


def test_measured_again_it_is_the_same(script, kept):
    again = script.measured((60e6,))
    old = [one for one in kept["rows"] if one["frequency_hz"] == 60e6]
    assert {n: v for n, v in again.items() if n != "rows"} == {
        n: v for n, v in kept.items() if n != "rows"
    }
    assert [one["network"] for one in again["rows"]] == [one["network"] for one in old]
    for new, before in zip(again["rows"], old, strict=True):
        assert new["pixels"] == pytest.approx(before["pixels"], rel=1e-3)
        for measure in ("right", "expected", "mae_m", "alone_mae_m"):
            assert new[measure]["mean"] == pytest.approx(before[measure]["mean"], rel=2e-3)


def test_what_decides_is_the_network_s_error_against_half_a_range(script, kept):
    rows = kept["rows"]
    for name in {one["network"] for one in rows}:
        own = script.rows_of(rows, name)
        assert [one["frequency_hz"] for one in own] == list(script.FREQUENCIES_HZ)
        shares = [one["right"]["mean"] for one in own]
        assert shares == sorted(shares, reverse=True)
        for one in own:
            assert one["right"]["mean"] == pytest.approx(one["expected"]["mean"], abs=2e-3)
            # As the page has it: else merging would not be worth while.
            assert one["mae_m"]["mean"] < one["alone_mae_m"]["mean"]


def test_light_at_another_frequency_has_the_phase_of_its_distance(script):
    truth_m = torch.tensor([[[0.5, 7.25, 24.0, torch.inf]]])
    blank = torch.zeros_like(truth_m)
    light = Exposure(torch.zeros(1, 8, 1, 4), blank + 3.0, blank, truth_m)
    for hz in (12e6, 100e6):
        found = decode(script.at_frequency(light, hz).correlation)
        torch.testing.assert_close(found.amplitude, blank + 3.0)
        expected = truth_m[..., :3] % unambiguous_range_m(hz)
        torch.testing.assert_close(
            distance_m(found.phase_rad, hz)[..., :3], expected, atol=1e-5, rtol=0
        )
