"""No file that is read as a configuration gets a module imported, which would execute it."""

from __future__ import annotations

import sys

import pytest

from agents.cli.entry import main
from agents.config import DemoConfig, StudyPlan
from shotenv.config.bank import BankConfig
from shotenv.config.env import EnvConfig
from shotenv.config.reader import ConfigError, configs_dir, read_config

CASES = {
    "a section": (EnvConfig, "laser: {class_path: NAME.Class}"),
    "a section with its arguments": (EnvConfig, "laser: {class_path: NAME.Class, init_args: {}}"),
    "a section as a word": (EnvConfig, "laser: NAME.Class"),
    "the whole": (EnvConfig, "class_path: NAME.Class"),
    "a section within one": (DemoConfig, "env: {laser: {class_path: NAME.Class}}"),
    "a section that may be missing": (BankConfig, "own_scene: NAME.Class"),
    "of a study": (StudyPlan, "transfer: {class_path: NAME.Class}"),
    "in a package": (BankConfig, "world: shotenv.NAME.Class"),
}


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Name of a module that can be imported, and tells when it is."""
    (tmp_path / "canary_of_configs.py").write_text(
        "import pathlib\npathlib.Path(__file__).with_name('executed').touch()\nclass Class: pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    yield "canary_of_configs"
    sys.modules.pop("canary_of_configs", None)


@pytest.mark.parametrize("case", CASES)
def test_a_configuration_imports_nothing(tmp_path, module, case):
    model, text = CASES[case]
    path = tmp_path / "hostile.yaml"
    path.write_text(text.replace("NAME", module))
    with pytest.raises(ConfigError, match=r"hostile\.yaml: .*Class"):
        read_config(model, path)
    assert not (tmp_path / "executed").exists() and module not in sys.modules


def test_the_command_line_imports_nothing(tmp_path, module, capsys):
    path = tmp_path / "hostile.yaml"
    path.write_text(f"env: {{laser: {module}.Class}}")
    assert main(["demo", "--config", str(path)]) == 2
    assert "env.laser: " in capsys.readouterr().err
    assert not (tmp_path / "executed").exists()


def test_sections_are_still_taken_from_files(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(f"name: own\nsensor: {configs_dir() / 'sensor' / 'epc660.yaml'}\n")
    assert read_config(BankConfig, path).sensor.name == "epc660"
