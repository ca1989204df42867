"""Regression of every action's worth on the observation, in rounds of playing and looking ahead.

A round plays all drives with the network so far and some random actions, so that what is observed
is what such a network meets (DAgger: Ross, Gordon and Bagnell, AISTATS 2011). In the frames of all
rounds every action is then taken, and followed for `horizon` frames with the network so far: what
that brings, discounted, is what a new network is fitted to. It is policy iteration by roll-outs
(Lagoudakis and Parr, ICML 2003), but for the counterfactuals: all three actions meet the same
frames with the same noise, and are compared without chance. A horizon of 1 is the greedy
regression; more tells what looking brings to later frames, and what heat takes from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import nn

from agents.config import AgentConfig
from agents.policies import (
    Action,
    NetworkPolicy,
    Observation,
    Policy,
    RandomPolicy,
    score_network,
)
from agents.training.branching import Branches, Path as Played
from agents.training.checkpoint import Checkpoint, Validate, provenance_of
from agents.training.fitting import Frames, fit
from agents.training.heat_price import with_heat_price
from agents.training.scalars import Scalars
from shotenv.decision import feature_index
from unwrap.support import progress

LEAST_RANDOM: Final = 0.02
"""Share of random actions in the drive that has the fewest (assumed)."""


class RegressionTrainer:
    """One regression in the folder `out`.

    Parameters
    ----------
    training, judging : Branches
        Drives to learn from, and drives of other clips that say when to stop. Prices of power are
        drawn log-uniformly from the range that their environment has.
    config : AgentConfig
    validate : callable
        Mean return of a policy on validation drives; the best round's policy is kept.
    out : Path
        Gets the checkpoint, and the best policy as `policy.safetensors` and `agent.json`.

    Raises
    ------
    ValueError
        `out` holds the checkpoint of another configuration, or a damaged one; or `unseen` has a
        feature that there is none of.
    """

    def __init__(
        self,
        training: Branches,
        judging: Branches,
        config: AgentConfig,
        validate: Validate,
        out: Path,
    ) -> None:
        self._drives = training, judging
        self._power_price, self._config = training.problem.config.reward.power, config
        for name in config.regression.unseen:
            feature_index(training.feature_names, name)  # refuses what there is none of
        self._validate, self._out = validate, out
        self._provenance = provenance_of(config, training.feature_names, training.problem.config)
        self._checkpoint = Checkpoint(out, self._provenance)
        self._scalars = Scalars(out if config.tensorboard else None)
        # Of each round.
        self._networks: list[nn.Sequential] = []
        # What each round played, of the training and of the judging drives.
        self._played: tuple[list[Played], list[Played]] = [], []

    def run(self) -> NetworkPolicy:
        """Train to the end, from the checkpoint where there is one; returns the best policy.

        Raises
        ------
        KeyboardInterrupt
            Ctrl-C; the networks of all finished rounds are kept.
        """
        rounds = self._config.regression.rounds
        self._out.mkdir(parents=True, exist_ok=True)
        state = self._checkpoint.load(self._restore)
        # What the finished rounds played follows from their networks, and takes a second each.
        for number in range(state.rounds):
            self._play(number)
        with progress(rounds, "training", "round", done=state.rounds) as bar:
            while state.rounds < rounds:
                self._play(state.rounds)
                training, judging = (self._frames(which) for which in (0, 1))
                seed = self._config.seed * rounds + state.rounds
                self._networks.append(fit(training, judging, self._config, seed=seed))
                state = state.judged(self._policy(-1), self._validate, self._out)
                state = replace(state, rounds=state.rounds + 1)
                self._scalars.add("validation/return", state.last_return, state.rounds)
                bar.set_postfix_str(state.in_words(), refresh=False)
                self._checkpoint.save(self._tensors(), state)
                bar.update(1)
        # From disk: the best round's policy, which need not be the last one's.
        return NetworkPolicy.load(self._out)

    def _policy(self, number: int) -> NetworkPolicy:
        return NetworkPolicy(self._networks[number], self._provenance)

    def _play(self, number: int) -> None:
        """Play all drives as round `number` does, at prices of its own."""
        generator = np.random.default_rng((self._config.seed, number))
        low, high = self._power_price
        for drives, played in zip(self._drives, self._played, strict=True):
            unit = generator.random(len(drives))
            # A price may be 0, which has no logarithm; its range is then that number alone.
            prices = low * (high / low) ** unit if low < high else np.full(len(drives), low)
            if number == 0:
                policy: Policy = RandomPolicy(int(generator.integers(2**31)))
            else:
                # Some drives stray far from what the network would do, most only little: a network
                # that never looks would else never be shown what looking tells.
                most = max(self._config.regression.epsilon, LEAST_RANDOM)
                shares = np.geomspace(LEAST_RANDOM, most, len(drives))
                policy = Straying(
                    self._policy(number - 1), generator.permutation(shares), generator
                )
            played.append(drives.play(policy, prices))

    def _frames(self, which: int) -> Frames:
        """Frames of all rounds so far, with what actions are worth to the last network."""
        config, drives = self._config.regression, self._drives[which]
        # Nothing has been learnt before the first round: each action for itself alone.
        horizon = config.horizon if self._networks else 1
        follower = self._policy(-1) if self._networks else RandomPolicy(0)
        parts = []
        for number, played in enumerate(self._played[which]):
            # Neighbours are alike: every round takes others of them.
            chosen = slice(number % config.stride, None, config.stride)
            observations = played.observations[chosen]
            # What it is worth at the price that heat asks for; what is observed is the drive's own.
            states = [
                with_heat_price(
                    state, seen, heat_price=config.heat_price, near_k=config.heat_near_k
                )
                for state, seen in zip(played.states[chosen], observations, strict=True)
            ]
            worth = drives.follow(states, follower, horizon=horizon, gamma=config.gamma)
            parts.append(Frames.of(observations, worth))
        return Frames.together(parts)

    def _tensors(self) -> dict[str, torch.Tensor]:
        return {
            f"{number}.{name}": value.contiguous()
            for number, network in enumerate(self._networks)
            for name, value in network.state_dict().items()
        }

    def _restore(self, tensors: dict[str, torch.Tensor]) -> None:
        config, features = self._config, len(self._provenance.feature_names)
        # A ridge regression has none.
        hidden = [config.regression.members * width for width in config.hidden]
        rounds = 1 + max(int(name.split(".", 1)[0]) for name in tensors)
        for number in range(rounds):
            network = score_network((features, *hidden, 3), "tanh")
            mine = f"{number}."
            network.load_state_dict(
                {n.removeprefix(mine): v for n, v in tensors.items() if n.startswith(mine)}
            )
            self._networks.append(network)


class Straying(Policy):
    """Another policy that in each of N drives takes a share [N] of its actions at random."""

    def __init__(self, policy: Policy, shares: np.ndarray, generator: np.random.Generator) -> None:
        self._policy, self._shares, self._generator = policy, shares, generator

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Its choice, or any."""
        own = self._policy.act(observation, info)
        any_of_them = self._generator.integers(0, 3, len(self._shares))
        strays = self._generator.random(len(self._shares)) < self._shares
        return np.where(strays, any_of_them, own)

    def reset(self) -> None:
        """Start the other policy anew."""
        self._policy.reset()
