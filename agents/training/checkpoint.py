"""What a run keeps: a checkpoint to continue from, and the best policy so far."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import torch
from pydantic import Field, TypeAdapter
from safetensors import SafetensorError, safe_open

from agents.config import AgentConfig
from agents.policies import Provenance, Scheduler, first_line
from shotenv.config import EnvConfig
from unwrap.support import require_regular, tensor_bytes, write_bytes

# One file, replaced whole: network, optimiser and progress of the same round, or none of them.
CHECKPOINT: Final = "checkpoint.safetensors"
SCHEMA: Final = "2"
MOST_BYTES: Final = 1 << 32
"""Of a checkpoint: the largest, with a replay buffer, have some hundred MB."""
Validate = Callable[[Scheduler], float]


@dataclass(frozen=True)
class TrainingState:
    """How far a run has come.

    Attributes
    ----------
    rounds : int
        Finished rounds.
    last_return, best_return : float
        Last and best return on validation drives so far.
    best_round : int
        Finished rounds when it was found; -1 before the first validation.
    """

    rounds: Annotated[int, Field(ge=0)] = 0
    last_return: float = -math.inf
    best_return: float = -math.inf
    best_round: int = -1

    def judged(self, policy: Scheduler, validate: Validate, out: Path) -> TrainingState:
        """This state with the return of `policy`, which is kept in `out` where it is the best."""
        found = validate(policy)
        state = replace(self, last_return=found)
        if found <= self.best_return:
            return state
        policy.save(out)
        return replace(state, best_return=found, best_round=self.rounds)

    def in_words(self) -> str:
        """For a progress bar."""
        return f"validation return {self.last_return:.1f}, best {self.best_return:.1f}"


def provenance_of(
    config: AgentConfig, feature_names: Sequence[str], env: EnvConfig | None
) -> Provenance:
    """What a run is told and what its policies tell; `env` has the prices of its drives."""
    return Provenance(
        algorithm=config.algorithm,
        feature_names=tuple(feature_names),
        power_price=env.reward.power if env else None,
        training=config.told(),
        environment=env.model_dump(mode="json") if env else {},
        seed=config.seed,
    )


_STATE: Final = TypeAdapter(TrainingState)


class Checkpoint:
    """The checkpoint of one run in the folder `out`: tensors and the `TrainingState`, no pickle.

    Parameters
    ----------
    out : Path
        Folder of the run.
    provenance : Provenance
        What a checkpoint must have been made with to be continued here; versions may differ.
    """

    def __init__(self, out: Path, provenance: Provenance) -> None:
        self.path = out / CHECKPOINT
        known = provenance.model_dump(mode="json", exclude={"versions"})
        self._identity = json.dumps(known, sort_keys=True)

    def save(self, tensors: dict[str, torch.Tensor], state: TrainingState) -> None:
        """Replace the file."""
        words = {"schema": SCHEMA, "identity": self._identity, "progress": json.dumps(vars(state))}
        write_bytes(self.path, tensor_bytes(tensors, words))

    def load(self, restore: Callable[[dict[str, torch.Tensor]], Any]) -> TrainingState:
        """Hand the tensors to `restore`; a new run's state where there is no file.

        Raises
        ------
        ValueError
            The file is of another configuration, or damaged.
        """
        if not self.path.exists():
            return TrainingState()
        try:
            require_regular(self.path, MOST_BYTES)
            with safe_open(self.path, framework="pt") as file:
                words = dict(file.metadata() or {})
                tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            same = (words["schema"], words["identity"]) == (SCHEMA, self._identity)
            # Tensors of another configuration may not fit, which would read as damage.
            if same:
                restore(tensors)
            state = _STATE.validate_json(words["progress"])
        except MemoryError:
            raise ValueError(f"{self.path} is damaged, or too large for this memory") from None
        except (SafetensorError, OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
            raise ValueError(
                f"{self.path} is damaged ({first_line(error)}); delete it to start anew"
            ) from None
        if not same:
            raise ValueError(
                f"{self.path} belongs to another configuration; choose another folder or delete it"
            )
        return state


def training_drives(seed: int, drives: int) -> np.ndarray:
    """Seeds of the `drives` drives that a run with this seed trains on."""
    return np.random.SeedSequence(seed).generate_state(drives)
