"""The house: imports point one way, through doors, and heavy packages stay where they belong."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LONGEST_FILE, LARGEST_ROOM = 350, 13
"""Lines of a file; files of a room."""

# What each room may import, besides itself: rooms further up in this table, by their doors.
ROOMS: dict[str, set[str]] = {}


def room(name: str, *imports: str) -> None:
    unknown = set(imports) - set(ROOMS)
    assert not unknown, f"{name} imports {unknown}, which stand below it"
    ROOMS[name] = set(imports)


SIGNAL = ("unwrap.support", "unwrap.signal")
UNWRAPPING = (*SIGNAL, "unwrap.depth", "unwrap.networks")
room("unwrap.support")
room("unwrap.storage", "unwrap.support")
room("unwrap.execution", "unwrap.support")
room("unwrap.pictures")
room("unwrap.signal", "unwrap.support")
room("unwrap.depth", *SIGNAL)
room("unwrap.networks", *SIGNAL, "unwrap.depth")
room("unwrap.networks.peers", *UNWRAPPING)
room("unwrap.training", *UNWRAPPING)
room("unwrap.ros", "unwrap.support")
room("unwrap.recordings", *UNWRAPPING, "unwrap.pictures", "unwrap.ros")
room("unwrap.cameras.files", "unwrap.support", "unwrap.signal", "unwrap.recordings")
room("unwrap.cameras", *UNWRAPPING, "unwrap.recordings", "unwrap.cameras.files")
room(
    "unwrap.cameras.writing",
    *SIGNAL,
    "unwrap.recordings",
    "unwrap.cameras.files",
    "unwrap.cameras",
)
room(
    "unwrap.calibration",
    *SIGNAL,
    "unwrap.depth",
    "unwrap.recordings",
    "unwrap.cameras.files",
    "unwrap.cameras",
)
room("unwrap.export", *UNWRAPPING, "unwrap.training")
room("unwrap.comparison", *UNWRAPPING, "unwrap.execution", "unwrap.training", "unwrap.pictures")
room("unwrap", *UNWRAPPING)

LIGHT = ("shotenv.config", "shotenv.world.geometry", "shotenv.world")
SENSING = ("shotenv.config", "shotenv.sensor", "shotenv.laser", "shotenv.bank")
room("shotenv.config", *SIGNAL)
room("shotenv.world.geometry", "unwrap.support", "shotenv.config")
room("shotenv.world.things", "shotenv.world.geometry")
room(
    "shotenv.world.families",
    "unwrap.support",
    "shotenv.config",
    "shotenv.world.geometry",
    "shotenv.world.things",
)
room(
    "shotenv.world",
    "unwrap.support",
    "shotenv.config",
    "shotenv.world.geometry",
    "shotenv.world.families",
)
room("shotenv.render.backend")
room(
    "shotenv.render.surfaces", "unwrap.support", "shotenv.world.geometry", "shotenv.render.backend"
)
room(
    "shotenv.render",
    *SIGNAL,
    "shotenv.config",
    "shotenv.world.geometry",
    "shotenv.render.backend",
    "shotenv.render.surfaces",
)
room(
    "shotenv.scenes",
    "unwrap.support",
    "shotenv.config",
    "shotenv.world.geometry",
    "shotenv.render.surfaces",
)
room("shotenv.sensor", *SIGNAL, "shotenv.config")
room("shotenv.laser", "shotenv.config")
room("shotenv.bank.files", "unwrap.support", "shotenv.config")
room(
    "shotenv.bank",
    *UNWRAPPING,
    "unwrap.execution",
    "unwrap.training",
    "unwrap.pictures",
    *LIGHT,
    "shotenv.render",
    "shotenv.render.backend",
    "shotenv.scenes",
    "shotenv.sensor",
    "shotenv.bank.files",
    "unwrap.storage",
)
room(
    "shotenv.bank.listing",
    "unwrap.signal",
    "unwrap.pictures",
    "shotenv.config",
    "shotenv.sensor",
    "shotenv.bank",
)
room("shotenv.decision", *UNWRAPPING, *SENSING)
room("shotenv.env", *SIGNAL, "unwrap.pictures", *SENSING, "shotenv.decision")
room(
    "shotenv.dataset", *UNWRAPPING, "unwrap.training", "unwrap.export", *SENSING, "shotenv.decision"
)
room(
    "shotenv.recorded",
    *SIGNAL,
    "unwrap.recordings",
    "unwrap.cameras.files",
    "unwrap.cameras",
    "unwrap.cameras.writing",
    *SENSING,
    "shotenv.decision",
)
room(
    "shotenv.live",
    *UNWRAPPING,
    "unwrap.cameras.files",
    "unwrap.cameras",
    *SENSING,
    "shotenv.decision",
    "shotenv.env",
)
room("shotenv", "shotenv.bank", "shotenv.config", "shotenv.sensor", "shotenv.env")

ENVIRONMENT = ("shotenv.config", "shotenv.laser", "shotenv.decision", "shotenv.env")
room("agents.config", "unwrap.support", "shotenv.config")
room("agents.policies", *SIGNAL, *ENVIRONMENT, "agents.config")
room("agents.optimum", *SIGNAL, *ENVIRONMENT, "agents.policies")
PLAYING = (*SIGNAL, *ENVIRONMENT, "agents.config", "agents.policies", "agents.optimum")
room("agents.evaluation", *PLAYING)
room("agents.training", *PLAYING, "unwrap.execution", "agents.evaluation")
room(
    "agents.study",
    *PLAYING,
    "unwrap.execution",
    "unwrap.storage",
    "agents.evaluation",
    "agents.training",
)
room("agents.report", *PLAYING, "unwrap.pictures", "agents.evaluation")
room("agents.report.recordings", *PLAYING, "agents.evaluation", "agents.report")
room(
    "agents.report.calibration",
    *SIGNAL,
    "unwrap.calibration",
    "shotenv.config",
    "agents.report",
)
room("agents.deploy", *SIGNAL, "agents.policies")
room("agents", "agents.policies", "agents.evaluation", "agents.training")
room(
    "agents.cli.command",
    "unwrap.support",
    "unwrap.execution",
    "unwrap.storage",
    "unwrap.depth",
    "shotenv.config",
    "shotenv.decision",
    "agents.config",
)
room("agents.cli.cameras", *ROOMS)
room("agents.cli", *ROOMS)

ONLY_IN = {
    "mitsuba": "shotenv/render/",
    "drjit": "shotenv/render/",
    "trimesh": ("shotenv/world/", "shotenv/scenes/", "unwrap/recordings/"),
    "stable_baselines3": "agents/",
    "sb3_contrib": "agents/training/",
    "lightning": "unwrap/training/",
    "numba": "unwrap/support/compiled.py",
    "ray": "unwrap/execution/",
    "plotly": "agents/report/",
    "pygame": "shotenv/env/",
    "mcap": "unwrap/ros/",
    "minari": "agents/evaluation/",
    "rerun": "agents/report/",
    "jinja2": ("agents/report/", "unwrap/comparison/"),
    "PIL": ("unwrap/pictures/", "unwrap/recordings/", "unwrap/comparison/", "shotenv/"),
    "onnx": ("unwrap/export/", "agents/deploy/"),
    "onnxruntime": ("unwrap/export/", "agents/deploy/"),
    "openvino": "unwrap/networks/",
    "fsspec": "unwrap/storage/",
    "backports": "shotenv/bank/files/",
    "h5py": ("unwrap/cameras/files/", "unwrap/cameras/writing/"),
}
SOURCES = sorted(
    path.relative_to(ROOT).as_posix()
    for house in ("unwrap", "shotenv", "agents")
    for path in (ROOT / house).rglob("*.py")
)
MODULES = {
    source.removesuffix(".py").replace("/", ".").removesuffix(".__init__") for source in SOURCES
}


def room_of(source: str) -> str:
    return source.rpartition("/")[0].replace("/", ".")


def imports_of(source: str):
    """(module, name) of every import of a file; the name is empty in `import module`."""
    for node in ast.walk(ast.parse((ROOT / source).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{source}: relative import"
            yield from ((node.module or "", alias.name) for alias in node.names)


@pytest.mark.parametrize("source", SOURCES)
def test_imports_stay_within_the_table_and_go_through_doors(source):
    own = room_of(source)
    for module, name in imports_of(source):
        package = module.partition(".")[0]
        if package in ("unwrap", "shotenv", "agents"):
            # `agents.cli.entry` is a file inside a room, `agents.cli` the door of one.
            inside = module in MODULES and module not in ROOMS
            target = module.rpartition(".")[0] if inside else module
            if target == own:
                continue
            assert target in ROOMS[own], f"{source} imports {module}, which {own} may not"
            assert not inside, f"{source} reaches behind the door of {target}: {module}.{name}"
        if package in ONLY_IN:
            assert source.startswith(ONLY_IN[package]), f"{source} imports {module}"


def files_imported(text: str) -> set[str]:
    """Files that a source imports as it is loaded: `from agents.cli import entry` may be one, too.

    Imports inside functions and for type checkers alone do not count.
    """
    return {
        module.replace(".", "/") + ".py"
        for node in ast.parse(text).body
        if isinstance(node, ast.ImportFrom) and node.module
        for module in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
    }


def in_cycles(graph: dict[str, set[str]]) -> list[str]:
    """Files that import themselves in the end."""
    found = []
    for source in graph:
        waiting, reached = list(graph[source]), set()
        while waiting:
            following = waiting.pop()
            if following in graph and following not in reached:
                reached.add(following)
                waiting += graph[following]
        if source in reached:
            found.append(source)
    return found


def test_no_module_imports_itself_round_corners():
    """Between files of a room; the table, in which rooms import those above, has no cycles."""
    texts = {source: (ROOT / source).read_text(encoding="utf-8") for source in SOURCES}
    assert in_cycles({source: files_imported(text) for source, text in texts.items()}) == []


def test_cycles_are_found_however_they_are_written():
    made = {
        "room/one.py": "from room import two",
        "room/two.py": "import os\nfrom room.three import thing",
        "room/three.py": "from room.one import other",
        "room/four.py": "from room.one import other\ndef f():\n    from room.four import f",
    }
    graph = {source: files_imported(text) for source, text in made.items()}
    assert in_cycles(graph) == ["room/one.py", "room/two.py", "room/three.py"]


def test_every_room_is_in_the_table_and_says_what_it_is_for():
    assert {room_of(source) for source in SOURCES} == set(ROOMS)
    for name in ROOMS:
        door = ROOT / name.replace(".", "/") / "__init__.py"
        words = ast.get_docstring(ast.parse(door.read_text(encoding="utf-8")))
        assert words and words.splitlines()[0].endswith("."), f"{name} does not say what it is for"
        # The peers are loaded by name from the registry's table: nobody else may use them.
        assert door.with_suffix(".pyi").is_file() or name == "unwrap.networks.peers"


def test_what_a_door_names_can_be_had_and_hides_no_file():
    """A name like a file's would be the file or the thing, by the order of imports."""
    for name in ROOMS:
        door = ROOT / name.replace(".", "/") / "__init__.pyi"
        if not door.is_file():
            continue
        package = __import__(name, fromlist=["*"])
        files = {path.stem for path in door.parent.iterdir()}
        for node in ast.parse(door.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom):
                for alias in node.names:
                    assert hasattr(package, alias.name), f"{name}.{alias.name}"
                    assert node.module is None or alias.name not in files, f"{name}.{alias.name}"


