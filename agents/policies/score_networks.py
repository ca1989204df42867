"""Score networks: linear layers with one activation between, from features to a score per action.

What stable-baselines3 and sb3-contrib train for three actions is such a network with other things
around it. The functions here take it out, so that using it needs torch alone.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, Literal, cast

import numpy as np
import torch
from torch import nn

from agents.policies.policy import Observation
from unwrap.signal import Shots

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.dqn.policies import QNetwork

Activation = Literal["tanh", "relu"]
ACTIVATIONS: Final[dict[Activation, type[nn.Module]]] = {"tanh": nn.Tanh, "relu": nn.ReLU}


def score_network(layers: Sequence[int], activation: Activation) -> nn.Sequential:
    """Untrained network of the widths `layers`: features, hidden layers, actions.

    Examples
    --------
    >>> score_network((35, 64, 3), "relu")
    Sequential(
      (0): Linear(in_features=35, out_features=64, bias=True)
      (1): ReLU()
      (2): Linear(in_features=64, out_features=3, bias=True)
    )
    """
    modules: list[nn.Module] = []
    for inputs, outputs in pairwise(layers):
        modules += [nn.Linear(inputs, outputs), ACTIVATIONS[activation]()]
    return nn.Sequential(*modules[:-1])


def linear_layers(network: nn.Sequential) -> list[nn.Linear]:
    """The linear layers of a score network, in order."""
    return [module for module in network if isinstance(module, nn.Linear)]


def widths_of(network: nn.Sequential) -> tuple[int, ...]:
    """Widths of its layers, features first, actions last."""
    layers = linear_layers(network)
    return (layers[0].in_features, *(layer.out_features for layer in layers))


def activation_of(network: nn.Sequential) -> Activation:
    """The activation between its layers.

    Raises
    ------
    TypeError, ValueError
        It is not linear layers with biases and one activation, tanh or relu, between them.
    """
    if not isinstance(network, nn.Sequential):
        raise TypeError(f"network is {type(network).__name__}; expected an nn.Sequential")
    modules = list(network)
    between = {type(module) for module in modules[1::2]} or {nn.Tanh}
    linear = all(isinstance(m, nn.Linear) and m.bias is not None for m in modules[::2])
    for name, kind in ACTIVATIONS.items():
        if linear and len(modules) % 2 and between == {kind}:
            return name
    got = ", ".join(type(module).__name__ for module in modules)
    raise ValueError(
        f"network is {got or 'empty'}; expected linear layers with biases and tanh or relu between"
    )


def actor_network(policy: ActorCriticPolicy) -> nn.Sequential:
    """Logits of a stable-baselines3 actor (PPO, A2C): a copy of its own layers."""
    _require_plain(policy.features_extractor)
    return _copy_of(*policy.mlp_extractor.policy_net, policy.action_net)


def q_network(network: QNetwork) -> nn.Sequential:
    """Action values of stable-baselines3's DQN (`model.q_net`): a copy of its layers."""
    _require_plain(network.features_extractor)
    return _copy_of(*cast(nn.Sequential, network.q_net))


def mean_quantile_network(network: Any) -> nn.Sequential:
    """Mean over the quantiles of sb3-contrib's QR-DQN (`model.quantile_net`).

    The mean of linear functions is linear: it is folded into the last layer, whose outputs are the
    actions of the first quantile, then those of the second and so on.
    """
    _require_plain(network.features_extractor)
    return mean_of_quantiles(network.quantile_net, network.n_quantiles)


def mean_of_quantiles(network: nn.Sequential, quantiles: int) -> nn.Sequential:
    """The same network with the mean over the quantiles in its last layer; see there."""
    modules = list(_copy_of(*network))
    last = cast(nn.Linear, modules[-1])
    shape = quantiles, -1
    # In float64, rounded once.
    weight = last.weight.double().reshape(*shape, last.in_features).mean(dim=0)
    mean = _linear(weight, last.bias.double().reshape(shape).mean(dim=0))
    return nn.Sequential(*modules[:-1], mean)


