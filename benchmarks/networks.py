"""Arithmetic of the networks as a share of what large matrix products reach on the same device.

On a CUDA device everything is measured there, otherwise on the processor with all its threads. The
weights are untrained and the images random: the time depends on neither.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import torch
from torch import Tensor

from benchmarks.rows import row
from benchmarks.turns import alternately
from unwrap.networks import Settings, Unwrapper, build_network, load_unwrapper, save_weights
from unwrap.networks.engines import Engine
from unwrap.networks.network import arithmetic
from unwrap.signal import Sensed, SensorDescription, Truth
from unwrap.support.process_state import keep_freed_memory
from unwrap.training import TrainConfig
from unwrap.training.module import TrainingModule

HEIGHT, WIDTH, CHANNELS = 240, 320, 64
# Assumed: what is left to gain beyond these is not worth code of one's own for it.
SINGLE_GOAL, BATCH_GOAL, TRAINING_GOAL, OUTSIDE_GOAL = 0.65, 0.70, 0.50, 0.05
BATCHES = {"cpu": 16, "cuda": 64}
TRAINING_BATCHES = {"cpu": (8, 32), "cuda": (1, 64)}
"""The smallest and the largest of the recipes' batches on a processor, else a GPU's extremes."""
PRODUCT_SIZES = {"cpu": 2048, "cuda": 8192}
"""Side of the square matrices: large enough that starting a product costs nothing."""
ROUNDS = {"cpu": 15, "cuda": 50}
FEW_ROUNDS = {"cpu": 5, "cuda": 10}
FORWARD_AND_BACKWARD = 3
"""A training step's multiply-accumulates over those of its forward pass: the backward pass takes
two products for each of the forward's, for the gradients of the input and of the weights."""


def run() -> list[dict[str, Any]]:
    """Inference, training, and what the public face costs beside its network."""
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    with tempfile.TemporaryDirectory() as folder:
        unwrapper = untrained(Path(folder) / "net.safetensors", device)
    many, few = ROUNDS[device.type], FEW_ROUNDS[device.type]
    used = [
        inference(unwrapper, device, 1, SINGLE_GOAL, many),
        inference(unwrapper, device, BATCHES[device.type], BATCH_GOAL, few),
        outside(unwrapper, device, many),
    ]
    if device.type == "cpu":
        keep_freed_memory()  # As training does.
    return used + [training(unwrapper, device, size, few) for size in TRAINING_BATCHES[device.type]]


def untrained(path: Path, device: torch.device) -> Unwrapper:
    """TofRegNet as it is loaded from a file."""
    settings = Settings(width=CHANNELS)
    # Frames of the size that it is said to be trained on are seen with all their pixels.
    metadata = {
        "network": "tofregnet",
        "width": CHANNELS,
        "f1_hz": settings.f1_hz,
        "trained_height": HEIGHT,
        "trained_width": WIDTH,
    }
    save_weights(path, build_network("tofregnet", settings), metadata)
    unwrapper = load_unwrapper(path)
    unwrapper.network.to(device)
    return unwrapper


def inference(
    unwrapper: Unwrapper, device: torch.device, batch: int, goal: float, rounds: int
) -> dict[str, Any]:
    """`Unwrapper.predict` of a batch, whose frames it computes one by one."""
    gray = images(batch, device)
    macs = batch * unwrapper.macs(HEIGHT, WIDTH)
    name = f"inference, batch {batch} / matrix product"
    return share(name, lambda: unwrapper.predict(gray), macs, batch, goal, device, rounds)


def training(unwrapper: Unwrapper, device: torch.device, batch: int, rounds: int) -> dict[str, Any]:
    """Forward pass, loss, backward pass and optimiser."""
    sensor, config = SensorDescription(), TrainConfig(network="tofregnet", width=CHANNELS)
    module = TrainingModule(config, sensor, steps=100).to(device).train()
    optimizer: Any = module.configure_optimizers()["optimizer"]  # type: ignore[index,call-overload]
    sensed, distance_m = Sensed(images(batch, device)), 25 * images(batch, device)
    truth = Truth(distance_m, torch.ones_like(distance_m, dtype=torch.bool))

    def step() -> None:
        optimizer.zero_grad()
        output = module(sensed)
        module.network.loss(output, sensed, truth, sensor, config.loss_weights).backward()
        optimizer.step()

    macs = FORWARD_AND_BACKWARD * batch * unwrapper.macs(HEIGHT, WIDTH)
    name = f"training step, batch {batch} / matrix product"
    return share(name, step, macs, batch, TRAINING_GOAL, device, rounds)


def outside(unwrapper: Unwrapper, device: torch.device, rounds: int) -> dict[str, Any]:
    """Share of the time of `Unwrapper.predict` that is not its network's."""
    gray, network = images(1, device), Engine(unwrapper.network, device)
    features = unwrapper.network.features(Sensed(gray), SensorDescription())

    @torch.inference_mode()
    def bare() -> None:
        network(features)

    whole_s, bare_s = warm_and_timed(lambda: unwrapper.predict(gray), bare, device, rounds)
    note = f"{1e3 * whole_s:.2f} ms for a frame, of which the network {1e3 * bare_s:.2f} ms"
    return row("inference outside the network", 1 - bare_s / whole_s, "<=", OUTSIDE_GOAL, note)


def share(
    name: str,
    work: Callable[[], object],
    macs: int,
    frames: int,
    goal: float,
    device: torch.device,
    rounds: int,
) -> dict[str, Any]:
    """Rate of `work` over that of a matrix product, two operations per multiply-accumulate."""
    size, dtype = PRODUCT_SIZES[device.type], arithmetic(device)
    left, right = torch.randn(2, size, size, device=device).to(dtype)
    work_s, product_s = warm_and_timed(work, lambda: left @ right, device, rounds)
    rate, product_rate = 2 * macs / work_s, 2 * size**3 / product_s
    note = (
        f"{rate / 1e9:.0f} of {product_rate / 1e9:.0f} GFLOP/s in {str(dtype).split('.')[1]}, "
        f"{frames / work_s:.2f} frames/s of {WIDTH} x {HEIGHT} at width {CHANNELS}, {where(device)}"
    )
    return row(name, rate / product_rate, ">=", goal, note)


def warm_and_timed(
    first: Callable[[], object], second: Callable[[], object], device: torch.device, rounds: int
) -> tuple[float, float]:
    """Seconds of both, by a clock that waits for the device, after a turn that is not counted.

    A GPU is handed its work and goes on alone: a clock that does not wait times the handing over.
    """

    def clock() -> float:
        if device.type == "cuda":
            torch.cuda.synchronize(device)
        return perf_counter()

    # The first turn compiles, plans convolutions and allocates.
    alternately(first, second, 1, clock)
    return alternately(first, second, rounds, clock, settled=True)


def where(device: torch.device) -> str:
    """The device, in words."""
    if device.type == "cuda":
        return torch.cuda.get_device_name(device)
    return f"{torch.get_num_threads()} threads"


def images(batch: int, device: torch.device) -> Tensor:
    """Random gray images [batch, HEIGHT, WIDTH] in [0, 1]."""
    random = torch.Generator().manual_seed(0)
    return torch.rand(batch, HEIGHT, WIDTH, generator=random).to(device)


if __name__ == "__main__":
    print(run())
