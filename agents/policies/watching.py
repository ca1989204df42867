"""Policies that watch the scene: its distance, change and motion, and what the network makes of it.

None of them measures what fewer shots would lose; they are what practice does without that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from agents.policies.policy import Action, Observation, Policy, checked_shots, single
from agents.policies.readings import Readings, checked_at_least, checked_frames
from unwrap.signal import Shots

FRAME_S: Final = 0.1
"""Period of a frame at 10 Hz."""


class DistanceHysteresisPolicy(Policy):
    """Few shots while the scene is near, more once it is far, with a gap between the two limits.

    As rangefinders switch their mode: PX4's driver of Broadcom's AFBR-S50 goes to long range above
    SENS_AFBR_THRESH + SENS_AFBR_HYSTER (4 + 1 m by default) and back below their difference. The
    distance here is the feature `network_distance`, the mean that the network predicts from the
    gray image.

    Parameters
    ----------
    near, far : float
        Below `near` few shots are taken, above `far` more, between them those of the last frame;
        shares of the scored range.
    few, more : int
        Shots of the two modes; a drive begins with `more`.
    """

    def __init__(
        self, feature_names: Sequence[str], near: float, far: float, few: int = 2, more: int = 8
    ) -> None:
        self.near = checked_at_least("near", near, 0.0)
        self.far = checked_at_least("far", far, near)
        self.few, self.more = checked_shots(few, "few"), checked_shots(more, "more")
        self._read = Readings(feature_names, "network_distance")
        self._is_far = np.array(True)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Shots of the mode that the distance, or between the limits the last frame, asks for."""
        distance = self._read("network_distance", observation)
        stays_far = self._is_far & (distance >= self.near)
        self._is_far = np.asarray((distance > self.far) | stays_far)
        return single(np.where(self._is_far, self.more.action, self.few.action))

    def reset(self) -> None:
        """Begin in the mode of more shots."""
        self._is_far = np.array(True)

    def __str__(self) -> str:
        """The rule in words."""
        return (
            f"{self.few:d} DCS below {self.near:.0%} of the range, {self.more:d} above "
            f"{self.far:.0%}, between them as before"
        )


class WakeOnChangePolicy(Policy):
    """8 DCS while the gray image changes, fewer once it has been still for some frames.

    As users switch the projector of a stereo camera to save power: off after ten seconds without
    movement, on as soon as there is some (librealsense, issue 8823).

    Parameters
    ----------
    change : float
        Mean change of log10 ambient radiance between frames above which the image is not still.
    still_frames : int
        Still frames after which the sensor sleeps.
    asleep : int
        Shots while it sleeps.
    """

    def __init__(
        self, feature_names: Sequence[str], change: float, still_frames: int, asleep: int = 2
    ) -> None:
        self.change = checked_at_least("change", change, 0.0)
        self.still_frames = checked_frames("still_frames", still_frames, 1)
        self.asleep = checked_shots(asleep, "asleep")
        self._read = Readings(feature_names, "gray_change")
        self._still = np.array(-1)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """8 DCS until the image has been still long enough."""
        moves = self._read("gray_change", observation) > self.change
        # The first frame of a drive shows no change, yet wakes the sensor.
        self._still = np.where(moves, 0, self._still + 1)
        awake = self._still < self.still_frames
        return single(np.where(awake, Shots.EIGHT.action, self.asleep.action))

    def reset(self) -> None:
        """Begin awake."""
        self._still = np.array(-1)

    def __str__(self) -> str:
        """The rule in words."""
        change = f" without a change of {self.change:g}" if np.isfinite(self.change) else ""
        return f"8 DCS until {self.still_frames} frames{change}, then {self.asleep:d}"


class MotionPolicy(Policy):
    """8 DCS where what the last 8 DCS saw cannot be carried along by motion, fewer elsewhere.

    After Noraky and Sze, arXiv 1810.01930: depth is estimated from the last full-power frame and
    the motion of the images, and the sensor is on at full power where that estimate is poor. There
    is no such estimate here: way and turn since the last frame of 8 DCS (frames times the present
    speed and yaw rate) and the change of the gray image since it stand for how poor it would be.

    Parameters
    ----------
    way_m, turn_rad : float
        Way and turn since the last 8 DCS beyond which the estimate counts as poor.
    change : float
        Change of log10 ambient radiance since then beyond which it does.
    otherwise : int
        Shots while it is good.
    """

    def __init__(
        self,
        feature_names: Sequence[str],
        way_m: float,
        turn_rad: float,
        change: float,
        otherwise: int = 2,
    ) -> None:
        self.way_m = checked_at_least("way_m", way_m, 0.0)
        self.turn_rad = checked_at_least("turn_rad", turn_rad, 0.0)
        self.change = checked_at_least("change", change, 0.0)
        self.otherwise = checked_shots(otherwise, "otherwise")
        needed = ("since_eight", "change_since_eight", "ego_speed", "yaw_rate")
        self._read = Readings(feature_names, *needed)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """8 DCS where way, turn or change are beyond their limits."""
        frames = self._read.frames_since_eight(observation)
        # Bounded, for before the first 8 DCS they are infinitely many, and a speed may be 0.
        seconds = FRAME_S * (np.minimum(frames, 1e9) + 1)
        poor = (
            (seconds * self._read.speed_m_s(observation) > self.way_m)
            | (seconds * self._read.yaw_rate_rad_s(observation) > self.turn_rad)
            | (self._read("change_since_eight", observation) > self.change)
            | np.isinf(frames)
        )
        return single(np.where(poor, Shots.EIGHT.action, self.otherwise.action))

    def __str__(self) -> str:
        """The rule in words."""
        limits = {"m": self.way_m, "rad": self.turn_rad, "of change": self.change}
        listed = [f"{limit:g} {unit}" for unit, limit in limits.items() if np.isfinite(limit)]
        once = f"once {' or '.join(listed)} lie behind the last" if listed else "in the first frame"
        return f"8 DCS {once}, else {self.otherwise:d}"


class UnsurePolicy(Policy):
    """8 DCS where the network is unsure, or where 2 and 4 DCS disagreed when last compared.

    To ask for more where one's own answer is in doubt is Chow's reject option: "On optimum
    recognition error and reject tradeoff", IEEE Trans. Inf. Theory 16 (1970).

    Parameters
    ----------
    confidence : float
        Mean confidence of the network below which it is unsure, 0..1.
    disagreement : float
        Mean error term of 2 DCS measured against 4 DCS, above which they disagree, 0..0.5; frames
        of 4 and 8 DCS tell it.
    otherwise : int
        Shots elsewhere.
    """

    def __init__(
        self,
        feature_names: Sequence[str],
        confidence: float,
        disagreement: float,
        otherwise: int = 4,
    ) -> None:
        self.confidence = checked_at_least("confidence", confidence, 0.0)
        self.disagreement = checked_at_least("disagreement", disagreement, 0.0)
        self.otherwise = checked_shots(otherwise, "otherwise")
        self._read = Readings(feature_names, "network_confidence", "two_from_four")

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """8 DCS where there is doubt."""
        doubt = (self._read("network_confidence", observation) < self.confidence) | (
            self._read.regret("two_from_four", observation) > self.disagreement
        )
        return single(np.where(doubt, Shots.EIGHT.action, self.otherwise.action))

    def __str__(self) -> str:
        """The rule in words."""
        return (
            f"8 DCS where the network's confidence is below {self.confidence:g} or 2 DCS were off "
            f"4 by more than {self.disagreement:g}, else {self.otherwise:d}"
        )
