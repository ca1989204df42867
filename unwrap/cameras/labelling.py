"""Which plane is which sample: all ways to label them, and those that fit a known distance.

Order and sign cannot be told from the samples alone. One known distance tells most of them apart,
but only modulo the unambiguous range, and not where two ways give distances that lie nearer than
the noise; then several fit, and a second distance has to decide.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from unwrap.cameras.camera_frames import CameraFrames
from unwrap.cameras.files import CameraDescription
from unwrap.signal import unambiguous_range_m

SIGMAS = 3.0
"""How far a mean may be off, in standard deviations."""
UNKNOWN_SHARE = 0.02
"""Of the unambiguous range: error of distance that a camera without calibration may have, such as
wiggle and its own delay; assumed."""
LEFT_OVER_SHARE = 0.05
"""Of the signal: what opposite samples of four may leave where they should cancel; assumed."""


@dataclass(frozen=True)
class Labelling:
    """One way to label the planes, and the distance that it gives at one frequency.

    Attributes
    ----------
    phase_deg : tuple of float
        Of the planes as stored, for `samples.phase_deg`; `samples.sign` is then 1.
    frequency_hz : float
    distance_m, noise_m : float
        Mean wrapped distance, and its standard deviation.
    off_m : float
        From the known distance to the nearest distance that wraps to this one.
    consistent : bool
        Whether the planes can be such samples at all, at all frequencies: opposite ones of four
        must cancel, but for the pixel's offset.
    fits : bool
        Consistent, and near enough to the known distance at all frequencies.
    described : bool
        Whether the description has it so.
    """

    phase_deg: tuple[float, ...]
    frequency_hz: float
    distance_m: float
    noise_m: float
    off_m: float
    consistent: bool
    fits: bool
    described: bool


def labellings(camera: CameraDescription) -> list[tuple[float, ...]]:
    """Every order of the camera's phases, as each is named once.

    Planes in quadrature have 24 orders, and a sign turns each into another of them. Phasors have
    eight: either part first, each with either sign.

    Examples
    --------
    The three phases of a camera come in six orders, each with either sign.

    >>> from unwrap.cameras.files import LensConfig, SamplesConfig
    >>> lens, samples = LensConfig(horizontal_fov_deg=60), SamplesConfig(phase_deg=(0, 120, 240))
    >>> camera = CameraDescription(
    ...     name="x", container="simulation", samples=samples, frequencies_hz=(8e7,), lens=lens
    ... )
    >>> len(labellings(camera))
    12
    """
    phases = camera.samples.phases_deg
    found = {
        tuple((phase + turned) % 360.0 for phase in order)
        for order in itertools.permutations(phases)
        for turned in (0.0, 180.0)
    }
    if camera.samples.kind == "phasors":
        first, second = phases
        found = {
            (a % 360.0, b % 360.0)
            for one, other in ((first, second), (second, first))
            for a in (one, one + 180.0)
            for b in (other, other + 180.0)
        }
    return sorted(found)


def fitting(
    pieces: Iterable[CameraFrames],
    camera: CameraDescription,
    known_m: float,
    at: tuple[int, int],
    *,
    reach_px: int = 2,
) -> list[Labelling]:
    """All labellings with the distances that they give at a pixel, those that fit best first.

    Parameters
    ----------
    pieces : iterable of CameraFrames
        Of a still scene; all frames are averaged.
    known_m : float
        Radial distance of what the pixel sees, metres.
    at : (int, int)
        Row and column, as the image lies in the view.
    reach_px : int
        Neighbours to each side that are averaged with the pixel, and tell the noise with it.

    Raises
    ------
    ValueError
        A pixel outside the image, or saturated, or without signal; a distance that is not positive.

    Notes
    -----
    A labelling fits where its distance is off by less than three standard deviations of the mean
    and two hundredths of the unambiguous range, at every frequency.
    """
    if not (known_m > 0 and math.isfinite(known_m)):
        raise ValueError(f"known_distance is {known_m}; expected a positive distance in metres")
    planes, frequencies = _planes_at(pieces, camera, at, reach_px)
    found = []
    described = camera.samples.phases_deg
    for phases in labellings(camera):
        ways = [
            _fit(values, phases, hz, known_m, camera)
            for values, hz in zip(planes, frequencies, strict=True)
        ]
        # One order serves all frequencies: where one does not fit, none does.
        consistent = all(way.consistent for way in ways)
        fits = consistent and all(
            abs(way.off_m) <= SIGMAS * way.noise_m + UNKNOWN_SHARE * unambiguous_range_m(hz)
            for way, hz in zip(ways, frequencies, strict=True)
        )
        same = all(math.isclose(a, b) for a, b in zip(phases, described, strict=True))
        found += [replace(way, consistent=consistent, fits=fits, described=same) for way in ways]
    return sorted(
        found, key=lambda way: (not way.fits, not way.consistent, way.phase_deg, -way.frequency_hz)
    )


def _planes_at(
    pieces: Iterable[CameraFrames],
    camera: CameraDescription,
    at: tuple[int, int],
    reach_px: int,
) -> tuple[np.ndarray, tuple[float, ...]]:
    """Planes [K, P, values] as stored around a pixel, and the frequencies."""
    parts: list[np.ndarray] = []
    frequencies: tuple[float, ...] = ()
    row, column = at
    for frames in pieces:
        height, width = frames.saturated.shape[-2:]
        if not (0 <= row < height and 0 <= column < width):
            raise ValueError(f"at is {row},{column}; expected a pixel of {height} x {width}")
        rows = slice(max(row - reach_px, 0), row + reach_px + 1)
        columns = slice(max(column - reach_px, 0), column + reach_px + 1)
        good = ~frames.saturated[:, rows, columns].numpy()
        samples = frames.samples_lsb[..., rows, columns].numpy()  # [F, K, n, h, w]
        parts.append(np.moveaxis(samples, 0, 2)[:, :, good])
        frequencies = frames.frequencies_hz
    values = np.concatenate(parts, axis=-1)
    if values.shape[-1] == 0:
        raise ValueError(f"at is {row},{column}: all pixels there are saturated")
    return _stored_order(values, camera), frequencies


def _stored_order(values: np.ndarray, camera: CameraDescription) -> np.ndarray:
    """Planes [K, P, values] as stored, from canonical samples [K, n, values].

    Of made samples the planes are what their phasor would give: the offset is gone, which tells
    nothing here.
    """
    angles = np.deg2rad(camera.samples.phases_deg)
    if values.shape[1] == 2:
        return values[:, np.rint(angles / (math.pi / 2)).astype(int) % 4]
    cosine, sine = values[:, 0] - values[:, 2], values[:, 1] - values[:, 3]
    common = values.mean(axis=1)
    if sorted(camera.samples.phases_deg) == [0.0, 90.0, 180.0, 270.0]:
        return values[:, np.rint(angles / (math.pi / 2)).astype(int) % 4]
    parts = np.cos(angles)[:, None, None] * cosine + np.sin(angles)[:, None, None] * sine
    return np.moveaxis(parts / 2 + common, 0, 1)


def _fit(
    planes: np.ndarray,
    phases: tuple[float, ...],
    frequency_hz: float,
    known_m: float,
    camera: CameraDescription,
) -> Labelling:
    """The distance at one frequency of planes [P, values], labelled so."""
    range_m = unambiguous_range_m(frequency_hz)
    angles = np.deg2rad(phases)
    columns = [np.cos(angles), np.sin(angles)]
    if camera.samples.kind == "samples" and len(phases) > 2:
        columns.append(np.ones_like(angles))
    model = np.stack(columns, axis=-1)
    parameters = np.linalg.pinv(model) @ planes
    real, imaginary = parameters[:2].mean(axis=-1)
    # Of the mean, per part; noise of neighbours that see other distances is part of it.
    spread = math.sqrt(parameters[:2].var(axis=-1).mean() / planes.shape[-1])
    amplitude = math.hypot(real, imaginary)
    left_over = np.abs((planes - model @ parameters).mean(axis=-1)).max()
    signal = float((planes.max(axis=0) - planes.min(axis=0)).mean()) / 2
    if signal <= SIGMAS * spread:
        raise ValueError(
            f"{signal:.3g} LSB of signal at {frequency_hz / 1e6:g} MHz, with noise of "
            f"{spread:.3g}: too little to tell a distance by; expected a brighter pixel"
        )
    distance_m = math.atan2(imaginary, real) / (2 * math.pi) % 1.0 * range_m
    return Labelling(
        phase_deg=phases,
        frequency_hz=frequency_hz,
        distance_m=distance_m,
        noise_m=spread / max(amplitude, spread) / (2 * math.pi) * range_m,
        off_m=(distance_m - known_m + range_m / 2) % range_m - range_m / 2,
        consistent=bool(left_over <= SIGMAS * spread + LEFT_OVER_SHARE * signal),
        fits=False,
        described=False,
    )
