"""What is seen of each bank frame before any sample is taken: computed once for a problem."""

from __future__ import annotations

from dataclasses import dataclass
from math import isclose

import numpy as np
import torch
from torch import Tensor

from shotenv.bank import Bank, BankError, Clip, KeptPredictions, StoredNetwork, ThinnedBank
from shotenv.config import SensorConfig
from shotenv.decision.features import SCENE_FEATURES, Scene, evaluated
from shotenv.sensor import electrons_per_radiance_second, full_scale_lsb, gray_gain_lsb_per_e
from unwrap.signal import unambiguous_range_m
from unwrap.support import array, loop

GRID = 8
"""Cells down and across an image in which ambient light is compared from frame to frame."""
DARKEST_RADIANCE = 1e-5
"""Floor of the ambient radiance, W m-2 sr-1: less does not show in a gray image."""


@dataclass(frozen=True)
class Scenes:
    """Scene features of every frame of a bank; rows of other splits are NaN.

    Attributes
    ----------
    features : float32 [N, len(SCENE_FEATURES)]
    log_ambient : float32 [N, GRID * GRID]
        See `Scene`.
    """

    features: Tensor
    log_ambient: Tensor

    def change(self, before: Tensor, now: Tensor) -> Tensor:
        """Mean absolute change of log10 ambient between bank frames [B], float32 [B]."""
        change = np.empty(len(now), np.float32)
        mean_changes_(array(self.log_ambient), before.numpy(), now.numpy(), change)
        return torch.from_numpy(change)


@loop
def mean_changes_(values: np.ndarray, before: np.ndarray, now: np.ndarray, change: np.ndarray):
    """Mean absolute difference of the rows `now` [B] from `before` [B] of values float32 [N, K].

    `change`, float32 [B], is written.
    """
    for b in range(len(change)):
        total = np.float32(0.0)
        for k in range(values.shape[1]):
            total += abs(values[now[b], k] - values[before[b], k])
        change[b] = total / np.float32(values.shape[1])


def look_at_scenes(
    bank: Bank, clips: tuple[Clip, ...], kept: KeptPredictions, sensor: SensorConfig
) -> Scenes:
    """Scene features of every frame of `clips`."""
    # NaN, so that a frame of a split that is not played would show at once.
    features = torch.full((len(bank), len(SCENE_FEATURES)), torch.nan)
    log_ambient = torch.full((len(bank), GRID * GRID), torch.nan)
    exposure_s, speed_m_s, yaw_rate_rad_s = map(
        torch.from_numpy, (bank.gray_exposure_s, bank.ego_speed_m_s, bank.yaw_rate_rad_s)
    )
    # Clip by clip: all frames of a bank at once would fill the memory.
    for clip in clips:
        frames = torch.arange(clip.start, clip.start + clip.frames)
        gray = bank.gray(frames).to(torch.float32) / full_scale_lsb(sensor.adc_bits)
        prediction = kept.of(frames)
        scene = Scene(
            gray=gray,
            log_ambient=log_ambient_of(gray, exposure_s[frames], sensor),
            predicted_m=prediction.distance_m,
            confidence=prediction.confidence,
            unambiguous_m=unambiguous_range_m(sensor.f1_hz),
            range_m=sensor.max_range_m,
            ego_speed_m_s=speed_m_s[frames],
            yaw_rate_rad_s=yaw_rate_rad_s[frames],
        )
        features[frames], log_ambient[frames] = evaluated(SCENE_FEATURES, scene), scene.log_ambient
    return Scenes(features, log_ambient)


def stored_scenes(bank: ThinnedBank, clips: tuple[Clip, ...], network: StoredNetwork) -> Scenes:
    """Scene features of every frame of `clips`, as they were made before the bank was thinned.

    Raises
    ------
    BankError
        The bank lacks a feature, or has one of another formula.
    """
    held = bank.manifest.scene_features
    missing = [feature.name for feature in SCENE_FEATURES if feature.name not in held]
    if missing:
        raise BankError(
            f"bank {bank.name} lacks the scene features {', '.join(missing)}; thin the bank again"
        )
    then = dict(zip(held, bank.manifest.probe, strict=True))
    now = probe_features(bank.config.sensor)
    # Machines add in another order, which changes less; another formula changes more.
    changed = [name for name, value in now.items() if not isclose(value, then[name], abs_tol=1e-4)]
    if changed:
        raise BankError(
            f"bank {bank.name} has other formulas of the scene features {', '.join(changed)}; thin "
            "the bank again"
        )
    columns = [held.index(feature.name) for feature in SCENE_FEATURES]
    # Rows of other splits are NaN, as in `look_at_scenes`.
    played = torch.zeros(len(bank), 1, dtype=torch.bool)
    for clip in clips:
        played[clip.start : clip.start + clip.frames] = True
    features = bank.scene_features(network)[:, columns]
    return Scenes(features.where(played, torch.nan), bank.log_ambient.where(played, torch.nan))


def probe_features(sensor: SensorConfig) -> dict[str, float]:
    """Scene features of one made-up frame by name, in which other formulas show.

    A thinned bank keeps those of the formulas that it was made with.
    """
    down, across = torch.meshgrid(torch.arange(24.0), torch.arange(32.0), indexing="ij")
    # Dark and bright, near and far, uneven in both directions.
    gray = (0.5 + 0.31 * (down / 5).sin() + 0.18 * (across / 3 + down / 7).cos())[None]
    exposure_s = torch.tensor([2e-3], dtype=torch.float64)
    scene = Scene(
        gray=gray,
        log_ambient=log_ambient_of(gray, exposure_s, sensor),
        predicted_m=sensor.max_range_m * gray.flip(1),
        confidence=0.9 * gray.flip(2),
        unambiguous_m=unambiguous_range_m(sensor.f1_hz),
        range_m=sensor.max_range_m,
        ego_speed_m_s=torch.tensor([7.3], dtype=torch.float64),
        yaw_rate_rad_s=torch.tensor([-0.21], dtype=torch.float64),
    )
    values = evaluated(SCENE_FEATURES, scene)[0].tolist()
    return {feature.name: value for feature, value in zip(SCENE_FEATURES, values, strict=True)}


def log_ambient_of(gray: Tensor, exposure_s: Tensor, sensor: SensorConfig) -> Tensor:
    """Log10 of the ambient radiance on a coarse grid, [B, GRID * GRID], W m-2 sr-1."""
    full_scale_e = full_scale_lsb(sensor.adc_bits) / gray_gain_lsb_per_e(sensor)
    # Radiance of a full-scale pixel, inverting the camera equation and the exposure time.
    scale = full_scale_e / (electrons_per_radiance_second(sensor) * exposure_s)
    # Averaged before the logarithm, which would turn noise in the dark into large changes.
    coarse = torch.nn.functional.adaptive_avg_pool2d(gray.unsqueeze(1), GRID).flatten(1)
    return (coarse * scale[:, None].to(gray.dtype)).clamp_(min=DARKEST_RADIANCE).log10_()
