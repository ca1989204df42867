"""Bad values of options: one sentence that names what is wrong, before any work is begun."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from agents.cli.entry import main

RENDER, STUDY = ("render",), ("study", "study.yaml")
PARALLEL = (RENDER, STUDY, ("train", "--seeds", "1"))
RECORD = ("record", "--camera", "mlx75027", "--out", "new")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder to stand in, with a file of words, one of bytes, and folders empty and not."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "words").write_text("hello")
    (tmp_path / "bytes").write_bytes(bytes(range(256)))
    (tmp_path / "broken.yaml").write_text("a: [1\n")
    (tmp_path / "study.yaml").write_text("policies: [random]\npresets: [default]\nseeds: [0]\n")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    (tmp_path / "empty").mkdir()
    return tmp_path


def unheard_of() -> str:
    """Where nobody listens."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{free.getsockname()[1]}"


def refused(capsys, words, says):
    status = main([str(word) for word in words])
    out, told = capsys.readouterr()
    assert status in (1, 2) and out == ""
    assert says in told and told.count("\n") == 1 and "Errno" not in told, told


@pytest.mark.parametrize("command", PARALLEL, ids=" ".join)
def test_workers_that_cannot_be_had(capsys, monkeypatch, command):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    says = "workers is 1000000000; expected at most"
    refused(capsys, (*command, "--workers", "1000000000"), says)
    address = unheard_of()
    monkeypatch.setenv("RAY_ADDRESS", address)
    says = f"RAY_ADDRESS is '{address}', where nobody answers"
    refused(capsys, (*command, "--executor", "ray"), says)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((*RENDER, "--workers", "0"), "workers: 0; expected above 0"),
        ((*RENDER, "--workers", "-1"), "workers: -1; expected above 0"),
        ((*RENDER, "--workers", "many"), "workers: 'many'; expected a whole number"),
        ((*RENDER, "--executor", "spark"), "executor: spark; expected one of 'local', 'ray'"),
        ((*RENDER, "--out", ""), "out is empty; expected a value"),
        ((*RENDER, "--out="), "out is empty; expected a value"),
        ((*RENDER, "--out", "s3://bucket/bank"), "out is s3:/bucket/bank, of a URL"),
        ((*RENDER, "--to", "folder"), "folder is no URL; expected one such as s3://"),
        ((*RENDER, "--to", "gopher://x"), "gopher://x is no place"),
        ((*RENDER, "--sensor", "nowhere"), "sensor: nowhere; expected a file of keys"),
        ((*STUDY, "--out", "gopher://x"), "gopher://x is no place"),
        (("study", "words"), "words: expected keys with values"),
        (("study", "bytes"), "bytes: 'utf-8' codec"),
        (("study", "broken.yaml"), "broken.yaml: while parsing"),
        (("study", "empty"), "empty: not a regular file"),
        (("study", "nowhere.yaml"), "nowhere.yaml: No such file"),
        (("bank", "verify", ""), "the first argument is empty"),
        (("bank", "publish", "pocket", "--to", "folder"), "folder is no URL"),
        (("evaluate", "empty", "--budget", "x"), "budget: x; expected float"),
        (("train", "--seeds", "-1"), "seeds: -1; expected at least 0"),
        ((*RECORD[:-1], "full"), "full is not an empty folder; nothing is written over"),
        ((*RECORD, "--drives", "1000000000000"), "drives is 1000000000000; expected at most"),
    ],
    ids=lambda value: " ".join(value)[-30:] if isinstance(value, tuple) else "",
)
def test_values_that_cannot_be_used(capsys, folder, words, says):
    before = sorted(folder.rglob("*"))
    refused(capsys, words, says)
    assert sorted(folder.rglob("*")) == before


def test_a_place_that_cannot_be_written_to_is_told_before_the_work(capsys, folder, tiny_bank):
    place = f"file://{folder}/words/place"
    refused(capsys, ("bank", "publish", tiny_bank, "--to", place), place)
    refused(capsys, (*RENDER, "--to", place), place)
    refused(capsys, (*STUDY, "--out", place), place)


def test_a_bank_is_not_published_into_itself(capsys, tiny_bank):
    for inside in (tiny_bank, f"{tiny_bank}/clips"):
        before = sorted(Path(tiny_bank).rglob("*"))
        says = f"file://{inside} lies in the bank"
        refused(capsys, ("bank", "publish", tiny_bank, "--to", f"file://{inside}"), says)
        assert sorted(Path(tiny_bank).rglob("*")) == before


def test_a_server_that_does_not_answer_is_no_place_without_a_bank(capsys):
    address = unheard_of()
    refused(
        capsys, ("bank", "verify", f"http://{address}/bank"), f"cannot read http://{address}/bank"
    )


def test_a_seed_that_no_training_takes_is_told_before_the_others_begin(
    capsys, tiny_bank, tiny_unwrapper, folder
):
    words = ("train", f"--env.bank={tiny_bank}", f"--env.unwrapper={tiny_unwrapper}")
    status = main([*words, "--seeds", "1", "99999999999999999999", "--out", "new"])
    told = capsys.readouterr().err.splitlines()[-1]
    assert status == 2 and "seed: Input should be less than or equal to" in told
    assert not (folder / "new").exists()
