"""Drives leave out the clips that are for training networks only, unless asked for."""

import dataclasses

import pytest

from shotenv.bank import BankError, open_bank
from shotenv.config.keywords import env_config
from shotenv.decision.problem import clips_driven


@pytest.fixture
def bank(tiny_bank):
    """The tiny bank, its last training clip turned into clutter."""
    bank = open_bank(tiny_bank)
    last = max(clip.start for clip in bank.splits("train"))
    bank.clips = tuple(
        dataclasses.replace(clip, family="clutter") if clip.start == last else clip
        for clip in bank.clips
    )
    return bank


@pytest.mark.parametrize("split", ["train", "validation", "all"])
def test_drives_pass_no_clutter(bank, split):
    driven = clips_driven(bank, env_config(split=split))
    assert driven
    assert "clutter" not in {clip.family for clip in driven}


def test_drives_pass_clutter_where_it_is_asked_for(bank):
    driven = clips_driven(bank, env_config(split="train", clutter=True))
    assert driven == bank.splits("train")
    # Other splits have none, so that one configuration serves training and judging.
    assert clips_driven(bank, env_config(split="test", clutter=True)) == bank.splits("test")


def test_a_bank_of_clutter_alone_says_what_to_do(bank):
    bank.clips = tuple(dataclasses.replace(clip, family="clutter") for clip in bank.clips)
    with pytest.raises(BankError, match=r"clutter alone in split 'train', .* set clutter to true"):
        clips_driven(bank, env_config(split="train"))
