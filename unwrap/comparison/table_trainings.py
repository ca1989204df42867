"""Which networks are trained for the results table, and the training of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from pydantic import Field

from unwrap.comparison.catalogue import NETWORKS
from unwrap.comparison.compared_frames import OpenSplits
from unwrap.execution import Executor, output_to, run_tasks, visible
from unwrap.networks import NetworkName, Unwrapper, load_unwrapper
from unwrap.support import Positive, Section, progress, read_json, say
from unwrap.training import TrainConfig, train

PAPERS: tuple[NetworkName, ...] = ("tofregnet", "tofsegnet")
PEERS: tuple[NetworkName, ...] = ("su_net", "phasenet", "agresti_net", "chen_net")
RecipeName = Literal["paper", "ours"]


class TableConfig(Section):
    """What every network of the table is trained on, and for how long: the same for all."""

    bank: str = Field("nearfield", description="name or path of the bank")
    sensor: str = Field("epc660", description="name or path of the sensor that looks at it")
    stride: int = Field(1, ge=1, le=8, description="every how many rows and columns are used")
    width: int = Field(64, ge=4, le=128, description="channels of the networks' first stage")
    epochs: int = Field(150, ge=1, description="passes over the training frames")
    batch_size: int = Field(32, ge=1, description="frames per step")
    learning_rate: Positive = Field(3e-3, description="highest learning rate, one rise and fall")
    networks: tuple[NetworkName, ...] = Field(
        (*PAPERS, *PEERS, "toffusionnet"), description="networks that are trained and judged"
    )
    seed: int = Field(0, ge=0, description="seed of weights, order and augmentation")


@dataclass(frozen=True)
class Training:
    """One trained network of the table.

    Attributes
    ----------
    label : str
        As rows name it.
    recipe : "paper" or "ours"
        Losses and flips as published, or ours; see `RECIPES`.
    config : TrainConfig
    """

    label: str
    recipe: RecipeName
    config: TrainConfig

    @property
    def folder(self) -> str:
        """Its place below the folder of the table."""
        config = self.config
        return f"{config.network}-{self.recipe}-{config.split_by}-{config.truth}"


RECIPES: dict[RecipeName, dict[str, Any]] = {
    "paper": {"equation_7_mean_share": 1.0, "wrap_weight": 0.0, "flip_vertical": True},
    "ours": {"clip_norm": 1.0},
}
"""Fields of `TrainConfig` that a recipe changes."""


def planned_trainings(config: TableConfig) -> Iterator[Training]:
    """The paper's networks on both splits and both truths, the others on clips and rendered truth.

    TofRegNet also with our loss, which is what the shipped weights are trained with.
    """
    for network in config.networks:
        if network not in PAPERS:
            yield _training(config, network, "ours")
            continue
        for split_by in ("clip", "frame"):
            for truth in ("rendered", "measured"):
                yield _training(config, network, "paper", split_by=split_by, truth=truth)
        if network == "tofregnet":
            yield _training(config, network, "ours")


def _training(
    config: TableConfig, network: NetworkName, recipe: RecipeName, **fields: Any
) -> Training:
    shared = ("bank", "sensor", "stride", "width", "epochs", "batch_size", "learning_rate", "seed")
    values = {name: getattr(config, name) for name in shared} | RECIPES[recipe] | fields
    # Memory: for the only network that was made to look at its own depth of the frame before.
    memory = network == "toffusionnet"
    ours = " with our loss" if network in PAPERS and recipe == "ours" else ""
    train_config = TrainConfig(network=network, memory=memory, **values)
    return Training(NETWORKS[network].label + ours, recipe, train_config)


class TrainingTask(NamedTuple):
    """One training for a worker, whose network has its own folder in that of the table."""

    training: Training
    open_splits: OpenSplits
    out: Path

    @property
    def folder(self) -> Path:
        """Of the network."""
        return self.out / self.training.folder

    @property
    def path(self) -> Path:
        """Of the weights."""
        return self.folder / f"{self.training.config.network}.safetensors"

    @property
    def stands(self) -> bool:
        """Whether the weights were trained as the configuration says, to the end."""
        return _is_trained(self.path, self.training.config)


def train_one(task: TrainingTask) -> None:
    """Train a network; may take hours."""
    config = task.training.config
    say(f"training {task.training.label}, split by {config.split_by}, {config.truth} truth")
    train(config, task.open_splits(config), task.folder)


def train_with_log(task: TrainingTask) -> None:
    """As `train_one`; bars and lines go to a file beside the folder of the network."""
    with output_to(visible(task.out) / f"{task.training.folder}.log"):
        train_one(task)


def train_missing(
    trainings: Sequence[Training],
    open_splits: OpenSplits,
    out: Path,
    *,
    executor: Executor = "local",
    workers: int | None = None,
) -> dict[Training, Unwrapper]:
    """Train the networks that do not stand in `out` yet, and load all.

    Parameters
    ----------
    open_splits : callable
        At the top level of a module, where workers train.
    out : Path
        Folder of the table.
    executor, workers
        See `run_tasks`. With "local" and fewer than two workers the trainings follow each other
        here, each on all cores.
    """
    out = out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    tasks = [TrainingTask(training, open_splits, out) for training in trainings]
    missing = [task for task in tasks if not task.stands]
    if executor == "local" and (workers or 1) == 1:
        for task in missing:
            train_one(task)
    else:
        with progress(len(tasks), "trainings", "network", done=len(tasks) - len(missing)) as bar:
            for _ in run_tasks(
                train_with_log,
                missing,
                executor=executor,
                workers=workers,
                gpu=True,
                tasks_per_worker=1,
                name=lambda task: f"training {task.training.folder}",
            ):
                bar.update(1)
    return {task.training: load_unwrapper(task.path) for task in tasks}


def _is_trained(path: Path, config: TrainConfig) -> bool:
    """Whether the weights at `path` were trained as `config` says, to the end."""
    # A training writes its numbers last, so that they tell of a finished one.
    numbers = path.with_suffix(".json")
    if not (path.is_file() and numbers.is_file()):
        return False
    # Where the configuration is another, `train` goes on to refuse the checkpoint beside it.
    try:
        trained_as = read_json(numbers).get("config")
    except ValueError as error:
        raise ValueError(f"{numbers} is damaged ({error}); delete it to train again") from None
    return trained_as == config.model_dump(mode="json")
