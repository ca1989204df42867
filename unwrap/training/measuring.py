"""How well a network that was trained does on frames that it was not trained on."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from unwrap.signal import Truth
from unwrap.support import on_device
from unwrap.training.config import TrainConfig
from unwrap.training.data import Source, acquiring_threads, in_order, loader, training_device
from unwrap.training.module import TrainingModule, wrap_hits

JUDGED_DRAW = 0
"""Draw of the noise that networks are validated and tested on; no epoch of training sees it."""


@torch.inference_mode()
def measure(module: TrainingModule, source: Source) -> dict[str, Any]:
    """Wrap accuracy and mean depth error of the prediction itself, in all and per family.

    `wrap_accuracy` is that of the nearest-candidate merge without noise, `floor_wrap_accuracy` that
    of eq. 6, `mae_m` the prediction's own error; all over pixels within the scored range, and over
    all numbers of samples that the network was trained with. Processes that trained together
    measure a share of the frames each.
    """
    config, device = module.config, training_device()
    module = module.eval().to(device)
    orders = list(module.ranks.own(in_order(source, 1, config.shown_shots, draw=JUDGED_DRAW)))
    judging = loader(source, orders, threads=acquiring_threads(device))
    sums: dict[str, Tensor] = {}
    for order, batch in zip(orders, judging, strict=True):
        sensed, truth = on_device(batch, device)
        counts = _counts(module.predict(sensed).distance_m, truth, config)
        for key in (source.families[order.numbers[0]], "all"):
            sums[key] = sums.get(key, torch.zeros(4, dtype=torch.float64)) + counts
    totals: dict[str, Tensor] = {}
    for part in module.ranks.pooled([sums]):
        for key, counts in part.items():
            totals[key] = totals.get(key, 0) + counts
    # Sums of pixels, divided once at the end: frames with few scored pixels weigh little.
    names = ("wrap_accuracy", "floor_wrap_accuracy", "mae_m")
    shares = {key: (total[1:] / total[0]).tolist() for key, total in totals.items()}
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
