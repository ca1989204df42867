"""Choices that need no knowledge of outcomes: fixed, blind, and the one-threshold rule."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import NamedTuple, TypeVar

import numpy as np

from agents.optimum.outcome_table import Choice, DriveTable, Situation, play
from agents.policies import rule_in_words
from unwrap.signal import Shots

Name = TypeVar("Name")


class Rule(NamedTuple):
    """Parameters of a one-threshold rule: its limit, and the actions (0 to 2) on either side."""

    limit: float
    below: int
    above: int

    @property
    def shots(self) -> tuple[Shots, Shots]:
        """Samples taken below and above the limit."""
        of_action = tuple(Shots)
        return of_action[self.below], of_action[self.above]

    def __str__(self) -> str:
        """The rule in words."""
        return rule_in_words(self.limit, *self.shots)


def always(action: int) -> Choice:
    """Choose `action` in every frame."""
    return lambda now: np.full(now.snr.shape, action)


def cycle(pattern: tuple[int, ...]) -> Choice:
    """Repeat a pattern of actions, frame after frame."""
    return lambda now: np.full(now.snr.shape, pattern[now.frame % len(pattern)])


def mixture(shares: tuple[float, float, float], *, seed: int = 0) -> Choice:
    """Draw each action with a fixed probability, independently of everything."""
    edges = np.cumsum(shares)[:-1]

    def choose(now: Situation) -> np.ndarray:
        # Seeded by the frame, so that a choice keeps no state and plays alike however often.
        draw = np.random.default_rng((seed, now.frame)).random(now.snr.shape)
        return np.searchsorted(edges, draw, side="right")

    return choose


def threshold(limit: float, below: int, above: int) -> Choice:
    """One action where the last signal-to-noise is below `limit`, another from there on."""
    return lambda now: np.where(now.snr < limit, below, above)


def threshold_choices(table: DriveTable, limits: int = 40) -> Iterator[tuple[Rule, Choice]]:
    """Every pair of actions in either order, with thresholds at quantiles of the feature."""
    # Quantiles, for as many frames between two limits wherever the feature's values crowd. Those
    # of 0 and 1 are left out: beyond the extremes a rule is a fixed choice.
    quantiles = np.quantile(table.snr, np.linspace(0.01, 0.99, limits))
    for limit, (below, above) in itertools.product(
        np.unique(quantiles).tolist(), itertools.permutations(range(3), 2)
    ):
        yield Rule(limit, below, above), threshold(limit, below, above)


def best_choice(table: DriveTable, choices: Iterable[tuple[Name, Choice]]) -> Name:
    """Name of the choice that costs least over all drives of `table`."""
    return min(choices, key=lambda choice: play(table, choice[1]).cost.sum())[0]


def blind_choices(longest: int = 8, steps: int = 5) -> Iterator[tuple[str, Choice]]:
    """Choices that look at nothing: fixed, one frame in n different, and mixtures on a grid."""
    for shots in Shots:
        yield f"always {shots}", always(shots.action)
    for length, (one, rest) in itertools.product(
        range(2, longest + 1), itertools.permutations(Shots, 2)
    ):
        # The special frame comes first; in drives of hundreds of frames its place hardly matters.
        pattern = one.action, *[rest.action] * (length - 1)
        yield f"{one} every {length} frames, else {rest}", cycle(pattern)
    for two, four in itertools.product(range(1, steps), repeat=2):
        # Of the grid of shares that sum to 1, those in which each action has its part: the others
        # are fixed choices, or close to cycles.
        if two + four < steps:
            shares = (two / steps, four / steps, 1 - (two + four) / steps)
            yield "mixture {:.0%}/{:.0%}/{:.0%} of 2/4/8".format(*shares), mixture(shares)


def best_rule(validation: DriveTable) -> Rule:
    """The one-threshold rule that costs least on validation drives."""
    return best_choice(validation, threshold_choices(validation))
