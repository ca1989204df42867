"""The folder that a trained scheduler is saved in: its description and its weights, no pickle."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field, ValidationError
from torch import nn

from agents.policies.score_networks import Activation
from unwrap.support import Range, Section, write_bytes, write_json

AGENT_SCHEMA: Final = 5
WEIGHTS: Final = "policy.safetensors"
DESCRIPTION: Final = "agent.json"
PACKAGES: Final = ("shotenv", "torch", "stable-baselines3", "sb3-contrib")
# Assumed: a damaged or hostile description must not make a network that fills the memory.
WIDEST, DEEPEST = 1024, 16


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

    algorithm: str
    feature_names: tuple[str, ...]
    power_price: Range | None = None
    training: dict[str, Any] = Field(default_factory=dict)
    environment: dict[str, Any] = Field(default_factory=dict)
    seed: int = 0
    versions: dict[str, str] = Field(default_factory=installed_versions)


class Description(Section):
    """What `agent.json` holds beside its schema: `Provenance`, and the network's form.

    Attributes
    ----------
    layers : tuple of int
        Widths: features, hidden layers, actions.
    activation : {"tanh", "relu"}
    memory : int
        Units of an LSTM that reads the features, whose output is what the first layer reads then;
        0 without one.
    """

    algorithm: str
    feature_names: tuple[str, ...] = Field(max_length=WIDEST)
    layers: tuple[Annotated[int, Field(ge=1, le=WIDEST)], ...] = Field(
        min_length=2, max_length=DEEPEST
    )
    activation: Activation
    power_price: Range | None
    training: dict[str, Any]
    environment: dict[str, Any] = Field(default_factory=dict)  # older files have none
    seed: int
    versions: dict[str, str]
    memory: int = Field(0, ge=0, le=WIDEST)

    @property
    def provenance(self) -> Provenance:
        """What it says of how the scheduler came about."""
        return Provenance(**self.model_dump(include=set(Provenance.model_fields)))


def write_scheduler(folder: Path, module: nn.Module, description: Description) -> None:
    """Write `policy.safetensors`, then `agent.json`, each atomically."""
    from safetensors.torch import save

    # safetensors refuses tensors that do not lie in one piece.
    tensors = {name: value.contiguous() for name, value in module.state_dict().items()}
    # The description comes last: a folder that has it has the weights, too.
    write_bytes(folder / WEIGHTS, save(tensors))
    write_json(
        folder / DESCRIPTION, {"schema": AGENT_SCHEMA, **description.model_dump(mode="json")}
    )


def read_weights(folder: Path, module: nn.Module) -> None:
    """Put the weights of `folder` into `module`, which is formed as its description says.

    Raises
    ------
    ValueError
        They are missing or damaged, of another form, or not all finite; the message names the file.
    """
    from safetensors.torch import load_file

    weights = folder / WEIGHTS
    try:
        module.load_state_dict(load_file(weights))
    except Exception as error:  # safetensors has an error type of its own per fault
        raise ValueError(f"{weights} is not a usable network: {first_line(error)}") from None
    if not all(value.isfinite().all() for value in module.parameters()):
        raise ValueError(f"{weights} is not a usable network: not all weights are finite")


def read_description(path: Path) -> Description:
    """What an `agent.json` says.

    Raises
    ------
    ValueError
        It is missing, damaged, of another schema, or has a field that is missing, unknown or of no
        use; the message names the file, and the field.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        # Looked at before the fields: those of another version may have other names.
        schema = content.pop("schema")
    except (FileNotFoundError, NotADirectoryError):
        raise ValueError(
            f"{path.parent} holds no scheduler ({path.name} is missing); "
            "`shotenv train --out DIR` makes one"
        ) from None
    # The last three: JSON that is no table, or a table without a schema.
    except (UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError, AttributeError):
        raise ValueError(f"{path} is damaged; expected the description of a scheduler") from None
    if schema != AGENT_SCHEMA:
        raise ValueError(
            f"{path} has schema {schema!r}, but this version reads {AGENT_SCHEMA}; "
            "train the scheduler again (`shotenv train --out DIR`)"
        )
    try:
        return Description.model_validate(content)
    except ValidationError as error:
        fault = error.errors()[0]
        field = ".".join(map(str, fault["loc"]))
        got = "" if fault["type"] == "missing" else f", got {fault['input']!r}"
        raise ValueError(
            f"{path}: {field}: {fault['msg'].lower()}{got}; expected what `shotenv train` writes"
        ) from None


def first_line(error: Exception) -> str:
    """The first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]
