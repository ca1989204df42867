"""Made-up frames that an export is checked with where there is no bank."""

import torch

from unwrap.export.export_frames import made_up_frames
from unwrap.signal.description import SensorDescription
from unwrap.signal.shots import Shots

SENSOR = SensorDescription()
UNAMBIGUOUS_M = 299_792_458.0 / 48e6


def test_made_up_images_are_pinned_and_differ_between_splits():
    made = [made_up_frames(s, 2, (24, 40), SENSOR) for s in ("test", "test", "train")]
    grays = [frames.inputs["gray"] for frames in made]
    assert torch.equal(grays[0], grays[1]) and not torch.equal(grays[0], grays[2])
    assert grays[0].shape == (2, 24, 40) and grays[0].dtype == torch.uint16
    gray = grays[0].float()
    assert gray.max() <= 4095 and gray.std() > 300
    assert made[0].wrapped_m.min() >= 0 and made[0].wrapped_m.max() < UNAMBIGUOUS_M
    assert made[0].truth_m is None and "made-up" in made[0].source


def test_made_up_samples_tell_the_made_up_distance():
    still = made_up_frames("test", 2, (48, 64), SENSOR)
    frames = made_up_frames("test", 2, (48, 64), SENSOR, Shots.FOUR)
    assert torch.equal(frames.inputs["gray"], still.inputs["gray"])
    saturated, words = frames.inputs["saturated"], frames.inputs["dcs_lsb"]
    assert 0 < saturated.float().mean() < 0.2
    assert torch.equal(words, words.round()) and words.abs().max() <= 2047
    apart_m = frames.wrapped_m - frames.inputs["shift_m"][:, None, None] - still.wrapped_m
    apart_m -= UNAMBIGUOUS_M * (apart_m / UNAMBIGUOUS_M).round()
    assert apart_m[~saturated].abs().median() < 0.1
