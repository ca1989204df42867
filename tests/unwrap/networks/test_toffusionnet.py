"""TofFusionNet: what it learns from a made-up batch, what memory tells it, what always holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from peer_scenes import SENSOR, UNAMBIGUOUS_M, batch, samples, wraps_of

from unwrap.depth.confidence import expected_calibration_error
from unwrap.networks.losses import LossWeights
from unwrap.networks.network import Settings, multiply_accumulates
from unwrap.networks.registry import build_network
from unwrap.networks.toffusionnet import (
    FORGOTTEN,
    KNOTS_PER_WRAP,
    SPOILT,
    VECTOR,
    TofFusionNet,
    candidate_scores,
    correction_rad,
    knot_entropy,
    mean_distance_m,
    memory_maps,
    spoil_memory,
    true_wraps,
)
from unwrap.networks.tofregnet import TofRegNet
from unwrap.signal.sensed import Memory, Sensed, Truth, wrapped_and_valid
from unwrap.support.tensors import mapped

SETTINGS = Settings(width=8)
KNOTS = KNOTS_PER_WRAP * SETTINGS.classes + 1


def untrained(seed: int = 1) -> TofFusionNet:
    torch.manual_seed(seed)
    network = build_network("toffusionnet", SETTINGS)
    assert isinstance(network, TofFusionNet)
    return network


def seeded(frames, seed):
    generator = torch.Generator().manual_seed(seed)
    return lambda *shape: torch.rand(frames, *shape, generator=generator)


def loss_of(network, sensed, truth):
    output = network(network.features(sensed, SENSOR))
    return network.loss(output, sensed, truth, SENSOR, LossWeights())


@torch.no_grad()
def predict(network, sensed):
    return network.predict(network(network.features(sensed, SENSOR)), sensed, SENSOR)


def trained(network, batches, steps=40, learning_rate=2e-2):
    """`network` after `steps` whose rate falls to 0, so that its normalisation settles."""
    optimizer = torch.optim.Adam(network.parameters(), learning_rate)
    schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.01, steps)
    for step in range(steps):
        sensed, truth = batches[step % len(batches)]
        sensed = network.as_trained_on(sensed, seeded(len(sensed), step))
        loss = loss_of(network.train(), sensed, truth)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    return network.eval()


def right_share(network, sensed, truth):
    error_m = predict(network, sensed).distance_m - truth.distance_m
    return float((error_m.abs() < UNAMBIGUOUS_M / 2).float().mean())


def test_forty_steps_tell_the_wraps_of_one_batch_from_two_and_from_four_samples():
    batches = [batch(shots) for shots in (2, 4)]
    truth = batches[0][1].distance_m
    assert wraps_of(truth).flatten().bincount().max() < 0.5 * truth.numel()
    network = trained(untrained(), batches)
    assert all(right_share(network, *one) > 0.9 for one in batches)


def test_every_parameter_feels_the_loss():
    network, (sensed, truth) = untrained(), batch(4)
    loss_of(network, sensed, truth).backward()
    dead = [n for n, p in network.named_parameters() if p.grad is None or not p.grad.abs().sum()]
    assert dead == []


@pytest.mark.parametrize("shots", [2, 4, 8])
def test_any_size_and_number_of_samples_gives_a_distance_and_a_confidence(shots):
    sensed, _ = batch(shots, 37, 51)
    found = predict(untrained().eval(), sensed)
    assert found.distance_m.shape == found.confidence.shape == (2, 37, 51)
    assert found.distance_m.dtype == found.confidence.dtype == torch.float32
    assert found.distance_m.min() >= 0
    assert found.distance_m.max() <= 33
    assert 1 / SETTINGS.classes - 1e-6 <= found.confidence.max() <= 1


def test_frames_without_samples_are_refused():
    with pytest.raises(ValueError, match="raw"):
        untrained().features(Sensed(torch.rand(1, 32, 32)), SENSOR)


def test_a_prediction_does_not_depend_on_its_batch():
    network, (sensed, _) = untrained().eval(), batch(4)
    together = predict(network, sensed)
    alone = predict(network, mapped(lambda values: values[1:], sensed))
    torch.testing.assert_close(alone.distance_m[0], together.distance_m[1], atol=1e-3, rtol=1e-4)
    torch.testing.assert_close(alone.confidence[0], together.confidence[1], atol=1e-3, rtol=1e-4)


def test_unknown_truth_does_not_count():
    network, (sensed, truth) = untrained().eval(), batch(4)
    known = truth.known.clone()
    known[:, :, 20:40] = False
    absurd = truth.distance_m.masked_fill(~known, 0.0), truth.distance_m.masked_fill(~known, 29.0)
    first, second = (loss_of(network, sensed, Truth(values, known)) for values in absurd)
    assert first == second
    nothing = Truth(truth.distance_m, torch.zeros_like(known))
    assert loss_of(network, sensed, nothing) == 0


def test_distance_lies_about_the_pixel_s_own_candidates_where_there_is_signal():
    sensed, _ = batch(2)
    network = untrained().eval()
    output = 3 * torch.randn(2, KNOTS + VECTOR, 48, 64, generator=torch.Generator().manual_seed(0))
    wrapped_m, valid = wrapped_and_valid(sensed, SENSOR)
    assert valid.all()
    found_m = network.predict(output, sensed, SENSOR).distance_m
    correction_m = network.parts(output, wrapped_m)[1]
    assert correction_m.abs().max() <= UNAMBIGUOUS_M / 4
    wraps = (found_m - correction_m - wrapped_m) / UNAMBIGUOUS_M
    inside = found_m > 0
    torch.testing.assert_close(wraps[inside], wraps[inside].round(), atol=1e-4, rtol=0)
    assert len(wraps[inside].round().unique()) == SETTINGS.classes
    # The merge finds the same wraps again, whatever the correction is.
    merged = ((found_m - wrapped_m) / UNAMBIGUOUS_M).round()
    assert torch.equal(merged[inside], wraps[inside].round())


def test_a_long_vector_replaces_the_phase_within_a_right_angle():
    phase_rad = torch.linspace(0, 6.2, 63).view(1, 7, 9)
    wanted_rad = phase_rad + torch.linspace(-1.5, 1.5, 63).view(1, 7, 9)
    vector = 1e4 * torch.stack((wanted_rad.cos(), wanted_rad.sin()), 1)
    found = correction_rad(vector, phase_rad)
    torch.testing.assert_close(found, wanted_rad - phase_rad, atol=2e-3, rtol=0)
    assert correction_rad(-vector, phase_rad).abs().max() <= torch.pi / 2
    assert torch.equal(correction_rad(0 * vector, phase_rad), torch.zeros_like(phase_rad))


def test_distance_is_the_curve_s_mean_where_there_is_no_signal():
    sensed, _ = batch(4)
    assert sensed.raw is not None
    saturated = torch.zeros(2, 48, 64, dtype=torch.bool)
    saturated[:, 10:20] = True
    sensed = replace(sensed, raw=replace(sensed.raw, saturated=saturated))
    network, output = untrained().eval(), torch.zeros(2, KNOTS + VECTOR, 48, 64)
    # All weight on the fourth knot.
    output[:, 4] = 60.0
    found = network.predict(output, sensed, SENSOR)
    expected_m = 4 * UNAMBIGUOUS_M / KNOTS_PER_WRAP
    torch.testing.assert_close(
        found.distance_m[saturated].mean().item(), expected_m, rtol=1e-4, atol=0
    )
    assert (found.distance_m[~saturated] - expected_m).abs().mean() > 0.1
    assert found.confidence[saturated].min() > 0.5


def test_candidates_are_looked_up_on_the_curve():
    """A curve that is linear in distance gives the candidates' own distances."""
    knots_m = torch.arange(KNOTS) * (UNAMBIGUOUS_M / KNOTS_PER_WRAP)
    wrapped_m = torch.linspace(0, UNAMBIGUOUS_M * 0.999, 60).view(1, 6, 10)
    scores = knots_m.view(1, -1, 1, 1).expand(1, KNOTS, 6, 10)
    found = candidate_scores(scores, wrapped_m, UNAMBIGUOUS_M)
    expected = wrapped_m.unsqueeze(1) + UNAMBIGUOUS_M * torch.arange(5).view(1, 5, 1, 1)
    torch.testing.assert_close(found, expected)


