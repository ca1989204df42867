"""Configuration of the decision problem: what it repeats of other rooms is the same there."""

from __future__ import annotations

from typing import get_args

import pytest

from shotenv.config.env import EnvConfig
from shotenv.config.reader import ConfigError, read_config
from unwrap.depth.correction import Eight
from unwrap.depth.merge import Merge


def test_every_merge_rule_can_be_configured():
    assert get_args(EnvConfig.model_fields["merge"].annotation) == get_args(Merge)
    assert get_args(EnvConfig.model_fields["eight"].annotation) == get_args(Eight)


@pytest.mark.parametrize("text", ["reward: {unexpected: {x: 1}}", "reward: {unexpected: 1}"])
def test_an_unknown_key_is_named_with_those_beside_it(tmp_path, text):
    path = tmp_path / "problem.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"problem.yaml: unknown key reward.unexpected; .* duty"):
        read_config(EnvConfig, path)
