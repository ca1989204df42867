"""A thinned bank: one pixel of each few, and what was made of the full frames; read into memory.

    correlation   float16, divided by the pixel's active light
    active        float16, in units of a power of two, by which the largest value is just below 2^15
    ambient       likewise
    distance      uint16, millimetres; 65535 is the sky
    gray          uint16, as it was

A float16 has eleven significant bits: what is divided by the largest value of a bank keeps them
down to a billionth of it. Bytes of equal worth lie together in the file, which compresses better.
"""

from __future__ import annotations

import io
import shutil
import zipfile
from collections.abc import Mapping
from functools import lru_cache
from math import ceil, log2
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from shotenv.bank.bank import Bank
from shotenv.bank.files import (
    THINNED_ARRAYS,
    THINNED_FILE,
    BankError,
    StoredNetwork,
    ThinnedContents,
    cure_for,
    read_thinned_contents,
    sha256_of,
    write_thinned_contents,
)
from shotenv.bank.predictions import PredictedDistances
from shotenv.sensor import Exposure
from unwrap.networks import WeightsLabel
from unwrap.support import require_regular, unfinished, write_bytes

SKY = np.iinfo(np.uint16).max
"""Stored distance where nothing is hit."""
FARTHEST_M = (SKY - 1) / 1000
"""Truth beyond is stored as this, metres."""
LARGEST = 2.0**15
"""What the largest radiance of a bank is stored as, or less by a factor below two."""
NO_MAP_BYTES = 16_384
"""More than what is no map takes of a frame, or names and headers of the whole file."""
LOG_AMBIENT = "log_ambient"


class ThinnedBank(Bank):
    """A bank that has one pixel of each square of `every` x `every`, in memory.

    Its maps are small frames [H / every, W / every], whose neighbours were none in the scene. What
    needs whole images was made before they were thinned: the distances that networks predict, and
    the scene features.

    Raises
    ------
    BankError
        A file is missing or damaged.
    """

    manifest: ThinnedContents

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, read_thinned_contents(Path(folder)))
        about = self.manifest
        units = about.active_unit, about.ambient_unit
        path = self.folder / THINNED_FILE
        self._arrays, self._light = _opened(path, self._most_bytes(), about.sha256, *units)
        shape = (len(self), self.height, self.width)
        if self._arrays["gray"].shape != shape:
            raise _damaged(path)

    def _most_bytes(self) -> int:
        """Of the file: its maps and predictions as in memory, and room for what is no map.

        A file of gigabytes in its place is refused before its digest is taken.
        """
        maps = sum(each.frame_bytes(self.height, self.width) for each in THINNED_ARRAYS.values())
        predicted = 2 * self.height * self.width * len(self.manifest.networks)
        return len(self) * (maps + predicted + NO_MAP_BYTES) + NO_MAP_BYTES

    @property
    def every(self) -> int:
        """See `Bank.every`."""
        return self.manifest.every

    def exposure(self, indices: Tensor) -> Exposure:
        """See `Bank.exposure`."""
        light = self._light
        maps = (light.correlation, light.active, light.ambient, light.distance_m)
        return Exposure(*(_picked(each, indices) for each in maps))

    def distance_m(self, indices: Tensor) -> Tensor:
        """See `Bank.distance_m`."""
        return _picked(self._light.distance_m, indices)

    def gray(self, indices: Tensor) -> Tensor:
        """See `Bank.gray`."""
        return _picked(self._arrays["gray"], indices)

    def network(self, label: WeightsLabel) -> StoredNetwork:
        """The stored network that has these weights.

        Raises
        ------
        BankError
            There is none, or it has other weights.
        """
        for stored in self.manifest.networks:
            if stored.fingerprint == label.fingerprint:
                return stored
        for stored in self.manifest.networks:
            if stored.name == label.network:
                raise BankError(
                    f"{label.network} here has fingerprint {label.fingerprint[:16]}, bank "
                    f"{self.name} holds predictions of {stored.fingerprint[:16]}; thin the bank "
                    "again"
                )
        names = " and ".join(stored.name for stored in self.manifest.networks)
        raise BankError(
            f"bank {self.name} holds predictions of {names}, not of {label.network}; choose one of "
            "them, or thin the bank again with it"
        )

    def predictions(self, network: StoredNetwork) -> PredictedDistances:
        """Distances that the network predicted from the full frames."""
        return PredictedDistances(self._arrays[network.distances])

    def scene_features(self, network: StoredNetwork) -> Tensor:
        """Scene features of the full frames, float32 [N, len(manifest.scene_features)]."""
        return self._arrays[network.features]

    @property
    def log_ambient(self) -> Tensor:
        """Log10 of the ambient radiance of the full frames on a coarse grid, float32 [N, K]."""
        return self._arrays[LOG_AMBIENT]


def _picked(maps: Tensor, indices: Tensor) -> Tensor:
    """The maps `indices` [B] of a bank's, copied by NumPy.

    By torch, threads would share the copying, and wait for each other longer than it takes wherever
    another process has a part of the cores.
    """
    return torch.from_numpy(maps.numpy().take(indices.numpy(), axis=0))


