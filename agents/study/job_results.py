"""Results of jobs as files: sums of each clip as arrays, and beside them what they are of.

The arrays are written first, the JSON last, each renamed into place: a job whose JSON stands is
done.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from agents.evaluation import PlayedFront
from agents.optimum import Front
from unwrap.support import write_bytes, write_json

RESULT_SCHEMA: Final = 1
OF_FRONT: Final = ("energy", "depth_mae_m", "frames")
SUMS: Final = ("returns", "life_used_h", "temperature_k")


@dataclass(frozen=True)
class JobResult:
    """What a job played.

    Attributes
    ----------
    fronts : mapping of str to PlayedFront
        By what they are: "front" of a policy; "blind" and "optimum" of the references.
    seconds : float
        Of one core that it took, training and all; of a training that was resumed, the rest alone.
    arrays : mapping of str to float64 [C]
        Other sums of each clip.
    """

    fronts: Mapping[str, PlayedFront]
    seconds: float
    arrays: Mapping[str, np.ndarray]


def write_result(stem: Path, result: JobResult, depends_on: Mapping[str, Any]) -> None:
    """Write `stem`.npz, then `stem`.json."""
    arrays = {f"other/{name}": values for name, values in result.arrays.items()}
    for name, front in result.fronts.items():
        arrays |= {f"{name}/{part}": getattr(front.front, part) for part in OF_FRONT}
        arrays |= {f"{name}/{part}": getattr(front, part) for part in SUMS}
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)  # type: ignore[arg-type]
    write_bytes(stem.with_suffix(".npz"), content.getvalue())
    points = {
        name: {"prices": front.prices, "policies": front.policies}
        for name, front in result.fronts.items()
    }
    write_json(
        stem.with_suffix(".json"),
        {
            "schema": RESULT_SCHEMA,
            "depends_on": depends_on,
            "seconds": round(result.seconds, 1),
            "fronts": points,
        },
    )


def stands(stem: Path, depends_on: Mapping[str, Any]) -> bool:
    """Whether the result of a job is there already.

    Raises
    ------
    ValueError
        What is there is damaged, or of another schema or configuration; it is left as it is.
    """
    path = stem.with_suffix(".json")
    if not path.is_file():
        return False
    before = _described(path)["depends_on"]
    # As JSON has it, where tuples are lists.
    now = json.loads(json.dumps(depends_on))
    if before != now:
        parts = [name for name in now if before.get(name) != now[name]] or sorted(
            set(before) - set(now)
        )
        raise ValueError(
            f"{path} is the result of another configuration ({', '.join(parts)} differ); expected "
            "that of this study: nothing was overwritten, `--out` takes another folder"
        )
    return True


def read_result(stem: Path) -> JobResult:
    """What `write_result` wrote.

    Raises
    ------
    ValueError
        It is missing, damaged or of another schema; the message names the file.
    """
    told = _described(stem.with_suffix(".json"))
    path = stem.with_suffix(".npz")
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        fronts = {
            name: PlayedFront(
                Front(*(arrays[f"{name}/{part}"] for part in OF_FRONT)),
                tuple(points["prices"]),
                tuple(points["policies"]),
                *(arrays[f"{name}/{part}"] for part in SUMS),
            )
            for name, points in told["fronts"].items()
        }
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        raise ValueError(f"{path} is missing or damaged; delete it and its .json beside") from None
    others = {
        name.removeprefix("other/"): values
        for name, values in arrays.items()
        if name.startswith("other/")
    }
    return JobResult(fronts, told["seconds"], others)


def _described(path: Path) -> dict[str, Any]:
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        schema = told["schema"]
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError):
        raise ValueError(f"{path} is missing or damaged; expected the result of a job") from None
    if schema != RESULT_SCHEMA:
        raise ValueError(
            f"{path} has schema {schema!r}, but this version reads {RESULT_SCHEMA}; nothing was "
            "overwritten, `--out` takes another folder"
        )
    return told
