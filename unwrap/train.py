"""Training of TofRegNet and TofSegNet on a rendered bank: one call, resumable.

`train` reads from top to bottom: data, module, trainer, weights file, measured numbers. A run that
was killed or interrupted loses the epoch it was in; started again, it gives the same weights as a
run that was not.
"""

from __future__ import annotations

import logging
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import lightning
import numpy as np
import torch
from lightning.pytorch.callbacks import ModelCheckpoint, TQDMProgressBar
from lightning.pytorch.utilities.types import OptimizerLRScheduler
from pydantic import BaseModel, ConfigDict, Field
from torch import Tensor
from torch.nn import functional
from torch.utils.data import DataLoader

from unwrap.data import Augmentation, BankFrames, EpochShuffle, SplitBy
from unwrap.files import write_json
from unwrap.losses import EQUATION_7, regression_loss, wrap_loss
from unwrap.merge import nearest_wraps
from unwrap.nets import Autoencoder, TofRegNet, TofSegNet, autocast, class_depth_m
from unwrap.phase import unambiguous_range_m
from unwrap.unwrapper import load_unwrapper
from unwrap.weights import save_weights

AUGMENTATION_STREAM = 1
"""Second word of the augmentation generator's seed, apart from the one that orders the frames."""

ADVICE = (
    ".*does not have many workers.*",
    ".*exists and is not empty.*",
    ".*Trying to infer the `batch_size`.*",
    ".*LeafSpec.* is deprecated.*",
)
"""Lightning's warnings that do not fit here."""


class TrainConfig(BaseModel):
    """Training of an unwrapping network."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    network: Literal["tofregnet", "tofsegnet"] = Field("tofregnet", description="which network")
    bank: str = Field("training", description="name or path of the bank to train on")
    split_by: SplitBy = Field(
        "clip", description="whole clips, or the paper's random split of frames"
    )
    width: int = Field(32, ge=4, le=128, description="channels of the first ResNet stage")
    classes: int = Field(5, ge=2, le=16, description="wrap classes of tofsegnet")
    f1_hz: float = Field(24e6, gt=0, description="frequency whose wraps are predicted, Hz")
    max_range_m: float = Field(25.0, gt=0, description="range that is scored, m")
    clamp_m: float = Field(30.0, gt=0, description="truth beyond, and the sky, counts as this, m")
    epochs: int = Field(40, ge=1, description="passes over the training frames")
    batch_size: int = Field(32, ge=1, description="frames per step")
    learning_rate: float = Field(3e-3, gt=0, description="highest learning rate")
    final_learning_rate: float = Field(1e-6, ge=0, description="learning rate at the last step")
    warmup_share: float = Field(0.1, ge=0, lt=1, description="share of steps that rise linearly")
    weight_decay: float = Field(0.01, ge=0, description="decoupled decay; 0 is plain Adam")
    equation_7_weight: float = Field(1.0, ge=0, description="weight of the paper's loss, eq. 7")
    equation_7_mean_share: float = Field(
        0.85, ge=0, le=1, description="lambda of L_SI; the paper's 1 leaves the mean error free"
    )
    wrap_weight: float = Field(1.0, ge=0, description="weight of our wrap loss; 0 as in the paper")
    flip_horizontal: bool = Field(True, description="mirror left and right")
    flip_vertical: bool = Field(False, description="mirror up and down, as the paper does too")
    contrast: float = Field(0.2, ge=0, description="largest relative change of gamma")
    brightness: float = Field(0.3, ge=0, description="largest relative change of gain")
    seed: int = Field(0, ge=0, description="seed of weights, order and augmentation")
    start_from: str | None = Field(
        None, description="name or path of a network whose layers of equal shape are taken over"
    )

    @property
    def unambiguous_m(self) -> float:
        """Width of a wrap, metres."""
        return unambiguous_range_m(self.f1_hz)

    @property
    def augmentation(self) -> Augmentation:
        """How training images are varied."""
        return Augmentation(
            self.flip_horizontal, self.flip_vertical, self.contrast, self.brightness
        )

    def build(self) -> Autoencoder:
        """The network, with weights drawn from `seed`."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.seed)
            if self.network == "tofregnet":
                network: Autoencoder = TofRegNet(self.width, self.clamp_m)
            else:
                network = TofSegNet(self.width, self.classes)
        if self.start_from is not None:
            take_over(network, load_unwrapper(self.start_from).network)
        return network


