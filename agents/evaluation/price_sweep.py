"""Fronts that were played: depth error against laser energy as the price of power is turned.

A family of policies has a policy for each price. Played on the same test drives at every price, it
draws a front, beside that of choices that look at nothing and that of the optimum, which knows
all. Energy is relative to 8 DCS in every frame with a laser that never trips. All of them are held
back by heat: what a front tells is what the sensor would do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium.vector import VectorEnv

from agents.config import StudyConfig
from agents.evaluation.play import FIXED_POLICIES, PlayedDrives, play_drives
from agents.evaluation.statistics import Interval, ratio, resampled, study_interval
from agents.optimum import Front, Possible, by_clip, clairvoyant
from agents.policies import MixturePolicy, Policy
from unwrap.signal import Shots

SWEEP: Final = (0.01, 0.02, 0.04, 0.06, 0.09, 0.13, 0.2, 0.35)
"""Prices that are played (assumed): at the dearest the default's optimum takes 8 DCS in 3 %."""
COMPARED: Final = np.linspace(0.3, 0.9, 13)
"""Energies over which the gap that is closed is averaged."""
HALF: Final = 0.5
MORE_ERROR: Final = (0.0, 0.1, 0.25)
"""Depth errors beside that of always 8 DCS at which energies are compared."""
MIXED: Final = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
"""Shares of 8 DCS in the mixtures of 2 and 8 that stand for choices that look at nothing."""


@dataclass(frozen=True)
class PlayedFront:
    """What a family reached on the test drives.

    Attributes
    ----------
    prices : float [L]
        Price of each point; NaN where none was asked for.
    front : Front
        Its L points.
    returns : float64 [C, L]
        Sums of the rewards over the frames of each clip.
    """

    prices: np.ndarray
    front: Front
    returns: np.ndarray

    @property
    def rows(self) -> list[dict[str, float | None]]:
        """Points as they are written, in the order of the prices."""
        frames = self.front.frames.sum()
        means = (each.sum(axis=0) / frames for each in (self.front.energy, self.front.depth_mae_m))
        columns = zip(self.prices, *means, self.returns.sum(axis=0) / frames, strict=True)
        return [
            {
                "price": None if np.isnan(price) else float(price),
                "laser_energy_share": float(energy),
                "depth_mae_m": float(error),
                "return": float(gained),
            }
            for price, energy, error, gained in columns
        ]

    def beside(self, other: PlayedFront) -> Front:
        """This front's points with those of another."""
        return Front(
            np.hstack((self.front.energy, other.front.energy)),
            np.hstack((self.front.depth_mae_m, other.front.depth_mae_m)),
            self.front.frames,
        )


def play_front(
    at_price: Callable[[float], Policy],
    envs: VectorEnv,
    seeds: Sequence[int],
    *,
    prices: Sequence[float] = SWEEP,
    tick: Callable[[int], object] = lambda frames: None,
) -> PlayedFront:
    """Play a family on the drives `seeds`, once for each price."""
    played = [play_drives(at_price(one), envs, seeds, price=one, tick=tick) for one in prices]
    return _front(played, np.array(prices), _range_m(envs))


def play_blind(
    envs: VectorEnv, seeds: Sequence[int], *, tick: Callable[[int], object] = lambda frames: None
) -> PlayedFront:
    """Play what looks at nothing: 2 and 8 DCS mixed, and each fixed choice."""
    mixtures = [MixturePolicy((1 - share, 0.0, share)) for share in MIXED]
    policies = [*FIXED_POLICIES.values(), *mixtures]
    played = [play_drives(policy, envs, seeds, tick=tick) for policy in policies]
    return _front(played, np.full(len(played), np.nan), _range_m(envs))


