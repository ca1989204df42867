"""Temporal error: by how much the depth of what stands still changes from frame to frame.

It depends on the shots of two frames. So it is measured once for each pair of actions, and serves
every policy that the drives are played by.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import Tensor

from agents.optimum.tabulation import drive_of
from shotenv.decision import Acquisition, Problem, acquire_depths
from unwrap.signal import Shots
from unwrap.support import concatenate

STILL_M: Final = 0.05
"""What stands still: where the true distance changes by less, which at 10 Hz is by .5 m/s. In test
drives of `pocket` these are 78 % of the pixels that are scored in both frames [measured]."""


@dataclass(frozen=True)
class SignedErrors:
    """Depth minus truth of the same frames with each number of samples: A = 3 actions, batch B.

    Attributes
    ----------
    error_m : float32 [A, B, H, W]
    counted : bool [A, B, H, W]
        Where a pixel is scored and its depth valid.
    truth_m : float32 [B, H, W]
    """

    error_m: Tensor
    counted: Tensor
    truth_m: Tensor

    @classmethod
    def of(cls, acquired: Sequence[Acquisition]) -> SignedErrors:
        """Of acquisitions of the same frames with 2, 4 and 8 samples."""
        return cls(
            torch.stack([one.depth.distance_m - one.truth_m for one in acquired]),
            torch.stack([one.depth.valid & one.scored for one in acquired]),
            acquired[0].truth_m,
        )


def temporal_error_m(before: SignedErrors, now: SignedErrors) -> Tensor:
    """Mean absolute change of the signed depth error from one frame to the next, metres.

    Over the pixels that count in both frames and stand still: whose true distance changes by less
    than `STILL_M`.

    Returns
    -------
    float64 [A, A, B]
        [i, j] of action i in the frame before and j now; NaN where there is no such pixel.
    """
    still = (now.truth_m - before.truth_m).abs() < STILL_M
    counted = before.counted.unsqueeze(1) & now.counted & still
    change_m = (now.error_m - before.error_m.unsqueeze(1)).abs()
    # Where a pixel does not count its distance may be NaN.
    total_m = torch.where(counted, change_m, 0.0).sum(dim=(-2, -1), dtype=torch.float64)
    return total_m / counted.sum(dim=(-2, -1))


@torch.inference_mode()
def tabulate_temporal_errors(
    problem: Problem, seeds: Sequence[int], *, tick: Callable[[int], object] = lambda frames: None
) -> np.ndarray:
    """Temporal error of every pair of actions in the drives that environments have with `seeds`.

    With the noise of the drives themselves, as they are played. 24 drives of 256 frames of `pocket`
    take 2 s of one core.

    Parameters
    ----------
    tick : callable
        Told the number of frames after each step of all drives.

    Returns
    -------
    float64 [N, T, A, A]
        Metres; [n, t, i, j] of action i in frame t - 1 and j in frame t. NaN in the first frame of
        a drive and of each clip, and where nothing stands still. All NaN with a derated laser: what
        that would measure depends on the choices before; and of recordings without a reference or
        eight samples.
    """
    frames = problem.config.frames_per_drive
    found = np.full((len(seeds), frames, len(Shots), len(Shots)), np.nan)
    bank = problem.bank
    scored = bank.truth_level == "external" and len(bank.answers) == len(Shots)
    if problem.config.laser.derate_per_k or not scored:
        return found
    # All drives side by side: maps of two steps are all that is kept.
    drives = concatenate([drive_of(problem, seed) for seed in seeds])
    cuts = np.isin(drives.frames.numpy(), [clip.start for clip in problem.bank.clips])
    before = None
    for t in range(frames):
        step = torch.full((len(seeds),), t)
        now = SignedErrors.of(acquire_depths(problem, drives, step, tuple(Shots)))
        if before is not None:
            error_m = temporal_error_m(before, now).movedim(-1, 0).numpy()
            # Clips are played to their ends: only their first frames do not follow the one before.
            found[:, t] = np.where(cuts[:, t, None, None], np.nan, error_m)
        before = now
        tick(len(seeds))
    return found
