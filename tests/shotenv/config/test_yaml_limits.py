"""YAML that grows without measure is refused at once, wherever it is read; what ships is read."""

from __future__ import annotations

import subprocess
import sys

import pytest
import yaml

from shotenv.config.bank import BankConfig
from shotenv.config.keywords import env_config
from shotenv.config.reader import ConfigError, configs_dir, find_config, read_config
from shotenv.config.yaml_limits import (
    DEEPEST,
    LONGEST_TEXT,
    MOST_VALUES,
    YamlTooLarge,
    check_limits,
)

BOMB = "\n".join(
    ["a: &a [x, x, x, x, x, x, x, x, x]"]
    + [
        f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]"
        for before, name in zip("abcdefgh", "bcdefghi", strict=True)
    ]
)
"""Nine levels of nine: 387 million values in 400 characters."""

SENSOR = find_config("sensor", "epc660").resolve()
BEGUN = f"name: small\nsensor: {SENSOR}\n"


def indented(text: str) -> str:
    return "".join(f"      {line}\n" for line in text.splitlines())


HOSTILE = {
    "aliases of aliases": (BOMB, "more than 10000 values"),
    "aliases in a value": (f"{BEGUN}seed: 3\nworld:\n{indented(BOMB)}", "more than 10000 values"),
    # Where a number is expected, a quoted text is parsed once more.
    "aliases in a quoted text": (
        f"{BEGUN}world:\n  speed_m_s:\n    - |\n{indented(BOMB)}    - 1.0\n",
        "more than 10000 values",
    ),
    "an alias within itself": (f"{BEGUN}world: &w {{families: *w}}", "part of what it stands for"),
    "an alias to nothing": (f"{BEGUN}world: *w", "undefined alias"),
    "many levels": (f"{BEGUN}seed: {'[' * 100_000}", "more than 32 levels"),
    "a long text": (f"{BEGUN}# {'x' * 3_000_000}", "1048576"),
}


@pytest.mark.timeout(20)
@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_yaml_is_refused_at_once_with_the_file_named(tmp_path, kind):
    text, words = HOSTILE[kind]
    path = tmp_path / "hostile.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=words) as refused:
        read_config(BankConfig, path)
    assert "hostile.yaml" in str(refused.value)
    assert len(str(refused.value)) < 1000


@pytest.mark.timeout(20)
def test_sections_in_files_of_their_own_are_refused_as_well(tmp_path):
    path = tmp_path / "imager.yaml"
    path.write_text(BOMB)
    with pytest.raises(ConfigError, match=r"imager\.yaml.*more than 10000 values"):
        env_config(sensor=str(path))
    (tmp_path / "bank.yaml").write_text("name: small\nsensor: imager.yaml\n")
    with pytest.raises(ConfigError, match=r"bank\.yaml.*imager\.yaml.*more than 10000 values"):
        read_config(BankConfig, tmp_path / "bank.yaml")


@pytest.mark.parametrize("command", ["render", "demo"])
def test_the_command_line_refuses_a_hostile_file_at_once(tmp_path, command):
    path = tmp_path / "hostile.yaml"
    path.write_text(BOMB)
    run = "import sys; from agents.cli.entry import main; sys.exit(main())"
    words = [sys.executable, "-c", run, command, "--config", path]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.startswith("shotenv: ") and done.stderr.count("\n") == 1
    assert "hostile.yaml" in done.stderr and "more than 10000 values" in done.stderr


@pytest.mark.parametrize("path", sorted(configs_dir().rglob("*.yaml")), ids=lambda path: path.stem)
def test_what_ships_is_far_within_the_limits(path):
    text = path.read_text()
    check_limits(text)
    assert len(text) < LONGEST_TEXT / 20


def test_a_few_aliases_are_welcome(tmp_path):
    path = tmp_path / "bank.yaml"
    path.write_text(f"{BEGUN}train_clips: &few 2\nvalidation_clips: *few\ntest_clips: *few\n")
    config = read_config(BankConfig, path)
    assert (config.train_clips, config.validation_clips, config.test_clips) == (2, 2, 2)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("[1, 2, {a: 3}]", 6),
        ("[&one [1, 2], *one, *one]", 1 + 3 * 3),
        ("[&two [&one [1, 2], *one], *two]", 1 + 2 * (1 + 2 * 3)),
    ],
)
def test_values_are_counted_as_the_loader_would_make_them(monkeypatch, text, values):
    def made(value) -> int:
        if isinstance(value, dict):
            return 1 + sum(map(made, value)) + sum(map(made, value.values()))
        return 1 + sum(map(made, value)) if isinstance(value, list) else 1

    assert made(yaml.safe_load(text)) == values
    monkeypatch.setattr("shotenv.config.yaml_limits.MOST_VALUES", values)
    check_limits(text)
    monkeypatch.setattr("shotenv.config.yaml_limits.MOST_VALUES", values - 1)
    with pytest.raises(YamlTooLarge):
        check_limits(text)


def test_each_limit_is_where_it_is_said_to_be():
    check_limits("[" * DEEPEST + "]" * DEEPEST)
    with pytest.raises(YamlTooLarge, match="levels"):
        check_limits("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1))
    check_limits("x" * LONGEST_TEXT)
    with pytest.raises(YamlTooLarge, match="characters"):
        check_limits("x" * (LONGEST_TEXT + 1))
    check_limits("- 1\n" * (MOST_VALUES - 1))
    with pytest.raises(YamlTooLarge, match="values"):
        check_limits("- 1\n" * MOST_VALUES)
