"""A bank of one's own scene is rendered by the command, and plays like any other."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch
import yaml
from render_worlds import square
from scene_files import write_obj

from agents.cli import main
from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.clip_rendering import world_of
from shotenv.bank.files.folders import bank_folder, identity
from shotenv.bank.files.layout import BankError
from shotenv.bank.files.store import verify
from shotenv.bank.listing.contact_sheets import contact_sheet
from shotenv.bank.opening import open_bank
from shotenv.config.bank import BankConfig, WorldConfig
from shotenv.config.own_scene import MaterialsConfig, ScenePathConfig
from shotenv.scenes.bank_config import own_bank
from unwrap.support.section import Section

pytestmark = pytest.mark.render
ROOT = Path(__file__).parents[3]
WALL_M = 4.0
SMALL = ["--camera.width", "32", "--camera.height", "24", "--camera.samples_per_pixel", "1"]
CLIPS = [
    {"waypoints_m": [(0, 0, 0), (3, 0, 0)], "speed_m_s": [(0, 2.0), (0.4, 2.0)]},
    {"split": "test", "poses": [{"time_s": t, "position_m": (0, t, 0)} for t in (0, 0.3)]},
]
MOUNTS = [
    {"name": "front", "position_m": (0.5, 0, 1.0)},
    {"name": "left", "position_m": (0, 0.3, 1.0), "yaw_deg": 90.0},
]


def write_scene(folder: Path, wall_m: float = WALL_M) -> list[str]:
    """A wall ahead, a nearer one to the left, their files; the command's arguments."""
    ahead, left = ((wall_m, 0, 0), (0, 9, 0), (0, 0, 9)), ((0, 2, 0), (9, 0, 0), (0, 0, 9))
    corners = np.concatenate([square(*ahead), square(*left)])
    scene = write_obj(folder / "two walls.obj", corners, "chalk")
    (folder / "way.yaml").write_text(
        json.dumps({"clips": CLIPS, "lights": {"sky": {"zenith": 0.2, "horizon": 0.2}}})
    )
    (folder / "table.yaml").write_text("materials: {chalk: {albedo: 0.7}}")
    files = {"scene": scene, "path": folder / "way.yaml", "materials": folder / "table.yaml"}
    return [word for name, file in files.items() for word in (f"--{name}", str(file))]


