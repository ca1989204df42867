"""Fronts that were played: depth error against laser energy as the price of power is turned.

A family of policies has a policy for each price. Played on the same test drives at every price, it
draws a front, beside that of choices that look at nothing and that of the optimum, which knows
all. Energy is relative to 8 DCS in every frame with a laser that never trips. All of them are held
back by heat: what a front tells is what the sensor would do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium.vector import VectorEnv

from agents.evaluation.play import FIXED_POLICIES, PlayedDrives, play_drives
from agents.optimum import Front, Possible, by_clip, clairvoyant
from agents.policies import MixturePolicy, Policy, Scheduler
from unwrap.signal import Shots

MIXTURES: Final = {
    f"8 DCS in {share:.0%} of frames at random, else 2": MixturePolicy((1.0 - share, 0.0, share))
    for share in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
}
"""Mixtures of 2 and 8 DCS that stand, with the fixed choices, for what looks at nothing."""


@dataclass(frozen=True)
class PlayedFront:
    """What a family reached on the test drives: C clips, L points.

    Attributes
    ----------
    front : Front
        Energy and error of the points. In frames without laser the whole scored range is missed.
    prices : tuple of L floats or None
        Price of each point; None where none was asked for.
    policies : tuple of L str
        What was played.
    returns, life_used_h, temperature_k : float64 [C, L]
        Sums over the frames of each clip; of returns so that their mean over frames is that of
        a drive. What is not known, as the optimum's life, is NaN.
    """

    front: Front
    prices: tuple[float | None, ...]
    policies: tuple[str, ...]
    returns: np.ndarray
    life_used_h: np.ndarray
    temperature_k: np.ndarray

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Points as they are written, in the order of the prices."""
        frames = self.front.frames.sum()
        columns = {
            "laser_energy_share": self.front.energy,
            "depth_mae_m": self.front.depth_mae_m,
            "return": self.returns,
            "life_used_per_frame_h": self.life_used_h,
            "temperature_k": self.temperature_k,
        }
        means = {name: sums.sum(axis=0) / frames for name, sums in columns.items()}
        return [
            {
                "price": price,
                "policy": policy,
                # JSON knows no NaN.
                **{name: None if np.isnan(x[i]) else float(x[i]) for name, x in means.items()},
            }
            for i, (price, policy) in enumerate(zip(self.prices, self.policies, strict=True))
        ]

    def of_clips(self, chosen: np.ndarray) -> PlayedFront:
        """The same of those clips alone that are `chosen`, bool [C]."""
        own = self.front
        return PlayedFront(
            Front(own.energy[chosen], own.depth_mae_m[chosen], own.frames[chosen]),
            self.prices,
            self.policies,
            self.returns[chosen],
            self.life_used_h[chosen],
            self.temperature_k[chosen],
        )

    def beside(self, other: PlayedFront) -> PlayedFront:
        """This front's points, then those of another on the same drives."""
        own, its = self.front, other.front

        def both(one: np.ndarray, two: np.ndarray) -> np.ndarray:
            return np.hstack((one, two))

        return PlayedFront(
            Front(both(own.energy, its.energy), both(own.depth_mae_m, its.depth_mae_m), own.frames),
            self.prices + other.prices,
            self.policies + other.policies,
            both(self.returns, other.returns),
            both(self.life_used_h, other.life_used_h),
            both(self.temperature_k, other.temperature_k),
        )


def prices_of(scheduler: Scheduler, prices: Sequence[float]) -> tuple[float, ...]:
    """Those of `prices` that a scheduler was trained for, rising.

    One that was trained at a single price, or does not observe it, has that price alone: turning
    the knob would tell it nothing. Without any, where the training is not known, none is its own.

    Raises
    ------
    ValueError
        None of the prices lies in the range that it was trained with.
    """
    trained = scheduler.provenance.power_price
    if trained is None:
        return ()
    low, high = trained
    if low == high:
        return (low,)
    if "power_price" not in scheduler.feature_names:
        # What a range of prices that it cannot see amounts to is their geometric mean.
        return (float(np.sqrt(low * high)),)
    own = tuple(sorted(price for price in prices if low <= price <= high))
    if not own:
        raise ValueError(
            f"prices is {', '.join(f'{price:g}' for price in prices)}; expected at least one from "
            f"{low:g} to {high:g}, which the scheduler was trained with"
        )
    return own


