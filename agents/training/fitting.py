"""Networks fitted to what each action is worth: several of them, averaged into one.

The data are few clips, which networks learn by heart within a few passes. So each sees the frame
with noise, is judged after every pass on frames of other clips, and is kept as it was then at its
best; and scores are the mean over several networks. Without hidden layers it is a ridge regression
(Hoerl and Kennard, Technometrics 12, 1970), which is solved: what networks have to beat.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor, nn

from agents.config import AgentConfig
from agents.policies import linear_layers, mean_network, rescaled_network, score_network
from shotenv.decision import FEATURE_NAMES, SCENE_FEATURES, SEEN_FEATURES, feature_index

SHOWN: Final = len(SCENE_FEATURES) + len(SEEN_FEATURES)
"""Features at the front of the observation that tell the scene, by which a clip is known again; the
others tell the state of the drive, such as the price, and are given as they are."""
PENALTIES: Final = (1e-4, 1e-3, 1e-2, 1e-1, 1.0)
"""Of a ridge regression's weights, of features and targets with variance 1 (assumed)."""


@dataclass(frozen=True)
class Frames:
    """Frames in which it is known what each action is worth.

    Attributes
    ----------
    observations : float32 [N, D]
    worth : float32 [N, 3]
        Discounted reward of each action and of what follows it.
    """

    observations: Tensor
    worth: Tensor

    @classmethod
    def of(cls, observations: np.ndarray, worth: np.ndarray) -> Frames:
        """Frames of arrays [..., D] and [..., 3]."""
        flat = [part.reshape(-1, part.shape[-1]) for part in (observations, worth)]
        return cls(*(torch.from_numpy(np.ascontiguousarray(part, np.float32)) for part in flat))

    @classmethod
    def together(cls, parts: Sequence[Frames]) -> Frames:
        """All frames of `parts`, in order."""
        observations, worth = ([getattr(one, name) for one in parts] for name in vars(parts[0]))
        return cls(torch.cat(observations), torch.cat(worth))


def regret(network: nn.Module, frames: Frames) -> float:
    """How much less the actions that `network` scores highest are worth than the best ones."""
    with torch.inference_mode():
        chosen = network(frames.observations).argmax(dim=1, keepdim=True)
    lost = frames.worth.max(dim=1, keepdim=True).values - frames.worth.gather(1, chosen)
    return float(lost.mean(dtype=torch.float64))


def fit(training: Frames, judging: Frames, config: AgentConfig, *, seed: int) -> nn.Sequential:
    """A network whose scores are what each action is worth, beside the mean of all three.

    The result depends on the arguments alone.

    Parameters
    ----------
    training : Frames
        What the members are fitted to.
    judging : Frames
        Frames of other clips, which choose the pass after which each member is kept, or the penalty
        of a ridge regression.
    """
    seen = training.observations
    # Where a feature hardly differs in training, other drives must not be blown up.
    mean, spread = seen.mean(dim=0), seen.std(dim=0).clamp(min=1e-3)
    # How hard a frame is does not tell what to choose in it.
    worth = training.worth - training.worth.mean(dim=1, keepdim=True)
    scale = float(worth.std().clamp(min=1e-9))
    shown, target = (seen - mean) / spread, worth / scale
    # At its mean a feature tells nothing, and its weights stay 0: nor does it in play.
    unseen = [feature_index(FEATURE_NAMES, name) for name in config.regression.unseen]
    shown[:, unseen] = 0.0
    judged = Frames((judging.observations - mean) / spread, judging.worth)
    if not config.hidden:
        return rescaled_network(_ridge(shown, target, judged), mean, spread, scale)
    members = [
        _member(shown, target, judged, config, seed=seed * config.regression.members + number)
        for number in range(config.regression.members)
    ]
    return rescaled_network(mean_network(members), mean, spread, scale)


def _ridge(shown: Tensor, target: Tensor, judged: Frames) -> nn.Sequential:
    """The linear scores whose penalty loses least on the judging frames."""
    features, wanted = shown.double(), target.double()
    # Features have mean 0, so that the intercept is the mean of the targets, and not penalised.
    gram, moment = (features.T @ each / len(features) for each in (features, wanted))
    found = []
    for penalty in PENALTIES:
        eye = torch.eye(len(gram), dtype=gram.dtype)
        weight = torch.linalg.solve(gram + penalty * eye, moment)
        network = score_network(weight.shape, "tanh")
        layer = linear_layers(network)[0]
        with torch.no_grad():
            layer.weight.copy_(weight.T)
            layer.bias.copy_(wanted.mean(dim=0))
        found.append(network)
    return min(found, key=lambda network: regret(network, judged))


def _member(
    shown: Tensor, target: Tensor, judged: Frames, config: AgentConfig, *, seed: int
) -> nn.Sequential:
    learner = config.regression
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = score_network((shown.shape[1], *config.hidden, target.shape[1]), "tanh")
    unseen = [feature_index(FEATURE_NAMES, name) for name in learner.unseen]
    with torch.no_grad():
        linear_layers(network)[0].weight[:, unseen] = 0.0
    generator = torch.Generator().manual_seed(seed)
    optimizer = torch.optim.AdamW(
        network.parameters(), learner.learning_rate, weight_decay=learner.weight_decay
    )
    steps = learner.passes * -(-len(shown) // learner.batch_size)
    # The rate falls along a cosine to 0 over all steps.
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    best, least = network.state_dict(), np.inf
    for _ in range(learner.passes):
        for rows in torch.randperm(len(shown), generator=generator).split(learner.batch_size):
            noisy = shown[rows]
            noisy[:, :SHOWN] += learner.noise * torch.randn(
                noisy[:, :SHOWN].shape, generator=generator
            )
            noisy[:, unseen] = 0.0
            scores = network(noisy)
            loss = nn.functional.mse_loss(scores, target[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
        lost = regret(network, judged)
        if lost < least:
            least, best = lost, {k: value.clone() for k, value in network.state_dict().items()}
    network.load_state_dict(best)
    return network
