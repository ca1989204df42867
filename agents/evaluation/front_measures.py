"""What fronts come to: energy at equal error, error at half the energy, the gap that is closed.

Two references: *always 8* asks for 8 DCS in every frame of the same drives and gets fewer where
the laser would trip, as a sensor without a scheduler does; *cool 8* has 8 DCS in every frame with
a laser that never trips. Energies are shares of that of cool 8.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from agents.config import StudyConfig
from agents.evaluation.price_sweep import PlayedFront
from agents.evaluation.statistics import resampled_each
from agents.optimum import Front
from unwrap.signal import Shots

BLIND: Final = "blind"
OPTIMUM: Final = "optimum"
HALF: Final = 0.5
"""Of cool 8's energy: where errors are compared."""
COMPARED: Final = np.linspace(0.3, 0.9, 13)
"""Energies over which the gap that is closed is averaged."""
ALLOWED: Final = {"at_equal_error": 1.0, "at_10_percent_more": 1.1, "at_25_percent_more": 1.25}
"""Errors at which energies are compared, relative to the reference's."""
PAIRED: Final = (*(f"energy_saved_{at}" for at in ALLOWED), "error_at_half_energy", "gap_closed")
"""Measures of which the scheduler's difference to each other front is told."""
SMALLEST_GAP_M: Final = 1e-6

Measures = dict[str, float]


@dataclass(frozen=True)
class References:
    """What fronts are measured by, where clips count as often as a resample drew them.

    Attributes
    ----------
    cool_eight_m : float
        Error of cool 8.
    always_two_m, always_eight_m : float
        Errors of the fixed choices as they were played; 2 DCS are the worst of them.
    always_eight_energy, always_eight_life_h, always_eight_k : float
        Energy, life used in a frame and mean temperature of always 8.
    blind_at_half_m : float
        Error of the best blind mixture at half the energy.
    blind_m, optimum_m : float64 [len(COMPARED)]
        Errors of the best blind mixture and of the optimum; without an optimum NaN.
    """

    cool_eight_m: float
    always_two_m: float
    always_eight_m: float
    always_eight_energy: float
    always_eight_life_h: float
    always_eight_k: float
    blind_at_half_m: float
    blind_m: np.ndarray
    optimum_m: np.ndarray


def references(
    blind: PlayedFront, optimum: PlayedFront | None, cool_eight_m: np.ndarray, weight: np.ndarray
) -> References:
    """References where each clip counts `weight` [C] times."""
    frames = weight @ blind.front.frames
    energy, error_m = blind.front.means(weight)
    two, eight = (blind.policies.index(f"always_{shots:d}") for shots in (Shots.TWO, Shots.EIGHT))
    best = optimum.beside(blind).front.error_at(COMPARED, weight) if optimum else np.nan
    return References(
        cool_eight_m=float(weight @ cool_eight_m / frames),
        always_two_m=float(error_m[two]),
        always_eight_m=float(error_m[eight]),
        always_eight_energy=float(energy[eight]),
        always_eight_life_h=float(weight @ blind.life_used_h[:, eight] / frames),
        always_eight_k=float(weight @ blind.temperature_k[:, eight] / frames),
        blind_at_half_m=float(blind.front.error_at(HALF, weight)),
        blind_m=blind.front.error_at(COMPARED, weight),
        optimum_m=np.broadcast_to(best, COMPARED.shape),
    )


def measures_of(
    one: PlayedFront, blind: PlayedFront, against: References, weight: np.ndarray
) -> Measures:
    """What a front, mixed with blind choices, comes to; see `compare_fronts` for each measure."""
    mixed = one.beside(blind)
    front, frames = mixed.front, weight @ mixed.front.frames
    energy, _ = front.means(weight)
    life_h, temperature_k = (
        weight @ sums / frames for sums in (mixed.life_used_h, mixed.temperature_k)
    )
    found: Measures = {}
    for at, allowed in ALLOWED.items():
        shares = front.mixture_at(allowed * against.always_eight_m, weight)
        found[f"energy_saved_{at}"] = 1.0 - shares @ energy / against.always_eight_energy
        # Of the optimum the choices alone are known.
        if not np.isnan(life_h).any():
            found[f"life_factor_{at}"] = against.always_eight_life_h / (shares @ life_h)
            found[f"cooler_k_{at}"] = against.always_eight_k - shares @ temperature_k
        found[f"energy_{at}"] = front.energy_at(allowed * against.cool_eight_m, weight)
    found |= main_measures(front, against, weight)
    found["below_blind_at_half_energy"] = (
        1.0 - found["error_at_half_energy"] / against.blind_at_half_m
    )
    found["hypervolume"] = one.front.hypervolume(against.always_two_m, weight)
    return {name: float(value) for name, value in found.items()}


