"""What a step of a training does: network, loss, optimiser and schedule, as Lightning wants it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import lightning
import numpy as np
import torch
from lightning.pytorch.loggers import TensorBoardLogger
from lightning.pytorch.utilities.types import OptimizerLRScheduler
from torch import Tensor

from unwrap.depth import nearest_wraps
from unwrap.networks import Prediction, autocast
from unwrap.signal import Sensed, SensorDescription
from unwrap.support import on_device
from unwrap.training.config import TrainConfig
from unwrap.training.data import Batch
from unwrap.training.ranks import ALONE, Ranks, Share

AUGMENTATION_STREAM = 1
"""Word in the seed of the augmentation, so that it differs from other seeds of the same step."""
NETWORK_STREAM = 2
"""The same for what a network's `as_trained_on` draws."""


class TrainingModule(lightning.LightningModule):
    """Network, loss, optimiser and schedule, as Lightning wants them.

    Parameters
    ----------
    config : TrainConfig
    sensor : SensorDescription
        What delivers the frames.
    steps : int
        Of the whole training.
    ranks : Ranks
        Which of the processes that train together this is.
    frames, judged : int
        Training frames and validation batches of all processes; where there is one alone its
        batches tell.

    Attributes
    ----------
    restoring : bool
        Whether a checkpoint is being taken over just now.
    """

    def __init__(
        self,
        config: TrainConfig,
        sensor: SensorDescription,
        steps: int,
        *,
        ranks: Ranks = ALONE,
        frames: int = 0,
        judged: int = 0,
    ):
        super().__init__()
        self.config, self.sensor, self.steps = config, sensor, steps
        self.ranks, self.frames, self.judged = ranks, frames, judged
        self.restoring = False
        self.network = config.build().to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, sensed: Sensed) -> Tensor:
        """The network's output for a batch of frames."""
        with autocast(sensed.gray.device):
            return self.network(self.network.features(sensed, self.sensor))

    def predict(self, sensed: Sensed) -> Prediction:
        """Distance and confidence of a batch of frames."""
        return self.network.predict(self(sensed), sensed, self.sensor)

    def training_step(self, batch: Batch, index: int) -> Tensor:
        """Loss of one augmented batch, or of a share of it.

        All that is random in it follows from seed, step and the frames' places in the batch: a
        training that was resumed draws what one that was not interrupted does, and processes with
        a share each draw what one with the whole batch does.
        """
        share = self._share(len(batch[0]), index)
        generator = torch.Generator().manual_seed(self._seed_of(AUGMENTATION_STREAM))
        sensed, truth = self.config.augmentation(*batch, generator=generator, share=share)
        generator = torch.Generator(sensed.gray.device)
        draw = share.draw(generator.manual_seed(self._seed_of(NETWORK_STREAM)))
        sensed = self.network.as_trained_on(sensed, draw)
        weights = replace(self.config.loss_weights, total=self.ranks.total)
        loss = self.network.loss(self(sensed), sensed, truth, self.sensor, weights)
        whole = self.ranks.total(loss.detach())
        self.log("loss", whole, prog_bar=True, batch_size=len(sensed))
        # Lightning gives the mean of the processes' gradients, where their sum is meant.
        return loss if self.ranks.alone else self.ranks.processes * loss

    def _share(self, own: int, index: int) -> Share:
        """What this process, which has `own` frames, has of the training batch `index`."""
        if self.ranks.alone:
            return Share(own)
        size = self.config.batch_size
        return self.ranks.share(min(size, self.frames - index * size))

    def on_train_start(self) -> None:
        """Refuse to train with processes that do not continue from the same step."""
        self.restoring = False
        steps = self.ranks.pooled([self.global_step])
        if len(set(steps)) > 1:
            raise ValueError(
                f"the processes continue from steps {', '.join(map(str, steps))}; expected a "
                "folder of results whose checkpoint all nodes see"
            )

    def validation_step(self, batch: Batch, index: int) -> None:
        """Wrap accuracy on validation frames, and a picture of the first of them."""
        sensed, truth = batch
        predicted_m = self.predict(sensed).distance_m
        right, scored = wrap_hits(predicted_m, truth.distance_m, self.config)
        accuracy = (right & truth.known).sum() / (scored & truth.known).sum().clamp(min=1)
        # Lightning averages over the batches of all processes, weighted by `batch_size`.
        weight = self._validation_weight(len(sensed), index)
        together = not self.ranks.alone
        self.log("wrap_accuracy", accuracy, prog_bar=True, batch_size=weight, sync_dist=together)
        # The loader hands out the same frames each epoch: pictures can be compared.
        if index == 0 and isinstance(self.logger, TensorBoardLogger):
            depths = torch.cat((truth.distance_m[0], predicted_m[0]), dim=1) / self.config.clamp_m
            picture = torch.cat((sensed.gray[0], depths.clamp(0, 1)), dim=1).float().cpu()
            self.logger.experiment.add_image(
                "gray, true and predicted depth", picture[None], self.current_epoch
            )

    def _validation_weight(self, frames: int, index: int) -> int:
        """What a process's validation batch `index` counts among those of all."""
        if self.ranks.alone:
            return frames
        # All have as many batches, with one that does not count for who was dealt one less.
        dealt = index * self.ranks.processes + self.ranks.rank
        # A multiple, since Lightning rounds the mean of the processes' weights to whole numbers.
        return frames * self.ranks.processes if dealt < self.judged else 0

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
        """Take network, optimiser, schedule and progress alone; see `require_checkpoint`."""
        self.restoring = True
        # Those of the callbacks name files, which would be deleted as older checkpoints.
        checkpoint.pop("callbacks", None)


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
