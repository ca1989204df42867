"""What the agent sees: named features, scaled to about [-1, 1]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from shotenv.bank import Bank, Clip
from shotenv.config import SensorConfig
from shotenv.predictions import KeptPredictions
from shotenv.sensor import electrons_per_radiance_second
from shotenv.sensor.converter import full_scale_lsb
from shotenv.sensor.gray import gray_gain_lsb_per_e
from unwrap.phase import unambiguous_range_m

SCENE_FEATURES: Mapping[str, str] = {
    "gray_mean": "mean of the gray image, share of full scale",
    "gray_std": "standard deviation of the gray image, share of half of full scale",
    "gray_dark": "share of pixels below 5 % of full scale",
    "gray_bright": "share of pixels above 80 % of full scale",
    "gray_texture": "mean difference of horizontal neighbours, share of full scale, times 20",
    "gray_vertical": "mean of the upper minus the lower half, share of full scale",
    "ambient_level": "log10 of the mean ambient radiance, W m-2 sr-1: -1 at 1e-4, 1 at 10",
    "network_distance": "mean predicted distance over the scored range",
    "network_confidence": "mean confidence of the network",
    "network_beyond": "share of pixels that the network sees beyond the unambiguous range",
    "ego_speed": "speed over 15 m/s",
    "yaw_rate": "yaw rate over 0.5 rad/s",
}
SEEN_FEATURES: Mapping[str, str] = {
    "amplitude": "mean amplitude: log10 of one plus LSB, over 3",
    "signal_to_noise": "mean over pixels of q / (q + 1), q the amplitude over 4 sigma of a sample",
    "valid_share": "share of valid pixels",
    "saturated_share": "share of saturated pixels",
    "residual": "opposite samples, with 4 or 8 shots: mean of q / (q + 1), q in 4 sigma",
    "disagreement": "network against two frequencies, with 8 shots: mean of e / (e + 1 m), valid",
}
STATE_FEATURES: Mapping[str, str] = {
    "gray_change": "mean change of log10 ambient since the last frame, on an 8 x 8 grid",
    "last_two": "1 after a frame of 2 shots",
    "last_four": "1 after a frame of 4 shots",
    "last_eight": "1 after a frame of 8 shots",
    "since_four": "1 - exp(-n / 16), n frames since 4 or 8 shots",
    "since_eight": "1 - exp(-n / 16), n frames since 8 shots",
    "temperature": "laser temperature above its release temperature, over 20 K",
    "heat_margin": "log(1 + K to the trip; negative: to the release, while off) / 3, fine near 0",
    "duty": "laser duty over the last second, relative to always 8",
    "power": "power over the last second, relative to always 8",
    "time_left": "1 at the start of the drive, -1 at its end",
}
FEATURES: Mapping[str, str] = {**SCENE_FEATURES, **SEEN_FEATURES, **STATE_FEATURES}
"""Name and meaning of each element of the observation, in order."""


def feature_index(feature_names: Sequence[str], name: str) -> int:
    """Place of the feature `name` in an observation.

    Raises
    ------
    ValueError
        There is no such feature.
    """
    if name not in feature_names:
        raise ValueError(f"feature_names has no {name!r}; it has {', '.join(feature_names)}")
    return list(feature_names).index(name)


def heat_margin(margin_k: Tensor) -> Tensor:
    """Feature `heat_margin` of a margin in kelvin, fine near 0: a frame warms by tenths of one."""
    return margin_k.sign() * margin_k.abs().log1p() / 3.0


def heat_margin_k(feature: np.ndarray) -> np.ndarray:
    """Margin in kelvin that the feature `heat_margin` stands for."""
    return np.sign(feature) * np.expm1(3.0 * np.abs(feature))


LIMIT = 2.0
"""Observations are clipped to +-LIMIT."""
GRID = 8


@dataclass(frozen=True)
class Scenes:
    """What is seen of each bank frame before any sample is taken; rows of other splits are NaN.

    Attributes
    ----------
    features : float32 [N, len(SCENE_FEATURES)]
        See `SCENE_FEATURES`.
    grid : float32 [N, GRID * GRID]
        Logarithm (base 10) of the ambient radiance, coarsely.
    """

    features: Tensor
    grid: Tensor


def look_at_scenes(
    bank: Bank, clips: tuple[Clip, ...], kept: KeptPredictions, sensor: SensorConfig
) -> Scenes:
    """Scene features of every frame of `clips`."""
    features = torch.full((len(bank), len(SCENE_FEATURES)), torch.nan)
    grid = torch.full((len(bank), GRID * GRID), torch.nan)
    for clip in clips:
        frames = torch.arange(clip.start, clip.start + clip.frames)
        features[frames], grid[frames] = _scene(bank, frames, kept, sensor)
    return Scenes(features, grid)


def _scene(
    bank: Bank, frames: Tensor, kept: KeptPredictions, sensor: SensorConfig
) -> tuple[Tensor, Tensor]:
    gray = bank.gray(frames).to(torch.float32) / full_scale_lsb(sensor.adc_bits)
    grid = _log_ambient(gray, torch.from_numpy(bank.gray_exposure_s)[frames], sensor)
    prediction = kept.of(frames)
    beyond = prediction.distance_m > unambiguous_range_m(sensor.f1_hz)
    middle = gray.shape[1] // 2
    mean = frame_means(gray)
    columns = (
        mean,
        2 * frame_means((gray - mean[:, None, None].to(gray.dtype)) ** 2).sqrt(),
        frame_means((gray < 0.05).to(gray.dtype)),
        frame_means((gray > 0.8).to(gray.dtype)),
        20 * frame_means((gray[:, :, 1:] - gray[:, :, :-1]).abs()),
        frame_means(gray[:, :middle]) - frame_means(gray[:, middle:]),
        (grid.mean(dim=1) + 1.5) / 2.5,
        frame_means(prediction.distance_m) / sensor.max_range_m,
        frame_means(prediction.confidence),
        frame_means(beyond.to(gray.dtype)),
        torch.from_numpy(bank.ego_speed_m_s)[frames] / 15.0,
        torch.from_numpy(bank.yaw_rate_rad_s)[frames] / 0.5,
    )
    return torch.stack([column.to(torch.float32) for column in columns], dim=1), grid


def frame_means(maps: Tensor) -> Tensor:
    """Mean of each of the maps [B, H, W], float64 [B].

    Row by row, because a sum over a whole frame at once is split among threads, and then its
    last bit depends on how many there are.
    """
    return maps.sum(dim=-1).sum(dim=-1, dtype=torch.float64) / (maps.shape[1] * maps.shape[2])


def _log_ambient(gray: Tensor, exposure_s: Tensor, sensor: SensorConfig) -> Tensor:
    """Log10 of the ambient radiance on a coarse grid, [B, GRID * GRID], floor 1e-5 W m-2 sr-1."""
    full_scale_e = full_scale_lsb(sensor.adc_bits) / gray_gain_lsb_per_e(sensor)
    scale = full_scale_e / (electrons_per_radiance_second(sensor) * exposure_s)
    coarse = torch.nn.functional.adaptive_avg_pool2d(gray.unsqueeze(1), GRID).flatten(1)
    return (coarse * scale[:, None].to(gray.dtype)).clamp_(min=1e-5).log10_()


def gray_change(scenes: Scenes, before: Tensor, now: Tensor) -> Tensor:
    """Mean absolute change of log10 ambient from bank frames `before` to `now`, float32 [B]."""
    return (scenes.grid[now] - scenes.grid[before]).abs_().mean(dim=1)
