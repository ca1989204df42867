"""Drives played by policies: the same drives with the same sensor noise for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from gymnasium.vector import VectorEnv

from agents.config import StudyConfig
from agents.optimum import by_clip, clairvoyant, tabulate
from agents.policies import Action, FixedPolicy, Observation, Policy
from shotenv.config import EnvConfig
from shotenv.decision import Problem, answered_actions
from shotenv.env import ShotScheduleVectorEnv
from unwrap.signal import Shots

# Objects that all studies share, since they remember nothing.
FIXED_POLICIES: Final = {f"always_{shots}": FixedPolicy(shots) for shots in Shots}


@dataclass(frozen=True)
class PlayedDrives:
    """Drives as a policy drove them; N drives of T frames.

    Attributes
    ----------
    seeds : int64 [N]
        Seeds of the drives.
    shots : int64 [N, T]
        Samples taken; 0 where the laser was off.
    asked : int64 [N, T]
        Samples asked for.
    observations : float32 [N, T, D]
        What the policy saw of each frame as it chose, features alone.
    reward, laser_energy_j, energy_j, life_used_h, depth_mae_m, wrap_accuracy, within_0p1m, \
temperature_k : float64 [N, T]
        As in the environment's `info`; error and shares of pixels are NaN where the laser was off.
    temporal_error_m : float64 [N, T]
        NaN where it is not known: before `with_temporal_errors`; and see there.
    family : str [N, T]
        Scene family of the frame.
    clip : int64 [N, T]
        Number of the bank's clip that the frame is of.
    power_price : float64 [N]
        Weight of power in the reward of each drive.
    reward_per_price : float64 [N, T]
        What a unit of that weight adds to the reward: `scale` times the term `power` of 4 DCS less
        that of what was taken.
    """

    seeds: np.ndarray
    shots: np.ndarray
    asked: np.ndarray
    observations: np.ndarray
    reward: np.ndarray
    laser_energy_j: np.ndarray
    energy_j: np.ndarray
    life_used_h: np.ndarray
    depth_mae_m: np.ndarray
    wrap_accuracy: np.ndarray
    within_0p1m: np.ndarray
    temporal_error_m: np.ndarray
    temperature_k: np.ndarray
    family: np.ndarray
    clip: np.ndarray
    power_price: np.ndarray
    reward_per_price: np.ndarray

    def rewards_at(self, price: float) -> np.ndarray:
        """Rewards [N, T] of the same frames, had power weighed `price` in all drives."""
        return self.reward + (price - self.power_price)[:, None] * self.reward_per_price

    def returns_at(self, price: float) -> np.ndarray:
        """Their sums [N] over each drive."""
        return self.rewards_at(price).sum(axis=1)

    @property
    def per_drive(self) -> dict[str, np.ndarray]:
        """Each measure as one number [N] per drive."""
        return {
            "return": self.reward.sum(axis=1),
            "laser_energy_j": self.laser_energy_j.sum(axis=1),
            "energy_j": self.energy_j.sum(axis=1),
            "life_used_h": self.life_used_h.sum(axis=1),
            # Over frames with laser: one without has no depth. The return counts it in full.
            "depth_mae_m": mean_known(self.depth_mae_m),
            "wrap_accuracy": mean_known(self.wrap_accuracy),
            "within_0p1m": mean_known(self.within_0p1m),
            "temporal_error_m": mean_known(self.temporal_error_m),
            "tripped_share": np.mean(self.shots == 0, axis=1),
        }

    def per_clip(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Of each measure the sum over the frames of each clip, and their number, [C] each.

        The ratio of both, summed over clips, is the mean over drives. Clips are what intervals
        resample: drives that pass the same ones are no independent trials.
        """
        frames = self.shots.shape[1]
        lit = self.shots > 0
        every, pairs = np.ones_like(lit), ~np.isnan(self.temporal_error_m)
        # What recordings cannot be scored against is not known with laser either.
        known = lit & ~np.isnan(self.depth_mae_m)
        # Over frames with laser: one without has no depth. The return counts it in full.
        counted = {
            "return": (frames * self.reward, every),
            "laser_energy_j": (frames * self.laser_energy_j, every),
            "energy_j": (frames * self.energy_j, every),
            "life_used_h": (frames * self.life_used_h, every),
            "depth_mae_m": (self.depth_mae_m, known),
            "wrap_accuracy": (self.wrap_accuracy, known),
            "within_0p1m": (self.within_0p1m, known),
            "temporal_error_m": (self.temporal_error_m, pairs),
            "tripped_share": (~lit, every),
        }
        return {
            name: (
                by_clip(np.where(where, values, 0.0), self.clip),
                by_clip(where.astype(float), self.clip),
            )
            for name, (values, where) in counted.items()
        }

    def with_temporal_errors(self, of_actions: np.ndarray) -> PlayedDrives:
        """The same with the temporal error of what was taken.

        Parameters
        ----------
        of_actions : float64 [N, T, 3, 3]
            Of these drives; see `tabulate_temporal_errors`. None is known, too, where the laser was
            off in a frame or the one before.
        """
        drive, frame = np.indices(self.shots[:, 1:].shape)
        action, lit = np.searchsorted(list(Shots), self.shots), self.shots > 0
        error_m = np.full(self.shots.shape, np.nan)
        error_m[:, 1:] = np.where(
            lit[:, :-1] & lit[:, 1:],
            of_actions[drive, frame + 1, action[:, :-1], action[:, 1:]],
            np.nan,
        )
        return replace(self, temporal_error_m=error_m)

    def shots_share(self, family: str | None = None) -> list[float]:
        """Share of 2, 4 and 8 shots among the frames with laser, of one family or of all."""
        counted = self.shots if family is None else self.shots[self.family == family]
        total = max(int(np.count_nonzero(counted)), 1)
        return [float(np.count_nonzero(counted == shots) / total) for shots in Shots]