def test_candidates_equal_numpy_interpolation():
    random = np.random.default_rng(0)
    scores = random.normal(size=(1, KNOTS, 2, 3)).astype(np.float32)
    wrapped_m = random.uniform(0, UNAMBIGUOUS_M, (1, 2, 3)).astype(np.float32)
    found = candidate_scores(torch.tensor(scores), torch.tensor(wrapped_m), UNAMBIGUOUS_M)
    knots_m = np.arange(KNOTS) * UNAMBIGUOUS_M / KNOTS_PER_WRAP
    for n, row, column in np.ndindex(5, 2, 3):
        at_m = wrapped_m[0, row, column] + n * UNAMBIGUOUS_M
        expected = np.interp(at_m, knots_m, scores[0, :, row, column])
        assert float(found[0, n, row, column]) == pytest.approx(expected, abs=1e-4)


def test_knot_entropy_is_that_of_a_shared_label():
    scores = torch.randn(1, KNOTS, 1, 1, generator=torch.Generator().manual_seed(0))
    logarithms = scores.log_softmax(1).flatten()
    spacing_m = UNAMBIGUOUS_M / KNOTS_PER_WRAP

    def entropy(place):
        distance_m = torch.full((1, 1, 1), place * spacing_m)
        return float(knot_entropy(scores, distance_m, UNAMBIGUOUS_M))

    assert entropy(3.0) == pytest.approx(-float(logarithms[3]), abs=1e-4)
    between = -0.75 * float(logarithms[3]) - 0.25 * float(logarithms[4])
    assert entropy(3.25) == pytest.approx(between, abs=1e-4)
    assert entropy(KNOTS + 5.0) == pytest.approx(-float(logarithms[-1]), abs=1e-4)


