"""Some changed files of each kind that is read; the measurement of that name takes a thousand."""

from __future__ import annotations

import pytest

from reliability.hostile_files import tallied
from reliability.hostile_kinds import KINDS

# A damaged listing of one clip or training is none: it is published again, nothing is refused.
COUNTED_AS_ABSENT = ("part of a place",)
SLOW = ("evaluation", "trusted", "recorded", "thinned", "XML", "Kinect")


def kinds():
    for kind in KINDS:
        slow = any(word in kind.name for word in SLOW)
        yield pytest.param(kind, 6 if slow else 10, id=kind.name.replace(" ", "-"))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "count"), list(kinds()))
def test_changed_files_are_taken_or_refused_by_name(kind, count):
    tally = tallied(kind, count)
    assert tally.faults == []
    assert tally.taken + tally.refused == count
    assert (tally.refused == 0) == (kind.name in COUNTED_AS_ABSENT)
