"""The tables of `docs/environment.md`, from the code: features, keys of `info`, arguments, options.

`python docs/environment_tables.py` writes them into the page; a test compares them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

from marked_tables import marked

from shotenv.config import EnvConfig, RewardConfig, env_config
from shotenv.decision import FEATURES, TERMS
from shotenv.env import INFO_ENTRIES

PAGE = Path(__file__).with_name("environment.md")


def rows(heading: tuple[str, ...], cells: list[tuple[str, ...]]) -> str:
    """A table of Markdown."""
    # A bar in a cell would begin another.
    escaped = [[cell.replace("|", "\\|") for cell in row] for row in (heading, *cells)]
    lines = [f"| {' | '.join(row)} |" for row in escaped]
    return "\n".join([lines[0], "|---" * len(heading) + "|", *lines[1:]])


def features() -> str:
    """Every element of the observation."""
    cells = [(f"`{f.name}`", f.unit, f.meaning) for f in FEATURES]
    return rows(("feature", "unit", "meaning"), cells)


def info() -> str:
    """Every key of `info`."""
    cells = [
        (
            f"`{e.name}`",
            e.unit,
            e.meaning,
            "as after `step`" if e.at_start is None else f"{e.at_start}",
        )
        for e in INFO_ENTRIES
    ]
    names = ", ".join(f"`{name}`" for name in TERMS)
    cells.append(("`reward_terms`", "1", f"dictionary of the unweighted terms {names}", "zeros"))
    cells.append(("`vector_reward`", "1", "the same as float32, in this order", "zeros"))
    return rows(("key", "unit", "meaning", "after `reset`"), cells)


def arguments() -> str:
    """Fields of the configuration, as keywords."""
    base = env_config()
    cells = []
    for name, field in EnvConfig.model_fields.items():
        value: Any = getattr(base, name)
        sections = {"sensor": "`epc660`", "laser": f"`{base.laser.name}`", "reward": "see Rewards"}
        default = sections.get(name) or f"`{value!r}`".replace("'", '"')
        meaning = field.description or {
            "sensor": "name in `configs/sensor/`, path, or mapping that changes single values",
            "laser": "name in `configs/laser/`, path, or mapping that changes single values",
            "reward": "mapping of weights",
        }.get(name, "")
        choices = [c for part in get_args(field.annotation) for c in (get_args(part) or (part,))]
        words = [f'`"{choice}"`' for choice in choices if isinstance(choice, str)]
        cells.append((f"`{name}`", default, meaning + (f": {', '.join(words)}" if words else "")))
    return rows(("argument", "default", "meaning"), cells)


def weights() -> str:
    """Fields of the reward."""
    reward = env_config().reward
    cells = [
        (f"`{name}`", f"`{getattr(reward, name)}`", field.description or "")
        for name, field in RewardConfig.model_fields.items()
    ]
    return rows(("of `reward`", "default", "meaning"), cells)


TABLES = {"weights": weights, "features": features, "info": info, "arguments": arguments}


def filled(page: str) -> str:
    """`page` with the tables between its marks `<!-- name -->` and `<!-- end -->`."""
    for name, table in TABLES.items():
        page = marked(page, name, table(), PAGE)
    return page


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
