"""Training of an unwrapping network: one call, resumable.

`train` reads from top to bottom: data, module, trainer, weights file, measured numbers. A run that
was killed or interrupted loses the epoch it was in; started again, it gives the same weights as a
run that was not. TensorBoard shows it: loss, accuracy and pictures of every epoch.
"""

from __future__ import annotations

import logging
import signal
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import lightning
import numpy as np
import torch
from lightning.pytorch.callbacks import ModelCheckpoint, TQDMProgressBar
from lightning.pytorch.loggers import TensorBoardLogger
from lightning.pytorch.utilities.types import OptimizerLRScheduler
from torch import Tensor

from unwrap.depth import nearest_wraps
from unwrap.networks import Prediction, autocast, save_weights
from unwrap.signal import Sensed, SensorDescription, Truth
from unwrap.support import keep_freed_memory, on_device, write_json
from unwrap.training.config import TrainConfig
from unwrap.training.data import (
    Batch,
    EpochShuffle,
    Source,
    acquiring_threads,
    in_order,
    loader,
    training_device,
)

AUGMENTATION_STREAM = 1
"""Word in the seed of the augmentation, so that it differs from other seeds of the same step."""
FORWARD_STREAM = 2
"""The same for what a network draws in its forward pass."""
JUDGED_DRAW = 0
"""Draw of the noise that networks are validated and tested on; no epoch of training sees it."""

LOGGED_PER_EPOCH = 50
"""Losses that TensorBoard is told of in an epoch; each makes a GPU wait for the processor."""

ADVICE = (
    ".*does not have many workers.*",
    ".*exists and is not empty.*",
    ".*Trying to infer the `batch_size`.*",
    ".*LeafSpec.* is deprecated.*",
)
"""Lightning's warnings that do not fit here."""


class TrainingModule(lightning.LightningModule):
    """Network, loss, optimiser and schedule, as Lightning wants them."""

    def __init__(self, config: TrainConfig, sensor: SensorDescription, steps: int):
        super().__init__()
        self.config, self.sensor, self.steps = config, sensor, steps
        self.network = config.build().to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, sensed: Sensed) -> Tensor:
        """The network's output for a batch of frames."""
        with autocast(sensed.gray.device):
            return self.network(self.network.features(sensed, self.sensor))

    def predict(self, sensed: Sensed) -> Prediction:
        """Distance and confidence of a batch of frames."""
        return self.network.predict(self(sensed), sensed, self.sensor)

    def training_step(self, batch: Batch, _: int) -> Tensor:
        """Loss of one augmented batch; all that is random in it follows from seed and step."""
        generator = torch.Generator().manual_seed(self._seed_of(AUGMENTATION_STREAM))
        sensed, truth = self.config.augmentation(*batch, generator=generator)
        # Networks draw from the global generator (memory that is spoilt, say). Seeded by the step,
        # a training that was resumed draws what one that was not interrupted does.
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self._seed_of(FORWARD_STREAM))
            weights = self.config.loss_weights
            loss = self.network.loss(self(sensed), sensed, truth, self.sensor, weights)
        self.log("loss", loss.detach(), prog_bar=True, batch_size=len(sensed))
        return loss

    def validation_step(self, batch: Batch, index: int) -> None:
        """Wrap accuracy on validation frames, and a picture of the first of them."""
        sensed, truth = batch
        predicted_m = self.predict(sensed).distance_m
        right, scored = wrap_hits(predicted_m, truth.distance_m, self.config)
        accuracy = (right & truth.known).sum() / (scored & truth.known).sum().clamp(min=1)
        # Lightning averages over batches, weighted by `batch_size`.
        self.log("wrap_accuracy", accuracy, prog_bar=True, batch_size=len(sensed))
        # The loader hands out the same frames each epoch: pictures can be compared.
        if index == 0 and isinstance(self.logger, TensorBoardLogger):
            depths = torch.cat((truth.distance_m[0], predicted_m[0]), dim=1) / self.config.clamp_m
            picture = torch.cat((sensed.gray[0], depths.clamp(0, 1)), dim=1).float().cpu()
            self.logger.experiment.add_image(
                "gray, true and predicted depth", picture[None], self.current_epoch
            )

    def transfer_batch_to_device(
        self, batch: Batch, device: torch.device, dataloader_idx: int
    ) -> Batch:
        """Lightning does not know how to move frozen dataclasses."""
        return on_device(batch, device)

    def _seed_of(self, stream: int) -> int:
        """A seed for a purpose in this step, independent of those of other purposes and steps."""
        words = (self.config.seed, stream, self.global_step)
        # torch takes signed seeds: 63 of the 64 bits.
        return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0] >> 1)

    def configure_optimizers(self) -> OptimizerLRScheduler:
        """AdamW; the rate rises linearly over the warm-up, then falls linearly to the end."""
        config = self.config
        optimizer = torch.optim.AdamW(
            self.network.parameters(),
            config.learning_rate,
            weight_decay=config.weight_decay,
            fused=True,  # A third of the time, which is a fifth of a step with few frames.
        )
        # One more than the warm-up: no step is taken at rate 0, which would teach nothing.
        warmup = int(config.warmup_share * self.steps)
        final = config.final_learning_rate / config.learning_rate

        def factor(step: int) -> float:
            if step < warmup:
                return (step + 1) / (warmup + 1)
            return 1 + (final - 1) * min(1.0, (step - warmup) / max(1, self.steps - warmup))

        schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, factor)
        return {
            "optimizer": optimizer,
            "lr_scheduler": {"scheduler": schedule, "interval": "step"},
        }

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Note the configuration, so that no other one continues from here."""
        checkpoint["train_config"] = self.config.model_dump_json()

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Refuse the checkpoint of another configuration."""
        if checkpoint.get("train_config") != self.config.model_dump_json():
            raise ValueError(
                "the checkpoint was made with another configuration; start afresh with "
                "resume=False, or write to another folder"
            )


