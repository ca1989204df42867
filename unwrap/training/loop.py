"""Training of an unwrapping network: one call, resumable.

`train` reads from top to bottom: data, module, trainer, weights file, measured numbers. A run that
was killed or interrupted loses the epoch it was in; started again, it gives the same weights as a
run that was not. TensorBoard shows it: loss, accuracy and pictures of every epoch.
"""

from __future__ import annotations

import logging
import os
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import lightning
from lightning.pytorch.callbacks import ModelCheckpoint, TQDMProgressBar
from lightning.pytorch.loggers import TensorBoardLogger
from lightning.pytorch.plugins.environments import LightningEnvironment, TorchElasticEnvironment
from lightning.pytorch.strategies import DDPStrategy
from torch import distributed

from unwrap.networks import save_weights
from unwrap.support import keep_freed_memory, on_device, write_json
from unwrap.training.config import TrainConfig
from unwrap.training.data import (
    EpochShuffle,
    Source,
    acquiring_threads,
    in_order,
    loader,
    training_device,
)
from unwrap.training.launch import Team, is_started, run_team
from unwrap.training.measuring import JUDGED_DRAW, measure
from unwrap.training.module import TrainingModule
from unwrap.training.pooled_norm import PooledNorms
from unwrap.training.ranks import Ranks
from unwrap.training.resuming import require_checkpoint, unusable

LOGGED_PER_EPOCH = 50
"""Losses that TensorBoard is told of in an epoch; each makes a GPU wait for the processor."""

ADVICE = (
    ".*does not have many workers.*",
    ".*exists and is not empty.*",
    ".*Trying to infer the `batch_size`.*",
    ".*LeafSpec.* is deprecated.*",
    ".*broadcast_buffers.* is deprecated.*",
)
"""Lightning's warnings that do not fit here."""

PATIENCE = timedelta(minutes=10)
"""How long a process waits for one that trains with it before it gives up (assumed)."""


def train(
    config: TrainConfig,
    sources: Callable[[str], Source],
    out: Path,
    *,
    devices: int = 1,
    nodes: int = 1,
    resume: bool = True,
    progress: bool = True,
) -> Path:
    """Train a network and write it to `out`.

    Parameters
    ----------
    config : TrainConfig
        What to train, and how.
    sources : callable
        Gives the frames of the splits "train", "validation" and "test"; picklable where there are
        several `devices`.
    out : Path
        Folder that gets `<network>.safetensors`, `<network>.json` with the numbers measured on the
        test frames, `<network>.ckpt`, the state after the last finished epoch, and `tensorboard/`.
    devices : int
        GPUs on this machine that share every batch, each with a process of its own; processes on
        the processor where there is no GPU. The steps are those of one, but for rounding.
    nodes : int
        Machines that do so, which all call this function. Where a launcher like torchrun has not
        started the processes they find each other by the environment variables MASTER_ADDR,
        MASTER_PORT and NODE_RANK; `out` is a folder that all of them see.
    resume : bool
        Continue from `<network>.ckpt` where there is one.
    progress : bool
        Show a progress bar.

    Returns
    -------
    Path
        The weights file.

    Raises
    ------
    ValueError
        The frames are unusable, or cannot be shared by so many; the checkpoint is damaged or
        belongs to another configuration.
    RuntimeError
        One of several processes failed or died; the checkpoint is kept.
    KeyboardInterrupt
        Ctrl-C; the checkpoint is kept.
    """
    team = Team(devices, nodes)
    team.check(config.batch_size, len(sources("train")), training_device())
    if team.alone or is_started():
        _train(config, sources, out, team, resume, progress)
    else:
        run_team(team, _train, config, sources, out, team, resume, progress)
    return out / f"{config.network}.safetensors"


