"""Canonical samples as a camera stores them: the inverse of what is done as they are read."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from unwrap.cameras import CameraFrames, quadrature_order
from unwrap.cameras.files import (
    AxesConfig,
    CameraDescription,
    SamplesConfig,
    StoredFrames,
    WordsConfig,
)

SAME_HZ = 1.0
"""Frequencies that are nearer are one, as for what reads them."""


def stored_frames(
    frames: CameraFrames,
    camera: CameraDescription,
    *,
    tells_frequencies: bool = False,
    tells_saturation: bool = False,
) -> StoredFrames:
    """Planes and gray images of frames, as the described camera stores them.

    Of more frequencies than the camera has its own are kept, of four samples the two that it takes.
    Three phases, and parts of phasors, are made of the four samples of each frequency.

    Parameters
    ----------
    frames : CameraFrames
        As they lie in the view.
    tells_frequencies : bool
        Whether the file will tell them, so that any selectable ones do.
    tells_saturation : bool
        Whether it tells full pixels beside the words; else a code stands in the place of their
        samples or, where the camera has none, a word at the end of the range.

    Raises
    ------
    ValueError
        Frequencies, samples or flags that the camera cannot hold; the message names it.
    """
    kept = kept_frequencies(frames.frequencies_hz, camera, tells_frequencies=tells_frequencies)
    order = [frames.frequencies_hz.index(hz) for hz in kept]
    samples = _as_stored(frames.samples_lsb.numpy()[:, order], camera.axes)
    flags = _as_stored(frames.saturated_samples.numpy()[:, order], camera.axes)
    planes = _joined(planes_of(samples, camera))
    full = _joined(flags_of(flags, camera))
    words = words_of(planes, full & (not tells_saturation), camera)
    gray = None
    if frames.gray is not None:
        gray = gray_words(_as_stored(frames.gray.numpy(), camera.axes), camera)
    if (place := camera.passive.plane) is not None and camera.passive.where == "plane":
        if gray is None:
            raise ValueError(f"gray images are missing; {camera.name} stores them among its planes")
        words = np.insert(words, place, gray, axis=1)
        full, gray = np.insert(full, place, False, axis=1), None
    return StoredFrames(
        words,
        gray,
        frequencies_hz=kept,
        temperature_k=frames.temperature_k,
        integration_s=frames.integration_s,
        laser_power_w=frames.laser_power_w,
        timestamp_s=frames.timestamp_s,
        saturated=full,
    )


def kept_frequencies(
    frequencies_hz: Sequence[float], camera: CameraDescription, *, tells_frequencies: bool
) -> tuple[float, ...]:
    """Those of `frequencies_hz` that the camera takes, in the order of its planes.

    Raises
    ------
    ValueError
        It has others.
    """
    own, count = camera.frequencies_hz, len(camera.frequencies_hz)
    near = [[hz for hz in frequencies_hz if abs(hz - one) < SAME_HZ] for one in own]
    if all(near):
        return tuple(hz for (hz, *_) in near)
    known = {*own, *camera.selectable_hz}
    first = tuple(frequencies_hz[:count])
    selectable = all(any(abs(hz - one) < SAME_HZ for one in known) for hz in first)
    if tells_frequencies and len(first) == count and selectable:
        return first
    raise ValueError(
        f"frequencies are {_megahertz(frequencies_hz)}; expected {_megahertz(own)}, as "
        f"{camera.name} has them: describe a camera with others, or take another sensor"
    )


def planes_of(samples: np.ndarray, camera: CameraDescription) -> np.ndarray:
    """Planes [F, K, P, H, W] in LSB, no whole numbers yet, of samples [F, K, n, H, W].

    Raises
    ------
    ValueError
        Fewer samples than the camera takes.
    """
    needed, found = _needed(camera.samples), samples.shape[2]
    if found < needed:
        raise ValueError(
            f"{found} samples of a frequency; expected {needed}, as {camera.name} takes them"
        )
    order = quadrature_order(camera.samples)
    if order is not None:
        planes = np.empty_like(samples[:, :, : len(order)])
        planes[:, :, order] = samples[:, :, : len(order)]
        return planes
    cosine, sine = ((samples[:, :, k] - samples[:, :, k + 2]) / 2 for k in (0, 1))
    # What is common to all samples is the pixel's offset; the parts of a phasor have none.
    common = samples.mean(axis=2) if camera.samples.kind == "samples" else np.float32(0)
    angles = map(math.radians, camera.samples.phases_deg)
    return np.stack([common + cosine * math.cos(a) + sine * math.sin(a) for a in angles], axis=2)


def flags_of(flags: np.ndarray, camera: CameraDescription) -> np.ndarray:
    """Flags bool [F, K, P, H, W] of planes, of flags [F, K, n, H, W] of samples."""
    order = quadrature_order(camera.samples)
    if order is not None:
        planes = np.empty_like(flags[:, :, : len(order)])
        planes[:, :, order] = flags[:, :, : len(order)]
        return planes
    return np.repeat(flags.any(axis=2, keepdims=True), len(camera.samples.phase_deg), axis=2)


def words_of(planes: np.ndarray, full: np.ndarray, camera: CameraDescription) -> np.ndarray:
    """Stored numbers [F, P, H, W] of planes in LSB and their flags.

    Raises
    ------
    ValueError
        A sample is full, and no word says so.
    """
    words = camera.words
    if words.real:
        if full.any():
            raise ValueError(
                f"{int(full.sum())} samples are full; {camera.name} has no word for it"
            )
        return planes.astype(np.float32)
    low, high = words.limits
    values = np.rint(planes).astype(np.int64) + words.mid_scale
    beyond = (values < low) | (values > high)
    ends = words.ends_overflow & ((values <= low) | (values >= high))
    values = values.clip(low, high)
    # A sample that is full within the range is that of a tap; the converter overflows at its ends.
    over, taps = full & ends | beyond, full & ~ends & ~beyond
    for flagged, codes in (
        (over, words.overflow or words.saturation),
        (taps, words.saturation or words.overflow),
    ):
        if codes:
            values[flagged] = codes[0]
        elif words.ends_overflow:
            values[flagged] = np.where(values[flagged] < words.mid_scale, low, high)
        elif flagged.any():
            raise ValueError(
                f"{int(flagged.sum())} samples are full or overflow; {camera.name} has no word for "
                "it: expected words.saturation, words.overflow or words.ends_overflow"
            )
    return values.astype(_smallest_type(words))


def gray_words(gray: np.ndarray, camera: CameraDescription) -> np.ndarray:
    """Stored gray images [F, H, W] of images in 0..1; among floats they stay what they are."""
    if camera.words.real and camera.passive.where == "plane":
        return gray
    return np.rint(gray * camera.passive.highest).astype(np.uint16)


def _needed(samples: SamplesConfig) -> int:
    """Canonical samples that the planes of a frequency are made of."""
    order = quadrature_order(samples)
    return 4 if order is None else len(order)


def _smallest_type(words: WordsConfig) -> np.dtype:
    """Integers that hold all words and codes."""
    codes = (*words.limits, *words.overflow, *words.saturation)
    fitting = (np.dtype(kind) for kind in ("int16", "uint16", "int32"))
    return next(
        d for d in fitting if np.iinfo(d).min <= min(codes) and max(codes) <= np.iinfo(d).max
    )


def _joined(planes: np.ndarray) -> np.ndarray:
    """Planes [F, K P, H, W], frequency by frequency."""
    return planes.reshape(len(planes), -1, *planes.shape[3:])


def _as_stored(maps: np.ndarray, axes: AxesConfig) -> np.ndarray:
    """Maps [..., H, W] of the view as the camera stores them."""
    rows = slice(None, None, -1 if axes.flip_rows else 1)
    columns = slice(None, None, -1 if axes.flip_columns else 1)
    turned = maps[..., rows, columns]
    return turned.swapaxes(-1, -2) if axes.transpose else turned


def _megahertz(frequencies_hz: Sequence[float]) -> str:
    return " and ".join(f"{hz / 1e6:g}" for hz in frequencies_hz) + " MHz"
