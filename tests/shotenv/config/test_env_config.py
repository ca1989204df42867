"""Configuration of the decision problem: what it repeats of other rooms is the same there."""

from __future__ import annotations

import re
from typing import get_args

import pytest
import yaml

from shotenv.config.env import EnvConfig
from shotenv.config.reader import ConfigError, find_config, read_config
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


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"laser": "foo.Bar"}, "laser is 'foo.Bar'; expected keys with values, or a YAML file of"),
        ({"laser": {"class_path": "a.B"}}, "class_path is 'a.B'; expected the keys of LaserConfig"),
        ({"laser": 7}, "the following arguments are required: laser.name"),
        ({"reward": {"power": {}}}, "reward.power: expected to be a valid tuple (got {})"),
        ({"reward": {"power": [1]}}, "reward.power: element 1 is missing (got [1])"),
        ({"bank": {"a": 1}}, "bank: {'a': 1}; expected str"),
        ({"split": "half"}, "split: half; expected one of 'train', 'validation', 'test', 'shift'"),
        (
            {"frames_per_drive": 1.5},
            "frames_per_drive: expected to be a valid integer, got a number with a fractional part "
            "(got 1.5)",
        ),
    ],
)
def test_a_wrong_value_is_told_in_plain_words(tmp_path, change, told):
    default = find_config("env", "default")
    content = yaml.safe_load(default.read_text())
    for section in ("sensor", "laser"):
        content[section] = str((default.parent / content[section]).resolve())
    path = tmp_path / "problem.yaml"
    path.write_text(yaml.safe_dump(content | change))
    with pytest.raises(ConfigError, match=re.escape(f"problem.yaml: {told}")):
        read_config(EnvConfig, path)