@lru_cache(maxsize=2)
def _opened(
    path: Path, most_bytes: int, sha256: str, active_unit: float, ambient_unit: float
) -> tuple[dict[str, Tensor], Exposure]:
    """Arrays of the file `path` that are used as they are stored, and the light made of the others.

    Kept for the process, which opens a bank once for each split: nobody changes them.
    """
    try:
        require_regular(path, most_bytes)
        if sha256_of(path) != sha256:
            raise _damaged(path)
        with np.load(path, allow_pickle=False) as file:
            stored = {name: _joined(file[name], _type_of(name)) for name in file.files}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        if isinstance(error, BankError):
            raise
        raise _damaged(path) from None
    maps = {name: stored.pop(name) for name in ("correlation", "active", "ambient", "distance")}
    light = decode_light(maps, active_unit=active_unit, ambient_unit=ambient_unit)
    return {name: torch.from_numpy(array) for name, array in stored.items()}, light


def _damaged(path: Path) -> BankError:
    return BankError(f"{path} is missing or damaged; {cure_for(path)}")


def encode_light(
    maps: Mapping[str, np.ndarray],
) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Light as it is stored, and its units `active_unit` and `ambient_unit`.

    Parameters
    ----------
    maps
        "correlation" float32 [N, 8, H, W]; "active", "ambient", "distance_m" float32 and "gray"
        uint16 [N, H, W], as a rendered bank has them.
    """
    units = {f"{name}_unit": _unit_of(maps[name]) for name in ("active", "ambient")}
    active = (maps["active"] / units["active_unit"]).astype(np.float16)
    # By the active light as it will be read: its own rounding then does not add to that of the
    # correlation, and phases have the error of one rounding.
    lit = _scaled(active, units["active_unit"])[:, None]
    ratio = np.divide(
        maps["correlation"], lit, out=np.zeros_like(maps["correlation"]), where=lit > 0
    )
    hit = np.isfinite(maps["distance_m"])
    near_m = np.where(hit, maps["distance_m"], 0.0).clip(0.0, FARTHEST_M)
    return {
        "correlation": ratio.astype(np.float16),
        "active": active,
        "ambient": (maps["ambient"] / units["ambient_unit"]).astype(np.float16),
        "distance": np.where(hit, np.rint(1000.0 * near_m), SKY).astype(np.uint16),
        "gray": maps["gray"],
    }, units


def decode_light(
    maps: Mapping[str, np.ndarray], *, active_unit: float, ambient_unit: float
) -> Exposure:
    """Light of maps that `encode_light` made; the same bits on every machine."""
    active = _scaled(maps["active"], active_unit)
    correlation = maps["correlation"].astype(np.float32)
    correlation *= active[:, None]
    distance_m = (maps["distance"] / 1000.0).astype(np.float32)
    distance_m[maps["distance"] == SKY] = np.inf
    found = correlation, active, _scaled(maps["ambient"], ambient_unit), distance_m
    return Exposure(*map(torch.from_numpy, found))


def _unit_of(values: np.ndarray) -> float:
    """Power of two by which the largest of `values` is at most `LARGEST`."""
    largest = float(values.max())
    return 2.0 ** ceil(log2(largest / LARGEST)) if largest else 1.0


def _scaled(stored: np.ndarray, unit: float) -> np.ndarray:
    return stored.astype(np.float32) * np.float32(unit)


def write_thinned(
    folder: Path, arrays: Mapping[str, np.ndarray], contents: Mapping[str, Any]
) -> ThinnedContents:
    """Write a thinned bank into `folder`, whole or not at all.

    Parameters
    ----------
    folder
        Must not exist yet, or be empty.
    arrays
        What is stored: maps as `encode_light` gives them, `LOG_AMBIENT`, and those that the
        networks of the contents name.
    contents
        Fields of `ThinnedContents` but for the digest of the arrays.

    Raises
    ------
    BankError
        The folder is not empty, or cannot be written.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise BankError(f"{folder} is not empty; choose another folder, or delete it")
    temporary = unfinished(folder)
    try:
        temporary.mkdir(parents=True)
        planes: dict[str, Any] = {name: _planes(array) for name, array in arrays.items()}
        file = io.BytesIO()
        np.savez_compressed(file, **planes)
        write_bytes(temporary / THINNED_FILE, file.getvalue())
        digest = sha256_of(temporary / THINNED_FILE)
        about = ThinnedContents.model_validate({**contents, "sha256": digest})
        write_thinned_contents(temporary, about)
        temporary.replace(folder)
    except OSError as error:
        raise BankError(
            f"cannot write {folder}: {error.strerror or error}; choose another folder"
        ) from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return about


def _type_of(name: str) -> str:
    """Type of the array `name`: of predictions float16, of what is no map float32."""
    if name in THINNED_ARRAYS:
        return THINNED_ARRAYS[name].dtype
    return "<f2" if name.startswith("distance_") else "<f4"


def _planes(array: np.ndarray) -> np.ndarray:
    """Bytes of an array, those of equal worth together: uint8 [bytes of a value, ...]."""
    little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    apart = little.view(np.uint8).reshape(*array.shape, array.dtype.itemsize)
    return np.moveaxis(apart, -1, 0)


def _joined(planes: np.ndarray, dtype: str) -> np.ndarray:
    """The array that `_planes` took apart, in the machine's own order of bytes."""
    together = np.ascontiguousarray(np.moveaxis(planes, 0, -1))
    return together.view(dtype)[..., 0].astype(np.dtype(dtype).newbyteorder("="), copy=False)
