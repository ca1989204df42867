"""Results of jobs as files: sums of each clip as arrays, and beside them what they are of.

The arrays are written first, the JSON last, each renamed into place: a job whose JSON stands is
done.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import Field, ValidationError

from agents.evaluation import PlayedFront
from agents.optimum import Front
from shotenv.config import one_sentence
from unwrap.support import (
    Section,
    in_one_line,
    read_arrays,
    read_json,
    write_bytes,
    write_json,
)

RESULT_SCHEMA: Final = 1
OF_FRONT: Final = ("energy", "depth_mae_m", "frames")
SUMS: Final = ("returns", "life_used_h", "temperature_k")


class _Points(Section):
    """Of one front: the price and the policy of each point."""

    prices: tuple[float | None, ...]
    policies: tuple[str, ...]


class _Told(Section):
    """What the JSON file of a result holds."""

    schema_: int = Field(alias="schema")
    depends_on: dict[str, Any]
    seconds: float = Field(ge=0, allow_inf_nan=False)
    fronts: dict[str, _Points]


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


def beside(stem: Path, ending: str) -> Path:
    """File of a job; what follows a dot in its name is no ending.

    Examples
    --------
    >>> beside(Path("default/lr.3-0"), ".json").name
    'lr.3-0.json'
    """
    return stem.with_name(stem.name + ending)


def write_result(stem: Path, result: JobResult, depends_on: Mapping[str, Any]) -> None:
    """Write `stem`.npz, then `stem`.json."""
    arrays = {f"other/{name}": values for name, values in result.arrays.items()}
    for name, front in result.fronts.items():
        arrays |= {f"{name}/{part}": getattr(front.front, part) for part in OF_FRONT}
        arrays |= {f"{name}/{part}": getattr(front, part) for part in SUMS}
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)  # type: ignore[arg-type]
    write_bytes(beside(stem, ".npz"), content.getvalue())
    points = {
        name: {"prices": front.prices, "policies": front.policies}
        for name, front in result.fronts.items()
    }
    write_json(
        beside(stem, ".json"),
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
    path = beside(stem, ".json")
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
    told = _described(beside(stem, ".json"))
    path = beside(stem, ".npz")
    try:
        arrays = read_arrays(path, "")
        fronts = {
            name: PlayedFront(
                Front(*(arrays[f"{name}/{part}"] for part in OF_FRONT)),
                tuple(points["prices"]),
                tuple(points["policies"]),
                *(arrays[f"{name}/{part}"] for part in SUMS),
            )
            for name, points in told["fronts"].items()
        }
        _check_fronts(fronts)
    except (ValueError, KeyError):
        raise ValueError(f"{path} is missing or damaged; delete it and its .json beside") from None
    others = {
        name.removeprefix("other/"): values
        for name, values in arrays.items()
        if name.startswith("other/")
    }
    return JobResult(fronts, told["seconds"], others)


def _check_fronts(fronts: Mapping[str, PlayedFront]) -> None:
    """Raise ValueError unless the arrays of each front have a number for each clip and point."""
    for name, one in fronts.items():
        shape = (*one.front.frames.shape, len(one.prices))
        sums = [one.front.energy, one.front.depth_mae_m, *(getattr(one, part) for part in SUMS)]
        fits = all(array.shape == shape and array.dtype.kind == "f" for array in sums)
        if not fits or len(shape) != 2 or len(one.policies) != shape[1]:
            raise ValueError(f"{name} has arrays of other clips or points")


def _described(path: Path) -> dict[str, Any]:
    try:
        told = read_json(path)
    except (FileNotFoundError, ValueError) as error:
        raise ValueError(
            f"{path} is missing or damaged ({in_one_line(error)}); expected the result of a job"
        ) from None
    schema = told.get("schema")
    if schema != RESULT_SCHEMA:
        raise ValueError(
            f"{path} has schema {schema!r}, but this version reads {RESULT_SCHEMA}; nothing was "
            "overwritten, `--out` takes another folder"
        )
    try:
        _Told.model_validate(told)
    except ValidationError as error:
        raise ValueError(
            f"{path} is damaged ({one_sentence(error, _Told)}); expected the result of a job"
        ) from None
    return told