def take_over(network: Autoencoder, other: Autoencoder) -> None:
    """Copy the layers of `other` that have the same name and shape in `network`.

    Raises
    ------
    ValueError
        There is none, as the widths differ.
    """
    own = network.state_dict()
    shared = {
        name: tensor
        for name, tensor in other.state_dict().items()
        if name in own and own[name].shape == tensor.shape and tensor.ndim > 0
    }
    if not shared:
        raise ValueError(f"start_from has width {other.width}; expected {network.width}")
    network.load_state_dict({**own, **shared})


def wrap_classes(depth_m: Tensor, unambiguous_m: float, classes: int) -> Tensor:
    """Wrap class floor(depth / unambiguous range) of each pixel, the last one for all beyond."""
    return (depth_m / unambiguous_m).long().clamp(0, classes - 1)


def loss_of(output: Tensor, depth_m: Tensor, config: TrainConfig) -> Tensor:
    """Training loss of a network's output: cross entropy, or eq. 7 and our wrap loss."""
    if config.network == "tofsegnet":
        truth = wrap_classes(depth_m, config.unambiguous_m, config.classes)
        return functional.cross_entropy(output, truth)
    paper = regression_loss(
        output,
        depth_m,
        range_m=config.clamp_m,
        weights=EQUATION_7,
        mean_share=config.equation_7_mean_share,
    )
    ours = wrap_loss(output, depth_m, config.unambiguous_m)
    return config.equation_7_weight * paper + config.wrap_weight * ours


def predicted_depth_m(output: Tensor, config: TrainConfig) -> Tensor:
    """Depth [B, H, W] of a network's output: itself, or what its classes stand for."""
    if config.network == "tofregnet":
        return output
    return class_depth_m(output, config.unambiguous_m)


class TrainingModule(lightning.LightningModule):
    """Network, loss, optimiser and schedule, as Lightning wants them."""

    def __init__(self, config: TrainConfig, steps: int):
        super().__init__()
        self.config = config
        self.steps = steps
        self.network = config.build().to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, gray: Tensor) -> Tensor:
        """gray [B, 1, H, W] in [0, 1] -> the network's output."""
        with autocast(gray.device):
            return self.network(gray)

    def training_step(self, batch: tuple[Tensor, Tensor], _: int) -> Tensor:
        """Loss of one augmented batch."""
        key = (self.config.seed, AUGMENTATION_STREAM, self.global_step)
        generator = torch.Generator().manual_seed(_seed_of(key))
        gray, depth_m = self.config.augmentation(*batch, generator=generator)
        loss = loss_of(self(gray), depth_m, self.config)
        self.log("loss", loss.detach(), prog_bar=True)
        return loss

    def validation_step(self, batch: tuple[Tensor, Tensor], _: int) -> None:
        """Wrap accuracy on validation clips, for the progress bar."""
        gray, depth_m = batch
        right, scored = wrap_hits(predicted_depth_m(self(gray), self.config), depth_m, self.config)
        accuracy = right.sum() / scored.sum().clamp(min=1)
        self.log("wrap_accuracy", accuracy, prog_bar=True, batch_size=len(gray))

    def configure_optimizers(self) -> OptimizerLRScheduler:
        """AdamW; the rate rises linearly over the warm-up, then falls linearly to the end."""
        config = self.config
        optimizer = torch.optim.AdamW(
            self.network.parameters(), config.learning_rate, weight_decay=config.weight_decay
        )
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


def _seed_of(key: tuple[int, ...]) -> int:
    """One 63-bit seed from several words."""
    return int(np.random.SeedSequence(key).generate_state(1, np.uint64)[0] >> 1)


def wrap_hits(predicted_m: Tensor, truth_m: Tensor, config: TrainConfig) -> tuple[Tensor, Tensor]:
    """Which pixels the nearest-candidate merge puts right without noise, and which are scored."""
    scored = truth_m <= config.max_range_m
    wrapped_m = truth_m % config.unambiguous_m
    wraps = nearest_wraps(predicted_m, wrapped_m, config.unambiguous_m)
    return scored & (wraps == (truth_m / config.unambiguous_m).floor()), scored


