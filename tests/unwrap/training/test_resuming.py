"""A training's checkpoint that is damaged, foreign or hostile: refused by name, never executed."""

from __future__ import annotations

import os
import pickle
import shutil
import zipfile

import pytest
import torch
from unwrap_source import Walls

from unwrap.training.config import TrainConfig
from unwrap.training.loop import train
from unwrap.training.module import TrainingModule

SMALL = TrainConfig(width=4, epochs=2, batch_size=2)
NAME = "tofregnet.ckpt"


def walls(split):
    return Walls(2, seed=len(split))


class InterruptedHereError(Exception):
    pass


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Folder of a training that has done one of two epochs, each of one step."""
    folder, step = tmp_path_factory.mktemp("trained"), TrainingModule.training_step

    def failing(self, batch, index):
        if self.global_step == 1:
            raise InterruptedHereError
        return step(self, batch, index)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TrainingModule, "training_step", failing)
        with pytest.raises(InterruptedHereError):
            train(SMALL, walls, folder, progress=False)
    return folder


def changed(path, change):
    content = torch.load(path, weights_only=True)
    change(content)
    torch.save(content, path)


def flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def swell(path):
    with path.open("r+b") as file:
        file.truncate(3 << 30)


def pack(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("tofregnet/data.pkl", bytes(1 << 20))


def pipe(path):
    path.unlink()
    os.mkfifo(path)


def link(path):
    path.unlink()
    path.symlink_to("nowhere")


class Canary:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def execute(path):
    """By torch's archive."""
    torch.save({"train_config": Canary(path.parent / "canary")}, path)


def execute_plainly(path):
    path.write_bytes(pickle.dumps(Canary(path.parent / "canary")))


def weights_of_another_size(content):
    content["state_dict"]["network.stem.0.weight"] = torch.zeros(1)


def weights_without_end(content):
    content["state_dict"]["network.stem.0.weight"][0] = torch.inf


def moments_of_another_size(content):
    content["optimizer_states"][0]["state"][0]["exp_avg"] = torch.zeros(1)


def no_loops(content):
    del content["loops"]


def another_epoch(content):
    content["epoch"] = "x"


def later_epoch(content):
    content["loops"]["fit_loop"]["epoch_progress"]["current"]["processed"] = 9
    content["loops"]["fit_loop"]["epoch_progress"]["current"]["completed"] = 9


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda path: path.write_bytes(b""), "not a zip file"),
        (lambda path: path.write_bytes(path.read_bytes()[:5000]), "not a zip file"),
        (flip, "does not match its checksum"),
        (swell, "bytes; expected at most"),
        (pack, "compressed"),
        (pipe, "not a regular file"),
        (link, "no such file"),
        (execute, "not as a training writes it"),
        (execute_plainly, "not a zip file"),
        (lambda path: torch.save([1, 2], path), "not a table"),
        (lambda path: torch.save({"state_dict": {}}, path), "train_config is missing"),
        (lambda path: changed(path, weights_of_another_size), "its state_dict do not fit"),
        (lambda path: changed(path, weights_without_end), "its state_dict do not fit"),
        (lambda path: changed(path, moments_of_another_size), "its optimizer_states do not fit"),
        (lambda path: changed(path, no_loops), "its loops do not fit"),
        (lambda path: changed(path, another_epoch), "its epoch do not fit"),
        (lambda path: changed(path, later_epoch), "not as a training writes it"),
    ],
)
def test_a_wrong_checkpoint_is_refused_by_name(trained, tmp_path, damage, says):
    path = tmp_path / NAME
    shutil.copy(trained / NAME, path)
    damage(path)
    with pytest.raises(ValueError, match=says) as caught:
        train(SMALL, walls, tmp_path, progress=False)
    assert str(path) in str(caught.value) and "resume=False" in str(caught.value)
    assert not (tmp_path / "canary").exists() and not (tmp_path / "tofregnet.safetensors").exists()


def test_files_that_a_checkpoint_names_are_left_alone(trained, tmp_path):
    path, other = tmp_path / "run" / NAME, tmp_path / "precious"
    path.parent.mkdir()
    other.write_text("of another")
    shutil.copy(trained / NAME, path)

    def elsewhere(content):
        for state in content["callbacks"].values():
            state.update(
                dirpath=str(path.parent), best_model_path=str(path.parent / ".." / other.name)
            )

    changed(path, elsewhere)
    # The checkpoint of the second epoch takes the place of the first's.
    train(SMALL, walls, path.parent, progress=False)
    assert other.exists()
