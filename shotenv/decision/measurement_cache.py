"""A cache of measurements: the same numbers, faster where drives come again."""

from __future__ import annotations

import torch
from torch import Tensor

from shotenv.decision.drive import Drive
from shotenv.decision.measurement import Measurement, measure_frames
from shotenv.decision.problem import Problem
from shotenv.decision.score import SCORES, DepthScore
from unwrap.support import take

MOST_KEPT = 500_000
"""Frames, counted once for each number of samples, that a cache keeps: some 0.3 GB, or all
choices in 650 drives of 256 frames."""


class MeasurementCache:
    """`measure_frames`, keeping what each (drive, frame, shots) gave; for one problem.

    What an acquisition gives depends on the drive (its seed and what was set of it), the frame and
    the shots alone, so an environment that plays the same drives again need not acquire again.
    What comes first is kept, up to `most_kept` frames, and later ones are measured every time:
    with drives that come in turns, dropping the oldest for the newest would lose each of them just
    before its return.

    Parameters
    ----------
    most_kept : int
        Bound of what is kept.
    """

    def __init__(self, most_kept: int = MOST_KEPT) -> None:
        self.most_kept = most_kept
        self._rows: dict[tuple, list[float]] = {}

    def __len__(self) -> int:
        """Frames kept, counted once for each number of samples."""
        return len(self._rows)

    def __call__(
        self,
        problem: Problem,
        drive: Drive,
        step: Tensor,
        shots: Tensor,
        power_w: Tensor | None = None,
    ) -> Measurement:
        """As `measure_frames`, for the frames at `step` [B] of `drive` with `shots` [B] samples."""
        # A derated laser has a power of its own every time, which hardly ever comes again.
        if power_w is not None and drive.is_derated(power_w):
            return measure_frames(problem, drive, step, shots, power_w)
        # A seed names a drive but for what options of `reset` set of it.
        body = drive.laser_power_w, drive.integration_s, drive.ambient_k
        parts = [part.tolist() for part in (drive.seed, step, drive.frame(step), *body, shots)]
        keys = list(zip(*parts, strict=True))
        missing = [i for i, key in enumerate(keys) if key not in self._rows]
        new = {}
        if missing:
            rows = torch.tensor(missing)
            measured = measure_frames(problem, take(drive, rows), step[rows], shots[rows])
            new = {keys[i]: row for i, row in zip(missing, _to_rows(measured), strict=True)}
        found = _from_rows([new.get(key) or self._rows[key] for key in keys])
        # All of a batch or none of it: which drives are kept does not depend on their order in it.
        if len(self._rows) + len(new) <= self.most_kept:
            self._rows |= new
        return found


def _to_rows(measured: Measurement) -> list[list[float]]:
    columns = [getattr(measured.score, name) for name in SCORES]
    columns.append(measured.error_of_four)
    return torch.cat((torch.stack(columns, dim=1), measured.features.double()), dim=1).tolist()


def _from_rows(rows: list[list[float]]) -> Measurement:
    values = torch.tensor(rows, dtype=torch.float64)
    *scores, error_of_four = values[:, : len(SCORES) + 1].T
    features = values[:, len(SCORES) + 1 :].to(torch.float32)
    return Measurement(DepthScore(*scores), error_of_four, features)