def play_front(
    at_price: Callable[[float], Policy],
    envs: VectorEnv,
    seeds: Sequence[int],
    prices: Sequence[float],
    *,
    names: Callable[[Policy], str] = str,
    keep: Callable[[PlayedDrives], object] = lambda played: None,
    tick: Callable[[int], object] = lambda points: None,
) -> PlayedFront:
    """Play a family on the drives `seeds`, once for each price.

    Parameters
    ----------
    at_price : callable
        The family's policy for a price. One that does not read the price plays the same at all,
        and is played once.
    envs : gymnasium.vector.VectorEnv
        As many environments as `seeds`.
    seeds, prices : sequences
    names : callable
        What is written of each policy; its words by default.
    keep : callable
        Given the drives of each point, of which the front has sums alone.
    tick : callable
        Told the number of points after each.
    """
    played: list[PlayedDrives] = []
    policies = [at_price(price) for price in prices]
    before: dict[int, PlayedDrives] = {}
    for policy, price in zip(policies, prices, strict=True):
        if policy.reads_price or id(policy) not in before:
            before[id(policy)] = play_drives(policy, envs, seeds, price=price)
        played.append(before[id(policy)])
        keep(played[-1])
        tick(1)
    return front_from(
        played, [names(policy) for policy in policies], prices, range_m=_range_m(envs)
    )


def play_blind(
    envs: VectorEnv, seeds: Sequence[int], *, tick: Callable[[int], object] = lambda points: None
) -> PlayedFront:
    """Play what looks at nothing: each fixed choice, and 2 and 8 DCS mixed."""
    policies: dict[str, Policy] = {**FIXED_POLICIES, **MIXTURES}
    played = []
    for policy in policies.values():
        played.append(play_drives(policy, envs, seeds))
        tick(1)
    return front_from(played, list(policies), [None] * len(played), range_m=_range_m(envs))


def front_from(
    played: Sequence[PlayedDrives],
    policies: Sequence[str],
    prices: Sequence[float | None],
    *,
    range_m: float,
) -> PlayedFront:
    """The front of the same drives as they were played L times.

    Returns are at the price of each point, or where it is None at that of each drive.
    """
    points = [
        {
            "energy": one.shots / Shots.EIGHT,
            # Without laser there is no depth.
            "depth_mae_m": np.where(one.shots > 0, one.depth_mae_m, range_m),
            "returns": one.reward if price is None else one.rewards_at(price),
            "life_used_h": one.life_used_h,
            "temperature_k": one.temperature_k,
        }
        for one, price in zip(played, prices, strict=True)
    ]
    return _stacked(points, played[0].clip, policies, prices)


def optimum_front(possible: Possible, prices: Sequence[float]) -> PlayedFront:
    """What knowing all reaches at each price, within what heat allows."""
    clips, range_m = possible.clips(), possible.problem.config.sensor.max_range_m
    samples = np.array([*Shots, 0])  # the last is that of action -1, a laser that is off
    points = []
    for price in prices:
        table = possible.table(price=price)
        best = clairvoyant(table)
        taken = np.maximum(best.actions, 0)[..., None]
        error_m = np.take_along_axis(table.depth_mae_m, taken, axis=-1)[..., 0]
        points.append(
            {
                "energy": samples[best.actions] / Shots.EIGHT,
                "depth_mae_m": np.where(best.actions >= 0, error_m, range_m),
                "returns": table.scale * (table.reference - best.frame_cost),
                "life_used_h": np.full(clips.shape, np.nan),
                "temperature_k": np.full(clips.shape, np.nan),
            }
        )
    return _stacked(points, clips, ["dynamic programming"] * len(points), prices)


def _stacked(
    points: Sequence[dict[str, np.ndarray]],
    clips: np.ndarray,
    policies: Sequence[str],
    prices: Sequence[float | None],
) -> PlayedFront:
    """Sums over the frames of each clip of what points were in each frame, [N, T]."""
    sums = {
        name: by_clip(np.stack([point[name] for point in points], axis=-1), clips)
        for name in points[0]
    }
    return PlayedFront(
        Front(sums["energy"], sums["depth_mae_m"], by_clip(np.ones(clips.shape), clips)),
        tuple(prices),
        tuple(policies),
        returns=clips.shape[1] * sums["returns"],
        life_used_h=sums["life_used_h"],
        temperature_k=sums["temperature_k"],
    )


def _range_m(envs: VectorEnv) -> float:
    unwrapped: Any = envs.unwrapped  # gymnasium's annotation does not know our attributes
    return unwrapped.problem.config.sensor.max_range_m