def mean_known(values: np.ndarray) -> np.ndarray:
    """Means [N] over the values [N, T] that are not NaN; NaN where all are.

    Examples
    --------
    >>> mean_known(np.array([[1.0, np.nan, 2.0], [np.nan, np.nan, np.nan]]))
    array([1.5, nan])
    """
    known = np.count_nonzero(~np.isnan(values), axis=1)
    return np.where(known > 0, np.nansum(values, axis=1) / np.maximum(known, 1), np.nan)


def make_envs(config: EnvConfig, split: str, count: int, mode: str) -> ShotScheduleVectorEnv:
    """`count` environments of `config` on the drives of `split`, with autoreset mode `mode`."""
    # As keywords, like everyone else's: the environment validates them again.
    fields = config.model_copy(update={"split": split}).model_dump()
    return ShotScheduleVectorEnv(count, autoreset_mode=mode, remember=True, **fields)


def drive_seeds(study: StudyConfig, drives: int) -> list[int]:
    """Seeds of the first `drives` drives of a study."""
    return [study.seed + i for i in range(drives)]


def play_drives(
    policy: Policy,
    envs: VectorEnv,
    seeds: Sequence[int],
    *,
    price: float | None = None,
    tick: Callable[[int], object] = lambda frames: None,
) -> PlayedDrives:
    """Drive one drive per environment, all at once, to the end.

    Parameters
    ----------
    policy : Policy
        Is reset first.
    envs : gymnasium.vector.VectorEnv
        As many environments as `seeds`, in any autoreset mode.
    seeds : sequence of int
        Seed of each drive.
    price : float, optional
        Weight of power in the reward of all drives; each drive's own by default.
    tick : callable
        Told the number of frames driven after each step.
    """
    one_each: Any = list(seeds)  # gymnasium's annotation forgets sequences
    options = {} if price is None else {"power_price": price}
    observations, infos = envs.reset(seed=one_each, options=options)
    policy.reset()
    unwrapped: Any = envs.unwrapped  # gymnasium's annotation does not know our attributes
    families = np.array(unwrapped.family_names)
    starts = np.array([clip.start for clip in unwrapped.problem.bank.clips])
    power_price = np.array(infos["power_price"])
    # Of the drives as they begin, which an environment that starts anew by itself replaces.
    drive, scale = unwrapped.state.drive, unwrapped.problem.config.reward.scale
    power_of_four = (drive.always_four.energy_j / drive.always_eight.energy_j).numpy()
    # All drives are equally long: they end in the same step, and no frame of a next one is kept.
    frames: list[dict[str, np.ndarray]] = []
    done = np.zeros(len(seeds), dtype=bool)
    allowed = answered_actions(unwrapped.problem).numpy()
    while not done.all():
        if allowed.all():
            actions = policy.act(observations, infos)
        else:
            actions = policy.act_among(observations, infos, allowed)
        features = observations["state"] if isinstance(observations, Mapping) else observations
        seen = np.array(features, dtype=np.float32)
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        done = terminated | truncated
        # Where a drive has ended and the next begun in one step, `infos` tell of the new drive.
        told = infos.get("final_info", infos)
        off = np.asarray(told["shots"]) == 0
        # Copies, since the environment may write the next step into the same arrays.
        frames.append(
            {
                "shots": np.array(told["shots"], dtype=np.int64),
                "asked": np.array(told["asked"], dtype=np.int64),
                "observations": seen,
                "reward": np.array(rewards, dtype=np.float64),
                "laser_energy_j": np.array(told["laser_energy_j"]),
                "energy_j": np.array(told["energy_j"]),
                "life_used_h": np.array(told["life_used_h"]),
                "depth_mae_m": np.where(off, np.nan, told["depth_mae_m"]),
                "wrap_accuracy": np.where(off, np.nan, told["wrap_accuracy"]),
                "within_0p1m": np.where(off, np.nan, told["within_0p1m"]),
                "temporal_error_m": np.full(len(seeds), np.nan),
                "temperature_k": np.array(told["temperature_k"]),
                "family": families[told["family"]],
                "reward_per_price": scale * (power_of_four - told["reward_terms"]["power"]),
                "clip": np.searchsorted(starts, told["frame"], side="right") - 1,
            }
        )
        tick(len(seeds))
    stacked = {name: np.stack([frame[name] for frame in frames], axis=1) for name in frames[0]}
    return PlayedDrives(seeds=np.asarray(seeds), power_price=power_price, **stacked)


