"""Stored numbers to samples in LSB, and what they report: overflow, full pixels, nonsense."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from unwrap.cameras.files import CameraDescription, WordsConfig


def samples_of(
    planes: np.ndarray, camera: CameraDescription, where: str, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Samples float32 [F, P, H, W] in LSB, and which are saturated: bool [F, P, H, W].

    Parameters
    ----------
    planes : [F, P, H, W]
        Stored numbers.
    where, names
        File and names of the frames, for what is refused.

    Raises
    ------
    ValueError
        Another kind of number than described, NaN, or a word outside the described range.
    """
    words = camera.words
    if words.real:
        if planes.dtype.kind != "f":
            raise ValueError(f"{where}: numbers are {planes.dtype}; expected floats")
        _refuse(~np.isfinite(planes), planes, "a finite number", where, names)
        samples = planes.astype(np.float32)
        return samples, np.zeros(planes.shape, bool)
    return _integers(planes, words, where, names)


def _integers(
    planes: np.ndarray, words: WordsConfig, where: str, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    kind = planes.dtype.kind
    if kind == "f":
        # Software that centres words on zero may keep them as floats; they are whole all the same.
        _refuse(~np.isfinite(planes), planes, "a finite number", where, names)
        _refuse(planes != np.rint(planes), planes, "whole numbers", where, names)
    elif kind not in "iu":
        raise ValueError(f"{where}: numbers are {planes.dtype}; expected integers")
    codes = (*words.overflow, *words.saturation)
    _check_codes(planes.dtype, codes, where)
    values = planes.astype(np.int64)
    coded = np.isin(values, codes)
    if words.signed and kind == "u":
        # Words as packed: the sign is the highest of the `bits`, and what is above is no sample.
        highest = 2 ** (words.stored_bits or words.bits) - 1
        _refuse(~coded & (values > highest), planes, f"words of 0..{highest}", where, names)
        half = 2 ** (words.bits - 1)
        values = np.where(coded, 0, ((values & (2 * half - 1)) ^ half) - half)
    low, high = words.limits
    outside = ~coded & ((values < low) | (values > high))
    _refuse(outside, planes, f"words of {low}..{high} ({words.bits} bits)", where, names)
    ends = ((values == low) | (values == high)) & words.ends_overflow
    # A code is no sample: in its place stands the middle, and the flag says so.
    samples = np.where(coded, 0, values - words.mid_scale).astype(np.float32)
    return samples, coded | ends


def gray_of(
    gray: np.ndarray, camera: CameraDescription, where: str, names: Sequence[str]
) -> np.ndarray:
    """Passive images float32 [F, H, W] in 0..1 of stored ones.

    Raises
    ------
    ValueError
        NaN, or values outside 0 to `passive.highest`; floats within 0..1 stand for themselves.
    """
    if gray.dtype.kind not in "iuf":
        raise ValueError(f"{where}: gray is {gray.dtype}; expected numbers")
    highest = camera.passive.highest if gray.dtype.kind in "iu" else 1.0
    # Written so that NaN, which compares false, is refused as well.
    wrong = ~((gray >= 0) & (gray <= highest))
    _refuse(wrong[:, None], gray[:, None], f"gray values of 0..{highest:g}", where, names)
    return (gray / highest).astype(np.float32)


def _check_codes(dtype: np.dtype, codes: Sequence[int], where: str) -> None:
    """Raise ValueError where a code cannot be told from a sample in numbers of this type."""
    if dtype.kind == "f" or not codes:
        return
    limits = np.iinfo(dtype)
    for code in codes:
        if not limits.min <= code <= limits.max:
            wrapped = np.array(code).astype(dtype)
            raise ValueError(
                f"{where}: numbers are {dtype}, in which the code {code} is {wrapped}, like a "
                "sample; expected a wider type, or a camera whose words.overflow and "
                f"words.saturation name {wrapped} knowingly"
            )


def _refuse(
    wrong: np.ndarray, planes: np.ndarray, expected: str, where: str, names: Sequence[str]
) -> None:
    """Raise ValueError, naming the first place, where anything is `wrong` [F, P, H, W]."""
    if wrong.any():
        frame, plane, row, column = (int(i) for i in np.argwhere(wrong)[0])
        raise ValueError(
            f"{where}: frame {names[frame]} holds {planes[frame, plane, row, column]} in plane "
            f"{plane} at row {row}, column {column}, and {int(wrong.sum())} such in all; expected "
            f"{expected}"
        )
