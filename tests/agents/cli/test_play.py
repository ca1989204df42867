"""`shotenv play`: keys to choices, a match without a window, and one in SDL's dummy window."""

from __future__ import annotations

import json

import pytest

from agents.cli.entry import main
from agents.cli.play_command import Controls, play_match, policy_of
from agents.evaluation.match import Match
from agents.policies.fixed import FixedPolicy
from shotenv.config.keywords import env_config
from shotenv.config.reader import ConfigError


class Keyboard:
    """A window that nobody sees, and the keys pressed while each picture was shown."""

    def __init__(self, *pressed):
        self.pictures, self.pressed = 0, list(pressed)

    def show(self, picture):
        self.pictures += 1

    def keys(self):
        return self.pressed.pop(0) if self.pressed else []


@pytest.fixture
def match(tiny_kwargs):
    return Match(env_config(**{**tiny_kwargs, "frames_per_drive": 5}), FixedPolicy(8), 0)


def test_keys_choose_pause_and_end():
    controls = Controls()
    controls.press(["2", "x", "[4]"])
    assert (controls.action, controls.fresh) == (1, True)
    controls.press(["space"])
    assert controls.paused
    controls.press(["space", "escape"])
    assert not controls.paused and controls.ended


def test_a_choice_holds_until_the_next(match):
    play_match(match, Keyboard(["2"], [], ["4"]), "always_8", waits=False)
    assert match.over and match.person.taken == (0, 2, 3, 0)


def test_a_frame_may_wait_for_its_key(match):
    keyboard = Keyboard([], ["2"], [], [], ["8"], ["q"])
    play_match(match, keyboard, "always_8", waits=True)
    assert match.person.taken == (0, 1, 0, 1) and keyboard.pictures == 6


def test_a_pause_stops_the_drive(match):
    play_match(match, Keyboard(["space"], [], ["space", "q"]), "always_8", waits=False)
    assert match.person.frames == 0


def test_a_rival_that_there_is_not_is_named(tmp_path):
    with pytest.raises(ConfigError, match="against is 'never_8'; expected random, always_2"):
        policy_of("against", "never_8")
    with pytest.raises(ValueError, match="holds no scheduler"):
        policy_of("against", str(tmp_path))


def test_a_drive_is_played_in_a_window(tiny_kwargs, tmp_path, capsys, monkeypatch):
    import pygame

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr("agents.cli.play_command.prepare_bank", lambda config: None)
    pygame.display.init()
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_2))
    words = ["--env.bank", tiny_kwargs["bank"], "--env.unwrapper", tiny_kwargs["unwrapper"]]
    words += ["--env.frames_per_drive", "4", "--pace", "1000", "--json", str(tmp_path / "n.json")]
    assert main(["play", "--against", "always_4", *words]) == 0
    numbers = json.loads((tmp_path / "n.json").read_text())
    assert numbers["you"]["frames_taken"] == {"0": 0, "2": 4, "4": 0, "8": 0}
    assert numbers["rival"]["frames_taken"]["4"] == 4
    assert "always_4: score" in capsys.readouterr().out
