"""Several processes that share each batch train what one process does."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import psutil
import pytest
import shared_walls
import torch
from shared_walls import (
    FRAMES,
    deadly_walls,
    precise_walls,
    raise_before_others,
    stopping_walls,
    walls,
)
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from watched_processes import end_session, wait_until

from unwrap.networks.registry import NetworkName
from unwrap.signal.shots import Shots
from unwrap.training.config import TrainConfig
from unwrap.training.data import EpochShuffle
from unwrap.training.launch import Team, is_first_process, run_team
from unwrap.training.loop import train
from unwrap.training.module import TrainingModule
from unwrap.training.ranks import Ranks, Share

CONFIG = TrainConfig(width=4, epochs=3, batch_size=4)
CPU = torch.device("cpu")


def parts(value, rank, processes):
    """The own frames of a batch."""
    from unwrap.support.tensors import mapped

    return mapped(lambda tensor: tensor[rank::processes], value)


@pytest.mark.parametrize("network", get_args(NetworkName))
def test_the_losses_of_shares_add_up_to_that_of_the_batch(network):
    config = TrainConfig(network=network, width=4)
    net, sensor = config.build().double().eval(), walls("train").sensor
    sensed, truth = walls("train").batch(range(7), draw=1, shots=Shots.FOUR)
    with torch.no_grad():
        output = net(net.features(sensed, sensor).double()).float()
        whole = net.loss(output, sensed, truth, sensor, config.loss_weights)
        # What each of three processes counts, in the order in which it asks for totals.
        counted = []
        for rank in range(3):
            own = []
            weights = replace(config.loss_weights, total=lambda n, own=own: own.append(n) or n)
            net.loss(*(parts(x, rank, 3) for x in (output, sensed, truth)), sensor, weights)
            counted.append(own)
        totals = [sum(numbers) for numbers in zip(*counted, strict=True)]
        assert totals
        losses = []
        for rank in range(3):
            left = iter(totals)
            weights = replace(config.loss_weights, total=lambda n, left=left: next(left))
            losses.append(
                net.loss(*(parts(x, rank, 3) for x in (output, sensed, truth)), sensor, weights)
            )
    assert float(sum(losses)) == pytest.approx(float(whole), rel=1e-6)
    # Not because all shares are alike.
    assert max(losses) > 1.01 * min(losses)


def test_frames_are_dealt_and_draw_as_in_the_whole_batch():
    shuffles = [EpochShuffle(10, 4, (Shots.TWO, Shots.FOUR), 3, Ranks(r, 3)) for r in range(3)]
    whole = EpochShuffle(10, 4, (Shots.TWO, Shots.FOUR), 3)
    for order, *own in zip(whole, *shuffles, strict=True):
        assert {one.shots for one in own} == {order.shots}
        for rank, one in enumerate(own):
            assert one.numbers == order.numbers[rank::3]
    sensed, truth = walls("train").batch(range(7), draw=1, shots=Shots.FOUR)
    vary = CONFIG.augmentation
    all_varied = vary(sensed, truth, generator=torch.Generator().manual_seed(5))
    for rank in range(3):
        share = Ranks(rank, 3).share(7)
        own = parts((sensed, truth), rank, 3)
        varied = vary(*own, generator=torch.Generator().manual_seed(5), share=share)
        assert torch.equal(varied[0].gray, all_varied[0].gray[rank::3])
        assert torch.equal(varied[1].known, all_varied[1].known[rank::3])
        drawn = share.draw(torch.Generator().manual_seed(5))(2, 3)
        assert torch.equal(drawn, Share(7).draw(torch.Generator().manual_seed(5))(2, 3)[rank::3])


def test_validation_batches_weigh_as_they_were_dealt():
    modules = [
        TrainingModule(CONFIG, walls("train").sensor, 1, ranks=Ranks(rank, 2), judged=3)
        for rank in range(2)
    ]
    # The second process has one batch less, and takes a stand-in.
    weights = [[m._validation_weight(4, index) for index in range(2)] for m in modules]
    assert weights == [[8, 8], [8, 0]]


@pytest.mark.parametrize(
    ("team", "batch_size", "message"),
    [
        (Team(0), 4, "devices is 0; expected at least 1"),
        (Team(1, 0), 4, "nodes is 0; expected at least 1"),
        (Team(3), 4, "leave a batch of 2 for 3 processes"),
        (Team(2), 1, "leave a batch of 1 for 2 processes"),
        (Team(1, 2), 4, "nodes is 2, but MASTER_ADDR and MASTER_PORT and NODE_RANK are not set"),
    ],
)
def test_what_cannot_be_shared_is_refused(team, batch_size, message):
    with pytest.raises(ValueError, match=message):
        team.check(batch_size, FRAMES["train"], CPU)


def test_processes_that_a_launcher_started_are_counted(monkeypatch):
    monkeypatch.setenv("LOCAL_RANK", "0")
    monkeypatch.setenv("LOCAL_WORLD_SIZE", "2")
    monkeypatch.setenv("WORLD_SIZE", "4")
    with pytest.raises(ValueError, match="devices is 1, but the launcher started 2 processes"):
        Team(1).check(4, 8, CPU)
    # Each machine would train by itself, into the same folder.
    with pytest.raises(ValueError, match="devices times nodes is 2, but the launcher started 4"):
        Team(2).check(4, 8, CPU)
    Team(2, 2).check(4, 8, CPU)
    assert is_first_process()
    monkeypatch.setenv("LOCAL_RANK", "1")
    assert not is_first_process()


@pytest.mark.parametrize("network", ["tofregnet", "phasenet"])
def test_one_process_trains_what_a_plain_loop_does(network, tmp_path, monkeypatch):
    """To the bit, also inside a Slurm job that is not Lightning's."""
    monkeypatch.setenv("SLURM_NTASKS", "4")
    monkeypatch.setenv("SLURM_JOB_NAME", "network")
    config = CONFIG.model_copy(update={"network": network, "clip_norm": 1.0})
    train(config, walls, tmp_path, progress=False)
    trained = weights_of(tmp_path, network)
    expected = {f"network.{name}": tensor for name, tensor in plainly_trained(config).items()}
    assert trained.keys() == expected.keys()
    for name, tensor in expected.items():
        assert torch.equal(trained[name], tensor), name


