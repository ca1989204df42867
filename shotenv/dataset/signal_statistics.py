"""What light a bank holds for a sensor: signal, saturation, gray images, persistence."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from shotenv.bank import Bank, Clip, KeptPredictions
from shotenv.config import SensorConfig
from shotenv.sensor import expose, full_scale_lsb, sensitivity
from unwrap.signal import Shots

DISTANCES_M = (5.0, 10.0, 20.0)
NEAR_SHARE = 0.1
"""A pixel counts for a distance where its own differs from it by less than this share."""
LAGS = (1, 2, 4, 8, 16, 32)
"""Frames between two frames of a clip that are compared."""
ERROR_SCALE_M = 1.0
"""Errors e count as e / (e + scale), so that a few far pixels do not stand for the frame."""


def light_statistics(
    bank: Bank,
    split: str,
    sensor: SensorConfig,
    *,
    laser_power_w: float,
    integration_s: float,
    kept: KeptPredictions | None = None,
    tick: Callable[[int], object] = lambda frames: None,
) -> dict[str, dict[str, Any]]:
    """Statistics of the frames of one split, for each family and over "all".

    Parameters
    ----------
    sensor : SensorConfig
        The imager that takes the samples.
    laser_power_w, integration_s : float
        Optical power while on, W, and time of one sample, s.
    kept : KeptPredictions or None
        What a network made of the gray images; None leaves `persistence` out.
    tick
        Is told the number of frames after each clip.

    Returns
    -------
    dict
        For each family: `frames`; `snr_at_m`, the median noise-free signal-to-noise ratio of one
        sample, `m S / sqrt(S + B + 2 sigma_r^2)`, of pixels within 10 % of 5, 10 and 20 m (None
        where there are none); `saturated_share` of the pixels with a full tap or a clipped word
        in any of eight samples; `gray_mean`, `gray_dark_share` and `gray_full_share`: mean of
        the gray images over full scale, and the shares of their pixels below 1 % of it and at it;
        `persistence`: autocorrelation over frames of the gray prediction's error, by lag.
    """
    measured: dict[str, list[dict[str, Any]]] = {}
    for clip in bank.splits(split):
        found = _measure(bank, clip, sensor, laser_power_w, integration_s, kept)
        measured.setdefault(clip.family, []).append(found)
        tick(clip.frames)
    families = {family: _summary(clips) for family, clips in measured.items()}
    everything = [clip for clips in measured.values() for clip in clips]
    return {"all": _summary(everything), **families}


def _measure(
    bank: Bank,
    clip: Clip,
    sensor: SensorConfig,
    laser_power_w: float,
    integration_s: float,
    kept: KeptPredictions | None,
) -> dict[str, Any]:
    """What one clip adds: samples of signal-to-noise, sums over pixels, errors over frames."""
    frames = torch.arange(clip.start, clip.start + clip.frames)
    power, time = torch.tensor([laser_power_w]), torch.tensor([integration_s])
    per_light = sensitivity(sensor, power.double(), time.double())
    full_scale = full_scale_lsb(sensor.adc_bits)
    snr: dict[float, list[np.ndarray]] = {distance: [] for distance in DISTANCES_M}
    sums, errors = np.zeros(5), []
    # Frame by frame: a clip of hundreds would fill the memory.
    for frame in frames.split(1):
        exposure, gray = bank.exposure(frame), bank.gray(frame).numpy() / full_scale
        signal_e = exposure.active.numpy() * float(per_light.active_e)
        ambient_e = exposure.ambient.numpy() * float(per_light.ambient_e)
        noise_e = np.sqrt(signal_e + ambient_e + 2 * sensor.read_noise_e**2)
        ratio = sensor.contrast * signal_e / noise_e
        truth_m = exposure.distance_m.numpy()
        for distance, found in snr.items():
            found.append(ratio[np.abs(truth_m - distance) < NEAR_SHARE * distance])
        raw = expose(
            exposure,
            sensor,
            shots=Shots.EIGHT,
            laser_power_w=power,
            integration_s=time,
            noise=None,
            offsets=None,
        )
        sums += (
            gray.size,
            float(raw.saturated.sum()),
            gray.sum(),
            (gray < 0.01).sum(),
            (gray >= 1.0).sum(),
        )
        if kept is not None:
            seen = truth_m < sensor.max_range_m
            error_m = np.abs(kept.distance_of(frame).numpy()[seen] - truth_m[seen])
            # Unknown where nothing is in range.
            error = np.mean(error_m / (error_m + ERROR_SCALE_M)) if seen.any() else np.nan
            errors.append(float(error))
    return {
        "frames": clip.frames,
        "snr": {distance: np.concatenate(found) for distance, found in snr.items()},
        "sums": sums,
        "errors": np.array(errors),
    }


def _summary(clips: list[dict[str, Any]]) -> dict[str, Any]:
    """Statistics of several clips."""
    pixels, saturated, gray, dark, full = np.sum([clip["sums"] for clip in clips], axis=0)
    ratios = {d: np.concatenate([clip["snr"][d] for clip in clips]) for d in DISTANCES_M}
    return {
        "frames": sum(clip["frames"] for clip in clips),
        "snr_at_m": {
            f"{distance:g}": float(np.median(found)) if len(found) else None
            for distance, found in ratios.items()
        },
        "saturated_share": float(saturated / pixels),
        "gray_mean": float(gray / pixels),
        "gray_dark_share": float(dark / pixels),
        "gray_full_share": float(full / pixels),
        "persistence": autocorrelation([clip["errors"] for clip in clips]),
    }


def autocorrelation(series: list[np.ndarray]) -> dict[str, float]:
    """Autocorrelation of several series about their common mean, by lag: 1 never changes.

    Pairs that lie in one series are averaged over all series, and divided by the variance of all
    values. Values that are NaN are unknown. Lags that no series reaches, and series without
    variance, are left out.

    Examples
    --------
    >>> autocorrelation([np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0])])["1"]
    -1.0
    """
    values = np.concatenate(series) if series else np.zeros(0)
    values = values[~np.isnan(values)]
    if values.size == 0 or not (variance := float(np.var(values))):
        return {}
    mean, found = values.mean(), {}
    for lag in LAGS:
        pairs = [(one[:-lag] - mean) * (one[lag:] - mean) for one in series]
        products = np.concatenate(pairs)
        known = products[~np.isnan(products)]
        if len(known):
            found[str(lag)] = float(known.mean() / variance)
    return found


def print_light(found: dict[str, dict[str, Any]]) -> None:
    """The statistics as a table, a row for each family."""
    print(
        f"{'family':20}{'frames':>7}{'signal to noise at 5, 10, 20 m':>32}{'saturated':>11}"
        f"{'gray mean':>11}{'dark':>7}{'full':>7}   error correlates over 1, 4, 16 frames"
    )
    for family, one in found.items():
        ratios = "".join(f"{_number(ratio, '.1f'):>9}" for ratio in one["snr_at_m"].values())
        kept = (f"{_number(one['persistence'].get(lag), '.2f'):>7}" for lag in ("1", "4", "16"))
        print(
            f"{family:20}{one['frames']:>7}{ratios:>32}{one['saturated_share']:>11.2%}"
            f"{one['gray_mean']:>11.1%}{one['gray_dark_share']:>7.0%}{one['gray_full_share']:>7.1%}"
            f"   {''.join(kept)}"
        )


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
