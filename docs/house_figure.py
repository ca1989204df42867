"""Draws the house of the README: its rooms, as the import test lists them, and the way of a frame.

.venv/bin/pip install -c constraints.txt -e '.[docs]'
.venv/bin/python docs/house_figure.py

What a room is for is read from its door. A room that `PLACES` does not put on a floor is refused;
a test tells so before the picture is drawn anew.
"""

from __future__ import annotations

import ast
import io
import sys
import textwrap
from collections.abc import Mapping
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from PIL import Image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOT = Path(__file__).parents[1]
IMAGE = Path(__file__).parent / "images" / "house.png"
Points = tuple[tuple[float, float], ...]

LEFT, RIGHT, LOW, HIGH = -40, 1036, -6, 996
"""The drawing's edges; one unit is a little less than a pixel of the README."""
DOTS_PER_UNIT = 1.5
CORRIDOR, ACTION, TEXT = "#a3195b", "#5f6975", "#1f2933"


class Box(NamedTuple):
    """Left, right, lower and upper edge."""

    left: float
    right: float
    low: float
    high: float


class Floor(NamedTuple):
    """One top-level folder: its lower and upper edge, the height of its name, its colours."""

    low: float
    high: float
    name: float
    fill: str
    ink: str


FLOORS = {
    "agents": Floor(690, 886, 869, "#fdf1e2", "#a04e0e"),
    "shotenv": Floor(360, 678, 661, "#e8f5eb", "#1f6a45"),
    "unwrap": Floor(2, 348, 18, "#e6f0fa", "#20588c"),
}
# Lower and upper edges of the rows of rooms.
TOP = (736, 852)
BACK, FRONT = (530, 644), (412, 522)
MAIN, CELLAR = (174, 298), (34, 166)
PLACES = {
    "agents.cli": Box(374, 626, 900, 954),
    "agents.cli.command": Box(424, 519, 926, 949),
    "agents.cli.cameras": Box(525, 620, 926, 949),
    "agents.report": Box(30, 134, *TOP),
    "agents.report.calibration": Box(36, 128, 764, 784),
    "agents.report.recordings": Box(36, 128, 740, 760),
    "agents.evaluation": Box(140, 264, *TOP),
    "agents.optimum": Box(270, 396, *TOP),
    "agents.training": Box(400, 530, *TOP),
    "agents.study": Box(536, 628, *TOP),
    "agents.config": Box(634, 742, *TOP),
    "agents.deploy": Box(748, 836, *TOP),
    "agents.policies": Box(842, 970, *TOP),
    "shotenv.world": Box(30, 178, FRONT[0], BACK[1]),
    "shotenv.world.families": Box(40, 168, 484, 510),
    "shotenv.world.things": Box(40, 168, 452, 478),
    "shotenv.world.geometry": Box(40, 168, 420, 446),
    "shotenv.scenes": Box(186, 312, 580, BACK[1]),
    "shotenv.render": Box(186, 312, FRONT[0], 573),
    "shotenv.render.surfaces": Box(196, 302, 452, 478),
    "shotenv.render.backend": Box(196, 302, 420, 446),
    "shotenv.bank": Box(320, 456, 516, BACK[1]),
    "shotenv.bank.listing": Box(390, 450, 521, 543),
    "shotenv.bank.files": Box(326, 385, 521, 543),
    "shotenv.sensor": Box(320, 456, FRONT[0], 510),
    "shotenv.config": Box(490, 666, *BACK),
    "shotenv.dataset": Box(674, 818, *BACK),
    "shotenv.laser": Box(490, 650, *FRONT),
    "shotenv.decision": Box(658, 818, *FRONT),
    "shotenv.env": Box(826, 950, FRONT[0], 512),
    "shotenv.recorded": Box(826, 950, 517, 577),
    "shotenv.live": Box(826, 950, 582, BACK[1]),
    "unwrap.cameras": Box(30, 144, *MAIN),
    "unwrap.cameras.files": Box(36, 85, 179, 202),
    "unwrap.cameras.writing": Box(90, 139, 179, 202),
    "unwrap.recordings": Box(152, 272, *MAIN),
    "unwrap.signal": Box(280, 412, *MAIN),
    "unwrap.networks": Box(420, 624, *MAIN),
    "unwrap.networks.peers": Box(430, 614, 179, 202),
    "unwrap.depth": Box(632, 800, *MAIN),
    "unwrap.training": Box(808, 970, *MAIN),
    "unwrap.ros": Box(30, 118, *CELLAR),
    "unwrap.calibration": Box(124, 238, *CELLAR),
    "unwrap.comparison": Box(244, 372, *CELLAR),
    "unwrap.export": Box(378, 496, *CELLAR),
    "unwrap.storage": Box(502, 612, *CELLAR),
    "unwrap.pictures": Box(618, 714, *CELLAR),
    "unwrap.execution": Box(720, 844, *CELLAR),
    "unwrap.support": Box(850, 970, *CELLAR),
}
"""Where each room is drawn. Rooms on the frame's way touch the hallway of their floor."""

