"""A place that cannot be written to is refused before a command works, in all that write."""

from __future__ import annotations

import warnings

import pytest
from jsonargparse import ArgumentParser

from agents.cli.command.outputs import FILES, FOLDERS
from agents.cli.entry import COMMANDS, main
from agents.policies.scheduler_files import UnboundSchedulerWarning


def arguments_that_write():
    for command in COMMANDS:
        parser = command.parser()
        for action in parser._actions:
            if action.dest in (*FILES, *FOLDERS):
                yield command, action.dest, action.metavar in ("DIR", "FOLDER")


FOUND = list(arguments_that_write())


def words_of(command, name, place):
    """The command with what it requires, and a place to write to."""
    parser: ArgumentParser = command.parser()
    words = command.words.split()
    for action in parser._actions:
        if action.dest == name or not getattr(action, "required", False):
            continue
        values = ["x"] * (action.nargs if isinstance(action.nargs, int) else 1)
        words += [*(action.option_strings[-1:]), *values] if action.option_strings else values
    if any(action.dest == name and not action.option_strings for action in parser._actions):
        return [*words, str(place)]
    return [*words, f"--{name}", str(place)]


def test_most_commands_write():
    assert len(FOUND) > 25
    assert {name for _, name, _ in FOUND} == {*FILES, *FOLDERS}


@pytest.mark.parametrize(
    ("command", "name", "is_folder"), FOUND, ids=lambda v: getattr(v, "words", str(v))
)
def test_a_place_that_cannot_be_written_to_is_refused_first(
    tmp_path, capsys, monkeypatch, command, name, is_folder
):
    def works(arguments):
        raise AssertionError("the command began to work")

    monkeypatch.setattr(
        "agents.cli.entry.COMMANDS", (type(command)(**vars(command) | {"action": works}),)
    )
    file, folder = tmp_path / "file", tmp_path / "folder"
    file.write_text("kept")
    folder.mkdir()
    wrong = file if is_folder else folder
    for place, says in (
        (wrong, f"expected a {'folder' if is_folder else 'file'}"),
        (file / "in" / "it", f"{file} is no folder"),
    ):
        status = main(words_of(command, name, place))
        told = capsys.readouterr().err
        assert status == 2 and f"{name} is {place}" in told and says in told
    assert file.read_text() == "kept" and sorted(tmp_path.iterdir()) == [file, folder]


def test_a_folder_without_permission_is_refused(tmp_path, capsys, monkeypatch):
    # As root every folder may be written to.
    monkeypatch.setattr("agents.cli.command.outputs.os.access", lambda place, mode: False)
    assert main(["doctor", "--json", str(tmp_path / "new" / "a.json")]) == 2
    told = capsys.readouterr().err
    assert f"json is {tmp_path}/new/a.json, but {tmp_path} may not be written to" in told
    assert list(tmp_path.iterdir()) == []


def test_a_warning_of_this_program_is_one_sentence(capsys, monkeypatch):
    def warns(arguments):
        for category in (UnboundSchedulerWarning, UserWarning):
            print(warnings.formatwarning("agent.json has no digest", category, "a.py", 7), end="")
        return 0

    before = warnings.formatwarning
    command = type(COMMANDS[0])(**vars(COMMANDS[0]) | {"action": warns})
    monkeypatch.setattr("agents.cli.entry.COMMANDS", (command,))
    assert main(command.words.split()) == 0
    own, other = capsys.readouterr().out.splitlines()
    assert own == "shotenv: warning: agent.json has no digest"
    assert other == "a.py:7: UserWarning: agent.json has no digest"
    assert warnings.formatwarning is before