class ReplayPolicy(Policy):
    """Takes given actions, whatever is observed.

    Parameters
    ----------
    actions : int64 [N, T]
        Of N drives at once; -1 where the laser is off, which asks for nothing.
    """

    def __init__(self, actions: np.ndarray) -> None:
        self._actions = np.maximum(actions, 0)
        self.reset()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The actions of the next frame."""
        self._frame += 1
        return self._actions[:, self._frame]

    def reset(self) -> None:
        """Begin with the first frame."""
        self._frame = -1


def play_optimum(
    problem: Problem,
    seeds: Sequence[int],
    *,
    tick: Callable[[int], object] = lambda frames: None,
) -> PlayedDrives | None:
    """The drives `seeds` as dynamic programming takes them at each drive's own price of power.

    What it chooses on the table of outcomes is played in the environment, which tells heat and
    energy, too.

    Parameters
    ----------
    problem : Problem
        That of the drives' split.
    seeds : sequence of int
    tick : callable
        Told the number of frames after each drive whose outcomes are known.

    Returns
    -------
    PlayedDrives or None
        None where the optimum is not known, with a derated laser: what that would measure depends
        on the choices before.
    """
    if problem.config.laser.derate_per_k > 0:
        return None
    best = clairvoyant(tabulate(problem, seeds, tick=tick).table())
    envs = make_envs(problem.config, problem.config.split, len(seeds), "Disabled")
    return play_drives(ReplayPolicy(best.actions), envs, seeds)
