"""What the rows of a table come to, with intervals over training seeds and clips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from agents.config import StudyConfig
from agents.evaluation import Interval, PlayedFront, main_measures, references
from agents.study.seed_statistics import Resamples, interquartile_mean
from unwrap.support import progress

AT_PRICE: Final = ("return", "depth_mae_m", "laser_energy_share")
"""Means over the frames that were played at the price of the table."""
ROUNDING: Final = 1e-9

Measured = dict[str, dict[str, np.ndarray]]
"""Of each row its measures of each seed, [S]."""


@dataclass(frozen=True)
class TableFronts:
    """All that a table is measured from: fronts on the same C clips.

    Attributes
    ----------
    rows : mapping of str to sequence of PlayedFront
        The front of each training seed.
    blind, optimum : PlayedFront
        What is played without looking, and with all known; there may be no optimum.
    cool_eight_m : float64 [C]
        See `agents.evaluation.table_fronts`.
    price : float
        Of power, at which the knob of the environment stands.
    """

    rows: Mapping[str, Sequence[PlayedFront]]
    blind: PlayedFront
    optimum: PlayedFront | None
    cool_eight_m: np.ndarray
    price: float

    @property
    def frames(self) -> np.ndarray:
        """Number of frames of each clip, float64 [C]."""
        return self.blind.front.frames

    def of_clips(self, chosen: np.ndarray) -> TableFronts:
        """The same of those clips alone that are `chosen`, bool [C]."""
        return TableFronts(
            {name: [one.of_clips(chosen) for one in row] for name, row in self.rows.items()},
            self.blind.of_clips(chosen),
            self.optimum.of_clips(chosen) if self.optimum else None,
            self.cool_eight_m[chosen],
            self.price,
        )

    @cached_property
    def at_price(self) -> dict[str, np.ndarray]:
        """Sums of `AT_PRICE` over the frames of each clip, float64 [len(AT_PRICE), S, C]."""
        found = {}
        for name, row in self.rows.items():
            at = [one.prices.index(self.price) for one in row]
            found[name] = np.array(
                [
                    [one.returns[:, i] for one, i in zip(row, at, strict=True)],
                    [one.front.depth_mae_m[:, i] for one, i in zip(row, at, strict=True)],
                    [one.front.energy[:, i] for one, i in zip(row, at, strict=True)],
                ]
            )
        return found

    @cached_property
    def mixed(self) -> dict[str, list[PlayedFront]]:
        """Every front beside what is played without looking."""
        return {name: [one.beside(self.blind) for one in row] for name, row in self.rows.items()}

    def measured(self, weight: np.ndarray) -> Measured:
        """Each measure of each row, where clips count `weight` [C] times."""
        against = references(self.blind, self.optimum, self.cool_eight_m, weight)
        found: Measured = {}
        for name, row in self.mixed.items():
            each = [main_measures(one.front, against, weight) for one in row]
            means = self.at_price[name] @ weight / (weight @ self.frames)
            found[name] = {
                **{measure: np.array([one[measure] for one in each]) for measure in each[0]},
                **dict(zip(AT_PRICE, means, strict=True)),
            }
        return found

    def resampled(self, study: StudyConfig, what: str) -> ResampledTable:
        """Measures of all clips and of each resample of them, under a progress bar."""
        resamples, drawn = Resamples.draw(len(self.frames), study), []
        with progress(len(resamples.clips), f"resamples of {what}", "draw") as bar:
            for weight in resamples.clips:
                drawn.append(self.measured(weight))
                bar.update(1)
        point = self.measured(np.ones(len(self.frames)))
        stacked = {
            name: {measure: np.stack([one[name][measure] for one in drawn]) for measure in row}
            for name, row in point.items()
        }
        return ResampledTable(resamples, point, stacked)


@dataclass(frozen=True)
class ResampledTable:
    """Measures of a table's rows, of all clips and of each of B resamples.

    Attributes
    ----------
    resamples : Resamples
    point, drawn : dict of dict of arrays
        By row and measure: [S], and [B, S].
    """

    resamples: Resamples
    point: Measured
    drawn: Measured

    def rows(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Of each row's measures the interquartile mean over seeds, its interval, and the seeds."""
        return {
            name: {
                measure: {
                    **self.resamples.over_seeds(values, self.drawn[name][measure], number).named(
                        "iqm"
                    ),
                    "mean": float(values.mean()),
                    "median": float(np.median(values)),
                    "seeds": values.tolist(),
                }
                for measure, values in row.items()
            }
            for number, (name, row) in enumerate(self.point.items())
        }

    def differences(self, first: str) -> dict[str, dict[str, dict[str, Any]]]:
        """Of the row `first` less each other one, in each measure that both have.

        Clips are drawn for both in common, seeds for each of them.
        """
        found: dict[str, dict[str, dict[str, Any]]] = {}
        number = {name: i for i, name in enumerate(self.point)}
        for name in self.point:
            if name == first:
                continue
            found[name] = {}
            for measure in self.point[first]:
                point, drawn = zip(
                    *(
                        (
                            interquartile_mean(self.point[one][measure]),
                            self.resamples.seed_means(self.drawn[one][measure], number[one]),
                        )
                        for one in (first, name)
                    ),
                    strict=True,
                )
                interval = self.resamples.interval(point[0] - point[1], drawn[0] - drawn[1])
                found[name][measure] = {
                    **interval.named("difference"),
                    "significant": leaves_out(interval, 0.0),
                }
        return found


def leaves_out(interval: Interval, value: float) -> bool:
    """Whether an interval does not hold a value, which would be no difference."""
    # Sums of halves are rounded.
    return not interval.low - ROUNDING <= value <= interval.high + ROUNDING