UPPER, MIDDLE, LOWER = 714, 387, 323
"""Heights of the three hallways."""
WAY: Points = (
    *((104, MIDDLE), (343, MIDDLE), (343, LOWER), (636, LOWER), (636, MIDDLE)),
    *((966, MIDDLE), (966, UPPER), (90, UPPER)),
)
"""What a frame becomes, from the world to the report."""
JOINING: tuple[Points, ...] = (
    ((212, LOWER), (343, LOWER)),
    ((540, MIDDLE), (636, MIDDLE)),
)
"""Recordings of a real camera, and what the shots cost, join it."""
CHOICE: Points = ((845, TOP[0]), (845, 684), (473, 684), (473, 467), (458, 467))
"""The way of the action back to the sensor."""
DOORS: dict[str, tuple[float, float]] = {
    "shotenv.world": (104, MIDDLE),
    "shotenv.render": (236, MIDDLE),
    "shotenv.sensor": (343, MIDDLE),
    "unwrap.recordings": (212, LOWER),
    "unwrap.signal": (343, LOWER),
    "unwrap.networks": (489, LOWER),
    "unwrap.depth": (636, LOWER),
    "shotenv.laser": (540, MIDDLE),
    "shotenv.decision": (744, MIDDLE),
    "shotenv.env": (888, MIDDLE),
    "agents.policies": (900, UPPER),
    "agents.evaluation": (240, UPPER),
    "agents.report": (90, UPPER),
}
"""Where rooms open to the hallway."""
HEADS: tuple[tuple[str, tuple[float, float]], ...] = (
    *((">", (127, MIDDLE)), (">", (282, LOWER)), (">", (466, LOWER)), (">", (936, MIDDLE))),
    *(("^", (966, 540)), ("<", (740, UPPER)), ("<", (400, UPPER))),
)
"""Which way it goes."""
VALUES: dict[str, tuple[float, float]] = {
    "World": (170, MIDDLE),
    "Exposure": (290, MIDDLE),
    "RawFrame": (343, 355),
    "PhaseFrame": (416, LOWER),
    "prediction": (562, LOWER),
    "DepthFrame": (636, 355),
    "ShotCost": (588, MIDDLE),
    "score": (690, MIDDLE),
    "reward": (816, MIDDLE),
    "observation": (927, 684),
    "drives played": (570, UPPER),
    "statistics": (165, UPPER),
}
"""What is carried, and where it is written on the way."""


def rooms_of_the_test() -> tuple[str, ...]:
    """Rooms inside the three folders, from the table of `test_imports.py`."""
    # By its path: the tests are no package, and this script runs without pytest's search path.
    path = ROOT / "tests" / "architecture" / "test_imports.py"
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return tuple(name for name in module.ROOMS if name not in FLOORS)


def purpose(room: str) -> str:
    """What the door of a room says it is for: its first sentence."""
    door = ROOT / room.replace(".", "/") / "__init__.py"
    # Read and not imported: the picture is drawn without torch and mitsuba.
    words = ast.get_docstring(ast.parse(door.read_text(encoding="utf-8"))) or ""
    line = words.splitlines()[0].replace("`", "")
    return line.split(". ")[0].removesuffix(".")


def check_places(rooms: tuple[str, ...], places: Mapping[str, Box]) -> None:
    """Refuse rooms that the picture does not show, and places of rooms that are gone.

    Raises
    ------
    ValueError
        The message names the rooms.
    """
    missing, gone = sorted(set(rooms) - set(places)), sorted(set(places) - set(rooms))
    if missing or gone:
        raise ValueError(f"PLACES lacks {missing} and has {gone} too many; expected the rooms")


def draw() -> bytes:
    """The picture, a PNG file."""
    from matplotlib.figure import Figure

    check_places(rooms_of_the_test(), PLACES)
    figure = Figure(figsize=((RIGHT - LEFT) / 100, (HIGH - LOW) / 100), facecolor="white")
    page = figure.add_axes((0, 0, 1, 1), xlim=(LEFT, RIGHT), ylim=(LOW, HIGH))
    page.axis("off")
    _walls(page)
    for room, place in PLACES.items():
        _room(page, room, place)
    _way(page)
    content = io.BytesIO()
    figure.savefig(content, dpi=100 * DOTS_PER_UNIT, metadata={"Software": None})
    # Few colours: a palette makes the file a third as large.
    small = io.BytesIO()
    Image.open(content).convert("RGB").quantize(96).save(small, format="PNG", optimize=True)
    return small.getvalue()


