"""A bank that is rendered to a place is the one that is rendered into a folder, byte for byte."""

from __future__ import annotations

import subprocess
import sys
import uuid

import pytest
from folder_contents import contents_of
from watched_processes import wait_until

from shotenv.bank import build, published
from shotenv.bank.clip_jobs import ClipJob
from shotenv.bank.clip_rendering import render_missing
from shotenv.bank.opening import open_bank
from shotenv.bank.published import build_published, standing_clips, verify_published
from shotenv.config.bank import BankConfig
from shotenv.config.reader import find_config, merged, read_config
from shotenv.config.sensor import SensorConfig

pytestmark = pytest.mark.render

LOCK = (".lock",)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    """What one test has fetched stands for no other."""
    monkeypatch.setenv("SHOTENV_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="module", params=["float32", "float16"])
def config(request) -> BankConfig:
    """Three clips of two frames: 32 x 24 pixels, one ray each per instant."""
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    tiny = {
        "camera": {"width": 32, "height": 24, "samples_per_pixel": 1, "gray_instants": 1},
        "world": {"frames_per_clip": 2, "families": ["garage"]},
        **{"seed": 5, "train_clips": 1, "validation_clips": 1, "test_clips": 1},
    }
    return merged(BankConfig(name="small", sensor=sensor, storage=request.param), tiny)


@pytest.fixture(scope="module")
def in_a_folder(config, tmp_path_factory):
    """The bank, rendered in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "render_clips", lambda jobs, *_: list(map(render_missing, jobs)))
        return build.build_bank(config, tmp_path_factory.mktemp("folder") / "bank")


def test_rendered_to_a_place_it_is_the_same_bank(config, in_a_folder, monkeypatch):
    """In this process, clip by clip; what stands is left."""
    url, done = f"memory://{uuid.uuid4().hex}", []

    def here(jobs: list[ClipJob], *_) -> None:
        for job in jobs:
            render_missing(job)
            done.append(job.name)

    monkeypatch.setattr(published, "render_clips", lambda jobs, *_: here(jobs[:1]))
    with pytest.raises(ValueError, match="lacks 2 of 3 clips"):
        build_published(config, url)
    monkeypatch.setattr(published, "render_clips", here)
    build_published(config, url)
    build_published(config, url)
    assert sorted(done) == ["00000-garage", "00001-garage", "00002-garage"]
    assert contents_of(open_bank(url).folder, but=LOCK) == contents_of(in_a_folder, but=LOCK)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("config", ["float16"], indirect=True)
def test_rendering_to_a_place_that_is_killed_goes_on(config, tmp_path):
    """Whole program, killed after its first clip; two workers go on."""
    many = merged(config, {"train_clips": 6})
    whole = build.build_bank(many, tmp_path / "whole", workers=1)
    file, url = tmp_path / "bank.json", f"file://{tmp_path}/place"
    file.write_text(many.model_dump_json())
    words = [sys.executable, "-m", "agents.cli", "render", "--config", file, "--to", url]
    killed = subprocess.Popen([*words, "--workers", "1"], stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: standing_clips(url, many) or killed.poll() is not None, seconds=100)
    finally:
        killed.kill()
        killed.wait()
    stood = len(standing_clips(url, many))
    assert 1 <= stood < 8
    done = subprocess.run([*words, "--workers", "2"], capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    assert f"{8 - stood} of 8 clips" in done.stderr and url in done.stdout
    assert verify_published(url) == ()
    assert contents_of(open_bank(url).folder, but=LOCK) == contents_of(whole, but=LOCK)
