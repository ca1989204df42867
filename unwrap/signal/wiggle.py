"""Wiggle: the phase error of square light and demodulation, and the stored table that removes it.

Square light and demodulation correlate to a triangle; its odd harmonics bend the decoded phase four
times per period, by at most 0.0711 rad. Two and four samples bend alike, so that one table per
modulation frequency serves both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from unwrap.signal.decoding import (
    BELOW_TWO_PI,
    TWO_PI,
    decode,
    to_phase_,
    to_turns_,
)
from unwrap.signal.frames import PhaseFrame
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.support import read_json, write_json

BINS = 256
"""Entries of a table; linear between them, it follows the curve to 3e-4 rad, 0.3 mm at 24 MHz."""
LARGEST_FILE_BYTES = 2**20
"""Far above the some 10 kB of two tables; larger files are not even read."""


class TurnsTable(NamedTuple):
    """What `WiggleTable.turns_of` looks up, for compiled loops: float32, since they compute in it.

    An angle lies at the place x = first + bins_per_rad angle, in bins; its turns are
    constant[i] + slope[i] x with i = floor(x).

    Attributes
    ----------
    constant, slope : float32 [n]
    first, bins_per_rad : float32
    """

    constant: np.ndarray
    slope: np.ndarray
    first: np.float32
    bins_per_rad: np.float32


@dataclass(frozen=True)
class WiggleTable:
    """Phase error of one modulation frequency by decoded phase.

    Attributes
    ----------
    error_rad : tuple of float
        Decoded minus true phase at the decoded phases i 2 pi / n, i = 0..n - 1; linear in between
        and periodic.
    """

    error_rad: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.error_rad) < 4:
            raise ValueError(f"error_rad has {len(self.error_rad)} entries; expected at least 4")
        if not all(abs(error) <= math.pi for error in self.error_rad):  # False for NaN, too.
            raise ValueError("error_rad holds NaN or more than pi; expected phase errors")

    def scaled(self, share: float) -> WiggleTable:
        """The table that removes `share` of what this one does."""
        return WiggleTable(tuple(share * error for error in self.error_rad))

    @cached_property
    def _first(self) -> Tensor:
        """Whole bins from the first line, whose phase is -pi or just below it, to phase 0.

        A tensor, since `torch.add` takes no number in its place.
        """
        return torch.tensor((len(self.error_rad) + 1) // 2)

    @cached_property
    def _lines(self) -> Tensor:
        """Lines a + b x of `turns_of` over the place x of a phase in bins: [2, lines] of a and b.

        One for each bin from -pi to 2 pi, so that angles in [-pi, pi] and phases in [0, 2 pi) need
        no wrapping first; and one bin beyond, for phases that round up. In float64 until the end:
        a is a difference of larger numbers.
        """
        count, first = len(self.error_rad), int(self._first)
        place = torch.arange(first + count + 2, dtype=torch.float64)
        errors = torch.tensor(self.error_rad, dtype=torch.float64).roll(first)
        errors = errors[place.long() % count] / TWO_PI
        turns = 1.0 + (place - first) / count - errors
        slopes = turns.diff()
        return torch.stack((turns[:-1] - slopes * place[:-1], slopes))

    @cached_property
    def turns_table(self) -> TurnsTable:
        """The same lines for the compiled loops."""
        constant, slope = self._lines.to(torch.float32).numpy()
        bins_per_rad = np.float32(len(self.error_rad) / TWO_PI)
        return TurnsTable(constant, slope, np.float32(int(self._first)), bins_per_rad)

    def turns_of(self, phase_rad: Tensor) -> Tensor:
        """Phases in [-pi, 2 pi) without their error, as turns plus 1; see `to_turns_`.

        `unwrap.depth.merge.merge_pixels` does the same by `turns_table`; a test holds the two
        together.
        """
        first, lines = self._first.to(phase_rad), self._lines.to(phase_rad)
        place = torch.add(first, phase_rad, alpha=len(self.error_rad) / TWO_PI).flatten()
        # Places are not negative, so that the conversion, which cuts off, is the floor.
        constant, slope = lines.index_select(1, place.to(torch.int32)).unbind(0)
        return torch.addcmul(constant, slope, place).view(phase_rad.shape)

    def corrected(self, frame: PhaseFrame) -> PhaseFrame:
        """`frame` with the phase error removed.

        Examples
        --------
        >>> table = WiggleTable((0.25,) * 4)
        >>> table.corrected(PhaseFrame(torch.tensor([1.0]), torch.tensor([9.0]), None)).phase_rad
        tensor([0.7500])
        """
        return replace(frame, phase_rad=to_phase_(self.turns_of(frame.phase_rad)))


FLAT = WiggleTable((0.0,) * 4)
"""No phase error."""


def shifted(frame: PhaseFrame, shift_m: Tensor, frequency_hz: float) -> PhaseFrame:
    """`frame` [B, H, W] with `shift_m` [B] added to its distances, which wrap.

    On the phase that is 4 pi f shift / c, as a delay of the light has it.
    """
    turns = shift_turns_(to_turns_(frame.phase_rad.clone()), shift_m, frequency_hz)
    return replace(frame, phase_rad=to_phase_(turns))


def shift_turns_(turns: Tensor, shift_m: Tensor, frequency_hz: float) -> Tensor:
    """Add the distances `shift_m` [B] to turns [B, H, W], in place, up to whole turns."""
    range_m = unambiguous_range_m(frequency_hz)
    # The remainder is taken in the shift's own type, float64, and is not negative: turns must not
    # become so.
    return turns.add_(shift_m.remainder(range_m).to(turns).view(-1, 1, 1), alpha=1 / range_m)


def wrap_phase(phase_rad: Tensor) -> Tensor:
    """Any phase wrapped to [0, 2 pi).

    Examples
    --------
    >>> wrap_phase(torch.tensor([-torch.pi / 2, 7.0]))
    tensor([4.7124, 0.7168])
    """
    turns = phase_rad.mul(1 / TWO_PI).floor_()
    # The clamp catches tiny negative phases, to which adding 2 pi gives 2 pi itself.
    return phase_rad.add(turns, alpha=-TWO_PI).clamp_(0.0, BELOW_TWO_PI)


def measure_wiggle(decoded_rad: Tensor, true_rad: Tensor, *, bins: int = BINS) -> WiggleTable:
    """Table from a calibration bench: phases decoded at known distances over one period.

    A least-squares fit of a periodic, piecewise linear curve to the errors, in which noise averages
    out. A constant error, the sensor's own delay, is part of the table.

    Parameters
    ----------
    decoded_rad, true_rad : float, of one shape
        Decoded phases, and 4 pi f d / c of the known distances.

    Raises
    ------
    ValueError
        Unequal shapes, a NaN, or a part of the period without measurements.
    """
    if decoded_rad.shape != true_rad.shape:
        raise ValueError(
            f"true_rad has shape {tuple(true_rad.shape)}; expected that of decoded_rad, "
            f"{tuple(decoded_rad.shape)}"
        )
    decoded, true = decoded_rad.double().flatten(), true_rad.double().flatten()
    error = torch.remainder(decoded - true + math.pi, TWO_PI) - math.pi
    if not bool(error.isfinite().all()):
        raise ValueError("decoded_rad or true_rad holds NaN or infinity")
    place = torch.remainder(decoded, TWO_PI) * (bins / TWO_PI)
    # The largest remainders round up to the whole period, which is bin 0 again.
    left = place.long().remainder(bins)
    empty = (torch.bincount(left, minlength=bins) == 0).nonzero().flatten().tolist()
    if empty:
        degrees = 360 / bins
        raise ValueError(
            f"{len(empty)} of {bins} bins hold no measurement, the first from "
            f"{empty[0] * degrees:.1f} to {(empty[0] + 1) * degrees:.1f} degrees; measure there or "
            "take fewer bins"
        )
    # Normal equations of the hat functions: each measurement touches the two entries beside it.
    right, share = (left + 1) % bins, place - place.floor()
    sides = ((left, 1.0 - share), (right, share))
    matrix, target = torch.zeros(bins * bins).double(), torch.zeros(bins).double()
    for row, weight in sides:
        target.index_add_(0, row, weight * error)
        for column, other in sides:
            matrix.index_add_(0, row * bins + column, weight * other)
    solution = torch.linalg.solve(matrix.view(bins, bins), target)
    return WiggleTable(tuple(solution.tolist()))


def correlation_samples(phase_rad: Tensor, weights: Sequence[tuple[int, float]]) -> Tensor:
    """Four samples [4, ...] at the given phases: the sum of w_h cos(h (phi - k pi / 2)).

    `weights` are those of `unwrap.signal.shots.harmonic_weights`.
    """
    angles = torch.stack([phase_rad - k * (math.pi / 2) for k in range(4)])
    return torch.stack([weight * torch.cos(h * angles) for h, weight in weights]).sum(dim=0)


def wiggle_of(weights: Sequence[tuple[int, float]], *, bins: int = BINS) -> WiggleTable:
    """Table that a noise-free bench would measure of a correlation with these harmonics.

    Examples
    --------
    >>> from unwrap.signal.shots import harmonic_weights
    >>> errors = wiggle_of(harmonic_weights(1.0, 501)).error_rad
    >>> round(max(errors), 4)
    0.0711
    """
    # Many phases to a bin, as wiggle moves some of them into the next; a bin may not stay empty.
    true_rad = torch.arange(32 * bins, dtype=torch.float64) * (TWO_PI / (32 * bins))
    samples = correlation_samples(true_rad, weights)
    return measure_wiggle(decode(samples.unsqueeze(-2)).phase_rad[0], true_rad, bins=bins)


def write_wiggle(path: Path, tables: Mapping[float, WiggleTable]) -> None:
    """Store the tables of a sensor, by modulation frequency in Hz, as JSON."""
    rows = [{"frequency_hz": hz, "error_rad": t.error_rad} for hz, t in tables.items()]
    write_json(path, {"wiggle": rows})


def read_wiggle(path: Path) -> dict[float, WiggleTable]:
    """Tables by modulation frequency in Hz.

    Raises
    ------
    ValueError
        The file is missing, too large, or no wiggle table; the message names it.
    """
    try:
        rows = read_json(path, LARGEST_FILE_BYTES)["wiggle"]
        return {
            float(row["frequency_hz"]): WiggleTable(tuple(map(float, row["error_rad"])))
            for row in rows
        }
    # JSON of the wrong shape fails as any of these; nested too deep, as the last.
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"{path} is no wiggle table: {error!r}") from None