def test_no_name_stands_for_two_files():
    """But for what means the same in its room."""
    same = {
        "__init__",
        "__main__",
        "config",
        "frames",
        "description",
        "page",
        "bank",
        "sensor",
        "laser",
    }
    names = [Path(source).stem for source in SOURCES]
    assert sorted({name for name in names if names.count(name) > 1} - same) == []


def test_no_name_stands_for_two_files_of_tests():
    # Test files are modules without packages: pytest refuses to import a second of a name.
    names = [path.name for path in ROOT.glob("tests/**/*.py") if path.name != "conftest.py"]
    assert sorted({name for name in names if names.count(name) > 1}) == []


@pytest.mark.parametrize(
    ("package", "heavy"),
    [
        ("unwrap", ("torch", "numba", "lightning")),
        ("shotenv", ("torch", "numba", "mitsuba", "drjit", "stable_baselines3")),
        ("agents", ("torch", "mitsuba", "stable_baselines3", "plotly")),
        (
            "agents.cli.entry",
            ("torch", "numba", "mitsuba", "stable_baselines3", "plotly", "onnx", "trimesh"),
        ),
        ("shotenv.config.env", ("torch", "numba", "mitsuba")),
        ("shotenv.render.frame", ("torch", "mitsuba")),
    ],
)
def test_import_is_light(package, heavy):
    # In a process of its own: here everything has long been loaded.
    code = f"import sys, {package}; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_files_and_rooms_keep_to_one_subject():
    long = {s: n for s in SOURCES if (n := len((ROOT / s).read_text().splitlines())) > LONGEST_FILE}
    assert not long
    files = [room_of(source) for source in SOURCES if not source.endswith("__init__.py")]
    assert [name for name in ROOMS if files.count(name) > LARGEST_ROOM] == []
