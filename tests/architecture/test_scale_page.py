"""What the page of costs says is what was measured, and costs grow in proportion."""

from __future__ import annotations

import json

import numpy as np
import pytest
import scale_page
from scale import costs, growth


@pytest.fixture
def found():
    return json.loads(scale_page.NUMBERS.read_text(encoding="utf-8"))


def test_the_page_says_what_was_measured(found):
    page = scale_page.PAGE.read_text(encoding="utf-8")
    assert page == scale_page.filled(page, found)
    found["points"]["rendering"][-1]["core_s"] *= 2
    assert page != scale_page.filled(page, found)


def test_every_subject_was_measured_at_several_sizes(found):
    assert list(found["points"]) == list(growth.SUBJECTS)
    for points in found["points"].values():
        sizes = [point["size"] for point in points]
        assert len(sizes) >= 3 and sizes == sorted(set(sizes))


def test_time_grows_in_proportion(found):
    """Of a billion frames nothing could be said, were it otherwise."""
    for name, points in found["points"].items():
        start_s, each_s = growth.fitted(points)
        assert each_s > 0, name
        # Of rules one family takes longer to tune than another.
        for point in points if name != "comparing" else ():
            assert start_s + each_s * point["size"] == pytest.approx(point["core_s"], rel=0.2), name


def test_rendering_takes_no_more_memory_for_more_frames(found):
    memory_mb = np.array([point["memory_mb"] for point in found["points"]["rendering"]])
    assert memory_mb.max() <= 1.2 * memory_mb[0]


def test_a_line_through_points_is_found():
    points = [{"size": size, "core_s": 3.0 + 0.5 * size} for size in (1, 2, 7)]
    assert growth.fitted(points) == pytest.approx((3.0, 0.5))


def test_durations_and_hours_have_the_unit_that_suits():
    assert costs.duration(0.0042) == "4.2 ms"
    assert costs.duration(3e-6) == "3 µs"
    assert costs.hours(5400) == "1.5 h"
    assert costs.hours(3.6e9) == "1,000,000 h"