def _train(
    config: TrainConfig,
    sources: Callable[[str], Source],
    out: Path,
    team: Team,
    resume: bool,
    progress: bool,
) -> None:
    """What each process of a `team` does; the first alone writes."""
    frames, validation, device = sources("train"), sources("validation"), training_device()
    if device.type == "cpu":
        keep_freed_memory()  # For the rest of the process.
    shots, size = config.shown_shots, config.batch_size
    steps = -(-len(frames) // size)
    with _quiet_lightning():
        trainer = _trainer(config, out, progress, steps, team)
    ranks = Ranks(trainer.global_rank, trainer.world_size)
    order = EpochShuffle(len(frames), size, shots, config.seed, ranks)
    judged = in_order(validation, size, shots, draw=JUDGED_DRAW)
    module = TrainingModule(
        config,
        frames.sensor,
        steps=config.epochs * steps,
        ranks=ranks,
        frames=len(frames),
        judged=len(judged),
    )
    path = out / f"{config.network}.ckpt"
    # Whatever lies there, and be it a link to nowhere.
    checkpoint = path if resume and os.path.lexists(path) else None
    if checkpoint is not None:
        require_checkpoint(checkpoint, module, trainer)
    threads = acquiring_threads(device)
    judging = loader(validation, list(ranks.own(judged)), threads=threads)
    # All processes validate equally often: who was dealt one batch less takes the first once more.
    filled = judged + judged[:1] * (-len(judged) % ranks.processes)
    with _quiet_lightning(), _ctrl_c_raises(), _restoring(checkpoint, module):
        trainer.fit(
            module,
            loader(frames, order, threads=threads),
            loader(validation, list(ranks.own(filled)), threads=threads),
            ckpt_path=None if checkpoint is None else str(checkpoint),
            weights_only=True,  # Nothing in a checkpoint is unpickled.
        )
    # Confidences are calibrated on frames that the weights have not seen.
    module.eval().to(device)
    batches = (on_device(batch, device) for batch in judging)
    module.network.calibrate(batches, validation.sensor, ranks.pooled)
    test = sources("test")
    measured = measure(module, test)
    if not ranks.alone:
        distributed.destroy_process_group()
    if ranks.rank == 0:
        _write(module, test, measured, out)


def _trainer(
    config: TrainConfig, out: Path, progress: bool, steps: int, team: Team
) -> lightning.Trainer:
    """Lightning's trainer of a `team`, for epochs of so many `steps`."""
    # Without a monitored number the best is the last; without counted versions it has one name, by
    # which `train` finds it again.
    every_epoch = ModelCheckpoint(
        out, config.network, save_top_k=1, monitor=None, enable_version_counter=False
    )
    bar = [TQDMProgressBar(refresh_rate=10)] if progress else []
    return lightning.Trainer(
        max_epochs=config.epochs,
        callbacks=[every_epoch, *bar],
        enable_progress_bar=progress,
        enable_model_summary=False,
        num_sanity_val_steps=0,
        gradient_clip_val=config.clip_norm or None,
        logger=TensorBoardLogger(out, name="tensorboard", version=config.network),
        log_every_n_steps=max(1, steps // LOGGED_PER_EPOCH),
        # Batches are of one size but for the last: it pays to try which convolution is fastest.
        benchmark=training_device().type == "cuda",
        devices=team.devices,
        num_nodes=team.nodes,
        plugins=_plugins(team),
        **({} if team.alone else _together()),
    )


def _plugins(team: Team) -> list[Any]:
    """Where a process finds its place, and batch normalisations that know of the others."""
    # Inside a Slurm job Lightning would ask Slurm, which knows nothing of the processes started
    # here and is refused even for one process where its options are others than Lightning's.
    places = [] if TorchElasticEnvironment.detect() else [LightningEnvironment()]
    return places if team.alone else [*places, PooledNorms()]


def _together() -> dict[str, Any]:
    """What a trainer needs to know where several processes share each batch."""
    # State that is not learned is the same everywhere as it is, since it follows from the whole
    # batch: nothing has to be sent before each forward pass.
    strategy = DDPStrategy(broadcast_buffers=False, timeout=PATIENCE)
    # The batches are dealt already, see `EpochShuffle`.
    return {"strategy": strategy, "use_distributed_sampler": False}


@contextmanager
def _quiet_lightning() -> Iterator[None]:
    """Silence Lightning's `ADVICE`, and what it logs below warnings, inside the context."""
    logs = [logging.getLogger(f"lightning.{part}") for part in ("pytorch", "fabric")]
    levels = [log.level for log in logs]
    with warnings.catch_warnings():
        for advice in ADVICE:
            warnings.filterwarnings("ignore", advice)
        for log in logs:
            log.setLevel(logging.WARNING)
        try:
            yield
        finally:
            for log, level in zip(logs, levels, strict=True):
                log.setLevel(level)


@contextmanager
def _restoring(checkpoint: Path | None, module: TrainingModule) -> Iterator[None]:
    """Name the checkpoint in what is raised while it is taken over."""
    try:
        yield
    except Exception as error:
        if checkpoint is None or not module.restoring:
            raise
        raise unusable(checkpoint, error) from error


@contextmanager
def _ctrl_c_raises() -> Iterator[None]:
    """Turn the exit that Lightning makes of Ctrl-C back into KeyboardInterrupt.

    Its handler of the signal, which would outlive the training, gives way to the one of before.
    """
    handler = signal.getsignal(signal.SIGINT)
    try:
        yield
    except SystemExit:
        signal.signal(signal.SIGINT, handler)
        raise KeyboardInterrupt from None


def _write(module: TrainingModule, test: Source, measured: dict[str, Any], out: Path) -> None:
    """Write the weights, then the numbers `measured` with them."""
    config = module.config
    path = out / f"{config.network}.safetensors"
    height, width = test.batch([0], draw=JUDGED_DRAW, shots=None)[0].gray.shape[-2:]
    metadata = {
        "network": config.network,
        "width": config.width,
        "classes": config.classes,
        "range_m": config.clamp_m,
        "f1_hz": config.f1_hz,
        "trained_height": height,
        "trained_width": width,
        "bank": Path(config.bank).name,
        "config": config.model_dump(mode="json"),
    }
    save_weights(path, module.network, metadata)
    numbers = {"config": config.model_dump(mode="json"), "test": measured}
    write_json(path.with_suffix(".json"), numbers)
