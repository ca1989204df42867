"""Which clips a bank has, where it lies, and what is said before it is rendered."""

from __future__ import annotations

from collections import Counter
from contextlib import nullcontext
from threading import Event, Thread

import pytest

from shotenv.bank import build as build_module
from shotenv.bank.build import build_bank
from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.files import folders
from shotenv.bank.files.folders import alone_in, bank_folder as bank_folder_of
from shotenv.bank.files.layout import BankError
from shotenv.config.bank import BankConfig
from shotenv.config.families import FAMILIES, SHIFT_FAMILIES
from shotenv.config.reader import ConfigError, find_config, merged, read_config
from unwrap.execution import WorkerError

COUNTS = ("train_clips", "validation_clips", "test_clips", "shift_clips", "clutter_clips")


@pytest.fixture
def config():
    starter = read_config(BankConfig, find_config("bank", "starter"))
    return merged(starter, dict.fromkeys(COUNTS, 1))


def test_clip_jobs_cover_every_family_and_split_with_seeds_of_their_own(config, tmp_path):
    jobs = clip_jobs(config, tmp_path)
    assert len({job.seed for job in jobs}) == len(jobs) == 15 + 4 + 1
    assert {(job.split, job.family) for job in jobs} == {
        (split, family)
        for split in ("train", "validation", "test")
        for family in config.world.families
    } | {("shift", family) for family in SHIFT_FAMILIES} | {("train", "clutter")}


@pytest.mark.parametrize("added", [("clutter_clips",), ("clutter_clips", "shift_clips")])
def test_added_clips_leave_the_other_clips_as_they_were(config, tmp_path, added):
    without = clip_jobs(merged(config, dict.fromkeys(added, 0)), tmp_path)
    kept = clip_jobs(config, tmp_path)[: len(without)]
    assert [(j.name, j.seed) for j in kept] == [(j.name, j.seed) for j in without]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            dict.fromkeys(COUNTS, 0),
            "at least one clip",
        ),
        ({"clutter_clips": -1}, "clutter_clips"),
        ({"world": {"families": ["garage", "clutter"]}}, "clutter, which is for training only"),
        ({"shift_mean_speed_m_s": -0.1}, "shift_mean_speed_m_s"),
        ({"shift_mean_speed_m_s": 20.0}, r"shift_mean_speed_m_s is 20; .*speed_m_s, 15"),
        ({"shift_clips": -1}, "shift_clips"),
        ({"shift_clips": 1.5}, "shift_clips"),
        ({"world": {"families": ["garage", SHIFT_FAMILIES[0]]}}, f"{SHIFT_FAMILIES[0]}, which"),
        ({"name": "../elsewhere"}, "name"),
        ({"camera": {"width": 0}}, "camera.width"),
    ],
)
def test_impossible_banks_are_refused(config, change, message):
    with pytest.raises(ConfigError, match=message):
        merged(config, change)


def test_held_out_families_may_be_trained_on_where_none_is_held_out(config):
    families = (*FAMILIES, *SHIFT_FAMILIES)
    opened = merged(config, {"world": {"families": families}, "shift_clips": 0})
    assert opened.clips[0] == ("train", 1, families)


def test_nearfield_is_of_the_papers_size_and_splits_80_10_10():
    config = read_config(BankConfig, find_config("bank", "nearfield"))
    jobs = clip_jobs(config, find_config("bank", "nearfield"))
    frames = Counter(job.split for job in jobs)
    per_clip = config.world.frames_per_clip
    assert {split: count * per_clip for split, count in frames.items()} == {
        "train": 1600,
        "validation": 200,
        "test": 200,
        "shift": 48,
    }
    assert len(jobs) * per_clip == 2048
    assert (config.camera.width, config.camera.height) == (320, 240)
    assert len(set(Counter(j.family for j in jobs if j.split == "test").values())) == 1


