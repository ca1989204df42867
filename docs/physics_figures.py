"""Makes the figures and the table of numbers of docs/physics.md from the package's own functions.

.venv/bin/pip install -c constraints.txt -e '.[render,docs]'
.venv/bin/python docs/physics_figures.py            # all
.venv/bin/python docs/physics_figures.py wiggle     # some
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import torch
from figures import (
    decoding,
    lamps,
    laser,
    light,
    movers,
    path_depth,
    renderer,
    sensor,
    stray_light,
)
from figures.stage import Made, Row
from marked_tables import marked

DOCS = Path(__file__).parent
IMAGES = DOCS / "images" / "physics"
FIGURES: tuple[Callable[[], Made], ...] = (
    light.samples,
    light.signal,
    decoding.wiggle,
    light.multipath,
    renderer.emission,
    light.panes,
    light.motion,
    movers.movers,
    renderer.renderer_error,
    path_depth.path_depth,
    stray_light.stray_light,
    lamps.lamps,
    sensor.photon_transfer,
    sensor.depth_noise,
    sensor.full_well,
    sensor.offsets,
    sensor.temperature,
    sensor.gray,
    decoding.valid,
    decoding.dual,
    laser.laser_energy,
    laser.laser_curves,
    laser.laser_heat,
    laser.laser_eye,
)
STYLE = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8,
}


def main(names: list[str]) -> None:
    """Draw the named figures, or all of them and the table."""
    # Sums are split among threads, and their last bits depend on how many there are.
    torch.set_num_threads(1)
    IMAGES.mkdir(parents=True, exist_ok=True)
    rows = [row for make in FIGURES if make.__name__ in names or not names for row in draw(make)]
    if not names:
        page = DOCS / "physics.md"
        text = page.read_text(encoding="utf-8")
        page.write_text(marked(text, "numbers", table(rows).rstrip(), page), encoding="utf-8")
    print(table(rows))


def draw(make: Callable[[], Made]) -> list[Row]:
    """Save one figure under its function's name; its rows of the table."""
    start = time.perf_counter()
    # From matplotlib's own defaults: a style file of the reader's would change the figures.
    with mpl.rc_context({**mpl.rcParamsDefault, **STYLE}):
        figure, rows = make()
        path = IMAGES / f"{make.__name__}.png"
        # Without the version of matplotlib a figure that has not changed is the same file.
        figure.savefig(path, dpi=140, metadata={"Software": None})
    print(f"{path.name} {time.perf_counter() - start:.1f} s", file=sys.stderr)
    return rows


def table(rows: list[Row]) -> str:
    """Markdown of the rows."""
    head = "| quantity | formula | measured |\n|---|---|---|\n"
    return head + "".join(f"| {' | '.join(row)} |\n" for row in rows)


if __name__ == "__main__":
    main(sys.argv[1:])