def main_measures(mixed: Front, against: References, weight: np.ndarray) -> Measures:
    """Energy saved at equal and 10 % more error, error at half the energy, the gap that is closed.

    Of a front that was mixed with blind choices; without an optimum there is no gap.
    """
    at_half_m, *compared_m = mixed.error_at(np.concatenate(([HALF], COMPARED)), weight)
    found = {"error_at_half_energy": float(at_half_m)}
    energy, _ = mixed.means(weight)
    for at in ("at_equal_error", "at_10_percent_more"):
        shares = mixed.mixture_at(ALLOWED[at] * against.always_eight_m, weight)
        found[f"energy_saved_{at}"] = 1.0 - shares @ energy / against.always_eight_energy
    if not np.isnan(against.optimum_m).any():
        found["gap_closed"] = gap_closed(np.array(compared_m), against.blind_m, against.optimum_m)
    return found


def gap_closed(own_m: np.ndarray, blind_m: np.ndarray, optimum_m: np.ndarray) -> float:
    """Share of the gap between blind and optimum that is closed, mean over energies.

    Errors at the same energies each. Where even the optimum gains nothing there is no gap.

    Examples
    --------
    >>> gap_closed(np.array([0.75, 0.5]), np.array([1.0, 0.5]), np.array([0.5, 0.5]))
    0.5
    """
    gap_m = blind_m - optimum_m
    there = gap_m > SMALLEST_GAP_M
    return float(np.mean((blind_m - own_m)[there] / gap_m[there])) if there.any() else 0.0


def compare_fronts(
    families: Mapping[str, PlayedFront],
    blind: PlayedFront,
    optimum: PlayedFront | None,
    cool_eight_m: np.ndarray,
    study: StudyConfig,
    *,
    scheduler: str,
) -> dict[str, Any]:
    """What each family's front comes to, with intervals over clips.

    Parameters
    ----------
    families : mapping of str to PlayedFront
        That of `scheduler` among them.
    blind, optimum : PlayedFront
        Of the same drives: 0 and 1 of the gap that is closed. `blind` has the fixed choices among
        its points. The optimum is None where it cannot be computed.
    cool_eight_m : float64 [C]
        Sum over the frames of each clip of the error of cool 8.
    study : StudyConfig
        Bootstrap draws and confidence.
    scheduler : str
        Whose difference to the others is told.

    Returns
    -------
    dict
        "measures": by name of the front, "blind" and "optimum" among them, each measure with its
        interval; "differences": the scheduler's less the others', in pairs; "always_8", "cool_8".

        energy_saved_at_equal_error
            Share of always 8's laser energy that is saved at its error; 0 where the front is
            nowhere as good. With `at_10_percent_more` and `at_25_percent_more` at more error.
        life_factor_at_equal_error, cooler_k_at_equal_error
            There, how many times as long the laser lives as with always 8, and by how much it is
            cooler, mean over frames.
        energy_at_equal_error
            Least energy at the error of cool 8; 1 where the front is nowhere as good, which
            "reached" tells.
        error_at_half_energy, below_blind_at_half_energy
            Error at half the energy of cool 8, m, and the share by which it is below that of blind.
        gap_closed
            See there.
        hypervolume
            Of the front's own points alone. The reference is an energy of 1 and the error of always
            2 DCS; m.

    Notes
    -----
    A family may be mixed with blind choices, as its front is between its points: else it would have
    no error at energies below its cheapest point, and one of a single price no front.
    """
    every = {**families, BLIND: blind} | ({OPTIMUM: optimum} if optimum else {})

    def statistics(weight: np.ndarray) -> dict[tuple[str, ...], float]:
        against = references(blind, optimum, cool_eight_m, weight)
        found: dict[tuple[str, ...], float] = {
            (name, measure): value
            for name, one in every.items()
            for measure, value in measures_of(one, blind, against, weight).items()
        }
        return found | {
            (name, measure, "difference"): found[scheduler, measure] - value
            for (name, measure), value in found.items()
            if measure in PAIRED and name != scheduler
        }

    once = np.ones(len(cool_eight_m))
    against = references(blind, optimum, cool_eight_m, once)
    told: dict[str, Any] = {
        "always_8": {
            "laser_energy_share": against.always_eight_energy,
            "depth_mae_m": against.always_eight_m,
            "temperature_k": against.always_eight_k,
            "life_used_per_frame_h": against.always_eight_life_h,
        },
        "cool_8": {"laser_energy_share": 1.0, "depth_mae_m": against.cool_eight_m},
        "measures": {name: {} for name in every},
        "differences": {name: {} for name in every if name != scheduler},
    }
    for (name, measure, *pair), one in resampled_each(statistics, len(once), study).items():
        if pair:
            told["differences"][name][measure] = one.named("difference")
        else:
            told["measures"][name][measure] = one.named("mean")
    for name, front in every.items():
        both = front.beside(blind).front
        for at, allowed in ALLOWED.items():
            reached = both.reaches(allowed * against.cool_eight_m, once)
            told["measures"][name][f"energy_{at}"]["reached"] = reached
    return told