def wrap_hits(predicted_m: Tensor, truth_m: Tensor, config: TrainConfig) -> tuple[Tensor, Tensor]:
    """Pixels [B, H, W] in the right wrap, were the phase free of noise, and pixels that are scored.

    The wrap is that of the nearest-candidate merge; scored is what lies within `max_range_m`.

    Examples
    --------
    >>> truth_m = torch.tensor([10.0, 10.0, 29.0])
    >>> wrap_hits(torch.tensor([13.0, 13.3, 29.0]), truth_m, TrainConfig())
    (tensor([ True, False, False]), tensor([ True,  True, False]))
    """
    scored = truth_m <= config.max_range_m
    unambiguous_m = config.settings.unambiguous_m
    wraps = nearest_wraps(predicted_m, truth_m % unambiguous_m, unambiguous_m)
    return scored & (wraps == (truth_m / unambiguous_m).floor()), scored


def train(
    config: TrainConfig,
    sources: Callable[[str], Source],
    out: Path,
    *,
    resume: bool = True,
    progress: bool = True,
) -> Path:
    """Train a network and write it to `out`.

    Parameters
    ----------
    config : TrainConfig
        What to train, and how.
    sources : callable
        Gives the frames of the splits "train", "validation" and "test".
    out : Path
        Folder that gets `<network>.safetensors`, `<network>.json` with the numbers measured on the
        test frames, `<network>.ckpt`, the state after the last finished epoch, and `tensorboard/`.
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
        The frames are unusable, or the checkpoint belongs to another configuration.
    KeyboardInterrupt
        Ctrl-C; the checkpoint is kept.
    """
    frames, validation, device = sources("train"), sources("validation"), training_device()
    if device.type == "cpu":
        keep_freed_memory()  # For the rest of the process.
    shots, size = config.shown_shots, config.batch_size
    order = EpochShuffle(len(frames), size, shots, config.seed)
    judged = in_order(validation, size, shots, draw=JUDGED_DRAW)
    module = TrainingModule(config, frames.sensor, steps=config.epochs * len(order))
    checkpoint = out / f"{config.network}.ckpt"
    threads = acquiring_threads(device)
    judging = loader(validation, judged, threads=threads)
    with _quiet_lightning(), _ctrl_c_raises():
        _trainer(config, out, progress, len(order)).fit(
            module,
            loader(frames, order, threads=threads),
            judging,
            ckpt_path=str(checkpoint) if resume and checkpoint.is_file() else None,
            weights_only=True,  # Nothing in a checkpoint is unpickled.
        )
    # Confidences are calibrated on frames that the weights have not seen.
    module.eval().to(device)
    module.network.calibrate((on_device(batch, device) for batch in judging), validation.sensor)
    return _write(module, sources("test"), out)


