"""Training: what it writes, resumed, interrupted, its schedule and configuration."""

import json
import os
import signal

import pytest
import torch
from pydantic import ValidationError
from safetensors.torch import load_file
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from unwrap_source import HEIGHT, SENSOR, WIDTH, Walls

from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.sizes import trained_size
from unwrap.networks.weight_files import save_weights
from unwrap.signal.sensed import Truth
from unwrap.training.config import TrainConfig
from unwrap.training.loop import train
from unwrap.training.module import TrainingModule, wrap_hits

SMALL = TrainConfig(width=4, epochs=2, batch_size=4)


def walls(split):
    frames = {"train": 8, "validation": 2, "test": 2}
    return Walls(frames[split], seed=len(split))


@pytest.mark.parametrize("network", ["tofregnet", "tofsegnet", "toffusionnet"])
def test_training_writes_a_network_and_its_numbers(tmp_path, network):
    config = SMALL.model_copy(update={"network": network})
    path = train(config, walls, tmp_path, progress=False)
    unwrapper = load_unwrapper(path)
    numbers = json.loads((tmp_path / f"{network}.json").read_text())
    assert unwrapper.name == network
    assert unwrapper.metadata["bank"] == config.bank
    assert TrainConfig(**unwrapper.metadata["config"]) == config
    assert trained_size(unwrapper.metadata) == (HEIGHT, WIDTH)
    assert 0 <= numbers["test"]["wrap_accuracy"] <= 1
    assert set(numbers["test"]["families"]) == {"garage"}


def test_loss_falls():
    """Forty steps on one batch."""
    module = TrainingModule(SMALL, SENSOR, steps=40)
    sensed, truth = Walls(4).batch(range(4), draw=0, shots=None)
    optimizer = torch.optim.Adam(module.parameters(), 1e-2)
    losses = []
    for _ in range(40):
        loss = module.network.loss(module(sensed), sensed, truth, SENSOR, SMALL.loss_weights)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.75 * losses[0]


@pytest.mark.parametrize("network", ["tofregnet", "tofsegnet"])
def test_unknown_truth_teaches_nothing(network):
    config = SMALL.model_copy(update={"network": network})
    module = TrainingModule(config, SENSOR, steps=1)
    sensed, truth = Walls(2).batch(range(2), draw=0, shots=None)
    known = torch.rand(truth.known.shape, generator=torch.Generator().manual_seed(0)) < 0.5
    output = module(sensed)
    losses = [
        module.network.loss(
            output, sensed, Truth(depth_m, known), SENSOR, config.loss_weights
        ).item()
        for depth_m in (truth.distance_m, truth.distance_m.where(known, 0.0))
    ]
    assert losses[0] == losses[1]
    assert (
        losses[0] != module.network.loss(output, sensed, truth, SENSOR, config.loss_weights).item()
    )


class InterruptedHereError(Exception):
    pass


def test_resumed_training_equals_uninterrupted(tmp_path, monkeypatch):
    whole = train(SMALL, walls, tmp_path / "whole", progress=False)
    step = TrainingModule.training_step

    # Eight frames in batches of four: step 3 is in the second of two epochs.
    def failing(self, batch, index):
        if self.global_step == 3:
            raise InterruptedHereError
        return step(self, batch, index)

    monkeypatch.setattr(TrainingModule, "training_step", failing)
    with pytest.raises(InterruptedHereError):
        train(SMALL, walls, tmp_path / "halves", progress=False)
    monkeypatch.undo()
    halves = train(SMALL, walls, tmp_path / "halves", progress=False)
    one, other = load_file(whole), load_file(halves)
    assert all(torch.equal(one[name], other[name]) for name in one)


def test_frames_acquired_ahead_train_the_same_weights(tmp_path, monkeypatch):
    # A network that looks at samples, so that the noise of each draw matters.
    config = TrainConfig(network="phasenet", width=4, epochs=2, batch_size=2)
    alone = load_file(train(config, walls, tmp_path / "alone", progress=False))
    monkeypatch.setattr("unwrap.training.loop.acquiring_threads", lambda device: 2)
    ahead = load_file(train(config, walls, tmp_path / "ahead", progress=False))
    assert all(torch.equal(ahead[name], tensor) for name, tensor in alone.items())


