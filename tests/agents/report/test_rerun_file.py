"""A drive goes into a recording and comes back as it was played."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from agents.cli.entry import main
from agents.evaluation.play import make_envs, play_drives
from agents.optimum.tabulation import drive_of
from agents.policies.fixed import FixedPolicy
from agents.report.rerun_file import write_recording
from agents.report.strip import taken_again
from shotenv.config.keywords import env_config
from shotenv.decision.problem import open_problem

rerun_chunk = pytest.importorskip("rerun.chunk")
FRAMES = 12
# A laser that takes what is asked for and trips after some frames of it.
HOT = {
    "thermal_resistance_k_per_w": 400.0,
    "thermal_time_constant_s": 1.0,
    "optical_power_w": [8.5, 8.5],
    "ambient_k": [310.15, 310.15],
}


COMPONENTS = ("Scalars:scalars", "TextLog:text", "Image:buffer", "DepthImage:buffer")


def read_back(path):
    """Of every path in the recording the values by frame."""
    found = {}
    for chunk in rerun_chunk.RrdReader(path).stream():
        table = chunk.to_record_batch()
        for name in set(COMPONENTS) & set(table.schema.names):
            frames, values = (table.column(one).to_pylist() for one in ("frame", name))
            # What clears a path has a row without a value.
            told = {frame: value for frame, value in zip(frames, values, strict=True) if value}
            found.setdefault(chunk.entity_path.lstrip("/"), {}).update(told)
    return found


@pytest.fixture(scope="module")
def played(tiny_bank, tiny_unwrapper):
    config = env_config(
        "default",
        bank=tiny_bank,
        unwrapper=tiny_unwrapper,
        frames_per_drive=FRAMES,
        laser=HOT,
        protect=False,
    )
    envs = make_envs(config, "train", 1, "Disabled")
    return open_problem(config), play_drives(FixedPolicy(8), envs, [3])


def test_a_recording_holds_every_frame_as_it_was_played(played, tmp_path):
    problem, drives = played
    frames, path = [], tmp_path / "new" / "drive.rrd"
    write_recording(path, problem, drives, "drive 3", tick=frames.append)
    assert sum(frames) == FRAMES and [one.name for one in path.parent.iterdir()] == ["drive.rrd"]
    found = read_back(path)
    shots = drives.shots[0]
    assert 0 in shots and 8 in shots
    assert [found["shots/taken"][frame] for frame in range(FRAMES)] == [[one] for one in shots]
    energy_j = [found["laser/energy_so_far_j"][frame][0] for frame in range(FRAMES)]
    np.testing.assert_allclose(energy_j, drives.laser_energy_j[0].cumsum())
    margin_k = [found["laser/margin_k"][frame][0] for frame in range(FRAMES)]
    np.testing.assert_allclose(
        margin_k, problem.config.laser.trip_k - drives.temperature_k[0], atol=1e-9
    )
    lit = np.flatnonzero(shots).tolist()
    assert sorted(found["error/depth_mae_m"]) == lit, "no error without laser"
    assert found["family"][0] == [drives.family[0, 0]]


def test_images_are_those_that_the_sensor_took(played, tmp_path):
    problem, drives = played
    write_recording(tmp_path / "drive.rrd", problem, drives, "drive 3")
    found = read_back(tmp_path / "drive.rrd")
    taken = taken_again(problem, drive_of(problem, 3), drives, 0, 0)
    shape = taken["truth_m"].shape
    (buffer,) = found["depth/corrected"][0]
    depth_m = np.frombuffer(bytes(buffer), np.float32).reshape(shape)
    expected = np.where(taken["valid"], taken["corrected_m"], 0.0).astype(np.float32)
    np.testing.assert_array_equal(depth_m, expected)
    assert sorted(found["gray"]) == list(range(FRAMES))
    assert sorted(found["depth/truth"]) == np.flatnonzero(drives.shots[0]).tolist()


def test_an_interrupted_recording_leaves_the_old_one(played, tmp_path):
    path = tmp_path / "drive.rrd"
    path.write_bytes(b"old")

    def stop(frames):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_recording(path, *played, "drive 3", tick=stop)
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


def test_the_command_records_a_drive(tiny_bank, tiny_unwrapper, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("agents.cli.collect_command.prepare_bank", lambda config: None)
    words = ["--env.bank", tiny_bank, "--env.unwrapper", tiny_unwrapper]
    words += ["--env.frames_per_drive", "4", "--seed", "5", "--json", tmp_path / "n.json"]
    path = tmp_path / "drive.rrd"
    assert main([str(word) for word in ("rerun", path, "--policy", "always_4", *words)]) == 0
    assert f"4 frames are in {path}" in capsys.readouterr().out
    assert [value for _, value in sorted(read_back(path)["shots/taken"].items())] == [[4]] * 4


def test_without_the_package_the_command_tells_how_to_get_it(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["rerun", str(tmp_path / "drive.rrd")]) == 1
    assert "pip install 'shotenv[rerun]'" in capsys.readouterr().err