def train(
    config: TrainConfig, bank: Path, out: Path, *, resume: bool = True, progress: bool = True
) -> Path:
    """Train a network on the clips of `bank` and write it to `out`.

    Parameters
    ----------
    config : TrainConfig
        What to train, and how.
    bank : Path
        Folder of a rendered bank with training, validation and test clips.
    out : Path
        Folder that gets `<network>.safetensors`, `<network>.json` with the numbers measured on the
        test clips, and `<network>.ckpt`, the state after the last finished epoch.
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
        The bank is unusable, or the checkpoint belongs to another configuration.
    KeyboardInterrupt
        Ctrl-C; the checkpoint is kept.
    """
    frames = BankFrames(bank, "train", config.clamp_m, by=config.split_by)
    validation = BankFrames(bank, "validation", config.clamp_m, by=config.split_by)
    steps = config.epochs * -(-len(frames) // config.batch_size)
    module = TrainingModule(config, steps)
    checkpoint = out / f"{config.network}.ckpt"
    with _quiet_lightning(), _interruptible():
        trainer = _trainer(config, out, progress)
        trainer.fit(
            module,
            DataLoader(frames, config.batch_size, sampler=EpochShuffle(len(frames), config.seed)),
            DataLoader(validation, config.batch_size),
            ckpt_path=str(checkpoint) if resume and checkpoint.is_file() else None,
            weights_only=True,
        )
    return _write(module, bank, out)


def _trainer(config: TrainConfig, out: Path, progress: bool) -> lightning.Trainer:
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
        logger=False,
        devices=1,
    )


@contextmanager
def _quiet_lightning() -> Iterator[None]:
    """Silence advice that does not fit: workers do not pay off on few cores, and the like."""
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
def _interruptible() -> Iterator[None]:
    """Turn the exit that Lightning makes of Ctrl-C back into KeyboardInterrupt."""
    handler = signal.getsignal(signal.SIGINT)
    try:
        yield
    except SystemExit:
        signal.signal(signal.SIGINT, handler)
        raise KeyboardInterrupt from None


def _write(module: TrainingModule, bank: Path, out: Path) -> Path:
    """Write the weights, then the numbers measured with them."""
    config = module.config
    network = module.network.eval()
    path = out / f"{config.network}.safetensors"
    metadata = {
        "network": config.network,
        "width": config.width,
        "classes": config.classes,
        "range_m": config.clamp_m,
        "f1_hz": config.f1_hz,
        "bank": bank.name,
        "config": config.model_dump(),
    }
    save_weights(path, network, metadata)
    numbers = {"config": config.model_dump(), "test": measure(module, bank)}
    write_json(path.with_suffix(".json"), numbers)
    return path


@torch.inference_mode()
def measure(module: TrainingModule, bank: Path, split: str = "test") -> dict[str, Any]:
    """Noise-free wrap accuracy and mean depth error on the clips of a split, and per family.

    `wrap_accuracy` is that of the nearest-candidate merge, `floor_wrap_accuracy` that of eq. 6,
    `mae_m` the prediction's own error; all over pixels within the scored range.
    """
    config = module.config
    frames = BankFrames(bank, split, config.clamp_m, by=config.split_by)
    module = module.eval().to("cpu")
    sums: dict[str, Tensor] = {}
    for family, (gray, depth_m) in zip(frames.families, DataLoader(frames), strict=True):
        predicted_m = predicted_depth_m(module(gray), config)
        right, scored = wrap_hits(predicted_m, depth_m, config)
        unambiguous = config.unambiguous_m
        floored = scored & ((predicted_m // unambiguous) == (depth_m // unambiguous))
        error = ((predicted_m - depth_m).abs() * scored).sum()
        counts = torch.stack((scored.sum(), right.sum(), floored.sum(), error)).double()
        for key in (family, "all"):
            sums[key] = sums.get(key, torch.zeros(4, dtype=torch.float64)) + counts
    names = ("wrap_accuracy", "floor_wrap_accuracy", "mae_m")
    shares = {key: (total[1:] / total[0]).tolist() for key, total in sums.items()}
    families = {key: dict(zip(names, value, strict=True)) for key, value in shares.items()}
    return {**families.pop("all"), "frames": len(frames), "families": families}