def optimum_front(possible: Possible, prices: Sequence[float] = SWEEP) -> PlayedFront:
    """What knowing all reaches at each price, within what heat allows."""
    clips, range_m = possible.clips(), possible.problem.config.sensor.max_range_m
    points = []
    for price in prices:
        table = possible.table(price=price)
        best = clairvoyant(table)
        taken = np.maximum(best.actions, 0)[..., None]
        error = np.take_along_axis(table.depth_mae_m, taken, axis=-1)[..., 0]
        lit, samples = best.actions >= 0, np.array([*Shots, 0])
        gained = table.scale * (table.reference - best.frame_cost)
        points.append((samples[best.actions] / Shots.EIGHT, np.where(lit, error, range_m), gained))
    return _stacked(points, clips, np.array(prices))


def _front(played: Sequence[PlayedDrives], prices: np.ndarray, range_m: float) -> PlayedFront:
    points = [
        (
            one.shots / Shots.EIGHT,
            # Without laser there is no depth: the whole range is missed.
            np.where(one.shots > 0, one.depth_mae_m, range_m),
            one.reward,
        )
        for one in played
    ]
    return _stacked(points, played[0].clip, prices)


def _stacked(points: Sequence[tuple], clips: np.ndarray, prices: np.ndarray) -> PlayedFront:
    energy, error, gained = (
        by_clip(np.stack(values, axis=-1), clips) for values in zip(*points, strict=True)
    )
    front = Front(energy, error, by_clip(np.ones(clips.shape), clips))
    return PlayedFront(prices, front, clips.shape[1] * gained)


def _range_m(envs: VectorEnv) -> float:
    unwrapped: Any = envs.unwrapped
    return unwrapped.problem.config.sensor.max_range_m


def compare_fronts(
    families: Mapping[str, PlayedFront],
    blind: PlayedFront,
    optimum: PlayedFront,
    error_of_eight_m: np.ndarray,
    study: StudyConfig,
) -> dict[str, Any]:
    """What each family's front comes to, with intervals over clips.

    Parameters
    ----------
    families : mapping of str to PlayedFront
    blind, optimum : PlayedFront
        Of the same drives: 0 and 1 of the gap that is closed.
    error_of_eight_m : float64 [C]
        Sum over the frames of each clip of the error of 8 DCS, with a laser that never trips.

    Returns
    -------
    dict
        "front", "error_at_half_energy", "energy_at_equal_error" (as always-8, and with 10 and 25 %
        more), "gap_closed": by name, "blind" and "optimum" among them.

    Notes
    -----
    A family may be mixed with the fixed choices, as its front is between its points: else it
    would have no error at energies below its cheapest point.
    """
    every = {**families, "blind": blind, "optimum": optimum}
    fronts = {name: one.beside(blind) for name, one in every.items()}
    clips = len(error_of_eight_m)

    def eight_m(weight: np.ndarray) -> float:
        return float(weight @ error_of_eight_m / (weight @ blind.front.frames))

    def interval(of: Callable[[np.ndarray], float]) -> dict[str, float]:
        return resampled(of, clips, study).named("mean")

    def gap(front: Front) -> Callable[[np.ndarray], float]:
        def closed(weight: np.ndarray) -> float:
            nothing, all_, ours = (
                one.error_at(COMPARED, weight)
                for one in (fronts["blind"], fronts["optimum"], front)
            )
            return float(np.mean((nothing - ours) / (nothing - all_)))

        return closed

    return {
        "front": {name: one.rows for name, one in every.items()},
        "error_at_half_energy": {
            name: interval(lambda weight, front=front: float(front.error_at(HALF, weight)))
            for name, front in fronts.items()
        },
        "energy_at_equal_error": {
            f"{more:.0%}": {
                name: interval(
                    lambda weight, front=front, more=more: front.energy_at(
                        (1 + more) * eight_m(weight), weight
                    )
                )
                for name, front in fronts.items()
            }
            for more in MORE_ERROR
        },
        "gap_closed": {name: interval(gap(front)) for name, front in fronts.items()},
    }
