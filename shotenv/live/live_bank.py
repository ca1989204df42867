"""A bank of the frame that a camera has just begun: nothing of it is there before, or after."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import torch
from torch import Tensor

from shotenv.bank import Clip, ClipFacts, ClipSettings, TableOfContents, TruthLevel, WordBank
from shotenv.live.live_camera import Camera, Samples, StaleFrameError
from unwrap.signal import RawFrame, Shots

Ego = Callable[[], tuple[float, float]]
"""Speed along the camera's heading, m/s, and yaw rate, rad/s, as a vehicle tells them now."""
FAMILY = "live"


def standing() -> tuple[float, float]:
    """`Ego` of a camera that stands still, or of which nothing is known."""
    return 0.0, 0.0


class LiveBank(WordBank):
    """One drive of `frames` frames, numbered from 0; the last one alone can be looked at.

    Samples are taken from the camera when they are asked for: whoever chooses has seen the gray
    image, and nothing that comes later.

    Parameters
    ----------
    camera : Camera
    frames : int
    settings : ClipSettings
        Constants of the drive.
    ego : callable
        See `Ego`; asked as each gray image arrives.
    stale_s : float
        Longest time from a gray image to the last of its samples.

    Attributes
    ----------
    number : int
        Of the frame that is there; -1 before the first.
    gray_s, samples_s : float
        `time.perf_counter` when its gray image, and when its last sample had arrived.
    """

    def __init__(
        self,
        camera: Camera,
        frames: int,
        settings: ClipSettings,
        *,
        ego: Ego = standing,
        stale_s: float = math.inf,
    ) -> None:
        super().__init__(Path(FAMILY), _contents(camera, frames))
        self.camera, self._settings, self._ego, self._stale_s = camera, settings, ego, stale_s
        self.number, self.gray_s, self.samples_s = -1, math.nan, math.nan
        self._gray = torch.empty(0)
        self._taken: Samples | None = None

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"{self.name} cannot be given to another process: it is live")

    @property
    def truth_level(self) -> TruthLevel:
        """See `WordBank.truth_level`."""
        return "none"

    @property
    def answers(self) -> tuple[Shots, ...]:
        """See `WordBank.answers`."""
        return tuple(Shots)

    def next_frame(self) -> None:
        """Wait for the camera's next frame and take its gray image."""
        frame = self.camera.next_frame()
        self.gray_s = self.samples_s = time.perf_counter()
        self.number, self._gray, self._taken = self.number + 1, frame.words.unsqueeze(0), None
        self.gray_exposure_s[self.number] = frame.exposure_s
        self.ego_speed_m_s[self.number], self.yaw_rate_rad_s[self.number] = self._ego()

    def gray(self, indices: Tensor) -> Tensor:
        """See `Bank.gray`."""
        self._require_now(indices)
        return self._gray

    def words(self, frames: Tensor, shots: Shots) -> RawFrame:
        """See `WordBank.words`; the camera takes the samples now, those asked for first.

        Raises
        ------
        StaleFrameError
            They came so late that they are not of the gray image's frame.
        """
        self._require_now(frames)
        if self._taken is None:
            self._taken = self.camera.acquire(shots)
            self.samples_s = time.perf_counter()
            if self.samples_s - self.gray_s > self._stale_s:
                raise StaleFrameError(
                    f"{self.name}: samples came {self.samples_s - self.gray_s:.3f} s after their "
                    f"gray image; expected at most {self._stale_s:g} s"
                )
        dcs_lsb, saturated = self._taken.dcs_lsb[:shots], self._taken.saturated[:shots]
        if len(dcs_lsb) < shots:
            raise ValueError(
                f"{int(shots)} samples are asked for, and {len(dcs_lsb)} were taken of this frame; "
                "expected the most to be asked for first"
            )
        return RawFrame(dcs_lsb.unsqueeze(0), saturated.any(dim=0, keepdim=True))

    def settings(self, clip: Clip) -> ClipSettings:
        """See `WordBank.settings`."""
        return self._settings

    def distance_m(self, indices: Tensor) -> Tensor:
        """See `WordBank.distance_m`: no pixel has a reference."""
        return torch.full((len(indices), self.height, self.width), torch.nan)

    def _require_now(self, frames: Tensor) -> None:
        if frames.tolist() != [self.number]:
            raise ValueError(
                f"frames are {frames.tolist()}; expected {[self.number]}, the one that is there"
            )


def _contents(camera: Camera, frames: int) -> TableOfContents:
    height, width = camera.size
    # What is told of frames is written as they come.
    unknown = (math.nan,) * frames
    clip = ClipFacts(
        name=FAMILY,
        family=FAMILY,
        seed=-1,
        split="test",
        frames=frames,
        time_s=unknown,
        ego_speed_m_s=unknown,
        yaw_rate_rad_s=unknown,
        gray_exposure_s=unknown,
    )
    return TableOfContents(name=camera.name, height=height, width=width, config=None, clips=(clip,))