def _trainer(config: TrainConfig, out: Path, progress: bool, steps: int) -> lightning.Trainer:
    """Lightning's trainer, for epochs of so many `steps`."""
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
        devices=1,
    )


@contextmanager
def _quiet_lightning() -> Iterator[None]:
    """Silence Lightning's `ADVICE`, and what it logs below warnings, inside the context."""
    log = logging.getLogger("lightning.pytorch")
    level = log.level
    with warnings.catch_warnings():
        for advice in ADVICE:
            warnings.filterwarnings("ignore", advice)
        log.setLevel(logging.WARNING)
        try:
            yield
        finally:
            log.setLevel(level)


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


def _write(module: TrainingModule, test: Source, out: Path) -> Path:
    """Write the weights, then the numbers measured with them."""
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
    numbers = {"config": config.model_dump(mode="json"), "test": measure(module, test)}
    write_json(path.with_suffix(".json"), numbers)
    return path


@torch.inference_mode()
def measure(module: TrainingModule, source: Source) -> dict[str, Any]:
    """Wrap accuracy and mean depth error of the prediction itself, in all and per family.

    `wrap_accuracy` is that of the nearest-candidate merge without noise, `floor_wrap_accuracy` that
    of eq. 6, `mae_m` the prediction's own error; all over pixels within the scored range, and over
    all numbers of samples that the network was trained with.
    """
    config, device = module.config, training_device()
    module = module.eval().to(device)
    orders = in_order(source, 1, config.shown_shots, draw=JUDGED_DRAW)
    judging = loader(source, orders, threads=acquiring_threads(device))
    sums: dict[str, Tensor] = {}
    for order, batch in zip(orders, judging, strict=True):
        sensed, truth = on_device(batch, device)
        counts = _counts(module.predict(sensed).distance_m, truth, config)
        for key in (source.families[order.numbers[0]], "all"):
            sums[key] = sums.get(key, torch.zeros(4, dtype=torch.float64)) + counts
    # Sums of pixels, divided once at the end: frames with few scored pixels weigh little.
    names = ("wrap_accuracy", "floor_wrap_accuracy", "mae_m")
    shares = {key: (total[1:] / total[0]).tolist() for key, total in sums.items()}
    families = {key: dict(zip(names, value, strict=True)) for key, value in shares.items()}
    return {**families.pop("all"), "frames": len(source), "families": families}


def _counts(predicted_m: Tensor, truth: Truth, config: TrainConfig) -> Tensor:
    """Scored pixels, those in the right wrap by either merge, and the sum of errors."""
    right, scored = (
        pixels & truth.known for pixels in wrap_hits(predicted_m, truth.distance_m, config)
    )
    unambiguous_m = config.settings.unambiguous_m
    floored = scored & (predicted_m // unambiguous_m == truth.distance_m // unambiguous_m)
    error = ((predicted_m - truth.distance_m).abs() * scored).sum()
    return torch.stack((scored.sum(), right.sum(), floored.sum(), error)).double().cpu()