def test_interrupt_keeps_the_checkpoint(tmp_path, monkeypatch):
    step = TrainingModule.training_step

    def interrupting(self, batch, index):
        if self.global_step == 3:
            os.kill(os.getpid(), signal.SIGINT)
        return step(self, batch, index)

    monkeypatch.setattr(TrainingModule, "training_step", interrupting)
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        train(SMALL, walls, tmp_path, progress=False)
    assert signal.getsignal(signal.SIGINT) is handler
    assert {path.name for path in tmp_path.iterdir()} == {"tofregnet.ckpt", "tensorboard"}


def test_checkpoint_of_another_configuration_is_refused(tmp_path):
    train(SMALL, walls, tmp_path, progress=False)
    other = SMALL.model_copy(update={"seed": 1})
    with pytest.raises(ValueError, match="another configuration"):
        train(other, walls, tmp_path, progress=False)
    train(other, walls, tmp_path, resume=False, progress=False)


def test_tensorboard_has_loss_accuracy_and_pictures(tmp_path):
    train(SMALL, walls, tmp_path, progress=False)
    log = EventAccumulator(str(tmp_path / "tensorboard" / "tofregnet")).Reload()
    assert {"loss", "wrap_accuracy"} <= set(log.Tags()["scalars"])
    assert len(log.Images("gray, true and predicted depth")) == SMALL.epochs


def test_weights_depend_on_the_seed_alone():
    # Whatever was drawn from torch's global generator before.
    torch.manual_seed(5)
    one = SMALL.build().state_dict()
    torch.manual_seed(6)
    other = SMALL.build().state_dict()
    assert all(torch.equal(one[name], other[name]) for name in one)


def test_schedule_rises_then_falls_to_the_final_rate():
    config = SMALL.model_copy(update={"warmup_share": 0.2})
    made = TrainingModule(config, SENSOR, steps=100).configure_optimizers()
    optimizer, schedule = made["optimizer"], made["lr_scheduler"]["scheduler"]
    rates = []
    for _ in range(101):
        rates.append(optimizer.param_groups[0]["lr"])
        optimizer.step()
        schedule.step()
    assert rates[20] == max(rates) == pytest.approx(config.learning_rate)
    assert rates[:21] == sorted(rates[:21])
    assert rates[20:] == sorted(rates[20:], reverse=True)
    assert rates[-1] == pytest.approx(config.final_learning_rate)


@pytest.mark.parametrize("wrong", [{"width": 2}, {"epochs": 0}, {"lr": 1}, {"network": "unet"}])
def test_configuration_is_checked(wrong):
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        TrainConfig(**wrong)


def test_hits_are_predictions_within_half_a_wrap():
    truth_m = torch.tensor([3.0, 10.0, 10.0, 29.0])
    predicted_m = truth_m + torch.tensor([3.0, -3.0, 3.3, 0.0])
    right, scored = wrap_hits(predicted_m, truth_m, SMALL)
    assert right.tolist() == [True, True, False, False]
    assert scored.tolist() == [True, True, True, False]


def test_start_from_transfers_the_layers_that_fit(tmp_path):
    other = TrainConfig(network="tofregnet", width=4, seed=1).build()
    save_weights(
        tmp_path / "other.safetensors",
        other,
        {"network": "tofregnet", "width": 4, "range_m": 30.0, "f1_hz": 24e6},
    )
    start = str(tmp_path / "other.safetensors")
    network = TrainConfig(network="tofsegnet", width=4, start_from=start).build()
    stem = "stem.0.weight"
    expected = other.state_dict()[stem].to(torch.float16).float()
    assert torch.equal(network.state_dict()[stem], expected)
    assert network.head.weight.shape[0] == 4 * 5
    with pytest.raises(ValueError, match="start_from has width 4; expected 8"):
        TrainConfig(network="tofsegnet", width=8, start_from=start).build()
