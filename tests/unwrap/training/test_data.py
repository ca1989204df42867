"""Batches for training: varied, shuffled, acquired ahead."""

import threading
from dataclasses import replace

import pytest
import torch
from unwrap_source import Walls

from unwrap.signal.frames import RawFrame
from unwrap.signal.sensed import Sensed, Truth
from unwrap.signal.shots import Shots
from unwrap.training.config import TrainConfig
from unwrap.training.data import Augmentation, EpochShuffle, Order, in_order, loader

STILL = Augmentation(flip_horizontal=False, flip_vertical=False, contrast=0, brightness=0)
BOTH = (Shots.TWO, Shots.FOUR)


def ramp():
    gray = torch.linspace(0, 0.5, 8 * 4 * 6).reshape(8, 4, 6)
    raw = RawFrame(torch.stack((gray, -gray), 1), gray.bool())
    sensed = Sensed(gray, raw, shift_m=torch.linspace(0, 1, 8))
    return sensed, Truth(10 * gray, torch.ones_like(gray, dtype=torch.bool))


def test_augmentation_without_effects_changes_nothing():
    sensed, truth = ramp()
    varied = STILL(sensed, truth, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(varied[0].gray, sensed.gray)
    torch.testing.assert_close(varied[1].distance_m, truth.distance_m)


@pytest.mark.parametrize(("which", "axis"), [("flip_horizontal", -1), ("flip_vertical", -2)])
def test_gray_and_depth_are_mirrored_together_in_about_half_the_images(which, axis):
    sensed, truth = ramp()
    gray = sensed.gray
    flags = {"flip_horizontal": False, "flip_vertical": False, which: True}
    augment = Augmentation(**flags, contrast=0, brightness=0)
    new, new_truth = augment(sensed, truth, generator=torch.Generator().manual_seed(0))
    new_gray = new.gray
    torch.testing.assert_close(new_truth.distance_m, 10 * new_gray)
    torch.testing.assert_close(new.raw.dcs_lsb, torch.stack((new_gray, -new_gray), 1))
    assert torch.equal(new.shift_m, sensed.shift_m)
    mirrored = [
        torch.allclose(new, old.flip(axis)) for new, old in zip(new_gray, gray, strict=True)
    ]
    kept = [torch.allclose(new, old) for new, old in zip(new_gray, gray, strict=True)]
    assert all(m != k for m, k in zip(mirrored, kept, strict=True))
    assert 0 < sum(mirrored) < len(gray)


def test_contrast_and_brightness_stay_within_their_limits():
    gray = torch.full((500, 2, 2), 0.25)
    augment = replace(STILL, contrast=0.5, brightness=0.2)
    truth = Truth(gray, gray.bool())
    varied, _ = augment(Sensed(gray), truth, generator=torch.Generator().manual_seed(0))
    new = varied.gray
    assert new.min() >= 0.25**1.5 / 1.2 - 1e-6
    assert new.max() <= 0.25 ** (1 / 1.5) * 1.2 + 1e-6
    assert new.std() > 0.02


def test_augmentation_depends_on_the_generator_alone():
    draws = [
        TrainConfig().augmentation(*ramp(), generator=torch.Generator().manual_seed(s))[0].gray
        for s in (1, 1, 2)
    ]
    assert torch.equal(draws[0], draws[1])
    assert not torch.equal(draws[0], draws[2])


def test_order_depends_on_seed_and_epoch_alone():
    sampler = EpochShuffle(50, 8, BOTH, seed=3)
    first = list(sampler)
    assert sorted(n for order in first for n in order.numbers) == list(range(50))
    assert len(first) == len(sampler) == 7
    assert {order.shots for order in first} == set(BOTH)
    assert {order.draw for order in first} == {1}
    sampler.set_epoch(1)
    second = list(sampler)
    assert [o.numbers for o in second] != [o.numbers for o in first]
    assert {order.draw for order in second} == {2}
    sampler.set_epoch(0)
    assert list(sampler) == first


def test_frames_in_order_come_once_for_each_number_of_samples():
    orders = in_order(Walls(5), 2, BOTH, draw=0)
    assert [order.numbers for order in orders] == [(0, 1), (2, 3), (4,)] * 2
    assert [order.shots for order in orders] == [Shots.TWO] * 3 + [Shots.FOUR] * 3
    assert [order.shots for order in in_order(Walls(2), 2, (), draw=0)] == [None]


def test_loader_acquires_what_is_ordered():
    source = Walls(4)
    orders = [Order((1, 3), 0, Shots.FOUR), Order((0,), 2, None)]
    batches = list(loader(source, orders))
    for (sensed, truth), order in zip(batches, orders, strict=True):
        expected, true = source.batch(order.numbers, draw=order.draw, shots=order.shots)
        assert torch.equal(sensed.gray, expected.gray)
        assert torch.equal(truth.distance_m, true.distance_m)
    assert batches[0][0].raw.shots == Shots.FOUR
    assert batches[1][0].raw is None


def test_what_is_acquired_ahead_is_what_is_ordered():
    source, orders = Walls(4), [Order((i % 4,), i, Shots.TWO) for i in range(9)]
    batches = loader(source, orders, threads=3)
    assert len(batches) == len(orders)
    for (sensed, _), order in zip(batches, orders, strict=True):
        expected, _ = source.batch(order.numbers, draw=order.draw, shots=order.shots)
        assert torch.equal(sensed.raw.dcs_lsb, expected.raw.dcs_lsb)


def test_leaving_the_batches_ends_the_threads():
    before = threading.active_count()
    batches = iter(loader(Walls(4), [Order((0,), i, Shots.TWO) for i in range(50)], threads=2))
    next(batches)
    batches.close()
    assert threading.active_count() == before


def test_what_cannot_be_acquired_ahead_raises_where_it_is_used():
    batches = loader(Walls(2), [Order((0,), 0, None), Order((7,), 0, None)], threads=2)
    with pytest.raises(IndexError):
        list(batches)
