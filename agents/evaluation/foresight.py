"""What a scheduler could foresee of each action's error, from what the sensor tells it.

A small network is trained on the known errors of every action in training drives. Told what the
last frame's shorter acquisitions were found to lose, or not, it says what looking is worth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor, nn

from agents.optimum import Possible
from shotenv.decision import SEEN_FEATURES
from unwrap.signal import Shots

LOOKING: Final = ("two_from_four", "regret_of_two", "regret_of_four")
"""Features that compare an acquisition with the shorter ones that it holds."""
# The numbers of the training are assumed.
NETWORKS: Final = 3
PASSES: Final = 40
BATCH: Final = 512
HIDDEN: Final = 64
RATE: Final = 3e-3
WEIGHT_DECAY: Final = 0.03


@dataclass(frozen=True)
class Foresight:
    """Networks that foresee errors, and the scales of what they are shown."""

    networks: tuple[nn.Module, ...]
    mean: Tensor
    spread: Tensor
    looking: bool

    @torch.inference_mode()
    def errors(self, possible: Possible) -> np.ndarray:
        """Foreseen error term of each action, up to what is common to all, float64 [N, T, A]."""
        shown = (shown_before(possible, looking=self.looking) - self.mean) / self.spread
        found = torch.stack([network(shown) for network in self.networks]).mean(dim=0)
        return found.double().numpy()


def shown_before(possible: Possible, *, looking: bool) -> Tensor:
    """What is known before each frame, float32 [N, T, D].

    The scene, the drive's settings, and what 2 DCS of the frame before told; with `looking` also
    what its 8 DCS showed of 2 and 4.
    """
    scenes = possible.problem.scenes.features
    names = [feature.name for feature in SEEN_FEATURES]
    by_two = [
        place for place, feature in enumerate(SEEN_FEATURES) if feature.least_shots == Shots.TWO
    ]
    by_eight = [names.index(name) for name in LOOKING]
    rows = []
    for drive, outcome in zip(possible.drives, possible.outcomes, strict=True):
        frames = drive.frames[0, : len(outcome.features)]
        settings = torch.cat([drive.laser_power_w, drive.integration_s]).log().float()
        told = outcome.features[:, Shots.TWO.action, by_two]
        if looking:
            told = torch.cat((told, outcome.features[:, Shots.EIGHT.action, by_eight]), dim=1)
        # Nothing is known of a frame before the first.
        before = torch.cat((torch.zeros_like(told[:1]), told[:-1]))
        rows.append(torch.cat((scenes[frames], settings.expand(len(frames), -1), before), dim=1))
    return torch.stack(rows)


def foresee(possible: Possible, *, looking: bool) -> Foresight:
    """Train networks to foresee the errors of each action in the drives of `possible`."""
    shown = shown_before(possible, looking=looking).flatten(0, 1)
    error = torch.stack([one.terms["error"] for one in possible.outcomes]).flatten(0, 1).float()
    # How hard a frame is says nothing about what to choose in it.
    target = error - error.mean(dim=1, keepdim=True)
    mean, spread = shown.mean(dim=0), shown.std(dim=0).clamp(min=1e-6)
    shown, scale = (shown - mean) / spread, target.std().clamp(min=1e-9)
    networks = tuple(_trained(shown, target / scale, seed=seed) for seed in range(NETWORKS))
    return Foresight(
        tuple(nn.Sequential(network, _Times(float(scale))) for network in networks),
        mean,
        spread,
        looking,
    )


class _Times(nn.Module):
    """A constant factor."""

    def __init__(self, factor: float) -> None:
        super().__init__()
        self._factor = factor

    def forward(self, values: Tensor) -> Tensor:
        return values * self._factor


def _trained(shown: Tensor, target: Tensor, *, seed: int) -> nn.Module:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = nn.Sequential(
            nn.Linear(shown.shape[1], HIDDEN),
            nn.Tanh(),
            nn.Linear(HIDDEN, HIDDEN),
            nn.Tanh(),
            nn.Linear(HIDDEN, target.shape[1]),
        )
    generator = torch.Generator().manual_seed(seed)
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=WEIGHT_DECAY)
    steps = PASSES * -(-len(shown) // BATCH)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for _ in range(PASSES):
        for rows in torch.randperm(len(shown), generator=generator).split(BATCH):
            loss = nn.functional.mse_loss(network(shown[rows]), target[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
    return network
