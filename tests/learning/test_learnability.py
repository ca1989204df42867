"""Plain learners learn the default problem; what was looked at helps them."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
import torch

SCRIPT = Path(__file__).parents[2] / "docs" / "learnability.py"


@pytest.fixture
def learnability(monkeypatch):
    spec = spec_from_file_location("learnability", SCRIPT)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield module
    torch.set_num_threads(threads)


@pytest.mark.slow
@pytest.mark.timeout(1500)
@pytest.mark.parametrize("algorithm", ["PPO", "DQN"])
def test_an_agent_with_library_defaults_beats_every_fixed_choice(learnability, algorithm):
    agent = learnability.train(algorithm, seed=0)
    drives = learnability.played({"agent": agent})
    over = learnability.compared(drives.pop("agent"), drives)
    assert over.keys() == {"always_2", "always_4", "always_8"}
    for fixed, difference in over.items():
        assert difference["low"] > 0.0, f"{fixed}: {difference}"


def test_an_agent_that_cannot_look_is_shown_the_rest(learnability):
    hidden = learnability.visible(looking=False) == 0.0
    assert hidden.sum() == len(learnability.LOOKED)
    assert (learnability.visible(looking=True) == 1.0).all()
    agent = learnability.train("PPO", seed=0, looking=False, steps=1)
    drives = learnability.played({"agent": agent}, drives=2)
    assert drives["agent"].reward.shape == drives["always_2"].reward.shape == (2, 256)