def plainly_trained(config: TrainConfig) -> dict[str, torch.Tensor]:
    """State of a network after a loop of torch's alone."""
    source, network = walls("train"), config.build().train().to(memory_format=torch.channels_last)
    order = EpochShuffle(len(source), config.batch_size, config.shown_shots, config.seed)
    steps = config.epochs * len(order)
    optimizer = torch.optim.AdamW(
        network.parameters(), weight_decay=config.weight_decay, fused=True
    )
    rise = int(config.warmup_share * steps)
    final = config.final_learning_rate / config.learning_rate
    step = 0
    for epoch in range(config.epochs):
        order.set_epoch(epoch)
        for one in order:
            share = 1 + (final - 1) * (step - rise) / (steps - rise)
            share = (step + 1) / (rise + 1) if step < rise else share
            optimizer.param_groups[0]["lr"] = config.learning_rate * share
            batch = source.batch(one.numbers, draw=one.draw, shots=one.shots)
            sensed, truth = config.augmentation(*batch, generator=seeded(config.seed, 1, step))
            draw = Share(len(sensed)).draw(seeded(config.seed, 2, step))
            sensed = network.as_trained_on(sensed, draw)
            output = network(network.features(sensed, source.sensor))
            loss = network.loss(output, sensed, truth, source.sensor, config.loss_weights)
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), config.clip_norm)
            optimizer.step()
            step += 1
    return network.state_dict()


def seeded(*words: int) -> torch.Generator:
    seed = np.random.SeedSequence(words).generate_state(1, np.uint64)[0] >> 1
    return torch.Generator().manual_seed(int(seed))


def curve(out: Path, network: str) -> tuple[list[float], list[float]]:
    """Losses of all steps and validation accuracies of all epochs."""
    folder = out / "tensorboard" / network
    log = EventAccumulator(str(folder), size_guidance={"scalars": 0}).Reload()
    return tuple([one.value for one in log.Scalars(name)] for name in ("loss", "wrap_accuracy"))


def weights_of(out: Path, network: str) -> dict[str, torch.Tensor]:
    return torch.load(out / f"{network}.ckpt", weights_only=True)["state_dict"]


@pytest.mark.slow
def test_two_processes_train_what_one_does_and_one_goes_on_where_they_stopped(tmp_path):
    # In float64: float32 rounds differently, which each step of Adam makes larger.
    one, two = tmp_path / "one", tmp_path / "two"
    try:
        train(CONFIG, precise_walls, one, progress=False)
        train(CONFIG, precise_walls, two, devices=2, progress=False)
        names = {"tensorboard", "tofregnet.ckpt", "tofregnet.json", "tofregnet.safetensors"}
        assert {path.name for path in two.iterdir()} == names
        for alone, together in zip(curve(one, "tofregnet"), curve(two, "tofregnet"), strict=True):
            assert together == pytest.approx(alone, rel=1e-6)
        expected = weights_of(one, "tofregnet")
        for name, tensor in weights_of(two, "tofregnet").items():
            torch.testing.assert_close(tensor, expected[name], atol=1e-7, rtol=1e-7)
        assert (two / "tofregnet.json").read_text() == (one / "tofregnet.json").read_text()
        # Two stop in the last epoch but one; one process goes on.
        part = tmp_path / "part"
        with pytest.raises(RuntimeError, match=r"process \d of 2 failed: .*stopped here"):
            train(CONFIG, StoppingWalls(), part, devices=2, progress=False)
        assert {path.name for path in part.iterdir()} == {"tensorboard", "tofregnet.ckpt"}
        train(CONFIG, precise_walls, part, progress=False)
        for name, tensor in weights_of(part, "tofregnet").items():
            torch.testing.assert_close(tensor, expected[name], atol=1e-7, rtol=1e-7)
    finally:
        torch.set_default_dtype(torch.float32)


