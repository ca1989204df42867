"""Frames of a bank as an export is checked with them."""

import pytest
import torch

from shotenv.bank.files.store import BankError
from shotenv.bank.opening import open_bank
from shotenv.config.keywords import env_config
from shotenv.dataset.export_inputs import bank_export_frames, choose_check_bank
from unwrap.signal.shots import Shots

HEIGHT, WIDTH = 48, 64
UNAMBIGUOUS_M = 299_792_458.0 / 48e6


def test_frames_of_a_bank_with_samples_have_noise_and_know_their_wraps(tiny_bank):
    bank = open_bank(tiny_bank)
    frames = bank_export_frames(bank, "test", 4, (HEIGHT, WIDTH), env_config(), Shots.TWO)
    shapes = {name: tuple(values.shape) for name, values in frames.inputs.items()}
    assert shapes["dcs_lsb"] == (4, 2, HEIGHT, WIDTH) and shapes["shift_m"] == (4,)
    assert shapes["noise_lsb"] == shapes["saturated"] == frames.truth_m.shape
    scored = frames.scored
    assert 0.2 < scored.float().mean() < 1 and frames.truth_m[scored].max() <= 25.0
    turns = ((frames.truth_m - frames.wrapped_m) / UNAMBIGUOUS_M)[scored]
    apart_m = (turns - turns.round()).abs() * UNAMBIGUOUS_M
    assert 1e-3 < apart_m.median() < 0.3


def test_frames_of_a_bank_are_scaled_to_the_size(tiny_bank):
    bank = open_bank(tiny_bank)
    frames = bank_export_frames(bank, "test", 4, (HEIGHT, WIDTH), env_config())
    first = int(bank.frames("test")[0])
    assert torch.equal(frames.inputs["gray"][0, ::2, 1::2].int(), bank.frame(first).gray.int())
    truth_m = frames.truth_m[0]
    known = truth_m.isfinite()
    turns = (truth_m - frames.wrapped_m[0])[known] / UNAMBIGUOUS_M
    # What moves, and the wiggle, keep the wrapped map from being the distance modulo the range.
    assert ((turns - turns.round()).abs() * UNAMBIGUOUS_M).median() < 0.05


def test_which_bank_is_chosen(sensor, tiny_bank):
    assert choose_check_bank("none", sensor) is None
    assert choose_check_bank(None, sensor) is None  # the starter bank of an empty cache
    assert len(choose_check_bank(tiny_bank, sensor)) == 64
    with pytest.raises(BankError, match="/no/bank"):
        choose_check_bank("/no/bank", sensor)
