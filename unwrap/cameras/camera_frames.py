"""Frames of any camera, in one order and one unit; what everything else works on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from unwrap.recordings import Recording
from unwrap.signal import RawFrame

LONG_GAP = 1.5
"""Intervals, in typical ones, from which on a frame is missing between two; assumed."""


@dataclass(frozen=True)
class CameraFrames:
    """Frames as a camera recorded them, F of them, at K modulation frequencies.

    Attributes
    ----------
    samples_lsb : float32 [F, K, n, H, W]
        n = 2 or 4 samples D_k = + m S cos(phi - k pi / 2) of each frequency, in LSB, with the
        pixel's offset as it was recorded.
    saturated : bool [F, H, W]
        A sample of the pixel, at any frequency, is no sample: full, or beyond the converter.
    gray : float32 [F, H, W] or None
        Passive images in 0..1.
    frequencies_hz : tuple of K floats
        Descending.
    made : bool
        The four samples were made from phasors, see `unwrap.cameras.canonical`.
    names : tuple of F str
    saturated_samples : bool [F, K, n, H, W]
        Which of the samples; of `saturated` any.
    temperature_k, integration_s, laser_power_w, timestamp_s : tuple of F floats or None
        None where neither the recording nor the description tells.
    """

    samples_lsb: Tensor
    saturated: Tensor
    gray: Tensor | None
    frequencies_hz: tuple[float, ...]
    made: bool
    names: tuple[str, ...]
    saturated_samples: Tensor
    temperature_k: tuple[float, ...] | None = None
    integration_s: tuple[float, ...] | None = None
    laser_power_w: tuple[float, ...] | None = None
    timestamp_s: tuple[float, ...] | None = None

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.names)

    def recording(self) -> Recording:
        """The frames as one or two frequencies are corrected: 2, 4 or 8 samples.

        Raises
        ------
        ValueError
            Three frequencies, or two of two samples each.
        """
        frames, frequencies, count, *size = self.samples_lsb.shape
        if (
            frequencies > 2
            or frequencies * count not in (2, 4, 8)
            or (frequencies, count) == (2, 2)
        ):
            raise ValueError(
                f"{frequencies} frequencies of {count} samples; expected one of 2 or 4, or two of 4"
            )
        samples = self.samples_lsb.reshape(frames, frequencies * count, *size)
        return Recording(
            RawFrame(samples, self.saturated), self.gray, None, self.names, made=self.made
        )

    def at_highest_frequency(self) -> CameraFrames:
        """The samples at the first frequency alone."""
        return replace(
            self,
            samples_lsb=self.samples_lsb[:, :1],
            saturated_samples=self.saturated_samples[:, :1],
            frequencies_hz=self.frequencies_hz[:1],
        )


def dropped_frames(timestamps_s: Sequence[float], names: Sequence[str]) -> list[str]:
    """A sentence for each place where the times of frames are not even.

    Examples
    --------
    >>> dropped_frames((0.0, 0.1, 0.2, 0.5), ("a", "b", "c", "d"))
    ['frame d comes 0.3 s after frame c, where 0.1 s is usual: about 2 frames were dropped']
    """
    steps = np.diff(timestamps_s)
    if len(steps) == 0:
        return []
    usual, found = float(np.median(steps)), []
    for number, step in enumerate(steps):
        before, after = names[number], names[number + 1]
        if step <= 0:
            found.append(f"frame {after} is {-step:g} s earlier than frame {before} before it")
        elif usual > 0 and step > LONG_GAP * usual:
            lost = max(1, round(step / usual) - 1)
            found.append(
                f"frame {after} comes {step:.3g} s after frame {before}, where {usual:.3g} s is "
                f"usual: about {lost} frames were dropped"
            )
    return found


def as_tensor(array: np.ndarray) -> Tensor:
    """A tensor of the array's content, contiguous."""
    return torch.from_numpy(np.ascontiguousarray(array))
