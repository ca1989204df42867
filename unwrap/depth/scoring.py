"""Score every way of unwrapping: wrap 0 everywhere, floor, nearest, two frequencies.

The caller brings raw frames, so that simulated and recorded ones are scored alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from torch import Tensor

from unwrap.depth.correction import correct
from unwrap.depth.merge import RULES, Merge
from unwrap.depth.metrics import depth_metrics
from unwrap.signal import (
    RawFrame,
    SensorDescription,
    Shots,
    decode_at,
    distance_m,
    unambiguous_range_m,
)

Scores = dict[str, dict[str, float]]


def evaluate(
    raws: Mapping[Shots, RawFrame],
    predicted_m: Tensor | Mapping[Shots, Tensor],
    truth_m: Tensor,
    scored: Tensor,
    sensor: SensorDescription,
    *,
    offset_lsb: Tensor | None = None,
    noise_lsb: Tensor | float | Mapping[Shots, Tensor] | None = None,
    shift_m: Tensor | None = None,
) -> Scores:
    """Score the prediction alone and every method that the given acquisitions allow.

    Parameters
    ----------
    raws : mapping of Shots to RawFrame
        Acquisitions of the same B frames with 2, 4 or 8 samples; any of them may be missing.
    predicted_m : float [B, H, W], or mapping of Shots to such
        A network's distance of the same frames: from the gray image alone, or of each acquisition
        by itself, made of its samples.
    truth_m : float [B, H, W]
        True distance, metres.
    scored : bool [B, H, W]
        Pixels that count, whether or not a method calls them valid.
    offset_lsb, noise_lsb, shift_m : optional
        As in `unwrap.depth.correction.correct`; the noise may be that of each acquisition.

    Returns
    -------
    dict of dict
        By method ("prediction", or "2 DCS prediction", ... where each acquisition has its own;
        "2 DCS wrap 0", "4 DCS nearest", "8 DCS", ...) the values of
        `depth_metrics` and `wrap_accuracy`, the share of scored pixels less than half an
        unambiguous range off; for acquisitions also `valid_share` of the scored pixels.
    """
    half_m = unambiguous_range_m(sensor.f1_hz) / 2
    if isinstance(predicted_m, Tensor):
        guesses = {"prediction": predicted_m}
        predicted_m = dict.fromkeys(raws, predicted_m)
    else:
        guesses = {f"{shots:d} DCS prediction": own_m for shots, own_m in predicted_m.items()}
    scores = {name: score(own_m, truth_m, scored, half_m) for name, own_m in guesses.items()}
    for shots, raw in raws.items():
        own_noise_lsb = noise_lsb[shots] if isinstance(noise_lsb, Mapping) else noise_lsb
        for name, merge in _methods(shots).items():
            if merge is None:
                first = decode_at(0, raw, sensor, offset_lsb=offset_lsb, shift_m=shift_m)
                depth_m, valid = distance_m(first.phase_rad, sensor.f1_hz), ~raw.saturated
            else:
                frame = correct(
                    raw,
                    predicted_m[shots],
                    sensor,
                    merge=merge,
                    offset_lsb=offset_lsb,
                    noise_lsb=own_noise_lsb,
                    shift_m=shift_m,
                )
                depth_m, valid = frame.distance_m, frame.valid
            share = float(valid[scored].double().mean())
            scores[name] = score(depth_m, truth_m, scored, half_m) | {"valid_share": share}
    return scores


def _methods(shots: Shots) -> dict[str, Merge | None]:
    """Merge rule by name of method; None is the wrapped map as it is."""
    if shots == Shots.EIGHT:
        return {"8 DCS": "nearest"}
    # Unmerged, the prediction has a row of its own.
    rules = [rule for rule in RULES if rule != "none"]
    return {f"{shots:d} DCS wrap 0": None, **{f"{shots:d} DCS {rule}": rule for rule in rules}}


def score(depth_m: Tensor, truth_m: Tensor, scored: Tensor, half_m: float) -> dict[str, float]:
    """`depth_metrics` and wrap accuracy, the share of scored pixels less than `half_m` off."""
    near = (depth_m - truth_m).abs() < half_m
    count = int(scored.sum())
    accuracy = int((near & scored).sum()) / count if count else math.nan
    return {"wrap_accuracy": accuracy, **depth_metrics(depth_m, truth_m, scored)}


def mean_scores(batches: list[tuple[int, Scores]]) -> Scores:
    """Mean of scores of batches, weighted by their number of frames; NaN entries are left out."""
    methods = batches[0][1]
    return {
        method: {name: _mean([(n, s[method][name]) for n, s in batches]) for name in values}
        for method, values in methods.items()
    }


def _mean(weighted: list[tuple[int, float]]) -> float:
    known = [(weight, value) for weight, value in weighted if not math.isnan(value)]
    total = sum(weight for weight, _ in known)
    return sum(weight * value for weight, value in known) / total if total else math.nan