class StoppingWalls:
    """Frames that cannot be acquired any more in the third epoch."""

    def __call__(self, split):
        source = precise_walls(split)
        batch = source.batch

        def until_then(numbers, *, draw, shots):
            if draw == 3:
                raise ValueError("stopped here")
            return batch(numbers, draw=draw, shots=shots)

        source.batch = until_then
        return source


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "message"),
    [
        (deadly_walls, r"process 1 of 2 failed: .*SIGKILL"),
        (stopping_walls, r"process 1 of 2 hangs: \d+ was stopped"),
    ],
)
def test_a_process_that_dies_or_stops_is_named(source, message, tmp_path):
    begun = time.monotonic()
    with pytest.raises(RuntimeError, match=message):
        train(CONFIG, source, tmp_path, devices=2, progress=False)
    assert time.monotonic() - begun < 120


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_two_machines_train_what_one_process_does_until_one_is_lost(tmp_path):
    """Each is a command of its own, as a user calls it; one process goes on from the last epoch."""
    part, mark = tmp_path / "part", tmp_path / "lost"
    first, second = nodes(part, mark)
    try:
        _, told = first.communicate(timeout=400)
        # Seconds, though a busy machine takes its time; what hangs is given up after minutes.
        assert first.returncode == 1 and time.time() - mark.stat().st_mtime < 60
        assert "process 0 of 1 failed: " in told and "if it lost another machine" in told
        second.communicate(timeout=60)
        assert second.returncode == -signal.SIGKILL
    finally:
        end_session(first)
        end_session(second)
    assert {path.name for path in part.iterdir()} == {"tensorboard", "tofregnet.ckpt"}
    try:
        train(CONFIG, precise_walls, tmp_path / "whole", progress=False)
        train(CONFIG, precise_walls, part, progress=False)
    finally:
        torch.set_default_dtype(torch.float32)
    expected = weights_of(tmp_path / "whole", "tofregnet")
    for name, tensor in weights_of(part, "tofregnet").items():
        torch.testing.assert_close(tensor, expected[name], atol=1e-7, rtol=1e-7)
    both = [(folder / "tofregnet.json").read_text() for folder in (part, tmp_path / "whole")]
    assert both[0] == both[1]


def nodes(out: Path, mark: Path) -> list[subprocess.Popen]:
    """The commands of two machines, which are this one."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    return [
        subprocess.Popen(
            [sys.executable, shared_walls.__file__, str(out), str(mark)],
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(sys.path),
                "MASTER_ADDR": "127.0.0.1",
                "MASTER_PORT": str(port),
                "NODE_RANK": str(rank),
            },
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        for rank in range(2)
    ]


@pytest.mark.slow
def test_what_raised_first_is_told_also_where_others_end_sooner(tmp_path):
    """And at once, though one is deaf to requests to end."""
    mark = tmp_path / "raised"
    with pytest.raises(RuntimeError, match="process 1 of 3 failed: ValueError: frame 7 is damaged"):
        run_team(Team(3), raise_before_others, mark)
    # A connection that hangs is given up after minutes.
    assert time.time() - mark.stat().st_mtime < 60


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_ctrl_c_ends_all_processes(tmp_path):
    path = os.pathsep.join(sys.path)
    training = subprocess.Popen(
        [sys.executable, shared_walls.__file__, str(tmp_path)],
        env={**os.environ, "PYTHONPATH": path},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        checkpoint = tmp_path / "tofregnet.ckpt"
        wait_until(lambda: checkpoint.exists() or training.poll() is not None, seconds=180)
        family = psutil.Process(training.pid).children(recursive=True)
        assert len(family) >= 2
        training.send_signal(signal.SIGINT)
        _, told = training.communicate(timeout=60)
        assert "KeyboardInterrupt" in told
        assert psutil.wait_procs(family, timeout=60)[1] == []
    finally:
        end_session(training)