def diagonal_blocks(layer: nn.Linear) -> int:
    """Most equal blocks along the diagonal outside of which a layer's weights are 0.

    Examples
    --------
    Four outputs of four inputs, where the first two read the first two inputs alone:

    >>> layer = nn.Linear(4, 4)
    >>> _ = layer.weight.data.copy_(torch.block_diag(torch.ones(2, 2), torch.ones(2, 2)))
    >>> diagonal_blocks(layer)
    2
    """
    outputs, inputs = layer.weight.shape
    for blocks in range(min(outputs, inputs), 1, -1):
        if outputs % blocks or inputs % blocks:
            continue
        block = torch.ones(outputs // blocks, inputs // blocks)
        outside = torch.block_diag(*[block] * blocks) == 0
        if not layer.weight[outside].any():
            return blocks
    return 1


def weights_in_blocks(layer: nn.Linear) -> torch.Tensor:
    """Weights of the `diagonal_blocks` of a layer, without the zeros: [B, O / B, I / B]."""
    blocks = diagonal_blocks(layer)
    outputs, inputs = layer.weight.shape
    each = layer.weight.detach().view(blocks, outputs // blocks, blocks, inputs // blocks)
    return torch.stack([each[n, :, n] for n in range(blocks)])


class BlockLinear(nn.Module):
    """A linear layer of `diagonal_blocks`, [N, I] to [N, O], that multiplies no zeros."""

    def __init__(self, layer: nn.Linear) -> None:
        super().__init__()
        # [B, I / B, O / B] and [B, 1, O / B].
        self.weight = weights_in_blocks(layer).transpose(1, 2).contiguous()
        self.bias = layer.bias.detach().view(len(self.weight), 1, -1)

    def forward(self, seen: torch.Tensor) -> torch.Tensor:
        """Outputs [N, O] of inputs [N, I]."""
        parts = seen.unflatten(1, (len(self.weight), -1)).transpose(0, 1)
        found = torch.baddbmm(self.bias, parts, self.weight)
        return found.transpose(0, 1).flatten(1)


def in_blocks(network: nn.Sequential) -> nn.Sequential:
    """A score network of [N, D] with each layer of several blocks as a `BlockLinear`."""
    return nn.Sequential(
        *(
            BlockLinear(module)
            if isinstance(module, nn.Linear) and diagonal_blocks(module) > 1
            else module
            for module in network
        )
    )


def mean_network(networks: Sequence[nn.Sequential]) -> nn.Sequential:
    """One network whose scores are the mean of those of `networks`, which are formed alike.

    Their hidden layers stand side by side, each reads its own alone, and the last takes the mean.

    Examples
    --------
    >>> members = [score_network((2, 4, 3), "tanh") for _ in range(5)]
    >>> widths_of(mean_network(members))
    (2, 20, 3)
    """
    depth, count = len(linear_layers(networks[0])), len(networks)
    merged = []
    for place, layers in enumerate(zip(*(linear_layers(one) for one in networks), strict=True)):
        weights, biases = ([getattr(one, part) for one in layers] for part in ("weight", "bias"))
        # All read the same features, and are summed into the same scores; between, blocks.
        weight = torch.cat(weights, 0) if place == 0 else torch.block_diag(*weights)
        bias = torch.cat(biases)
        if place == depth - 1:
            weight = torch.cat(weights, 1) / count if place else torch.stack(weights).mean(0)
            bias = torch.stack(biases).mean(0)
        merged.append(_linear(weight, bias))
    # As the first has it: linear layers in even places, the activation between.
    activations = list(networks[0])[1::2]
    pairs = zip(merged, [*activations, None], strict=True)
    return _copy_of(*(module for pair in pairs for module in pair if module is not None))


def rescaled_network(
    network: nn.Sequential, mean: torch.Tensor, spread: torch.Tensor, scale: float
) -> nn.Sequential:
    """`scale` times `network` of features (x - `mean`) / `spread`, as a network of x."""
    whole = _copy_of(*network)
    first, last = linear_layers(whole)[0], linear_layers(whole)[-1]
    with torch.no_grad():
        first.weight.div_(spread)
        first.bias.sub_(first.weight @ mean)
        last.weight.mul_(scale)
        last.bias.mul_(scale)
    return whole


def _linear(weight: torch.Tensor, bias: torch.Tensor) -> nn.Linear:
    # Without initial weights: they would take random numbers that a training run counts on.
    layer = nn.utils.skip_init(nn.Linear, weight.shape[1], weight.shape[0])
    with torch.no_grad():
        layer.weight.copy_(weight)
        layer.bias.copy_(bias)
    return layer


def require_widths(network: nn.Sequential, features: int) -> None:
    """Raise ValueError unless `network` maps that many features to a score per action."""
    layers = widths_of(network)
    if layers[0] != features or layers[-1] != len(Shots):
        raise ValueError(
            f"network maps {layers[0]} features to {layers[-1]} scores; "
            f"expected {features} features and {len(Shots)} scores"
        )


def features_of(observation: Observation, feature_names: Sequence[str]) -> torch.Tensor:
    """The features of an observation as a network reads them, float32 [..., D].

    Raises
    ------
    ValueError
        It has another number of features.
    """
    told = observation["state"] if isinstance(observation, Mapping) else observation
    features = torch.as_tensor(np.asarray(told, dtype=np.float32))
    if features.shape[-1:] != (len(feature_names),):
        raise ValueError(
            f"observation has shape {tuple(features.shape)}; expected {len(feature_names)} "
            f"features: {', '.join(feature_names)}"
        )
    return features


def _copy_of(*modules: nn.Module) -> nn.Sequential:
    return copy.deepcopy(nn.Sequential(*modules))


def _require_plain(extractor: nn.Module) -> None:
    """Refuse a network that does not read the features as they are."""
    parameters: Iterable[nn.Parameter] = extractor.parameters()
    if next(iter(parameters), None) is not None:
        raise ValueError(
            f"features_extractor is {type(extractor).__name__}, which has weights of its own; "
            "expected a network of the features themselves"
        )
