"""A person against a policy: both take the same drive, frame by frame, with the same noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.policies import Policy
from shotenv.config import EnvConfig
from shotenv.env import ShotScheduleEnv
from unwrap.signal import Shots


@dataclass(frozen=True)
class Tally:
    """What one side has come to.

    Attributes
    ----------
    frames : int
        Frames played.
    score : float
        Sum of the rewards.
    laser_energy_j : float
        Sum of the laser's energy.
    error_m : float
        Sum of the depth error (mean over the valid pixels) of the frames that had depth.
    right_wrap : float
        Sum of the shares of pixels in the right wrap.
    taken : tuple of int
        Frames without laser, and those with 2, 4 and 8 samples.
    shots : int
        Samples of the last frame.
    temperature_k : float
        The laser's, now.
    """

    frames: int
    score: float
    laser_energy_j: float
    error_m: float
    right_wrap: float
    taken: tuple[int, int, int, int]
    shots: int
    temperature_k: float

    @classmethod
    def start(cls, info: dict[str, Any]) -> Tally:
        """Nothing has been played yet."""
        return cls(0, 0.0, 0.0, 0.0, 0.0, (0, 0, 0, 0), 0, info["temperature_k"])

    def after(self, reward: float, info: dict[str, Any]) -> Tally:
        """One frame later."""
        shots = info["shots"]
        return Tally(
            frames=self.frames + 1,
            score=self.score + reward,
            laser_energy_j=self.laser_energy_j + info["laser_energy_j"],
            error_m=self.error_m + (info["depth_mae_m"] if shots else 0.0),
            right_wrap=self.right_wrap + info["wrap_accuracy"],
            taken=tuple(  # type: ignore[arg-type]
                count + (shots == n) for n, count in zip((0, *Shots), self.taken, strict=True)
            ),
            shots=shots,
            temperature_k=info["temperature_k"],
        )

    @property
    def numbers(self) -> dict[str, Any]:
        """As they are written: means over the frames, shares of them, and sums."""
        with_depth = max(self.frames - self.taken[0], 1)
        return {
            "frames": self.frames,
            "return": self.score,
            "laser_energy_j": self.laser_energy_j,
            "depth_mae_m": self.error_m / with_depth,
            "wrap_accuracy": self.right_wrap / max(self.frames, 1),
            "frames_taken": dict(zip(("0", "2", "4", "8"), self.taken, strict=True)),
            "temperature_k": self.temperature_k,
        }


class Match:
    """One drive, taken by a person and by a policy.

    Parameters
    ----------
    config : EnvConfig
        Configuration of the environment; its bank has every pixel.
    rival : Policy
        Chooses for the other side.
    drive : int
        Seed of the drive.

    Attributes
    ----------
    person, rival : Tally
        What each side has come to.
    """

    def __init__(self, config: EnvConfig, rival: Policy, drive: int) -> None:
        fields = config.model_dump()
        self.env = ShotScheduleEnv(render_mode="rgb_array", **fields)
        self._other, self._policy = ShotScheduleEnv(**fields), rival
        self.frames = config.frames_per_drive
        self._policy.reset()
        _, info = self.env.reset(options={"drive": drive})
        self._seen, self._told = self._other.reset(options={"drive": drive})
        self.person, self.rival = Tally.start(info), Tally.start(info)

    @property
    def over(self) -> bool:
        """Whether the drive has been played to its end."""
        return self.person.frames >= self.frames

    def play(self, action: int) -> None:
        """Play one frame: the person's `action`, and what the policy chooses."""
        _, reward, _, _, info = self.env.step(action)
        self.person = self.person.after(reward, info)
        chosen = self._policy.act(self._seen, self._told)
        self._seen, reward, _, _, self._told = self._other.step(chosen)
        self.rival = self.rival.after(reward, self._told)

    def now(self) -> np.ndarray:
        """Gray image of the frame that is to be taken, float32 [H, W], share of full scale."""
        state, problem = self.env.state, self.env.problem
        assert state is not None  # a match begins with a reset
        gray = problem.bank.gray(state.drive.frame(state.step))[0].numpy()
        return gray.astype(np.float32) / (2**problem.config.sensor.adc_bits - 1)
