"""Trainings with several seeds: each in its folder, as one alone would be; what is refused."""

from __future__ import annotations

import pytest

from agents.cli.entry import main
from agents.config.agent import AgentConfig
from agents.config.demo import DemoConfig
from agents.config.study_config import StudyConfig
from agents.study.seeds import train_seeds
from agents.training.scheduler import train_scheduler
from shotenv.config.keywords import env_config


@pytest.fixture
def config(tiny_kwargs) -> DemoConfig:
    """A regression of a second or two."""
    learner = {"rounds": 1, "drives": 2, "validation_drives": 2, "horizon": 1, "members": 1}
    return DemoConfig(
        env=env_config(**{**tiny_kwargs, "frames_per_drive": 8}),
        agent=AgentConfig(algorithm="regression", hidden=(4,), regression={**learner, "passes": 1}),
        study=StudyConfig(drives=2, tuning_drives=2),
    )


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["local", "ray"])
def test_each_seed_gives_what_it_gives_alone(config, executor, tmp_path, capfd):
    folders = train_seeds(config, [3, 5], tmp_path / "all", executor=executor, workers=2)
    assert [folder.name for folder in folders] == ["seed-3", "seed-5"]
    assert "return beyond" not in capfd.readouterr().err, "told in the log alone"
    assert "return beyond" in (tmp_path / "all" / "seed-5.log").read_text()
    agent = config.agent.model_copy(update={"seed": 5})
    train_scheduler(config.model_copy(update={"agent": agent}), tmp_path / "alone")
    weights = "policy.safetensors"
    alone = (tmp_path / "alone" / weights).read_bytes()
    assert (folders[1] / weights).read_bytes() == alone != (folders[0] / weights).read_bytes()


def test_a_seed_that_comes_twice_is_refused(config, tmp_path):
    with pytest.raises(ValueError, match="seeds are 1, 2, 1; expected each once"):
        train_seeds(config, [1, 2, 1], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_workers_without_seeds_are_refused(tmp_path, capsys):
    for words in (["--executor", "ray"], ["--workers", "2"]):
        assert main(["train", "--out", str(tmp_path / "out"), *words]) == 2
        assert "expected with --seeds alone" in capsys.readouterr().err
