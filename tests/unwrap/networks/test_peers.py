"""The peer networks: what they learn from one small batch, and what must not change them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from peer_scenes import SENSOR, UNAMBIGUOUS_M, batch, samples, steps, wraps_of

from unwrap.networks.losses import LossWeights
from unwrap.networks.network import Settings, multiply_accumulates
from unwrap.networks.peers.planes import sample_planes, with_agreement
from unwrap.networks.peers.su import smoothness
from unwrap.networks.registry import build_network
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.sensed import Sensed, Truth
from unwrap.support.tensors import mapped

PEERS = ("su_net", "phasenet", "agresti_net", "chen_net")


def network_of(name: str, width: int = 8):
    torch.manual_seed(1)
    return build_network(name, Settings(width=width))


def loss_of(network, sensed, truth):
    output = network(network.features(sensed, SENSOR))
    return network.loss(output, sensed, truth, SENSOR, LossWeights())


@torch.no_grad()
def predict(network, sensed):
    return network.predict(network(network.features(sensed, SENSOR)), sensed, SENSOR)


def right_share(network, sensed, truth):
    error = predict(network, sensed).distance_m - truth.distance_m
    return float((error.abs() < UNAMBIGUOUS_M / 2).float().mean())


@pytest.mark.parametrize("name", PEERS)
def test_a_short_training_tells_the_wraps_of_one_batch_from_two_and_from_four_samples(name):
    network, batches = network_of(name, width=16), [batch(shots) for shots in (2, 4)]
    optimizer = torch.optim.Adam(network.parameters(), 1e-2)
    losses = []
    for step in range(60):
        loss = loss_of(network.train(), *batches[step % 2])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert max(losses[-2:]) < 0.4 * losses[0]
    assert wraps_of(batches[0][1].distance_m).flatten().bincount().max() < 0.5 * steps().numel()
    # The most frequent wrap has less than half; what is reached depends on the processor.
    assert all(right_share(network.eval(), *one) > 0.7 for one in batches)


@pytest.mark.parametrize("name", PEERS)
def test_every_parameter_feels_the_loss(name):
    network, (sensed, truth) = network_of(name), batch(4)
    loss_of(network, sensed, truth).backward()
    for parameter in network.parameters():
        assert parameter.grad is not None and parameter.grad.abs().sum() > 0


@pytest.mark.parametrize("name", PEERS)
def test_a_prediction_does_not_depend_on_its_batch(name):
    network, (sensed, _) = network_of(name).eval(), batch(4)
    together = predict(network, sensed)
    alone = predict(network, mapped(lambda values: values[1:], sensed))
    torch.testing.assert_close(alone.distance_m[0], together.distance_m[1], atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(alone.confidence[0], together.confidence[1], atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("shots", [2, 4, 8])
@pytest.mark.parametrize("name", PEERS)
def test_any_size_and_number_of_samples_gives_a_distance_and_a_confidence(name, shots):
    network, (sensed, _) = network_of(name).eval(), batch(shots, 37, 51)
    found = predict(network, sensed)
    assert found.distance_m.shape == found.confidence.shape == (2, 37, 51)
    assert found.distance_m.dtype == found.confidence.dtype == torch.float32
    assert found.distance_m.isfinite().all() and found.distance_m.min() >= 0
    assert found.confidence.min() >= 0 and found.confidence.max() <= 1


@pytest.mark.parametrize("name", PEERS)
def test_of_eight_samples_only_the_first_four_count(name):
    network, (sensed, _) = network_of(name).eval(), batch(8)
    raw = RawFrame(sensed.raw.dcs_lsb[:, :4], sensed.raw.saturated)
    assert torch.equal(
        predict(network, sensed).distance_m, predict(network, replace(sensed, raw=raw)).distance_m
    )


@pytest.mark.parametrize("name", PEERS)
def test_truth_where_it_is_unknown_changes_no_loss(name):
    network, (sensed, truth) = network_of(name).eval(), batch(4)
    known = truth.known.clone()
    known[:, 10:30, 5:40] = False
    other = torch.where(known, truth.distance_m, 0.0)
    losses = [
        loss_of(network, sensed, Truth(values, known)) for values in (truth.distance_m, other)
    ]
    assert losses[0] == losses[1] > 0
    nothing = torch.zeros_like(known)
    assert loss_of(network, sensed, Truth(other, nothing)) == 0


@pytest.mark.parametrize("name", PEERS)
def test_the_sky_may_be_anything_up_to_the_range(name):
    network, (sensed, truth) = network_of(name), batch(2)
    range_m = network.settings.range_m
    sky = Truth(truth.distance_m.index_fill(1, torch.arange(12), range_m), truth.known)
    assert loss_of(network, sensed, sky).isfinite()


@pytest.mark.parametrize("name", PEERS)
def test_compute_is_about_that_of_the_gray_networks(name):
    network, (sensed, _) = network_of(name, width=32).eval(), batch(4, 120, 160)
    gray = build_network("tofregnet", Settings(width=32)).eval()
    ours, theirs = (
        multiply_accumulates(one, one.features(sensed, SENSOR)[:1]) for one in (network, gray)
    )
    assert 0.5 * theirs < ours < 1.2 * theirs


def test_sample_planes_are_the_samples_over_their_amplitude():
    distance_m = steps(8, 12)
    for shots in (2, 4):
        sensed = Sensed(torch.zeros_like(distance_m), samples(distance_m, 100.0, shots))
        planes = sample_planes(sensed, SENSOR)
        expected = sensed.raw.dcs_lsb / 100.0
        torch.testing.assert_close(planes[:, :shots], expected, atol=1e-5, rtol=0)
        assert (planes[:, shots:4] == 0).all()
        ratio = math.log1p(100.0 / SENSOR.noise_lsb) / 4 - 1
        torch.testing.assert_close(planes[:, 4], torch.full_like(distance_m, ratio))
        assert (planes[:, 6] == (shots == 4)).all()


def test_sample_planes_lose_the_stored_offset_with_two_samples_and_show_what_is_common_with_four():
    distance_m = steps(8, 12)
    offset_lsb = torch.linspace(-20, 20, 12).expand_as(distance_m)
    for shots in (2, 4):
        raw = samples(distance_m, 100.0, shots)
        shifted = RawFrame(raw.dcs_lsb + offset_lsb.unsqueeze(1), raw.saturated)
        plain = sample_planes(Sensed(torch.zeros_like(distance_m), raw), SENSOR)
        known = sample_planes(
            Sensed(torch.zeros_like(distance_m), shifted, offset_lsb=offset_lsb), SENSOR
        )
        torch.testing.assert_close(known, plain, atol=1e-5, rtol=0)
    unknown = sample_planes(Sensed(torch.zeros_like(distance_m), shifted), SENSOR)
    common = offset_lsb / (100.0 + SENSOR.noise_lsb)
    torch.testing.assert_close(unknown[:, 2] - plain[:, 2], common, atol=1e-5, rtol=0)


@pytest.mark.parametrize("name", PEERS)
def test_a_known_drift_is_removed_from_what_a_network_sees(name):
    network, distance_m = network_of(name), steps(8, 12)
    shift_m = torch.tensor([0.3, -0.2], dtype=torch.float64)
    gray = torch.zeros_like(distance_m)
    drifted = samples(distance_m - shift_m.view(-1, 1, 1), 100.0, 4)
    expected = network.features(Sensed(gray, samples(distance_m, 100.0, 4)), SENSOR)
    found = network.features(Sensed(gray, drifted, shift_m=shift_m), SENSOR)
    torch.testing.assert_close(found, expected, atol=1e-4, rtol=0)


@pytest.mark.parametrize("name", PEERS)
def test_frames_without_samples_are_refused(name):
    with pytest.raises(ValueError, match=r"sensed\.raw is None; expected 2, 4 or 8 samples"):
        network_of(name).features(Sensed(torch.zeros(1, 8, 8)), SensorDescription())


def test_a_distance_is_trusted_by_how_near_it_lies_to_a_wrap_candidate():
    distance_m = torch.full((1, 2, 4), 2.0)
    sensed = Sensed(torch.zeros_like(distance_m), samples(distance_m, 100.0, 4))
    offsets = torch.tensor([0.0, 1.0, 2.0, 2.25]) * UNAMBIGUOUS_M + 2.0
    found = with_agreement(offsets.expand(1, 2, 4), sensed, SENSOR)
    torch.testing.assert_close(found.confidence[0, 0], torch.tensor([1.0, 1.0, 1.0, 0.5]))
    below = with_agreement(torch.full((1, 2, 4), 2.0 - 0.75 * UNAMBIGUOUS_M), sensed, SENSOR)
    assert (below.confidence == 0).all()


def test_smoothness_is_the_damped_variation_of_known_pairs():
    prediction = torch.tensor([[[0.0, 0.2, 0.2], [0.0, 0.2, 0.5]]])
    target = torch.tensor([[[0.0, 1.0, 1.0], [0.0, 1.0, 7.0]]])
    known = torch.tensor([[[True, True, True], [True, True, False]]])
    across = (2 * 0.2 * math.exp(-1) + 0.0) / 3
    down = 0.0
    assert float(smoothness(prediction, target, known)) == pytest.approx(across + down)
