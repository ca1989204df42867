"""Pictures of a drive: panels of its last frame, what it has cost, a window and a film."""

from __future__ import annotations

import sys
import types

import gymnasium
import numpy as np
import pytest

import shotenv
from shotenv.env.picture import (
    CAPTION_PX,
    GAP_PX,
    LANE_PX,
    PANEL_PX,
    PANELS,
    SHOTS_COLORS,
)

FRAMES = 5


def make(kwargs, **changes):
    short = {**kwargs, "frames_per_drive": FRAMES, "render_mode": "rgb_array"}
    return gymnasium.make(shotenv.ENV_ID, **{**short, **changes})


def panel(picture: np.ndarray, name: str) -> np.ndarray:
    """The panel `name` of a picture of the tiny bank, 32 x 24 pixels enlarged five times."""
    left = PANELS.index(name) * (PANEL_PX + GAP_PX)
    return picture[CAPTION_PX : CAPTION_PX + 120, left : left + PANEL_PX]


def lane(picture: np.ndarray, place: int) -> np.ndarray:
    """Inside of the lane at `place`, where the frames are."""
    top = 2 * CAPTION_PX + 120 + place * (LANE_PX + GAP_PX) + GAP_PX
    return picture[top + 1 : top + LANE_PX - 1, 111 : -GAP_PX - 1]


def test_panels_show_the_frame_that_was_taken(tiny_kwargs):
    env = make(tiny_kwargs)
    env.reset(seed=0)
    before = env.render()
    env.step(2)
    after = env.render()
    assert before.dtype == np.uint8 and before.shape == after.shape
    assert before.shape[1] == len(PANELS) * (PANEL_PX + GAP_PX) - GAP_PX
    # The gray image and the truth are of the same frame; without laser there is nothing else.
    for name in ("gray", "truth"):
        assert panel(before, name).any()
        assert np.array_equal(panel(before, name), panel(after, name))
    for name in ("wrapped", "corrected", "error"):
        assert not panel(before, name).any() and panel(after, name).any()


def test_the_time_line_tells_of_the_drive_so_far(tiny_kwargs):
    env = make(tiny_kwargs)
    env.reset(seed=0)
    for action in (0, 1, 2):
        env.step(action)
    shots, temperature, energy = (lane(env.render(), place) for place in range(3))
    width = shots.shape[1] // FRAMES
    for frame, taken in enumerate((2, 4, 8)):
        column = shots[:, frame * width + width // 2]
        filled = np.all(column == SHOTS_COLORS[taken], axis=1).mean()
        assert filled == pytest.approx(taken / 8, abs=0.06)
    # Bright lines up to the last frame, faint ones as far as the drive goes.
    warm, spent = (drawn.max(axis=(0, 2)) > 150 for drawn in (temperature, energy))
    assert warm[: 3 * width - 4].all() and spent[2 * width : 3 * width - 4].all()
    assert not warm[3 * width + 4 :].any() and not spent[3 * width + 4 :].any()
    env.reset()
    assert not lane(env.render(), 0).any()


def test_a_vector_shows_what_single_environments_show(tiny_kwargs):
    env = make(tiny_kwargs)
    envs = gymnasium.make_vec(
        shotenv.ENV_ID, 2, **tiny_kwargs | {"frames_per_drive": FRAMES}, render_mode="rgb_array"
    )
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.render()
    env.reset(seed=0)
    envs.reset(seed=0)
    for action in (2, 0):
        env.step(action)
        envs.step(np.array([action, 1]))
    pictures = envs.render()
    assert len(pictures) == 2 and np.array_equal(pictures[0], env.render())


def test_a_window_shows_the_same_picture(tiny_kwargs, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    human, plain = make(tiny_kwargs, render_mode="human"), make(tiny_kwargs)
    for env in (human, plain):
        env.reset(seed=0)
        env.step(2)
    assert human.render() is None
    assert np.array_equal(human.unwrapped._window.pixels(), plain.render())
    human.close()
    human.close()


def test_without_pygame_the_window_says_what_to_install(tiny_kwargs, monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = make(tiny_kwargs, render_mode="human")
    with pytest.raises(ImportError, match=r"pip install 'shotenv\[play\]'"):
        env.reset(seed=0)


def test_a_film_is_recorded(tiny_kwargs, tmp_path, monkeypatch):
    """With a stand-in for moviepy, which allows no Pillow of today: the frames that it is given."""
    films = []

    class Clip:
        def __init__(self, frames, fps):
            films.append((frames, fps))

        def write_videofile(self, path, **options):
            assert path.endswith(".mp4")

    module = types.SimpleNamespace(ImageSequenceClip=Clip)
    for name in ("moviepy", "moviepy.video", "moviepy.video.io"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, "moviepy.video.io.ImageSequenceClip", module)
    env = gymnasium.wrappers.RecordVideo(
        make(tiny_kwargs), str(tmp_path / "films"), episode_trigger=lambda episode: True
    )
    env.reset(seed=0)
    for _ in range(FRAMES):
        env.step(1)
    env.close()
    ((frames, fps),) = films
    assert len(frames) == FRAMES + 1 and fps == 10
    # Codecs want even sizes.
    assert all(frame.dtype == np.uint8 for frame in frames)
    assert {tuple(size % 2 for size in frame.shape[:2]) for frame in frames} == {(0, 0)}
    assert not np.array_equal(frames[0], frames[-1])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"render_mode": "rgb_array"}, "render_mode='rgb_array' needs neighbours"),
        ({"render_mode": None, "observation": "image"}, 'observation="image" needs neighbours'),
    ],
)
def test_a_thinned_bank_is_refused(changes, words):
    thinned = {"bank": "pocket", "frames_per_drive": 8}
    with pytest.raises(ValueError, match=words + ": choose a rendered bank"):
        make(thinned, **changes)
    with pytest.raises(ValueError, match=words):
        gymnasium.make_vec(shotenv.ENV_ID, 2, **thinned, **changes)
    make(thinned, render_mode=None).reset(seed=0)
