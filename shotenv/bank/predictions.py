"""Network predictions for the frames of a bank: computed once, kept in the cache folder.

    <cache>/predictions/<bank>-<network>/distance_m.npy, confidence.npy, kept.json

Where the network is shown every k-th row and column (`unwrap.networks.sizes`) -k follows its name.
The folder is written under a hidden name, flushed and renamed; `kept.json` holds each file's
sha256. Kept predictions that are damaged are computed again.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from shotenv.bank.bank import Bank, require_full
from shotenv.bank.files import cache_dir, sha256_of, write_array
from unwrap.networks import Prediction, Unwrapper
from unwrap.support import progress, read_json, unfinished, write_json

ARRAYS = ("distance_m", "confidence")
SUMMARY = "kept.json"


@dataclass(frozen=True)
class PredictedDistances:
    """Predicted distance of every frame of a bank, float16 [N, H, W], metres."""

    distance_m: Tensor

    def distance_of(self, frames: Tensor) -> Tensor:
        """Predicted distance float32 [B, H, W] of the bank frames `frames` [B]."""
        return _rows(self.distance_m, frames)


@dataclass(frozen=True)
class KeptPredictions(PredictedDistances):
    """Predictions of every frame of a bank, memory-mapped float16 [N, H, W]."""

    confidence: Tensor

    def of(self, frames: Tensor) -> Prediction:
        """Prediction, float32, of the bank frames `frames` [B]."""
        return Prediction(self.distance_of(frames), _rows(self.confidence, frames))


def _rows(maps: Tensor, frames: Tensor) -> Tensor:
    """Maps of the frames, float32; only their own pages of the file are touched."""
    if len(frames) == 1:
        # A single one is converted where it lies.
        return maps.narrow(0, int(frames), 1).to(torch.float32)
    # By NumPy: see `shotenv.bank.thinned`.
    return torch.from_numpy(maps.numpy().take(frames.numpy(), axis=0).astype(np.float32))


def keep_predictions(bank: Bank, unwrapper: Unwrapper) -> KeptPredictions:
    """Predictions of `unwrapper` for `bank`, from the cache folder or computed now.

    Computing them takes one pass of the network for each frame, under a bar of progress.

    Raises
    ------
    BankError
        A thinned bank, whose images no network can read.
    OSError
        They could not be written, or not be read again.
    """
    require_full(bank, f"the network {unwrapper.name}")
    # By content: another bank or other weights under the same name are not mistaken for these.
    name = f"{bank.fingerprint}-{unwrapper.fingerprint[:16]}"
    stride = unwrapper.stride(bank.height, bank.width)
    if stride > 1:
        name += f"-{stride}"
    folder = cache_dir() / "predictions" / name
    kept = _load(folder, bank)
    if kept is None:
        _compute(folder, bank, unwrapper)
        kept = _load(folder, bank)
    if kept is None:
        raise OSError(f"cannot keep predictions in {folder}; is its disk full or failing?")
    return kept


def _load(folder: Path, bank: Bank) -> KeptPredictions | None:
    """Kept predictions, or None where there are none or they are damaged."""
    try:
        hashes = read_json(folder / SUMMARY)
        if any(sha256_of(folder / f"{name}.npy") != hashes[name] for name in ARRAYS):
            return None
        maps = [np.load(folder / f"{n}.npy", mmap_mode="c", allow_pickle=False) for n in ARRAYS]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    shape = (len(bank), bank.height, bank.width)
    if any(found.shape != shape or found.dtype != np.float16 for found in maps):
        return None
    return KeptPredictions(*(torch.from_numpy(found) for found in maps))


def _compute(folder: Path, bank: Bank, unwrapper: Unwrapper) -> None:
    """Predict every frame and put the result in `folder`, whole or not at all."""
    temporary = unfinished(folder)
    temporary.mkdir(parents=True)
    try:
        maps = zip(ARRAYS, _predict_all(bank, unwrapper), strict=True)
        hashes = {name: write_array(temporary / f"{name}.npy", values) for name, values in maps}
        write_json(temporary / SUMMARY, hashes)
        # Another process may have been faster; what stands then is as good unless damaged.
        if _load(folder, bank) is None:
            shutil.rmtree(folder, ignore_errors=True)
            temporary.rename(folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _predict_all(bank: Bank, unwrapper: Unwrapper) -> tuple[np.ndarray, np.ndarray]:
    """Predicted distance and confidence of every frame, each float16 [N, H, W]."""
    shape = (len(bank), bank.height, bank.width)
    distance_m, confidence = np.empty(shape, np.float16), np.empty(shape, np.float16)
    with progress(len(bank), f"{unwrapper.name} predicts", "frame") as bar:
        for index in range(len(bank)):
            # One by one: a frame is predicted alike whatever the bank around it.
            prediction = unwrapper.predict(bank.gray(torch.tensor([index])))
            distance_m[index] = prediction.distance_m[0].numpy()
            confidence[index] = prediction.confidence[0].numpy()
            bar.update()
    return distance_m, confidence
