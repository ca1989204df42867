"""Random streams: who draws what from which seed. No stream depends on actions or on the batch."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Sequence
from itertools import count, islice

import numpy as np
import torch
from torch import Tensor

from shotenv.sensor.normals import BLOCK, fill_normals_

_MASK = (1 << 64) - 1  # Python's integers do not wrap round by themselves.


class Purpose(enum.IntEnum):
    """What a stream is drawn for; each purpose has its own."""

    NOISE = 1
    OFFSETS = 2
    DRIVE = 3


def stream_seed(purpose: Purpose, *words: int) -> int:
    """63-bit seed of the stream named by `purpose` and `words` (SplitMix64's mixing, chained).

    Neighbouring words give unrelated seeds, which a plain sum would not.
    """
    state = _mix(int(purpose))
    for word in words:
        state = _mix(state ^ (int(word) & _MASK))
    return state >> 1


def _mix(value: int) -> int:
    # SplitMix64 (Steele, Lea, Flood 2014): golden-ratio increment and its finaliser.
    value = (value + 0x9E3779B97F4A7C15) & _MASK
    value = ((value ^ (value >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    value = ((value ^ (value >> 27)) * 0x94D049BB133111EB) & _MASK
    return value ^ (value >> 31)


def stream(purpose: Purpose, *words: int) -> torch.Generator:
    """Generator of the stream named by `purpose` and `words`."""
    return torch.Generator().manual_seed(stream_seed(purpose, *words))


def noise_samples(
    seeds: Sequence[int] | Tensor, frames: Sequence[int] | Tensor, height: int, width: int
) -> Iterator[Tensor]:
    """Standard normals of a batch of acquisitions, sample after sample without end.

    Each is a function of (seed, frame, sample, tap, pixel), so that the noise of fewer shots is a
    prefix of the noise of more, and that of a frame does not depend on what else is in the batch.

    Yields
    ------
    float32 [B, 2, height, width]
        Of tap A and tap B, one sample for each of the B pairs of `seeds` and `frames`.
    """
    of = np.asarray(seeds, np.int64), np.asarray(frames, np.int64)
    words = np.empty((4, BLOCK), np.uint32)
    for pair in count():
        # New ones each time: whoever keeps a sample must not see the next one written over it.
        normals = np.empty((2, len(of[0]), 2, height * width), np.float32)
        fill_normals_(int(Purpose.NOISE), *of, pair, words, normals)
        yield from torch.from_numpy(normals).unflatten(-1, (height, width)).unbind()


def draw_noise(seed: int, frame: int, shots: int, height: int, width: int) -> Tensor:
    """Normals of one acquisition, float32 [shots, 2, height, width]; see `noise_samples`."""
    return torch.cat(list(islice(noise_samples([seed], [frame], height, width), int(shots))))
