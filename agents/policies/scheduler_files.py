"""The folder that a trained scheduler is saved in: its description and its weights, no pickle."""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field, StringConstraints, ValidationError, field_validator
from torch import nn

from agents.config import MOST_HIDDEN, WIDEST
from agents.policies.score_networks import Activation
from shotenv.config import one_sentence
from unwrap.support import (
    Range,
    Section,
    check_range,
    read_json,
    read_regular,
    tensor_bytes,
    write_bytes,
    write_json,
)

AGENT_SCHEMA: Final = 5
WEIGHTS: Final = "policy.safetensors"
DESCRIPTION: Final = "agent.json"
PACKAGES: Final = ("shotenv", "torch", "stable-baselines3", "sb3-contrib")
# Assumed: a damaged or hostile description must not make a network that fills the memory.
DEEPEST = MOST_HIDDEN + 2
MOST_DESCRIPTION_BYTES, MOST_WEIGHTS_BYTES = 1 << 20, 1 << 27
"""Of the two files: a description has some 4 kB, the largest network above 70 MB."""
# They become identifiers of an exported scheduler's C file, and lines of its comments.
FeatureName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_]{1,80}$")]
Word = Annotated[str, StringConstraints(max_length=300)]


class UnboundSchedulerWarning(UserWarning):
    """A scheduler's folder that does not tell which weights its description is of."""


