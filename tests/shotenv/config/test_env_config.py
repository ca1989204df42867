"""Configuration of the decision problem: what it repeats of other rooms is the same there."""

from __future__ import annotations

from typing import get_args

from shotenv.config.env import EnvConfig
from unwrap.depth.correction import Eight
from unwrap.depth.merge import Merge


def test_every_merge_rule_can_be_configured():
    assert get_args(EnvConfig.model_fields["merge"].annotation) == get_args(Merge)
    assert get_args(EnvConfig.model_fields["eight"].annotation) == get_args(Eight)
