"""Pages tell what is there: paths, names, commands and tests that they name exist."""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import re
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import gymnasium
import pytest

import shotenv  # noqa: F401 - registers the environments
from agents.cli import main

ROOT = Path(__file__).parents[2]
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in (
        *ROOT.glob("*.md"),
        *(ROOT / "docs").glob("*.md"),
        ROOT / "unwrap" / "weights" / "README.md",
    )
}
HISTORY = "CHANGELOG.md"
"""Names what was, too."""
TOP = {path.name for path in ROOT.iterdir() if not path.name.startswith(".")}
HOUSES = ("unwrap", "shotenv", "agents")
SCRIPTS = sorted(
    path.relative_to(ROOT).as_posix()
    for folder in ("docs", "examples", "benchmarks", "reliability")
    for path in (ROOT / folder).rglob("*.py")
)
PHYSICS = "docs/physics.md"
TEXT = PAGES[PHYSICS]
NAMED_TESTS = sorted(set(re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", TEXT)))
CLOSING = {"Formula and measurement", "What is left out"}
IMAGES = ROOT / "docs" / "images" / "physics"


@cache
def functions_of(path: str) -> set[str]:
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def headings() -> dict[str, str]:
    """Text of each section of the physics page by its heading."""
    _, *sections = re.split(r"^## ", TEXT, flags=re.MULTILINE)
    return {section.partition("\n")[0]: section for section in sections}


def links(page: str) -> set[str]:
    found = re.findall(r"\]\(([^)#\s]+)(?:#[\w-]+)?\)", PAGES[page])
    return {link for link in found if "://" not in link}


def spoken(page: str) -> list[str]:
    """What a page has in backticks within its sentences and tables."""
    # Blocks of code are read by `blocks`: they hold backticks, and words that are no names.
    prose = re.sub(r"^```.*?^```", "", PAGES[page], flags=re.MULTILINE | re.DOTALL)
    return [" ".join(words.split()) for words in re.findall(r"`([^`]+)`", prose)]


def blocks(page: str, language: str) -> list[str]:
    """Code of one language on a page."""
    return re.findall(rf"^```{language}\n(.*?)^```", PAGES[page], re.MULTILINE | re.DOTALL)


def found(dotted: str) -> bool:
    """Whether a dotted name is a module, or what modules and doors have."""
    module, _, names = dotted.partition(".")
    thing = importlib.import_module(module)
    for name in names.split(".") if names else ():
        # A room has what its door names, and its files, which are there only once imported.
        try:
            thing = getattr(thing, name)
        except AttributeError:
            try:
                thing = importlib.import_module(f"{thing.__name__}.{name}")
            except (AttributeError, ModuleNotFoundError):
                return False
    return True


def not_importable(source: str) -> list[str]:
    """What a source imports of this project and cannot have."""
    return [
        f"{node.module}.{alias.name}"
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in HOUSES
        for alias in node.names
        if not found(f"{node.module}.{alias.name}")
    ]


@cache
def commands() -> tuple[str, ...]:
    """Words of all commands, from what `shotenv --help` prints."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main(["--help"]) == 0
    return tuple(re.findall(r"^  (\w+(?: \w+)?)  ", printed.getvalue(), re.MULTILINE))


def is_command(words: str) -> bool:
    """Whether words after `shotenv` begin with a command, or are of the program itself."""
    own = words.split()
    alone = not own or own[0].startswith("-") or own[0] in ("COMMAND", "...")
    return alone or any(own[: len(c.split())] == c.split() for c in commands())


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_files(page):
    folder = (ROOT / page).parent
    assert [link for link in sorted(links(page)) if not (folder / link).exists()] == []


@pytest.mark.parametrize("page", sorted(set(PAGES) - {HISTORY}))
def test_named_paths_exist(page):
    paths = [words for words in spoken(page) if re.fullmatch(r"[\w.-]+(/[\w.-]*)+", words)]
    within = [path for path in paths if path.split("/")[0] in TOP]
    missing = [path for path in within if not (ROOT / path).exists()]
    assert [path for path in missing if path not in gymnasium.registry] == []


@pytest.mark.parametrize("page", sorted(set(PAGES) - {HISTORY}))
def test_named_modules_and_functions_exist(page):
    dotted = re.compile(rf"(?:{'|'.join(HOUSES)})(?:\.\w+)+")
    names = {words for words in spoken(page) if dotted.fullmatch(words)}
    assert [name for name in sorted(names) if not found(name)] == []
    assert [name for code in blocks(page, "python") for name in not_importable(code)] == []


@pytest.mark.parametrize("page", sorted(PAGES))
def test_named_commands_exist(page):
    said = [words[len("shotenv ") :] for words in spoken(page) if words.startswith("shotenv ")]
    typed = re.findall(r"(?:^|\s)shotenv (.+)$", "\n".join(blocks(page, "console")), re.MULTILINE)
    assert [words for words in (*said, *typed) if not is_command(words)] == []
    targets = re.findall(
        r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE
    )
    made = [words.split()[1] for words in spoken(page) if words.startswith("make ")]
    assert set(made) <= set(targets)


def test_the_script_for_a_gpu_runs_commands_that_exist():
    script = (ROOT / "tools" / "gpu.sh").read_text(encoding="utf-8")
    assert (
        "python3 -m agents.cli " in script and (ROOT / "agents" / "cli" / "__main__.py").is_file()
    )
    run = re.findall(r"^\s*run (.+)$", script, re.MULTILINE)
    assert len(run) == 3 and all(is_command(words) for words in run)
    assert "python3 -m benchmarks networks" in script
    assert (ROOT / "benchmarks" / "networks.py").is_file()


@pytest.mark.parametrize("script", SCRIPTS)
def test_scripts_find_what_they_import(script):
    assert not_importable((ROOT / script).read_text(encoding="utf-8")) == []


def map_of_the_house() -> dict[str, str]:
    """Rows of the README's table of where new things go, by what is new."""
    section = PAGES["README.md"].partition("### Where does it go?")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (.+?) \| (.+) \|$", section, re.MULTILINE)
    return {name: rest for name, rest in rows if name != "new"}


@pytest.mark.parametrize("new", map_of_the_house())
def test_the_map_names_files_that_have_what_it_says(new):
    """Each name of a row is defined in a file, or a folder's files, that the row names."""
    words = re.findall(r"`([^`]+)`", map_of_the_house()[new])
    places = [ROOT / word for word in words if "/" in word and (ROOT / word).exists()]
    files = [f for p in places for f in (p.rglob("*.py*") if p.is_dir() else [p])]
    said = "\n".join(file.read_text("utf-8") for file in files if file.suffix in (".py", ".pyi"))
    names = [word for word in words if re.fullmatch(r"\w+", word) and not (ROOT / word).exists()]
    assert places
    # `def name`, `class name`, `name = ...`, `name: Type = ...`, and the field `name: Type`.
    defined = r"^\s*(?:(?:def|class) {0}\b|{0}(?:: [^=\n]+)? = |{0}: )"
    assert [n for n in names if not re.search(defined.format(n), said, re.MULTILINE)] == []


def test_the_map_tells_where_new_things_go():
    told = " ".join(map_of_the_house())
    for new in (
        "feature",
        "merge rule",
        "policy",
        "command",
        "camera",
        "network",
        "sensor",
        "scenes",
    ):
        assert new in told


def test_every_room_has_its_place_in_the_picture_of_the_house():
    path = ROOT / "docs" / "house_figure.py"
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    figure = module_from_spec(spec)
    spec.loader.exec_module(figure)
    figure.check_places(figure.rooms_of_the_test(), figure.PLACES)
    with pytest.raises(ValueError, match=r"lacks \['unwrap\.attic'\]"):
        figure.check_places((*figure.PLACES, "unwrap.attic"), figure.PLACES)
    assert figure.purpose("shotenv.laser").startswith("The laser")
    assert figure.IMAGE.stat().st_size < 150_000


@pytest.mark.parametrize(("path", "name"), NAMED_TESTS)
def test_named_tests_exist(path, name):
    assert name in functions_of(path)


def test_every_figure_of_the_physics_is_shown():
    shown = {Path(link).name for link in links(PHYSICS) if link.startswith("images/physics/")}
    assert shown == {path.name for path in IMAGES.iterdir()}
    assert all(path.stat().st_size < 120_000 for path in IMAGES.iterdir())


def test_every_effect_has_a_figure_and_a_proof():
    effects = {k: v for k, v in headings().items() if k not in CLOSING}
    assert len(effects) >= 15
    for name, section in effects.items():
        assert "](images/physics/" in section, name
        assert "\nProof: `tests/" in section, name


def test_the_table_of_numbers_is_filled():
    rows = headings()["Formula and measurement"].count("\n| ")
    assert rows > 20
