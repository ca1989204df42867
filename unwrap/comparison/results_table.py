"""The results table, made: bank, trainings, scores, page and figure."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from shotenv.config import SensorConfig, find_config, read_config
from shotenv.dataset import SensedFrames, sources
from unwrap.comparison.methods import Method, classical_methods, methods_of
from unwrap.comparison.page import PUBLISHED, Row, figure, tables
from unwrap.comparison.plan import TableConfig, Training, trained, trainings
from unwrap.comparison.scores import rows_of
from unwrap.networks import Unwrapper
from unwrap.signal import unambiguous_range_m
from unwrap.support import progress, say, write_bytes, write_json
from unwrap.training import TrainConfig, training_device

PAGE, NUMBERS, FIGURE = "unwrapping.md", "unwrapping.json", "unwrapping.png"
TEMPLATE = "unwrapping.md.jinja"
FULL = TableConfig()
"""The paper's size and length."""


def make_table(
    config: TableConfig, out: Path, page: Path | None = None, only: Sequence[str] | None = None
) -> list[Row]:
    """Train what is not trained yet into `out`, score it, and write page, numbers and figure.

    These go to the folder `page`, or to `out`.

    Everything that stands in `out` already is taken as it is, so that an interrupted table goes on
    where it stopped, and several processes can train their share of it (`only`, names of
    networks); these score nothing.

    Raises
    ------
    ValueError
        Another configuration was begun in `out`, or there is no such network.
    """
    wanted = [t for t in trainings(config) if not only or t.config.network in only]
    if not wanted:
        raise ValueError(f"only is {only}; expected some of {', '.join(config.networks)}")
    networks = {training: trained(training, out) for training in wanted}
    for unwrapper in networks.values():
        unwrapper.network.to(training_device())
    if only:
        say(f"{len(networks)} networks stand in {out}")
        return []
    rows = _rows(networks)
    folder = out if page is None else page
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / NUMBERS, {"config": config.model_dump(mode="json"), "rows": rows})
    write_bytes(folder / PAGE, _page(config, rows).encode())
    _write_figure(networks, folder / FIGURE)
    say(f"{folder / PAGE}, {NUMBERS} and {FIGURE} are written")
    return rows


def _rows(networks: dict[Training, Unwrapper]) -> list[Row]:
    """Rows of every split and truth that something was trained on, and of the held-out families."""
    rows: list[Row] = []
    for split_by, truth in dict.fromkeys((t.config.split_by, t.config.truth) for t in networks):
        of = {
            training: network
            for training, network in networks.items()
            if (training.config.split_by, training.config.truth) == (split_by, truth)
        }
        config = next(iter(of)).config
        methods = [method for pair in of.items() for method in methods_of(*pair)]
        if (split_by, truth) == ("clip", "rendered"):
            training_frames = sources(config)("train")
            methods += classical_methods(training_frames, device=training_device())
        rows += _scored(methods, config, "test", {"split": split_by, "truth": truth})
        if (split_by, truth) == ("clip", "rendered") and _has_held_out(training_frames):
            rows += _scored(methods, config, "shift", {"split": "shift", "truth": truth})
    return rows


def _has_held_out(frames: SensedFrames) -> bool:
    return any(clip.split == "shift" for clip in frames.bank.clips)


def _scored(
    methods: list[Method], config: TrainConfig, split: str, of: dict[str, str]
) -> list[Row]:
    frames: SensedFrames = sources(config)(split)
    times = len({shots for method in methods for shots in method.shots})
    with progress(times * len(frames), f"scoring {' '.join(of.values())}", "frame") as bar:
        rows = rows_of(methods, frames, device=training_device(), tick=bar.update)
        return [{**row, **of} for row in rows]


def _page(config: TableConfig, rows: list[Row]) -> str:
    """The page, from its template."""
    source = resources.files("unwrap.comparison") / TEMPLATE
    sensor = read_config(SensorConfig, find_config("sensor", config.sensor))
    template = Environment(undefined=StrictUndefined, keep_trailing_newline=True).from_string(
        source.read_text(encoding="utf-8")
    )
    return template.render(
        config=config.model_dump(mode="json"),
        small=config.width < FULL.width or config.epochs < FULL.epochs or config.stride > 1,
        f1_hz=sensor.f1_hz,
        unambiguous_m=unambiguous_range_m(sensor.f1_hz),
        max_range_m=sensor.max_range_m,
        min_snr=sensor.min_snr,
        tables=tables(rows),
        published=PUBLISHED,
    )


def _write_figure(networks: dict[Training, Unwrapper], path: Path) -> None:
    """A frame of each family; gray networks first, the one that sees the samples last."""
    shown = {
        training.label: network
        for training, network in networks.items()
        if (training.config.split_by, training.config.truth) == ("clip", "rendered")
        and training.config.network in ("tofregnet", "tofsegnet", "toffusionnet")
    }
    frames = sources(next(iter(networks)).config)("test")
    numbers = [frames.families.index(family) for family in dict.fromkeys(frames.families)]
    content = io.BytesIO()
    figure(shown, frames, numbers).save(content, format="PNG", optimize=True)
    write_bytes(path, content.getvalue())
