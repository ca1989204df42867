"""`reset(options=...)`: what is set of the drives that begin, instead of drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shotenv.decision import DriveOptions, Problem

STRONGEST_W = 100.0
"""Optical power that can be set; ten times the strongest laser of the shipped configurations."""
COLDEST_K = 233.15
"""Ambient temperature that can be set: -40 C, the lower end of the grades of automotive parts."""

HIGHEST_PRICE = 10.0
"""Price that can be set: always-8's power would weigh ten times as much as having no depth."""


@dataclass(frozen=True)
class ResetOptions:
    """What a reset asked for.

    Attributes
    ----------
    seeds : tuple of int, or None
        Seed of the drive of each environment; None leaves it to the environments.
    drive : DriveOptions
        What is set of each of the drives.
    """

    seeds: tuple[int, ...] | None
    drive: DriveOptions


def check_families(value: Any, problem: Problem) -> tuple[str, ...]:
    """Names of families that the problem has clips of, without repeats."""
    there = sorted({clip.family for clip in problem.clips})
    listed = isinstance(value, Sequence) and not isinstance(value, str) and len(value) > 0
    if not listed or any(name not in there for name in value):
        raise ValueError(
            f"families is {value!r}; expected a list of some of {', '.join(there)}, of which this "
            f"bank has clips in split {problem.config.split!r}"
        )
    return tuple(dict.fromkeys(value))


def check_laser_power(value: Any, problem: Problem) -> float:
    """Optical power, W."""
    return check_number("laser_power_w", value, 0.0, STRONGEST_W, "W")


def check_integration(value: Any, problem: Problem) -> float:
    """Integration time of a sample, s; it ends before the next sample begins."""
    return check_number("integration_s", value, 0.0, problem.config.sensor.sample_period_s, "s")


def check_ambient(value: Any, problem: Problem) -> float:
    """Ambient temperature, K; below it a tripped laser comes back."""
    return check_number("ambient_k", value, COLDEST_K, problem.config.laser.release_k, "K")


def check_number(name: str, value: Any, above: float, below: float, unit: str) -> float:
    """`value` as a float between two bounds, both left out.

    Raises
    ------
    ValueError
        It is no number, or not between them.
    """
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or not above < value < below:
        raise ValueError(
            f"{name} is {value!r}; expected a number of {unit} above {above:g} and below {below:g}"
        )
    return float(value)


def check_power_price(value: Any, problem: Problem) -> float:
    """Weight of power in the reward; 0 makes it free."""
    if value == 0 and not isinstance(value, bool):
        return 0.0
    return check_number("power_price", value, 0.0, HIGHEST_PRICE, "error terms")


# Fields of `DriveOptions`, each with what checks it: a new option is a line here and a field there.
CHECKS: Mapping[str, Callable[[Any, Problem], Any]] = {
    "families": check_families,
    "laser_power_w": check_laser_power,
    "integration_s": check_integration,
    "ambient_k": check_ambient,
    "power_price": check_power_price,
}
KNOWN = ("drive", *CHECKS)


def check_options(
    options: Any, problem: Problem, num_envs: int = 1, *, also: tuple[str, ...] = ()
) -> ResetOptions:
    """Options of `reset` for `num_envs` environments.

    Parameters
    ----------
    also : tuple of str
        Options that the caller reads itself.

    Raises
    ------
    ValueError
        An unknown option, or one with a value that is of no use; the message names it.
    """
    if options is None:
        return ResetOptions(None, DriveOptions())
    known = ", ".join((*also, *KNOWN))
    if not isinstance(options, Mapping):
        raise ValueError(f"options is {options!r}; expected a mapping with some of {known}")
    unknown = [name for name in options if name not in (*also, *KNOWN)]
    if unknown:
        raise ValueError(f"options has {unknown[0]!r}; expected some of {known}")
    given = {name: CHECKS[name](options[name], problem) for name in CHECKS if name in options}
    seeds = check_seeds_of_drives(options["drive"], num_envs) if "drive" in options else None
    return ResetOptions(seeds, DriveOptions(**given))


def check_seeds_of_drives(value: Any, num_envs: int) -> tuple[int, ...]:
    """Seeds of drives: one for all environments, or one for each of several."""
    each = value if num_envs > 1 and isinstance(value, list | tuple | np.ndarray) else [value]
    if len(each) == 1:
        each = [each[0]] * num_envs
    whole = all(isinstance(s, int | np.integer) and not isinstance(s, bool) for s in each)
    if not whole or len(each) != num_envs or not all(0 <= s < 2**63 for s in each):
        several = f", or {num_envs} of them" if num_envs > 1 else ""
        raise ValueError(
            f"drive is {value!r}; expected the seed of a drive, a whole number of at least 0 and "
            f"below 2^63{several}"
        )
    return tuple(int(seed) for seed in each)
