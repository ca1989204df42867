"""The card of the shipped networks says what their files and the bank's configuration say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shotenv.config import BankConfig, find_config, read_config
from shotenv.config.families import FAMILIES, SHIFT_FAMILIES
from unwrap import load_unwrapper

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "unwrap" / "weights"
CARD = " ".join((FOLDER / "README.md").read_text(encoding="utf-8").split())
SIZES = r"([\d.]+) million parameters, (\d+) million multiply-accumulates .*?([\d.]+) MB"
GRAY, SAMPLES = CARD.split("## TofFusionNet")


@pytest.mark.parametrize(
    ("name", "card"), [("tofregnet", GRAY), ("tofsegnet", GRAY), ("toffusionnet", SAMPLES)]
)
def test_sizes_are_those_of_the_files(name, card):
    millions, macs, megabytes = map(float, re.search(SIZES, card).groups())
    unwrapper = load_unwrapper(name)
    parameters = sum(weight.numel() for weight in unwrapper.network.parameters())
    assert parameters / 1e6 == pytest.approx(millions, abs=0.006)
    exception = re.search(rf"\({name}: (\d+)\)", card, re.IGNORECASE)
    told = float(exception[1]) if exception else macs
    assert unwrapper.macs(120, 160) / 1e6 == pytest.approx(told, abs=0.6)
    size = (FOLDER / f"{name}.safetensors").stat().st_size
    assert size / 1e6 == pytest.approx(megabytes, abs=0.06)


def test_numbers_of_worlds_are_those_of_the_configuration():
    bank = read_config(BankConfig, find_config("bank", "training"))
    clips = [
        len(FAMILIES) * bank.train_clips,
        len(FAMILIES) * bank.validation_clips,
        len(FAMILIES) * bank.test_clips,
        len(SHIFT_FAMILIES) * bank.shift_clips,
    ]
    told = r"(\d+) rendered worlds .*? plus (\d+) worlds .*?, (\d+) for testing and (\d+) of"
    assert [int(number) for number in re.search(told, CARD).groups()] == clips
    assert f"and {bank.clutter_clips} worlds of clutter" in CARD
    assert f"World seeds 0 to {sum(clips) + bank.clutter_clips - 1};" in CARD
    assert f"the {bank.world.frames_per_clip * clips[0]} training frames" in CARD
