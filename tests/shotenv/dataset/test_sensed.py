import dataclasses
from types import SimpleNamespace

import pytest
import torch

from shotenv.bank.opening import open_bank
from shotenv.config.keywords import env_config
from shotenv.dataset.sensed_frames import SensedFrames
from unwrap.depth.correction import correct_sensed
from unwrap.depth.merge import nearest_wraps
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.signal.shots import Shots

RANGE_M = 30.0


@pytest.fixture(scope="module")
def bank(tiny_bank):
    return open_bank(tiny_bank)


def frames_of(bank, split="train", **options):
    return SensedFrames(
        bank, bank.frames(split), env_config(bank=str(bank.folder)), range_m=RANGE_M, **options
    )


def tensors(value):
    fields = [getattr(value, field.name) for field in dataclasses.fields(value)]
    return [t for t in fields if isinstance(t, torch.Tensor)]


def test_a_frame_does_not_depend_on_its_batch(bank):
    frames = frames_of(bank, remembers=True)
    together, truth = frames.batch([0, 3, 5], draw=2, shots=Shots.FOUR)
    alone, true = frames.batch([3], draw=2, shots=Shots.FOUR)
    assert torch.equal(together.raw.dcs_lsb[1:2], alone.raw.dcs_lsb)
    assert torch.equal(together.memory.distance_m[1:2], alone.memory.distance_m)
    assert torch.equal(truth.distance_m[1:2], true.distance_m)
    assert all(
        torch.equal(a[1:2], b) for a, b in zip(tensors(together), tensors(alone), strict=True)
    )


def test_two_and_four_samples_begin_the_eight(bank):
    frames = frames_of(bank)
    eight, _ = frames.batch([1], draw=1, shots=Shots.EIGHT)
    for shots in (Shots.TWO, Shots.FOUR):
        fewer, _ = frames.batch([1], draw=1, shots=shots)
        assert torch.equal(fewer.raw.dcs_lsb, eight.raw.dcs_lsb[:, :shots])


def test_each_draw_has_other_noise_and_the_same_light(bank):
    frames = frames_of(bank)
    (one, true), (other, again) = (frames.batch([0], draw=d, shots=Shots.TWO) for d in (1, 2))
    assert not torch.equal(one.raw.dcs_lsb, other.raw.dcs_lsb)
    assert torch.equal(one.gray, other.gray)
    assert torch.equal(true.distance_m, again.distance_m)


def test_truth_is_that_of_the_bank_clamped(bank):
    frames = frames_of(bank)
    _, truth = frames.batch([0], draw=1, shots=None)
    rendered = bank.frame(int(frames.frames[0])).exposure.distance_m
    assert rendered.isinf().any()
    torch.testing.assert_close(truth.distance_m, rendered.clamp(max=RANGE_M))
    assert truth.known.all()


def test_measured_truth_agrees_with_the_rendered_where_it_is_known(bank):
    measured = frames_of(bank, truth="measured")
    sensed, truth = measured.batch([0], draw=5, shots=Shots.EIGHT)
    _, rendered = frames_of(bank).batch([0], draw=5, shots=None)
    scored = measured.scored([0], draw=0) & truth.known
    assert 0.2 < truth.known.float().mean() < 1
    error_m = (truth.distance_m - rendered.distance_m)[scored].abs()
    assert error_m.median() < 0.1
    # It was recorded once, whatever the draw of the samples.
    assert torch.equal(measured.batch([0], draw=9, shots=None)[1].distance_m, truth.distance_m)
    assert not torch.equal(
        correct_sensed(sensed, None, measured.sensor).distance_m, truth.distance_m
    )


def test_stride_takes_every_second_row_and_column(bank):
    sensed, truth = frames_of(bank, stride=2).batch([0], draw=1, shots=Shots.FOUR)
    whole, true = frames_of(bank).batch([0], draw=1, shots=None)
    assert torch.equal(sensed.gray, whole.gray[:, ::2, ::2])
    assert torch.equal(truth.distance_m, true.distance_m[:, ::2, ::2])
    assert sensed.raw.dcs_lsb.shape[-2:] == sensed.noise_lsb.shape[-2:] == truth.known.shape[-2:]


def test_the_true_prediction_unwraps_what_is_scored(bank):
    frames = frames_of(bank)
    sensed, truth = frames.batch(range(4), draw=1, shots=Shots.FOUR)
    depth = correct_sensed(sensed, truth.distance_m, frames.sensor)
    wrong = (depth.distance_m - truth.distance_m).abs() > unambiguous_range_m(24e6) / 2
    assert not (wrong & frames.scored(range(4), draw=1)).any()
    wraps = nearest_wraps(truth.distance_m, depth.distance_m, unambiguous_range_m(24e6))
    assert wraps.max() <= 1


def test_the_first_frame_of_a_clip_remembers_nothing(bank):
    frames = frames_of(bank, remembers=True)
    assert [frames.follows(number) for number in range(5)] == [False, True, True, True, False]
    sensed, truth = frames.batch([0, 1], draw=1, shots=Shots.FOUR)
    assert not sensed.memory.known[0].any()
    known = sensed.memory.known[1] > 0
    assert known.float().mean() > 0.2
    apart_m = (sensed.memory.distance_m[1] - truth.distance_m[1]).abs()[known]
    assert apart_m.median() < 1.0


def test_a_sensor_that_the_bank_was_not_rendered_for_is_refused(bank):
    with pytest.raises(ValueError, match="f1_hz"):
        SensedFrames(bank, bank.frames("train"), env_config(sensor="mlx75027"), range_m=RANGE_M)


def test_held_out_families_are_those_of_the_shift_split(bank):
    frames = frames_of(bank)
    assert frames.held_out_families == ()
    clips = [dataclasses.replace(clip, split="shift") for clip in bank.clips[:2]]
    frames.bank = SimpleNamespace(clips=(*clips, *bank.clips[2:]))
    assert frames.held_out_families == tuple(clip.family for clip in clips)


def test_depth_of_the_frame_before_is_nearer_by_the_way_driven(bank):
    frames = frames_of(bank)
    _, truth = frames.batch([1], draw=0, shots=None)
    warped = frames.warp(truth.distance_m, [1])
    index = int(frames.frames[1])
    moves_m = float(bank.ego_speed_m_s[index]) * 0.1
    seen = warped.known > 0
    assert seen.float().mean() > 0.5
    nearer_m = (truth.distance_m - warped.distance_m)[seen].median()
    assert nearer_m == pytest.approx(moves_m, abs=0.5)
