"""PNG files of 16-bit gray images: recordings from folders of them, depth in millimetres."""

from __future__ import annotations

import io
import re
import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
from PIL import Image

from unwrap.recordings.recording import Recording, recording_of
from unwrap.signal import ADC_BITS
from unwrap.support import MAX_BYTES, in_one_line, open_regular

HIGHEST_MM = 2**16 - 1
"""Farthest distance that a depth image can hold; farther ones are stored as this."""
_BROKEN = (
    *(OSError, ValueError, SyntaxError, EOFError, struct.error, zlib.error),
    *(Image.DecompressionBombError, Image.DecompressionBombWarning),
)
"""What decoding damaged or absurdly large images raises."""


def read_gray16(path: Path) -> np.ndarray:
    """Image uint16 [H, W] of a PNG file.

    Raises
    ------
    ValueError
        Missing, damaged, too large, or no 16-bit gray image; the message names the file.
    """
    try:
        with warnings.catch_warnings():
            # Pillow only warns of images that would fill the memory; here they are refused.
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            # PNG alone: Pillow goes by the content, and would let any of its decoders at the file.
            with open_regular(path, MAX_BYTES) as file, Image.open(file, formats=["PNG"]) as image:
                if image.mode != "I;16":
                    raise ValueError(f"mode {image.mode}; expected 16-bit gray")
                if 2 * image.width * image.height > MAX_BYTES:
                    raise ValueError(f"larger than {MAX_BYTES >> 20} MiB")
                return np.asarray(image, dtype=np.uint16)
    except _BROKEN as error:
        raise ValueError(f"{path}: {in_one_line(error)}") from None


def read_folder(folder: Path, *, bits: int = ADC_BITS) -> Recording:
    """Recording of a folder of images, see `read_png_folder`, which says what is refused.

    Raises
    ------
    ValueError
        What `recording_of` refuses, too.
    """
    arrays, names = read_png_folder(folder)
    return recording_of(arrays, str(folder), bits=bits, names=names)


def read_png_folder(folder: Path) -> tuple[dict[str, np.ndarray], tuple[str, ...] | None]:
    """Arrays of a folder with `dcs_0.png`, `dcs_1.png`, ... and maybe `gray.png`.

    Or with one such folder for each frame, which come in the order of their names.

    Returns
    -------
    dict
        `dcs` [n, H, W] and maybe `gray` [H, W]; with an axis of frames before these where there
        are folders of them.
    tuple of str or None
        Names of the folders; None where there is one frame.

    Raises
    ------
    ValueError
        No images, a gap in their numbers, frames that are not alike, or what `read_gray16`
        refuses.
    """
    if any(folder.glob("dcs_*.png")):
        return _read_frame(folder), None
    # As text: "10" comes before "9", but not before "09".
    frames = sorted(path for path in folder.iterdir() if any(path.glob("dcs_*.png")))
    if not frames:
        raise ValueError(
            f"{folder}: no dcs_0.png; expected samples as PNG files, or a folder of them per frame"
        )
    if sum(path.stat().st_size for frame in frames for path in frame.glob("*.png")) > MAX_BYTES:
        raise ValueError(f"{folder}: larger than {MAX_BYTES >> 20} MiB; split it")
    arrays = [_read_frame(frame) for frame in frames]
    kinds = [{name: array.shape for name, array in frame.items()} for frame in arrays]
    for frame, kind in zip(frames, kinds, strict=True):
        if kind != kinds[0]:
            raise ValueError(f"{frame}: holds {kind}; expected {kinds[0]}, as {frames[0].name}")
    together = {name: np.stack([frame[name] for frame in arrays]) for name in arrays[0]}
    return together, tuple(frame.name for frame in frames)


def _read_frame(folder: Path) -> dict[str, np.ndarray]:
    """`dcs` [n, H, W] and, if there is one, `gray` [H, W] of a folder of images."""
    # The glob lets dcs_old.png through, which is not a sample.
    numbers = sorted(
        int(found[1])
        for path in folder.glob("dcs_*.png")
        if (found := re.fullmatch(r"dcs_(\d)\.png", path.name))
    )
    if numbers not in (list(range(n)) for n in (2, 4, 8)):
        raise ValueError(f"{folder}: samples {numbers}; expected dcs_0.png to dcs_1, 3 or 7")
    samples = [read_gray16(folder / f"dcs_{number}.png") for number in numbers]
    if len({sample.shape for sample in samples}) > 1:
        raise ValueError(f"{folder}: images of {[s.shape for s in samples]}; expected one size")
    gray = folder / "gray.png"
    passive = {"gray": read_gray16(gray)} if gray.is_file() else {}
    return {"dcs": np.stack(samples), **passive}


def depth_png(distance_m: np.ndarray, valid: np.ndarray) -> bytes:
    """PNG of distances [H, W], see `whole_millimetres`."""
    content = io.BytesIO()
    Image.fromarray(whole_millimetres(distance_m, valid)).save(content, format="PNG")
    return content.getvalue()


def whole_millimetres(distance_m: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Distances [H, W] as uint16 millimetres; 0 where not `valid`.

    Distances below 1 mm are stored as 1, beyond `HIGHEST_MM` as that.
    """
    millimetres = np.where(valid, distance_m, 0.0).astype(np.float64) * 1000
    # 0 says that there is no depth, so that the nearest depth is 1.
    return np.where(valid, millimetres.round().clip(1, HIGHEST_MM), 0).astype(np.uint16)