def installed_versions() -> dict[str, str]:
    """Versions of the packages that train schedulers, as far as they are installed."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


class Provenance(Section):
    """How a scheduler came about; nothing of it is needed to use it, but for the names.

    Attributes
    ----------
    algorithm : str
        As "ppo", "recurrent_ppo", "dqn", "qrdqn", "regression".
    feature_names : tuple of str
        Elements of the observation, in order.
    power_price : (float, float), optional
        Lowest and highest weight of power (`reward.power`) that it was trained with.
    training : dict
        Configuration of the training.
    environment : dict
        Configuration of the environment that it was trained in; empty where it is not known.
    seed : int
        Of the training.
    versions : dict of str to str
        Of the packages that it was trained with.
    """

    algorithm: Word
    feature_names: tuple[FeatureName, ...] = Field(min_length=1, max_length=WIDEST)
    power_price: Range | None = None
    training: dict[str, Any] = Field(default_factory=dict)
    environment: dict[str, Any] = Field(default_factory=dict)
    seed: int = Field(0, ge=0)
    versions: dict[str, Word] = Field(default_factory=installed_versions)

    @field_validator("feature_names")
    @classmethod
    def _once_each(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(names)) < len(names):
            raise ValueError("a name stands twice; expected each once")
        return names

    @field_validator("power_price")
    @classmethod
    def _prices_possible(cls, bounds: Range | None) -> Range | None:
        if bounds is not None:
            check_range("power_price", bounds)
            if bounds[0] < 0 or not math.isfinite(bounds[1]):
                raise ValueError("expected finite prices of at least 0")
        return bounds


class Description(Provenance):
    """What `agent.json` holds beside schema and digest: `Provenance`, and the network's form.

    Attributes
    ----------
    layers : tuple of int
        Widths: features, hidden layers, actions.
    activation : {"tanh", "relu"}
    memory : int
        Units of an LSTM that reads the features, whose output is what the first layer reads then;
        0 without one.
    """

    layers: tuple[Annotated[int, Field(ge=1, le=WIDEST)], ...] = Field(
        min_length=2, max_length=DEEPEST
    )
    activation: Activation
    power_price: Range | None
    training: dict[str, Any]
    seed: int = Field(ge=0)
    versions: dict[str, Word]
    memory: int = Field(0, ge=0, le=WIDEST)

    @property
    def provenance(self) -> Provenance:
        """What it says of how the scheduler came about."""
        return Provenance(**self.model_dump(include=set(Provenance.model_fields)))


def write_scheduler(folder: Path, module: nn.Module, description: Description) -> None:
    """Write `policy.safetensors`, then `agent.json`, each atomically.

    The description has a digest of both, by which parts of two schedulers are told apart.
    """
    weights = tensor_bytes(module.state_dict())
    content = {"schema": AGENT_SCHEMA, **description.model_dump(mode="json")}
    # The description comes last: a folder that has it has the weights, too.
    write_bytes(folder / WEIGHTS, weights)
    write_json(folder / DESCRIPTION, {**content, "digest": _digest_of(content, weights)})


def _digest_of(content: Mapping[str, Any], weights: bytes) -> str:
    told = json.dumps(content, sort_keys=True).encode()
    return hashlib.sha256(hashlib.sha256(weights).digest() + told).hexdigest()


def read_weights(folder: Path, module: nn.Module) -> None:
    """Put the weights of `folder` into `module`, which is formed as its description says.

    Raises
    ------
    ValueError
        They are missing or damaged, not those that the description was written with, of another
        form or type, or not all finite; the message names the file.

    Warns
    -----
    UnboundSchedulerWarning
        The description, of an earlier version, does not tell which weights it was written with.
    """
    from safetensors.torch import load

    path, module_weights = folder / WEIGHTS, module.state_dict()
    try:
        content = read_regular(path, MOST_WEIGHTS_BYTES)
        tensors = load(content)
        for name, value in tensors.items():
            # Loading would take the real part of complex numbers, and whole numbers as they are.
            if name in module_weights and value.dtype != module_weights[name].dtype:
                expected = module_weights[name].dtype
                raise ValueError(f"{name} is {value.dtype}; expected {expected}")
        module.load_state_dict(tensors)
    except Exception as error:  # safetensors has an error type of its own per fault
        raise ValueError(f"{path} is not a usable network: {first_line(error)}") from None
    if not all(value.isfinite().all() for value in module.parameters()):
        raise ValueError(f"{path} is not a usable network: not all weights are finite")
    _check_bound(folder, content)


def _check_bound(folder: Path, weights: bytes) -> None:
    """Refuse weights that the folder's description was not written with, where it tells."""
    path = folder / DESCRIPTION
    told = read_json(path, MOST_DESCRIPTION_BYTES)
    digest = told.pop("digest", None)
    if digest is None:
        warnings.warn(
            f"{path} has no digest, as those of earlier versions: whether {WEIGHTS} beside it "
            "belongs to it cannot be checked; training again writes one",
            UnboundSchedulerWarning,
            stacklevel=4,
        )
    elif digest != _digest_of(told, weights):
        raise ValueError(
            f"{path} and {WEIGHTS} do not belong together, or one was changed; expected both as "
            "`shotenv train` wrote them"
        )


def read_description(path: Path) -> Description:
    """What an `agent.json` says; `read_weights` compares its digest with the weights.

    Raises
    ------
    ValueError
        It is missing, damaged, of another schema, or has a field that is missing, unknown or of no
        use; the message names the file, and the field.
    """
    try:
        content = read_json(path, MOST_DESCRIPTION_BYTES)
    except FileNotFoundError:
        raise ValueError(
            f"{path.parent} holds no scheduler ({path.name} is missing); "
            "`shotenv train --out DIR` makes one"
        ) from None
    except ValueError as error:
        raise ValueError(
            f"{path} is damaged ({error}); expected the description of a scheduler"
        ) from None
    # Looked at before the fields: those of another version may have other names.
    schema = content.pop("schema", None)
    if schema != AGENT_SCHEMA:
        raise ValueError(
            f"{path} has schema {schema!r}, but this version reads {AGENT_SCHEMA}; "
            "train the scheduler again (`shotenv train --out DIR`)"
        )
    content.pop("digest", None)
    try:
        return Description.model_validate(content)
    except ValidationError as error:
        raise ValueError(
            f"{path}: {one_sentence(error, Description)}; expected what `shotenv train` writes"
        ) from None


def first_line(error: Exception) -> str:
    """The first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]