def frames_of(name):
    """Configuration of a bank that comes along, and its frames by split and family."""
    config = read_config(BankConfig, find_config("bank", name))
    jobs = clip_jobs(config, find_config("bank", name))
    return config, {
        kind: clips * config.world.frames_per_clip
        for kind, clips in Counter((job.split, job.family) for job in jobs).items()
    }


def test_starter_has_1104_frames_and_no_clutter():
    _, frames = frames_of("starter")
    assert sum(frames.values()) == 1104
    assert {frames["shift", family] for family in SHIFT_FAMILIES} == {4 * 24}
    assert "clutter" not in {family for _, family in frames}


def test_a_fifth_of_the_frames_to_train_on_is_clutter():
    _, frames = frames_of("training")
    train = {family: count for (split, family), count in frames.items() if split == "train"}
    assert train["clutter"] / sum(train.values()) == pytest.approx(0.2, abs=0.01)
    assert [split for split, family in frames if family == "clutter"] == ["train"]


def test_shipped_banks_share_no_world():
    seeds = []
    for name in ("starter", "training", "nearfield"):
        bank = read_config(BankConfig, find_config("bank", name))
        seeds += [job.seed for job in clip_jobs(bank, find_config("bank", name))]
    assert len(set(seeds)) == len(seeds) >= 2000


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({"sensor": {"integration_s": (1e-4, 2e-4), "offset_std_lsb": 0.0}}, True),
        ({"sensor": {"gray_target": 0.5}}, False),
        ({"camera": {"bounces": 3}}, False),
        ({"seed": 1}, False),
    ],
)
def test_folder_changes_with_what_the_content_depends_on(config, change, same):
    moved = bank_folder_of(merged(config, change)) != bank_folder_of(config)
    assert moved is not same


def test_no_room_on_the_disk_is_said_before_rendering(config, tmp_path, monkeypatch):
    usage = type("Usage", (), {"free": 1000})
    monkeypatch.setattr(build_module.shutil, "disk_usage", lambda folder: usage)
    with pytest.raises(BankError, match="GB free"):
        build_bank(config, tmp_path / "bank")


def test_folder_of_another_configuration_is_left_alone(config, tmp_path, monkeypatch):
    monkeypatch.setattr(build_module, "render_clips", lambda *_: None)
    with pytest.raises(WorkerError, match="clips of this machine; expected a folder that all"):
        build_bank(config, tmp_path)
    other = merged(config, {"seed": 7})
    with pytest.raises(BankError, match="another configuration"):
        build_bank(other, tmp_path)


def test_unwritable_cache_folder_is_named(config, tmp_path):
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(BankError, match="SHOTENV_CACHE"):
        build_bank(config, blocker / "bank")


def test_what_goes_wrong_beside_the_workers_ends_them_at_once(config, tmp_path, monkeypatch):
    ended = []

    def tasks(function, given, **_):
        try:
            yield given[0], None
        finally:
            ended.append(True)

    class Broken(nullcontext):
        def update(self, _):
            raise BrokenPipeError

    monkeypatch.setattr(build_module, "run_tasks", tasks)
    monkeypatch.setattr(build_module, "progress", lambda *_: Broken(Broken()))
    with pytest.raises(BrokenPipeError) as kept:
        build_module.render_clips(clip_jobs(config, tmp_path), None, "ray")
    assert ended and kept.tb is not None


def test_who_waits_for_another_process_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(folders, "SILENT_S", 0.05)
    entered, told, said = Event(), Event(), []
    monkeypatch.setattr(folders, "say", lambda words: (said.append(words), told.set()))

    def wait_and_enter():
        with alone_in(tmp_path):
            entered.set()

    waiting = Thread(target=wait_and_enter)
    with alone_in(tmp_path):
        waiting.start()
        assert told.wait(60) and not entered.is_set()
    waiting.join(60)
    assert entered.is_set()
    assert said == [f"another process writes {tmp_path}; waiting for it"]
