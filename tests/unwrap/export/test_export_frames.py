"""The frames that an export is checked on: a bank's, or made up."""

import pytest
import torch

from shotenv.bank.layout import BankError
from shotenv.bank.opening import open_bank
from shotenv.config.keywords import env_config
from unwrap.export.export_frames import choose_bank, export_frames
from unwrap.signal.shots import Shots

HEIGHT, WIDTH = 48, 64
UNAMBIGUOUS_M = 299_792_458.0 / 48e6


def test_frames_of_a_bank_with_samples_have_noise_and_know_their_wraps(tiny_bank):
    bank = open_bank(tiny_bank)
    frames = export_frames(bank, "test", 4, (HEIGHT, WIDTH), env_config(), Shots.TWO)
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
    frames = export_frames(bank, "test", 4, (HEIGHT, WIDTH), env_config())
    first = int(bank.frames("test")[0])
    assert torch.equal(frames.inputs["gray"][0, ::2, 1::2].int(), bank.frame(first).gray.int())
    truth_m = frames.truth_m[0]
    known = truth_m.isfinite()
    turns = (truth_m - frames.wrapped_m[0])[known] / UNAMBIGUOUS_M
    # What moves, and the wiggle, keep the wrapped map from being the distance modulo the range.
    assert ((turns - turns.round()).abs() * UNAMBIGUOUS_M).median() < 0.05


def test_made_up_images_are_pinned_and_differ_between_splits():
    made = [export_frames(None, s, 2, (24, 40), env_config()) for s in ("test", "test", "train")]
    grays = [frames.inputs["gray"] for frames in made]
    assert torch.equal(grays[0], grays[1]) and not torch.equal(grays[0], grays[2])
    assert grays[0].shape == (2, 24, 40) and grays[0].dtype == torch.uint16
    gray = grays[0].float()
    assert gray.max() <= 4095 and gray.std() > 300
    assert made[0].wrapped_m.min() >= 0 and made[0].wrapped_m.max() < UNAMBIGUOUS_M
    assert made[0].truth_m is None and "made-up" in made[0].source


def test_made_up_samples_tell_the_made_up_distance():
    size, config = (HEIGHT, WIDTH), env_config(sensor={"harmonic_strength": 0.0})
    still = export_frames(None, "test", 2, size, config)
    frames = export_frames(None, "test", 2, size, config, Shots.FOUR)
    assert torch.equal(frames.inputs["gray"], still.inputs["gray"])
    saturated, words = frames.inputs["saturated"], frames.inputs["dcs_lsb"]
    assert 0 < saturated.float().mean() < 0.2
    assert torch.equal(words, words.round()) and words.abs().max() <= 2047
    apart_m = frames.wrapped_m - frames.inputs["shift_m"][:, None, None] - still.wrapped_m
    apart_m -= UNAMBIGUOUS_M * (apart_m / UNAMBIGUOUS_M).round()
    assert apart_m[~saturated].abs().median() < 0.1


def test_which_bank_is_chosen(sensor, tiny_bank):
    assert choose_bank("none", sensor) is None
    assert choose_bank(None, sensor) is None  # the starter bank of an empty cache
    assert len(choose_bank(tiny_bank, sensor)) == 64
    with pytest.raises(BankError, match="/no/bank"):
        choose_bank("/no/bank", sensor)