def _walls(page: Axes) -> None:
    """Roof, floors and their names, and which way imports point."""
    from matplotlib.patches import Polygon

    roof = ((-10, 888), (500, 990), (1010, 888))
    page.add_patch(Polygon(roof, closed=True, facecolor="#f3e3d6", edgecolor="#8a6d5a", lw=1.4))
    for folder, floor in FLOORS.items():
        _rounded(page, Box(18, 982, floor.low, floor.high), floor.fill, floor.ink, 1.4)
        name = page.text(30, floor.name, f"{folder}/", color=floor.ink, **_font(13, "bold"))
        name.set_family("monospace")
        words = page.text(126, floor.name, purpose(folder), color=floor.ink, **_font(9.5))
        words.set_style("italic")
        # The way of the action passes behind the words.
        words.set(bbox={"facecolor": floor.fill, "edgecolor": "none", "pad": 1.5}, zorder=4)
    arrow = {"arrowstyle": "-|>", "color": ACTION, "lw": 1.6}
    page.annotate("", (1004, 60), (1004, 860), arrowprops=arrow)
    page.text(1021, 440, "imports point down", rotation=270, color=ACTION, ha="center", **_font(10))


def _room(page: Axes, room: str, place: Box) -> None:
    folder, *_, name = room.split(".")
    ink = FLOORS[folder].ink
    inner = room.count(".") > 1
    _rounded(page, place, FLOORS[folder].fill if inner else "white", ink, 0.8)
    if inner:
        middle = (place.low + place.high) / 2
        page.text((place.left + place.right) / 2, middle, name, color=ink, ha="center", **_font(10))
        return
    page.text(place.left + 9, place.high - 15, name, color=ink, **_font(12.5, "bold"))
    # A letter of this size is about 6.9 units wide; found by looking at the picture.
    columns = int((place.right - place.left - 14) / 6.9)
    for number, line in enumerate(textwrap.wrap(purpose(room), columns)):
        page.text(place.left + 9, place.high - 37 - 15.5 * number, line, color=TEXT, **_font(9.2))


def _way(page: Axes) -> None:
    """The corridor, its doors, and what walks through it."""
    from matplotlib.patches import FancyArrowPatch

    for joined in JOINING:
        page.plot(*zip(*joined, strict=True), color=CORRIDOR, lw=2.2, zorder=3)
    page.plot(*zip(*WAY, strict=True), color=CORRIDOR, lw=4.5, zorder=3, solid_joinstyle="round")
    page.plot(*zip(*CHOICE, strict=True), color=ACTION, lw=1.8, ls=(0, (3, 1.6)), zorder=3)
    for end, start in (((456, 467), (472, 467)), ((90, TOP[0]), (90, UPPER))):
        color = ACTION if end[0] > 400 else CORRIDOR
        page.add_patch(
            FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=12, color=color, zorder=5)
        )
    for room, (x, y) in DOORS.items():
        # The hallway of `unwrap` runs above its rooms, the others below theirs.
        wall = PLACES[room].high if y == LOWER else PLACES[room].low
        page.plot((x, x), (y, wall), color=CORRIDOR, lw=2.2, zorder=3)
        page.plot(x, y, "o", color="white", mec=CORRIDOR, mew=2, ms=7, zorder=4)
    for head, (x, y) in HEADS:
        page.plot(x, y, head, color=CORRIDOR, ms=9, mew=0, zorder=4)
    for value, (x, y) in VALUES.items():
        _pill(page, value, x, y, CORRIDOR)
    _pill(page, "action: 2, 4 or 8 DCS", 650, 684, ACTION)
    page.annotate(
        "", (30, 229), (-14, 229), arrowprops={"arrowstyle": "-|>", "color": CORRIDOR, "lw": 2}
    )
    page.text(-25, 229, "a real camera", rotation=90, color=CORRIDOR, ha="center", **_font(10))


def _pill(page: Axes, words: str, x: float, y: float, color: str) -> None:
    frame = {"boxstyle": "round,pad=0.28", "facecolor": "white", "edgecolor": color, "lw": 1.1}
    page.text(x, y, words, color=color, ha="center", bbox=frame, zorder=6, **_font(9, "bold"))


def _rounded(page: Axes, box: Box, fill: str, ink: str, width: float) -> None:
    from matplotlib.patches import FancyBboxPatch

    size = box.right - box.left, box.high - box.low
    page.add_patch(
        FancyBboxPatch(
            (box.left, box.low),
            *size,
            boxstyle="round,pad=0,rounding_size=5",
            facecolor=fill,
            edgecolor=ink,
            lw=width,
        )
    )


def _font(size: float, weight: str = "normal") -> dict:
    return {"fontsize": size, "fontweight": weight, "va": "center"}


if __name__ == "__main__":
    IMAGE.write_bytes(draw())
    print(f"{IMAGE} {IMAGE.stat().st_size / 1e3:.0f} kB", file=sys.stderr)