@pytest.fixture(scope="module")
def bank(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own")
    words = [*write_scene(folder), *SMALL, "--world.mounts", json.dumps(MOUNTS)]
    assert main(["render", *words, "--out", str(folder / "bank"), "--workers", "1"]) == 0
    return open_bank(folder / "bank")


def test_each_way_is_a_clip_of_each_camera(bank):
    assert [(clip.name, clip.split, clip.frames) for clip in bank.clips] == [
        ("00000-own-front", "train", 4),
        ("00000-own-left", "train", 4),
        ("00001-own-front", "test", 3),
        ("00001-own-left", "test", 3),
    ]
    assert {clip.family for clip in bank.clips} == {"own"}
    assert bank.manifest.name == "two-walls" and not verify(bank.folder)


def test_cameras_see_the_walls_as_far_as_they_are(bank):
    front, left = (bank.distance_m(torch.arange(c.start, c.start + 4)) for c in bank.clips[:2])
    # 2 m/s at 10 Hz; the four pixels in the middle look ahead but for half a pixel.
    expected = WALL_M - 0.5 - 0.2 * np.arange(4)
    np.testing.assert_allclose(front[:, 12, 16], expected, rtol=1e-3)
    np.testing.assert_allclose(left[:, 12, 16], 2.0 - 0.3, rtol=1e-3)


def test_speeds_are_along_the_cameras_own_headings(bank):
    speed = [bank.ego_speed_m_s[clip.start] for clip in bank.clips]
    assert speed == pytest.approx([2.0, 0.0, 0.0, 1.0], abs=1e-6)


def test_the_bank_plays_like_any_other(bank, tiny_unwrapper):
    env = gymnasium.make(
        "shotenv/ShotSchedule-v0",
        bank=str(bank.folder),
        unwrapper=tiny_unwrapper,
        frames_per_drive=6,
    )
    env.reset(seed=0)
    told = [env.step(action)[-1] for action in (0, 1, 2, 2, 1, 0)]
    names = env.unwrapped.family_names
    assert {names[info["family"]] for info in told} == {"own"}
    assert all(np.isfinite(info["depth_mae_m"]) for info in told)
    env.close()


def test_it_has_a_contact_sheet_and_contents(bank, capsys):
    assert contact_sheet(bank, clips=2).size[0] > 100
    assert main(["bank", "info", str(bank.folder)]) == 0
    assert "two walls.obj at 10 Hz" in capsys.readouterr().out


def test_the_page_s_files_are_read_as_they_stand():
    page = (ROOT / "docs" / "scenes.md").read_text("utf-8")
    models = {"clips": ScenePathConfig, "world": World, "materials": MaterialsConfig}
    read = set()
    for text in re.findall(r"^```yaml\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        content = yaml.safe_load(text)
        (model,) = (model for key, model in models.items() if key in content)
        model.model_validate(content)
        read.add(model)
    assert read == set(models.values())


class World(Section):
    world: WorldConfig


def planned(folder: Path, sensor, wall_m: float = WALL_M) -> BankConfig:
    write_scene(folder, wall_m)
    files = [folder / name for name in ("two walls.obj", "way.yaml", "table.yaml")]
    return own_bank(BankConfig(name="base", sensor=sensor), *files)


def test_the_bank_s_identity_is_what_is_in_the_files_not_where_they_lie(sensor, tmp_path):
    folders = [tmp_path / name for name in ("here", "there", "far")]
    for folder in folders:
        folder.mkdir()
    here, there = planned(folders[0], sensor), planned(folders[1], sensor)
    far = planned(folders[2], sensor, WALL_M + 0.5)
    assert identity(here) == identity(there) and bank_folder(here) == bank_folder(there)
    assert bank_folder(far) != bank_folder(here)
    (folders[0] / "table.yaml").write_text("materials: {chalk: {albedo: 0.6}}")
    files = [folders[0] / name for name in ("two walls.obj", "way.yaml", "table.yaml")]
    assert identity(own_bank(BankConfig(name="base", sensor=sensor), *files)) != identity(here)


def test_a_scene_that_changed_since_it_was_planned_is_not_rendered(sensor, tmp_path):
    config = planned(tmp_path, sensor)
    job = clip_jobs(config, tmp_path / "bank")[0]
    assert len(world_of(job).static.corners) == 4
    write_scene(tmp_path, WALL_M + 0.5)
    with pytest.raises(BankError, match=r"two walls.obj has changed since the bank was begun"):
        world_of(job)


def test_a_scene_without_a_path_is_wrong_usage(tmp_path, capsys):
    assert main(["render", *write_scene(tmp_path)[:2]]) == 2
    assert "--scene, --path and --materials: expected the first two" in capsys.readouterr().err
    words = write_scene(tmp_path)[:4]
    assert main(["render", *words, "--out", str(tmp_path / "bank")]) == 1
    assert "'chalk' (the file tells no albedo" in capsys.readouterr().err
    assert not (tmp_path / "bank").exists()


def test_the_shipped_example_writes_scenes_that_can_be_rendered(sensor, tmp_path, capsys):
    runpy.run_path(str(ROOT / "examples" / "own_scene.py"))["main"](tmp_path)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2
    for line in lines:
        words = line.split()
        assert words[:2] == ["shotenv", "render"]
        named = dict(zip(words[2::2], words[3::2], strict=True))
        files = [Path(named[name]) for name in ("--scene", "--path", "--materials")]
        config = own_bank(BankConfig(name="base", sensor=sensor), *files)
        assert all(job.frames >= 8 for job in clip_jobs(config, tmp_path / "bank"))


def test_a_bank_s_own_configuration_reads_its_manifest_back(bank):
    assert bank.config.own_scene.materials["chalk"].albedo == 0.7
    assert bank.config == BankConfig.model_validate_json(bank.config.model_dump_json())
