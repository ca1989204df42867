"""The page of policies shows each family, with code that runs, and what was measured."""

from __future__ import annotations

import json
import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from agents.policies.policy import Policy
from agents.policies.practice import FAMILIES_OF_PRACTICE
from shotenv.config.env import EnvConfig
from shotenv.config.keywords import env_config
from shotenv.decision.features import FEATURE_NAMES

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "policies.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^### ([a-z_, ]+)\n(.*?)(?=^##)", PAGE, re.MULTILINE | re.DOTALL))
SHOWN = [name for heading in SECTIONS for name in heading.split(", ")]


@pytest.fixture(scope="module")
def script():
    """The script docs/policies_table.py."""
    path = DOCS / "policies_table.py"
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_family_has_its_section():
    assert sorted(SHOWN) == sorted(family.name for family in FAMILIES_OF_PRACTICE)


def test_the_code_on_the_page_runs(capsys):
    page = PAGE.replace('env_config("default")', 'env_config("default", frames_per_drive=3)')
    assert page != PAGE
    names: dict[str, object] = {"print": lambda *told: print(*told, sep="|")}
    batch = np.zeros((2, len(FEATURE_NAMES)), np.float32)
    policies = 0
    for code in re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        exec(code, names)
        policy = names.pop("policy", None)
        if isinstance(policy, Policy):
            policies += 1
            assert policy.act(batch[0]) in (0, 1, 2) and policy.act(batch).shape == (2,)
    rows = capsys.readouterr().out.splitlines()
    assert policies == len(SECTIONS) + 1, "each section, and the policy of one's own"
    assert len(rows) == 5 and rows[0].startswith("fixed at 0.04: always ")


def test_the_page_says_what_was_measured(script):
    found = json.loads(script.KEPT.read_text(encoding="utf-8"))
    assert script.filled(PAGE, found) == PAGE
    families = {*SHOWN, "clairvoyant greedy", "clairvoyant optimum"}
    assert {one["family"] for one in found["rows"]} == families
    # What was measured with other families, or another default, must be measured again.
    assert EnvConfig(**found["env"]) == env_config("default")


def test_what_is_measured_becomes_tables_beside_the_file(script, tmp_path, monkeypatch):
    two = [family for family in FAMILIES_OF_PRACTICE if family.name in ("fixed", "cycle")]
    monkeypatch.setattr(script, "FAMILIES_OF_PRACTICE", two)
    short = env_config("default", frames_per_drive=3)
    monkeypatch.setattr(script, "env_config", lambda name: short)
    file = tmp_path / "some.json"
    script.main(
        ["--drives", "3", "--tuning-drives", "2", "--prices", "0.09", "5", "--json", str(file)]
    )
    rows = json.loads(file.read_text())["rows"]
    assert len(rows) == 2 * 4
    dear = {one["family"]: one for one in rows if one["price"] == 5.0}
    assert dear["fixed"]["policy"] == "always 2 DCS"
    assert dear["fixed"]["laser_energy_share"]["mean"] == pytest.approx(0.25)
    for price in (0.09, 5.0):
        returns = {o["family"]: o["return"]["mean"] for o in rows if o["price"] == price}
        assert returns["clairvoyant optimum"] >= max(returns.values()) - 1e-3
    first, *_ = re.findall(r"^\| `(.+?)` \| (-?\d+) ", file.with_suffix(".md").read_text(), re.M)
    cheap = [one for one in rows if one["price"] == 0.09]
    assert int(first[1]) == round(max(one["return"]["mean"] for one in cheap))


def test_a_page_without_a_place_for_the_tables_is_named(script):
    with pytest.raises(ValueError, match="has 0 places for the table"):
        script.filled("# Policies\n", {"rows": []} | json.loads(script.KEPT.read_text()))