def test_mean_distance_of_a_flat_curve_is_the_middle_and_stays_below_the_end():
    end_m = SETTINGS.classes * UNAMBIGUOUS_M
    flat = mean_distance_m(torch.zeros(1, KNOTS, 1, 1), UNAMBIGUOUS_M)
    assert float(flat) == pytest.approx(end_m / 2)
    last = torch.zeros(1, KNOTS, 1, 1)
    last[:, -1] = 200.0
    assert end_m - 0.01 < float(mean_distance_m(last, UNAMBIGUOUS_M)) < end_m


def ambiguous(wraps: tuple[int, ...], remembers: bool) -> tuple[Sensed, Truth]:
    """Walls that look alike in gray and phase, so many wraps away; only memory tells them."""
    shape = (len(wraps), 32, 32)
    distance_m = (torch.tensor(wraps) * UNAMBIGUOUS_M + 2.5).view(-1, 1, 1).expand(shape)
    sensed = Sensed(
        gray=torch.full(shape, 0.5),
        raw=samples(torch.full(shape, 2.5), 100.0, 4, noise_lsb=0.5),
        noise_lsb=torch.full(shape, 0.5),
        memory=Memory(distance_m, torch.ones(shape)) if remembers else None,
    )
    return sensed, Truth(distance_m, torch.ones(shape, dtype=torch.bool))


NEAR_AND_FAR = (0, 2) * 6


@pytest.fixture(scope="module")
def with_memory() -> TofFusionNet:
    """Trained on walls that only memory tells."""
    return trained(untrained(), [ambiguous(NEAR_AND_FAR, True)])


def test_memory_tells_what_gray_and_phase_cannot(with_memory):
    assert right_share(with_memory, *ambiguous(NEAR_AND_FAR, True)) > 0.95
    assert 0.3 < right_share(with_memory, *ambiguous(NEAR_AND_FAR, False)) < 0.7


def test_confidence_stays_low_where_only_memory_could_tell(with_memory):
    knowing = predict(with_memory, ambiguous(NEAR_AND_FAR, True)[0]).confidence.mean()
    guessing = predict(with_memory, ambiguous(NEAR_AND_FAR, False)[0]).confidence.mean()
    assert knowing > guessing + 0.15


def test_memory_maps_are_zero_where_nothing_is_known():
    known = torch.tensor([[[1.0, 0.0]]])
    maps = memory_maps(Memory(torch.tensor([[[6.0, 5.0]]]), known), known, 30.0)
    torch.testing.assert_close(maps, torch.tensor([[[[0.2, 0.0]], [[1.0, 0.0]]]]))
    assert memory_maps(None, known, 30.0).abs().sum() == 0


