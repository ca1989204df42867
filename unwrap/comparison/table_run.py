"""One run of the results table, from the trainings to the page."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from unwrap.comparison.compared_frames import ComparedFrames, OpenSplits
from unwrap.comparison.compared_methods import Method, classical_methods, network_methods
from unwrap.comparison.method_scores import score_methods
from unwrap.comparison.table_figure import draw_frames
from unwrap.comparison.table_page import Row, render_page
from unwrap.comparison.table_trainings import (
    TableConfig,
    Training,
    planned_trainings,
    train_missing,
)
from unwrap.execution import Executor
from unwrap.networks import NetworkName, Unwrapper
from unwrap.support import progress, say, write_bytes, write_json
from unwrap.training import training_device

PAGE, NUMBERS, FIGURE = "unwrapping.md", "unwrapping.json", "unwrapping.png"
SHOWN: tuple[NetworkName, ...] = ("tofregnet", "tofsegnet", "toffusionnet")
"""Networks of the figure: those of the gray image first, the one that sees the samples last."""


def make_table(
    config: TableConfig,
    open_splits: OpenSplits,
    out: Path,
    page: Path | None = None,
    only: Sequence[str] | None = None,
    *,
    executor: Executor = "local",
    workers: int | None = None,
) -> list[Row]:
    """Train what is not trained yet into `out`, score it, and write page, numbers and figure.

    Everything that stands in `out` already is taken as it is, so that an interrupted table goes on
    where it stopped, and several processes can train their share of it.

    Parameters
    ----------
    config : TableConfig
    open_splits : callable
        Opens the frames that `config` names.
    out : Path
        Folder of the networks.
    page : Path, optional
        Folder of page, numbers and figure; `out` without.
    only : sequence of str, optional
        Names of networks: these are trained, and nothing is scored.
    executor, workers
        Where networks are trained, and how many at a time; see `train_missing`.

    Returns
    -------
    list of dict
        Rows of the table; none where `only` some were trained.

    Raises
    ------
    ValueError
        Another configuration was begun in `out`, or there is no such network.
    """
    wanted = [t for t in planned_trainings(config) if not only or t.config.network in only]
    if not wanted:
        raise ValueError(f"only is {only}; expected some of {', '.join(config.networks)}")
    networks = train_missing(wanted, open_splits, out, executor=executor, workers=workers)
    if only:
        say(f"{len(networks)} networks stand in {out}")
        return []
    # They come from their files, into the memory of the processor.
    for unwrapper in networks.values():
        unwrapper.network.to(training_device())
    rows = _score_all(networks, open_splits)
    folder = out if page is None else page
    # The first training planned is always on clips and rendered truth, as the figure needs.
    frames = open_splits(wanted[0].config)("test")
    # With what the pixels were scored by, which the configuration does not tell.
    numbers = {"config": config.model_dump(mode="json"), "min_snr": frames.sensor.min_snr}
    write_json(folder / NUMBERS, {**numbers, "rows": rows})
    write_bytes(folder / PAGE, render_page(config, frames.sensor, rows).encode())
    write_bytes(folder / FIGURE, _figure_png(networks, frames))
    say(f"{folder / PAGE}, {NUMBERS} and {FIGURE} are written")
    return rows


def _score_all(networks: Mapping[Training, Unwrapper], open_splits: OpenSplits) -> list[Row]:
    """Rows of every split and truth that something was trained on, and of the held-out families."""
    rows: list[Row] = []
    for split_by, truth in dict.fromkeys((t.config.split_by, t.config.truth) for t in networks):
        of = {
            training: network
            for training, network in networks.items()
            if (training.config.split_by, training.config.truth) == (split_by, truth)
        }
        splits = open_splits(next(iter(of)).config)
        methods = [method for pair in of.items() for method in network_methods(*pair)]
        if (split_by, truth) != ("clip", "rendered"):
            rows += _score_split(methods, splits("test"), split_by, truth)
            continue
        # What needs no training is told once, where most networks are.
        training_frames = splits("train")
        methods += classical_methods(training_frames, device=training_device())
        rows += _score_split(methods, splits("test"), split_by, truth)
        if training_frames.held_out_families:
            rows += _score_split(methods, splits("shift"), "shift", truth)
    return rows


def _score_split(
    methods: Sequence[Method], frames: ComparedFrames, split: str, truth: str
) -> list[Row]:
    times = len({shots for method in methods for shots in method.shots})
    with progress(times * len(frames), f"scoring {split} {truth}", "frame") as bar:
        rows = score_methods(methods, frames, device=training_device(), tick=bar.update)
    return [{**row, "split": split, "truth": truth} for row in rows]


def _figure_png(networks: Mapping[Training, Unwrapper], frames: ComparedFrames) -> bytes:
    """A frame of each family through the networks that were trained on clips and rendered truth."""
    trained = {
        training: network
        for training, network in networks.items()
        if (training.config.split_by, training.config.truth) == ("clip", "rendered")
    }
    shown = {t.label: network for t, network in trained.items() if t.config.network in SHOWN}
    if not shown:
        shown = {t.label: network for t, network in trained.items()}
    numbers = [frames.families.index(family) for family in dict.fromkeys(frames.families)]
    content = io.BytesIO()
    draw_frames(shown, frames, numbers).save(content, format="PNG", optimize=True)
    return content.getvalue()
