"""Imports point one way, and heavy packages are imported only where they belong."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = {"unwrap": {"unwrap"}, "shotenv": {"unwrap", "shotenv"}}
ROOMS["agents"] = {"unwrap", "shotenv", "agents"}
ONLY_IN = {
    "mitsuba": "shotenv/render/",
    "drjit": "shotenv/render/",
    "trimesh": ("shotenv/world/", "agents/"),
    "stable_baselines3": "agents/",
    "lightning": "unwrap/",
    "numba": "unwrap/compiled.py",
    "plotly": "agents/",
    "PIL": ("shotenv/", "agents/"),
    "onnx": "agents/",
    "openvino": "unwrap/program.py",
    "onnxruntime": "agents/",
}


def modules_imported_by(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add(node.module or "")
    return names


SOURCES = sorted(
    path.relative_to(ROOT).as_posix() for room in ROOMS for path in (ROOT / room).rglob("*.py")
)


@pytest.mark.parametrize("source", SOURCES)
def test_imports_stay_within_the_table(source):
    room = source.split("/")[0]
    for module in modules_imported_by(ROOT / source):
        package = module.split(".")[0]
        if package in ROOMS:
            assert package in ROOMS[room], f"{source} imports {module}"
        if package in ONLY_IN:
            assert source.startswith(ONLY_IN[package]), f"{source} imports {module}"


def test_world_knows_no_renderer_and_no_sensor():
    for source in SOURCES:
        if source.startswith("shotenv/world/"):
            ours = {m for m in modules_imported_by(ROOT / source) if m.startswith("shotenv")}
            assert all(m.startswith(("shotenv.world", "shotenv.config.sections")) for m in ours), (
                source
            )


@pytest.mark.parametrize(
    ("package", "heavy"),
    [
        ("shotenv", ("torch", "numba", "mitsuba", "drjit", "stable_baselines3")),
        ("agents", ("torch", "mitsuba", "stable_baselines3", "plotly")),
        (
            "agents.cli.entry",
            ("torch", "numba", "mitsuba", "stable_baselines3", "plotly", "onnx", "trimesh"),
        ),
        ("shotenv.config.sections", ("torch", "numba", "mitsuba")),
    ],
)
def test_import_is_light(package, heavy):
    code = f"import sys, {package}; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_no_file_grows_beyond_one_subject():
    long = {s: n for s in SOURCES if (n := len((ROOT / s).read_text().splitlines())) > 450}
    assert not long
