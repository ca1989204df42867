"""What a training continues from: Lightning's checkpoint, looked at before anything of it is used.

It is a file like any other that is read: damaged, foreign or hostile, it is refused by name.
Lightning itself would say so in the words of torch and pickle, or only when steps fail.
"""

from __future__ import annotations

import math
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import lightning
import torch
from torch import Tensor

from unwrap.support import in_one_line, require_regular
from unwrap.training.module import TrainingModule

MOST_BYTES: Final = 1 << 31
"""Of a checkpoint: weights and two moments of each in float32, of the largest network there is."""
CURE: Final = "delete it or start afresh with resume=False"


class _UnfitError(ValueError):
    """Not what a training writes; told in words of this project."""


def require_checkpoint(path: Path, module: TrainingModule, trainer: lightning.Trainer) -> None:
    """Refuse a checkpoint from which this training cannot continue.

    Raises
    ------
    ValueError
        It is of another configuration, no checkpoint of this project, or not as it was written;
        names the file and the cure.
    """
    try:
        found = _read(path)
        if found.get("train_config") == module.config.model_dump_json():
            _require_fitting(found, module, trainer)
            return
        # What another configuration leads to need not fit, which would read as damage.
        if not isinstance(found.get("train_config"), str):
            raise _UnfitError("its train_config is missing")
    except Exception as error:  # Readers of zips and pickles raise all kinds.
        raise unusable(path, error) from None
    raise ValueError(
        f"{path} was made with another configuration; {CURE}, or write to another folder"
    )


def unusable(path: Path, error: Exception) -> ValueError:
    """What is said of a checkpoint which `error` forbids to use."""
    # What torch says is advice on how to have such a file executed all the same.
    known = isinstance(error, _UnfitError | OSError | zipfile.BadZipFile)
    said = in_one_line(error) if known else "not as a training writes it"
    return ValueError(f"{path}: unusable checkpoint ({said}); {CURE}")


def _read(path: Path) -> dict[str, Any]:
    """Content of a checkpoint, on the processor; executes nothing of it."""
    try:
        require_regular(path, MOST_BYTES)
    except ValueError as error:
        raise _UnfitError(in_one_line(error)) from None
    with zipfile.ZipFile(path) as archive:
        # Packed members could swell beyond all memory; torch packs none.
        if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
            raise _UnfitError("its members are compressed")
        # torch does not compare the checksums.
        if (name := archive.testzip()) is not None:
            raise _UnfitError(f"{name} does not match its checksum")
    found = torch.load(path, map_location="cpu", weights_only=True)
    if not isinstance(found, dict):
        raise _UnfitError("not a table")
    return found


def _require_fitting(
    found: Mapping[str, Any], module: TrainingModule, trainer: lightning.Trainer
) -> None:
    """Refuse what this training's network, optimiser, schedule and loop cannot take over."""
    version = found.get("pytorch-lightning_version")
    # Lightning reads it to mend checkpoints of its first version.
    if not isinstance(version, str) or not re.fullmatch(r"2(\.[0-9]{1,4}){2}\w{0,20}", version):
        raise _UnfitError("not of Lightning 2")
    made: Any = module.configure_optimizers()
    optimizer, schedule = made["optimizer"], made["lr_scheduler"]["scheduler"]
    parameters = list(module.network.parameters())
    states = found.get("optimizer_states")
    moments = states[0].get("state") if isinstance(states, list) and states else None
    if not isinstance(moments, dict) or not set(moments) <= set(range(len(parameters))):
        raise _UnfitError("its optimizer_states are not those of the network")
    step = torch.zeros((), dtype=torch.float32)  # AdamW counts so, whatever the default is.
    like = {
        number: {"step": step, "exp_avg": tensor, "exp_avg_sq": tensor}
        for number, tensor in enumerate(parameters)
        if number in moments  # What had no gradient yet has none.
    }
    expected = {
        "epoch": 0,
        "global_step": 0,
        "state_dict": module.state_dict(),
        "optimizer_states": [
            {"state": like, "param_groups": optimizer.state_dict()["param_groups"]}
        ],
        "lr_schedulers": [schedule.state_dict()],
    }
    for name, value in expected.items():
        _require_like(found.get(name), value, name)
    loops = found.get("loops")
    loop = loops.get("fit_loop") if isinstance(loops, dict) else None
    _require_like(loop, trainer.fit_loop.state_dict(), "loops")


def _require_like(found: Any, expected: Any, name: str) -> None:
    """Refuse a value that is not built like `expected`, or a number that is not finite."""
    fits = type(found) is type(expected)
    if isinstance(expected, Tensor):  # Parameters come back as plain tensors.
        fits = isinstance(found, Tensor) and _describe(found) == _describe(expected)
        fits = fits and bool(found.isfinite().all())
    elif isinstance(expected, float):
        fits = fits and math.isfinite(found)
    elif isinstance(expected, int):
        fits = fits and 0 <= found < 1 << 62
    elif isinstance(expected, Mapping):
        fits = isinstance(found, dict) and set(found) == set(expected)
    elif isinstance(expected, list | tuple):
        fits = fits and len(found) == len(expected)
    if not fits:
        raise _UnfitError(f"its {name} do not fit this training")
    if isinstance(expected, Mapping):
        for key, value in expected.items():
            _require_like(found[key], value, name)
    elif isinstance(expected, list | tuple):
        for one, value in zip(found, expected, strict=True):
            _require_like(one, value, name)


def _describe(tensor: Tensor) -> tuple[Any, ...]:
    return tensor.dtype, tensor.shape, tensor.layout
