"""`gymnasium.Env` face of a camera that is there: choose the shots of each frame as it comes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor

from shotenv.bank import ClipSettings
from shotenv.config import env_config
from shotenv.decision import (
    FEATURE_NAMES,
    Drive,
    Measurement,
    Problem,
    State,
    allowed_actions,
    load_networks,
    observe,
    reset,
    step,
)
from shotenv.env import (
    ACTIONS,
    COLDEST_K,
    check_action,
    check_number,
    check_options,
    drive_seed,
    family_codes,
    feature_space,
    info_columns,
    info_of,
    term_space,
)
from shotenv.laser import start_laser
from shotenv.live.live_bank import Ego, LiveBank, standing
from shotenv.live.live_camera import Camera
from shotenv.live.live_problem import live_problem, look, measure_live
from shotenv.live.warm_up import warm_up
from shotenv.sensor import description_of
from unwrap.signal import DepthFrame, Shots


@dataclass(frozen=True)
class FrameTimes:
    """When the stages of a frame ended, `time.perf_counter` seconds.

    Attributes
    ----------
    gray_s, chosen_s, samples_s, depth_s : float
        The gray image had arrived; the shots were chosen; the samples had arrived; there was depth.
    """

    gray_s: float
    chosen_s: float
    samples_s: float
    depth_s: float


def keep_nothing(depth: DepthFrame, shots: Shots) -> None:
    """What is done with depth that nobody wants."""


class LiveShotScheduleEnv(gymnasium.Env[np.ndarray, np.int64]):
    """`ShotScheduleEnv` with a camera in place of a bank.

    Observation, masks, heat and energy are those of a drive in a bank: the same features of the
    gray image and of what samples told, the same model of the laser. There is no truth, so that
    energy, duty and heat alone make the reward. `step` takes the samples of the frame whose gray
    image was observed, and returns when the next gray image is there: it never runs ahead of the
    camera.

    The camera is closed by `close`, at the end of a `with` block, and by every error.

    Parameters
    ----------
    camera : Camera
    config
        As for `ShotScheduleEnv`, whose `fields` change it; bank and split do not matter. Its frame
        rate must be the camera's, and its sensor and laser those of the camera.
    offset_lsb : float32 [H, W], optional
        The calibrated dark offset, subtracted from two samples.
    shift_m : float, optional
        Added to every distance; minus the sensor's drift at the camera's temperature without.
    ego : callable
        Tells speed and yaw rate; see `Ego`.
    deliver : callable
        Given each depth frame, and from how many samples it is, as soon as it is there.
    stale_s : float, optional
        Longest time from a gray image to the last of its samples; a frame's period without.

    Attributes
    ----------
    times : FrameTimes
        Of the last frame.
    """

    metadata = {"render_modes": []}  # noqa: RUF012
    feature_names = FEATURE_NAMES

    def __init__(
        self,
        camera: Camera,
        config: str = "default",
        *,
        offset_lsb: Tensor | None = None,
        shift_m: float | None = None,
        ego: Ego = standing,
        deliver: Callable[[DepthFrame, Shots], object] = keep_nothing,
        stale_s: float | None = None,
        **fields: Any,
    ) -> None:
        self.camera, self.config = camera, env_config(config, **fields)
        self._offset_lsb = torch.zeros(camera.size) if offset_lsb is None else offset_lsb
        if self._offset_lsb.shape != camera.size:
            raise ValueError(
                f"offset_lsb is {tuple(self._offset_lsb.shape)}; expected {camera.size}"
            )
        self._shift_m, self._ego, self._deliver = shift_m, ego, deliver
        self._stale_s = 1.0 / self.config.frame_rate_hz if stale_s is None else stale_s
        self._networks = load_networks(self.config.unwrapper, description_of(self.config.sensor))
        self.observation_space = feature_space()
        self.action_space = spaces.Discrete(ACTIONS)
        self.reward_space = term_space()
        self.state: State | None = None
        self._left_k: float | None = None  # Of the laser, when last heard of.
        self.times = FrameTimes(*(math.nan,) * 4)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start the camera, and a drive with its next frame.

        Parameters
        ----------
        options
            `laser_k`, temperature of the laser now, K: without, that of the air around, or what the
            last drive left; `power_price`, set instead of drawn; `drive`, seed of what is drawn.

        Raises
        ------
        CameraError
            The camera failed.
        ValueError
            An unknown option, or a value that is of no use.
        """
        super().reset(seed=seed)
        with self._closing():
            if self._left_k is None:
                # Compiling loops and networks takes longer than a camera waits.
                usual = self._settings(self.config.sensor.calibration_temperature_k)
                warm_up(self.config, self._networks, usual, self.camera.size)
            self.camera.start()
            settings = self._settings(self.camera.temperature_k())
            frames = self.config.frames_per_drive + 1
            self._bank = bank = LiveBank(
                self.camera, frames, settings, ego=self._ego, stale_s=self._stale_s
            )
            self.problem = live_problem(bank, self.config, self._networks)
            self._codes = family_codes(bank)
            chosen = check_options(options, self.problem, also=("laser_k",))
            laser_k = self._left_k = self._laser_k(options or {}, settings.ambient_k)
            begun = reset(self.problem, chosen.seeds or (drive_seed(self.np_random),), chosen.drive)
            warmth = start_laser(torch.full_like(begun.drive.start_k, laser_k))
            state = self.state = replace(begun, laser=warmth)
            self._next_frame()
        return self._observed(state), info_of(info_columns(self.problem, self._codes, state), 0)

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take the samples of the frame that is there, and wait for the next one's gray image.

        Raises
        ------
        CameraError
            The camera failed, or the samples are not of this frame any more.
        ValueError
            The action is not 0, 1 or 2.
        ResetNeeded
            No drive has been started, or it is over.
        """
        chosen = torch.tensor([check_action(action)])
        before = self.state
        if before is None or int(before.step) >= self.config.frames_per_drive:
            raise gymnasium.error.ResetNeeded("no drive is under way; call reset() first")
        with self._closing():
            after, outcome = step(self.problem, before, chosen, measure=self._measure)
            self.state, self._left_k = after, float(after.laser.temperature_k)
            self._next_frame()
        columns = info_columns(self.problem, self._codes, before, after, outcome)
        truncated = bool(outcome.truncated)
        return self._observed(after), float(outcome.reward), False, truncated, info_of(columns, 0)

    def action_masks(self) -> np.ndarray:
        """Which actions the laser's heat allows now, bool [3]: others would trip it."""
        if self.state is None:
            raise gymnasium.error.ResetNeeded("no drive is under way; call reset() first")
        return allowed_actions(self.problem, self.state)[0].numpy()

    def close(self) -> None:
        """Close the camera."""
        self.camera.close()

    @contextmanager
    def _closing(self) -> Iterator[None]:
        """End the drive and close the camera where something fails: nobody else will."""
        try:
            yield
        except BaseException:
            self.state = None
            self.close()
            raise

    def _settings(self, imager_k: float) -> ClipSettings:
        """Constants of a drive that begins with the imager at this temperature."""
        sensor = self.config.sensor
        warmed_m = sensor.distance_drift_m_per_k * (imager_k - sensor.calibration_temperature_k)
        return ClipSettings(
            laser_power_w=self.camera.laser_power_w,
            integration_s=self.camera.integration_s,
            ambient_k=imager_k - sensor.self_heating_k,
            shift_m=-warmed_m if self._shift_m is None else self._shift_m,
            offset_lsb=self._offset_lsb,
        )

    def _laser_k(self, options: Mapping[str, Any], ambient_k: float) -> float:
        """Temperature that the laser begins a drive with."""
        if "laser_k" in options:
            lowest, highest = COLDEST_K, self.config.laser.trip_k
            return check_number("laser_k", options["laser_k"], lowest, highest, "K")
        # As the last drive left it, however long ago that was: too warm rather than too cold.
        return ambient_k if self._left_k is None else self._left_k

    def _next_frame(self) -> None:
        self._bank.next_frame()
        look(self.problem, self._bank, self._networks[0])

    def _observed(self, state: State) -> np.ndarray:
        return observe(self.problem, state)[0].numpy()

    def _measure(
        self, problem: Problem, drive: Drive, step: Tensor, shots: Tensor, power_w: Tensor | None
    ) -> Measurement:
        """As `measure_live`, and hands over the depth."""
        chosen_s = time.perf_counter()
        measured, taken = measure_live(problem, drive, step, shots, power_w)
        # Without laser no samples come: they are there when that is chosen.
        samples_s = max(chosen_s, self._bank.samples_s)
        self.times = FrameTimes(self._bank.gray_s, chosen_s, samples_s, time.perf_counter())
        if taken is not None:
            self._deliver(taken.depth, taken.raw.shots)
        return measured
