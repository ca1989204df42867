"""A rendered bank is the same however it came about: killed and resumed, few workers or many."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import pytest

from shotenv.bank import build as build_module
from shotenv.bank.build import build_bank
from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.clip_rendering import render_clip
from shotenv.bank.files.layout import BankError
from shotenv.bank.files.store import read_manifest, verify
from shotenv.bank.opening import open_bank
from shotenv.config.bank import BankConfig
from shotenv.config.reader import find_config, merged, read_config
from shotenv.config.sensor import SensorConfig

pytestmark = pytest.mark.render
PROGRAM = """
import sys
from pathlib import Path
from shotenv.bank.build import build_bank
from shotenv.config import BankConfig
config = BankConfig.model_validate_json(sys.argv[1])
build_bank(config, Path(sys.argv[2]), workers=int(sys.argv[3]))
"""


@pytest.fixture(scope="module")
def config() -> BankConfig:
    """Ten clips of two frames: 32 x 24 pixels, one ray each per instant."""
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    small = BankConfig(name="small", sensor=sensor)
    return merged(
        small,
        {
            "camera": {"width": 32, "height": 24, "samples_per_pixel": 1, "gray_instants": 1},
            "world": {"frames_per_clip": 2, "families": ["garage", "sunny_road"]},
            **{"seed": 5, "train_clips": 3, "validation_clips": 1, "test_clips": 1},
        },
    )


@pytest.fixture(scope="module")
def uninterrupted(config, tmp_path_factory):
    """Folder of the bank, rendered at once by one worker."""
    return build_bank(config, tmp_path_factory.mktemp("whole") / "bank", workers=1)


def start(config: BankConfig, folder, workers: int = 1, **environment) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, config.model_dump_json(), str(folder), str(workers)],
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def standing(folder) -> int:
    return len(list(folder.glob("clips/*/clip.json")))


def kill_at_a_random_moment(process: subprocess.Popen, folder, moment: random.Random) -> None:
    """Kill -9 a little while after one more clip has come to stand, so that no run is in vain."""
    before = standing(folder)
    while standing(folder) == before and process.poll() is None:
        time.sleep(0.01)
    time.sleep(moment.uniform(0.0, 0.05))
    process.send_signal(signal.SIGKILL)
    process.communicate()


def test_a_rendering_killed_again_and_again_gives_the_same_bank(config, uninterrupted, tmp_path):
    """Twice; `python -m reliability kills` does it twenty times, at any moment."""
    folder, moment = tmp_path / "bank", random.Random(2)
    for _ in range(2):
        kill_at_a_random_moment(start(config, folder), folder, moment)
        assert standing(folder) < len(clip_jobs(config, folder)), "killed too late to prove it"
        with pytest.raises(BankError, match=r"holds no manifest\.json"):
            read_manifest(folder)
    kept = {path: path.stat().st_mtime_ns for path in folder.glob("clips/*/clip.json")}
    assert len(kept) >= 2
    build_bank(config, folder, workers=2)
    assert read_manifest(folder) == read_manifest(uninterrupted)
    assert verify(folder) == ()
    assert all(path.stat().st_mtime_ns == written for path, written in kept.items())
    assert {path.name for path in folder.rglob(".*")} == {".lock"}


@pytest.mark.slow
def test_workers_and_threads_change_no_bit(config, uninterrupted, tmp_path):
    process = start(config, tmp_path / "bank", workers=3, OMP_NUM_THREADS="2")
    assert process.wait(timeout=200) == 0, process.stderr.read()
    process.stderr.close()
    assert read_manifest(tmp_path / "bank") == read_manifest(uninterrupted)


@pytest.mark.slow
def test_a_script_without_a_main_guard_renders_once_and_ends(config, tmp_path):
    """Workers must not run the script that started them: it would wait for itself."""
    script = tmp_path / "script.py"
    script.write_text(PROGRAM)
    one = merged(
        config, {"train_clips": 0, "validation_clips": 0, "world": {"families": ["garage"]}}
    )
    words = [sys.executable, script, one.model_dump_json(), tmp_path / "bank", "1"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("Rendering bank") == 1
    assert standing(tmp_path / "bank") == 1


def test_a_deleted_clip_is_rendered_again(config, uninterrupted, tmp_path, monkeypatch):
    """And here in this very process, after whatever else the renderer has done in it."""
    folder = shutil.copytree(uninterrupted, tmp_path / "bank")
    shutil.rmtree(folder / "clips" / clip_jobs(config, folder)[4].name)
    monkeypatch.setattr(build_module, "render_clips", lambda jobs, *_: list(map(render_clip, jobs)))
    build_bank(config, folder)
    assert read_manifest(folder) == read_manifest(uninterrupted)
    assert verify(folder) == ()


def test_a_damaged_record_is_named_when_rendering_goes_on(config, uninterrupted, tmp_path):
    folder = shutil.copytree(uninterrupted, tmp_path / "bank")
    (folder / "manifest.json").unlink()
    record = folder / "clips" / clip_jobs(config, folder)[2].name / "clip.json"
    record.write_text(json.dumps({"name": "x"}))
    with pytest.raises(BankError, match=f"{record.parent.name}/clip.json is damaged"):
        build_bank(config, folder, workers=1)


def test_rendered_light_is_plausible(uninterrupted):
    bank = open_bank(uninterrupted)
    light = bank.exposure(bank.frames("all"))
    assert light.correlation.isfinite().all()
    assert (light.active >= 0).all() and (light.ambient >= 0).all()
    assert (light.distance_m > 0).all() and light.distance_m.isfinite().any()
