"""Choices that need no knowledge of outcomes: fixed, blind, and the one-threshold rule."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from agents.optimum.outcome_table import (
    Choice,
    DriveTable,
    Name,
    Rule,
    Situation,
    play,
)
from unwrap.signal import Shots

SHOTS = tuple(map(int, Shots))


def fixed(action: int) -> Choice:
    """Choose `action` in every frame."""
    return lambda now: np.full(now.snr.shape, action)


def cycle(pattern: tuple[int, ...]) -> Choice:
    """Repeat a pattern of actions, frame after frame."""
    return lambda now: np.full(now.snr.shape, pattern[now.frame % len(pattern)])


def mixture(shares: tuple[float, float, float], *, seed: int = 0) -> Choice:
    """Draw each action with a fixed probability, independently of everything."""
    edges = np.cumsum(shares)[:-1]

    def choose(now: Situation) -> np.ndarray:
        draw = np.random.default_rng((seed, now.frame)).random(now.snr.shape)
        return np.searchsorted(edges, draw, side="right")

    return choose


def threshold(limit: float, below: int, above: int) -> Choice:
    """One action where the last signal-to-noise is below `limit`, another from there on."""
    return lambda now: np.where(now.snr < limit, below, above)


def threshold_choices(table: DriveTable, limits: int = 40) -> Iterator[tuple[Rule, Choice]]:
    """Every pair of actions in either order, with thresholds at quantiles of the feature."""
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
    for action in range(3):
        yield f"always {SHOTS[action]}", fixed(action)
    for length, (one, rest) in itertools.product(
        range(2, longest + 1), itertools.permutations(range(3), 2)
    ):
        name = f"{SHOTS[one]} every {length} frames, else {SHOTS[rest]}"
        yield name, cycle((one, *[rest] * (length - 1)))
    for two, four in itertools.product(range(1, steps), repeat=2):
        if two + four < steps:
            shares = (two / steps, four / steps, 1 - (two + four) / steps)
            yield "mixture {:.0%}/{:.0%}/{:.0%} of 2/4/8".format(*shares), mixture(shares)


def tuned_rule(validation: DriveTable) -> Rule:
    """The one-threshold rule that costs least on validation drives."""
    return best_choice(validation, threshold_choices(validation))


def describe_rule(rule: Rule) -> str:
    """A one-threshold rule in words."""
    below, above = SHOTS[rule.below], SHOTS[rule.above]
    return f"{below} DCS where signal_to_noise < {rule.limit:.3f}, else {above}"