def test_doubted_memory_is_withheld_erased_and_moved_in_its_shares():
    memory = Memory(torch.full((600, 12, 16), 10.0), torch.ones(600, 12, 16))
    shown = spoil_memory(memory, UNAMBIGUOUS_M, seeded(600, 0))
    some = shown.known.flatten(1).any(1)
    assert float(some.float().mean()) == pytest.approx(1 - FORGOTTEN, abs=0.06)
    distance_m = shown.distance_m[some]
    for moved_m in (0.0, 10 - UNAMBIGUOUS_M, 10 + UNAMBIGUOUS_M):
        share = (distance_m - moved_m).abs() < 1e-4
        assert float(share.float().mean()) == pytest.approx(SPOILT, abs=0.02)
    assert torch.equal(shown.known, (shown.distance_m > 0).float())
    # Blocks of 2 x 2 pixels share their fate.
    assert torch.equal(shown.distance_m[:, ::2, ::2], shown.distance_m[:, 1::2, 1::2])


def test_what_is_shown_of_memory_follows_what_is_drawn_and_only_in_training():
    network = untrained()
    sensed, _ = ambiguous((1, 2), True)

    def features(seed):
        shown = network.as_trained_on(sensed, seeded(len(sensed), seed))
        return network.features(shown, SENSOR)

    drawn = [features(seed) for seed in range(8)]
    assert torch.equal(features(3), drawn[3])
    assert not all(torch.equal(one, drawn[0]) for one in drawn)
    whole = network.features(sensed, SENSOR)
    torch.manual_seed(5)
    assert torch.equal(network.features(sensed, SENSOR), whole)


class Overconfident(TofFusionNet):
    """Its output is made up: the log-odds that gave the truth, times three."""

    def forward(self, features):
        return self.made_up


def overconfident_frames(shots: int, factor: float) -> tuple[Overconfident, Sensed, Truth]:
    generator = torch.Generator().manual_seed(shots)
    network = Overconfident(SETTINGS)
    scores = 1.5 * torch.randn(2, KNOTS + VECTOR, 96, 128, generator=generator)
    measured_m = UNAMBIGUOUS_M * torch.rand(2, 96, 128, generator=generator)
    sensed = Sensed(
        torch.rand(2, 96, 128),
        samples(measured_m, 100.0, shots),
        noise_lsb=torch.ones(2, 96, 128),
    )
    wrapped_m, _ = wrapped_and_valid(sensed, SENSOR)
    odds = candidate_scores(scores[:, :KNOTS], wrapped_m, UNAMBIGUOUS_M).softmax(1)
    wraps = torch.multinomial(odds.movedim(1, -1).flatten(0, -2), 1, generator=generator)
    distance_m = wrapped_m + wraps.view(2, 96, 128) * UNAMBIGUOUS_M
    network.made_up = factor * scores
    return network, sensed, Truth(distance_m, torch.ones_like(distance_m, dtype=torch.bool))


@pytest.mark.parametrize("shots", [2, 4])
def test_calibration_makes_overconfident_scores_honest(shots):
    network, sensed, truth = overconfident_frames(shots, 3.0)

    def error():
        found = network.eval().predict(network.made_up, sensed, SENSOR)
        wrapped_m, valid = wrapped_and_valid(sensed, SENSOR)
        right = true_wraps(truth.distance_m, wrapped_m, SETTINGS) == true_wraps(
            found.distance_m, wrapped_m, SETTINGS
        )
        return expected_calibration_error(found.confidence[valid], right[valid])

    assert error() > 0.15
    network.calibrate([(sensed, truth)], SENSOR)
    # What lies beyond the range is left out, hence not quite the temperature it was made with.
    assert network.temperature[int(shots > 2)] == pytest.approx(3.0, rel=0.1)
    assert network.temperature[int(shots == 2)] == 1.0
    assert error() < 0.03


def test_temperatures_travel_with_the_weights():
    network = untrained()
    network.temperature[:] = torch.tensor([1.5, 2.5])
    other = untrained(2)
    other.load_state_dict(network.state_dict())
    assert other.temperature.tolist() == [1.5, 2.5]


def test_network_costs_little_more_than_a_gray_one():
    gray, fused = TofRegNet(32).eval(), TofFusionNet(Settings(width=32)).eval()
    least = multiply_accumulates(gray, gray.example(96, 128))
    assert least < multiply_accumulates(fused, fused.example(96, 128)) < 1.6 * least
    assert fused(fused.example(96, 128)).isfinite().all()
