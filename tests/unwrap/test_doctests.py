"""The examples in docstrings run as they stand."""

from __future__ import annotations

import doctest
from importlib import import_module
from pathlib import Path

import pytest
import torch

ROOT = Path(__file__).parents[2]
ROOMS = ("support", "signal", "depth", "networks", "training", "cameras")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for room in ROOMS
    for path in (ROOT / "unwrap" / room).rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


def test_every_room_has_examples():
    assert {name.split(".")[1] for name in MODULES} == set(ROOMS)


@pytest.mark.parametrize("name", MODULES)
def test_examples_hold(name, capsys):
    torch.manual_seed(0)
    failed, run = doctest.testmod(import_module(name), optionflags=FLAGS)
    assert run > 0
    assert failed == 0, capsys.readouterr().out
