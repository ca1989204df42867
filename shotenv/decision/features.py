"""What the agent sees: one table of features with name, unit, meaning and function.

A feature belongs to the part of the table that its function takes: `Scene`, what the gray image
shows before any sample is taken; `Sums`, what the last acquisition told; `Now`, the state of the
drive. Values are scaled to about [-1, 1] and clipped to +-`LIMIT`. A new feature is a new line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from unwrap.signal import Shots

LIMIT = 2.0
"""Observations are clipped to +-LIMIT."""


class Feature(NamedTuple):
    """One element of the observation.

    Attributes
    ----------
    name, unit, meaning : str
        The unit is that of what is scaled; "1" is a plain number.
    value : callable
        The element of each frame, [B], from the `Scene`, `Sums` or `Now` of B frames.
    least_shots : Shots
        Fewest samples that tell it; with fewer it stays as the last frame with enough told it.
    """

    name: str
    unit: str
    meaning: str
    value: Callable[[Any], Tensor]
    least_shots: Shots = Shots.TWO


@dataclass(frozen=True)
class Scene:
    """What is seen of B bank frames before any sample is taken.

    Attributes
    ----------
    gray : float32 [B, H, W]
        Gray image, share of full scale.
    log_ambient : float32 [B, K]
        Log10 of the ambient radiance on a coarse grid, W m-2 sr-1.
    predicted_m, confidence : float32 [B, H, W]
        The network's distance, and its confidence.
    unambiguous_m, range_m : float
        Unambiguous range at f1, and the range that is scored.
    ego_speed_m_s, yaw_rate_rad_s : float64 [B]
    """

    gray: Tensor
    log_ambient: Tensor
    predicted_m: Tensor
    confidence: Tensor
    unambiguous_m: float
    range_m: float
    ego_speed_m_s: Tensor
    yaw_rate_rad_s: Tensor


@dataclass(frozen=True)
class Sums:
    """Sums over the pixels of an acquisition, without knowing the truth; float64 [B] each.

    Attributes
    ----------
    pixels, valid, saturated
        Number of all, of valid and of saturated pixels.
    amplitude_lsb
        Sum of the amplitudes.
    strength, residual
        Sums of q / (q + 1), q being the amplitude, or the residual of opposite samples, over four
        standard deviations of a sample.
    lost_by_two, lost_by_four, two_from_four
        Sums over valid pixels of the reward's error term e / (e + scale), e the distance between
        the depth of all samples and that of the first two; and of the first four; and between
        these two.
    """

    pixels: Tensor
    valid: Tensor
    saturated: Tensor
    amplitude_lsb: Tensor
    strength: Tensor
    residual: Tensor
    lost_by_two: Tensor
    lost_by_four: Tensor
    two_from_four: Tensor

    def per_valid(self, sums: Tensor) -> Tensor:
        """Mean over the valid pixels; 0 where there are none."""
        return sums / self.valid.clamp(min=1.0)


@dataclass(frozen=True)
class Now:
    """The state of B drives before a frame.

    Attributes
    ----------
    gray_change, change_since_eight : float32 [B]
        Mean change of log10 ambient since the last frame, and since the last with 8 samples.
    shots, since_four, since_eight : int64 [B]
        Samples of the last frame; frames since the last with at least 4, and with 8 samples.
    above_release_k, margin_k : float64 [B]
        Laser temperature above its release temperature; kelvin to the trip, or while the laser is
        off to the release, then negative.
    duty, power : float64 [B]
        Over the last second, relative to always 8.
    step : int64 [B]
        Frames played, of `frames` in all.
    power_price : float64 [B]
        Weight of power in the reward.
    laser_power_w, integration_s : float64 [B]
        Settings of the drive.
    """

    gray_change: Tensor
    change_since_eight: Tensor
    shots: Tensor
    since_four: Tensor
    since_eight: Tensor
    above_release_k: Tensor
    margin_k: Tensor
    duty: Tensor
    power: Tensor
    step: Tensor
    frames: int
    power_price: Tensor
    laser_power_w: Tensor
    integration_s: Tensor


def frame_means(maps: Tensor) -> Tensor:
    """Mean of each of the maps [B, H, W], float64 [B].

    Row by row, because a sum over a whole frame at once is split among threads, and then its
    last bit depends on how many there are.
    """
    return maps.sum(dim=-1).sum(dim=-1, dtype=torch.float64) / (maps.shape[1] * maps.shape[2])


def frame_shares(mask: Tensor) -> Tensor:
    """Share of each of the masks bool [B, H, W] that holds, float64 [B]."""
    return frame_means(mask.to(torch.float32))


def frame_spreads(maps: Tensor) -> Tensor:
    """Standard deviation of each of the maps [B, H, W], float64 [B]."""
    # In two passes: the mean square less the squared mean would cancel in even images.
    means = frame_means(maps)[:, None, None].to(maps.dtype)
    return frame_means((maps - means) ** 2).sqrt()


def upper_minus_lower(maps: Tensor) -> Tensor:
    """Mean of the upper minus that of the lower half of each of the maps [B, H, W]."""
    middle = maps.shape[1] // 2
    return frame_means(maps[:, :middle]) - frame_means(maps[:, middle:])


def heat_margin(margin_k: Tensor) -> Tensor:
    """Feature `heat_margin` of a margin in kelvin, fine near 0: a frame warms by tenths of one."""
    return margin_k.sign() * margin_k.abs().log1p() / 3.0


def heat_margin_k(feature: np.ndarray) -> np.ndarray:
    """Margin in kelvin that the feature `heat_margin` stands for."""
    return np.sign(feature) * np.expm1(3.0 * np.abs(feature))


def recently(since: Tensor) -> Tensor:
    """0 right after something was seen, towards 1 as it grows old: 1 - exp(-n / 16), n frames."""
    # By NumPy, as below: torch's own shares a few hundred numbers among threads, and waits for them.
    return torch.from_numpy(1.0 - np.exp(since.numpy() / -16.0))


def log10(values: Tensor) -> Tensor:
    """Base-10 logarithm."""
    return torch.from_numpy(np.log10(values.numpy()))


# One line for each, however long: name and formula are read together. The numbers in the formulas
# bring usual values to about [-1, 1]; they are choices and no physics, and agents are trained with
# them: another number is another observation.
# fmt: off
SCENE_FEATURES = (
    Feature("gray_mean", "full scale", "mean of the gray image", lambda s: frame_means(s.gray)),
    Feature("gray_std", "half of full scale", "standard deviation of the gray image", lambda s: 2 * frame_spreads(s.gray)),
    Feature("gray_dark", "1", "share of pixels below 5 % of full scale", lambda s: frame_shares(s.gray < 0.05)),
    Feature("gray_bright", "1", "share of pixels above 80 % of full scale", lambda s: frame_shares(s.gray > 0.8)),
    Feature("gray_texture", "full scale / 20", "mean difference of horizontal neighbours", lambda s: 20 * frame_means(s.gray.diff(dim=2).abs())),
    Feature("gray_vertical", "full scale", "mean of the upper minus the lower half", lambda s: upper_minus_lower(s.gray)),
    Feature("ambient_level", "log10 of W m-2 sr-1", "mean ambient radiance: -1 at 1e-4, 1 at 10", lambda s: (s.log_ambient.mean(dim=1) + 1.5) / 2.5),
    Feature("network_distance", "scored range", "mean predicted distance", lambda s: frame_means(s.predicted_m) / s.range_m),
    Feature("network_confidence", "1", "mean confidence of the network", lambda s: frame_means(s.confidence)),
    Feature("network_beyond", "1", "share of pixels that the network sees beyond the unambiguous range", lambda s: frame_shares(s.predicted_m > s.unambiguous_m)),
    Feature("ego_speed", "15 m/s", "speed along the camera's heading, negative backwards", lambda s: s.ego_speed_m_s / 15.0),
    Feature("yaw_rate", "0.5 rad/s", "yaw rate of the camera", lambda s: s.yaw_rate_rad_s / 0.5),
)
"""Functions of a `Scene`."""

# 6.9 is 3 ln 10: amplitudes of 0 to 1000 LSB are 0 to 1.
SEEN_FEATURES = (
    Feature("amplitude", "log10 of LSB, over 3", "one plus the mean amplitude", lambda s: (s.amplitude_lsb / s.pixels).log1p() / 6.9),
    Feature("signal_to_noise", "1", "mean of q / (q + 1), q the amplitude over 4 sigma of a sample", lambda s: s.strength / s.pixels),
    Feature("valid_share", "1", "share of valid pixels", lambda s: s.valid / s.pixels),
    Feature("saturated_share", "1", "share of saturated pixels", lambda s: s.saturated / s.pixels),
    Feature("residual", "1", "mean of q / (q + 1), q what opposite samples do not cancel, over 4 sigma", lambda s: s.residual / s.pixels, Shots.FOUR),
    Feature("two_from_four", "1/4", "mean error term of 2 DCS measured against 4 DCS, over valid pixels", lambda s: 4 * s.per_valid(s.two_from_four), Shots.FOUR),
    Feature("regret_of_two", "1/4", "mean error term of 2 DCS measured against 8 DCS, over valid pixels", lambda s: 4 * s.per_valid(s.lost_by_two), Shots.EIGHT),
    Feature("regret_of_four", "1/4", "mean error term of 4 DCS measured against 8 DCS, over valid pixels", lambda s: 4 * s.per_valid(s.lost_by_four), Shots.EIGHT),
)
"""Functions of the `Sums` of the last acquisition with enough samples; 0 before the first."""

STATE_FEATURES = (
    Feature("gray_change", "log10", "mean change of ambient radiance since the last frame, on a coarse grid", lambda n: n.gray_change),
    Feature("change_since_eight", "log10", "mean change of ambient radiance since the last frame of 8 samples, on a coarse grid", lambda n: n.change_since_eight),
    Feature("last_two", "1", "1 after a frame of 2 samples", lambda n: n.shots == Shots.TWO),
    Feature("last_four", "1", "1 after a frame of 4 samples", lambda n: n.shots == Shots.FOUR),
    Feature("last_eight", "1", "1 after a frame of 8 samples", lambda n: n.shots == Shots.EIGHT),
    Feature("since_four", "1", "1 - exp(-n / 16), n frames since 4 or 8 samples", lambda n: recently(n.since_four)),
    Feature("since_eight", "1", "1 - exp(-n / 16), n frames since 8 samples", lambda n: recently(n.since_eight)),
    Feature("temperature", "20 K", "laser temperature above its release temperature", lambda n: n.above_release_k / 20.0),
    Feature("heat_margin", "log of K", "log(1 + K to the trip; negative: to the release, while off) / 3, fine near 0", lambda n: heat_margin(n.margin_k)),
    Feature("duty", "always 8", "laser duty over the last second", lambda n: n.duty),
    Feature("power", "always 8", "power over the last second", lambda n: n.power),
    Feature("power_price", "1", "weight p of power in the reward: p / (p + 0.05)", lambda n: n.power_price / (n.power_price + 0.05)),
    Feature("laser_power", "log10 of 5 W", "optical power while on", lambda n: log10(n.laser_power_w / 5.0)),
    Feature("integration", "log10 of 0.5 ms", "integration time of a sample", lambda n: log10(n.integration_s / 0.5e-3)),
    Feature("time_left", "1", "1 at the start of the drive, -1 at its end", lambda n: 1.0 - n.step * (2.0 / n.frames)),
)
"""Functions of `Now`."""
# fmt: on

FEATURES = (*SCENE_FEATURES, *SEEN_FEATURES, *STATE_FEATURES)
"""All features, in the order of the observation."""
FEATURE_NAMES = tuple(feature.name for feature in FEATURES)
TOLD = torch.tensor(
    [
        [feature.least_shots <= shots for feature in SEEN_FEATURES]
        for shots in range(Shots.EIGHT + 1)
    ]
)
"""Which of the `SEEN_FEATURES` each number of samples tells, bool [9, S]: row 2 is that of two
samples, which leave out what takes more, and row 0, of none, is all false."""


def evaluated(features: Sequence[Feature], seen: Scene | Sums | Now) -> Tensor:
    """Values of `features`, float32 [B, len(features)]."""
    # Converted together: torch finds the type that holds all of them, and each number is rounded
    # once.
    return torch.stack([feature.value(seen) for feature in features], dim=1).to(torch.float32)


def feature_index(feature_names: Sequence[str], name: str) -> int:
    """Place of the feature `name` in an observation.

    Raises
    ------
    ValueError
        There is no such feature.
    """
    if not isinstance(feature_names, list | tuple) or not all(
        isinstance(one, str) for one in feature_names
    ):
        raise TypeError(
            f"feature_names is {type(feature_names).__name__}; expected a list or tuple of names"
        )
    if name not in feature_names:
        raise ValueError(f"feature_names has no {name!r}; it has {', '.join(feature_names)}")
    return list(feature_names).index(name)
