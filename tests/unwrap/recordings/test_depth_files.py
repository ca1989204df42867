"""Points as PCD, and depth as messages of ROS 2, of walls at known distances."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
import trimesh
from mcap.reader import make_reader
from peer_scenes import samples
from rosbags.typesys import Stores, get_typestore

from agents.cli.entry import main
from unwrap.recordings.pcd import encode_pcd
from unwrap.signal.wiggle import WiggleTable, write_wiggle

HEIGHT, WIDTH, FOV_DEG = 6, 8, 90.0
FOCAL = WIDTH / 2
LEFT = (WIDTH - 1) / 2 - torch.arange(WIDTH)
UP = ((HEIGHT - 1) / 2 - torch.arange(HEIGHT)).unsqueeze(1)
SLANT = (1 + (LEFT / FOCAL) ** 2 + (UP / FOCAL) ** 2).sqrt()
AHEAD_M = torch.tensor([4.0, 9.5, 14.0])
"""Walls across the view, one a frame."""
AMPLITUDE = (100 + torch.arange(HEIGHT * WIDTH).view(HEIGHT, WIDTH)).float()


@pytest.fixture
def corrected(tmp_path):
    """Runs the command on a recording of three walls, with a saturated pixel in the first."""
    raw = samples(AHEAD_M.view(-1, 1, 1) * SLANT, AMPLITUDE, 8)
    saturated = torch.zeros(raw.saturated.shape, dtype=torch.bool)
    saturated[0, 2, 3] = True
    recording, table = tmp_path / "walls.npz", tmp_path / "flat.json"
    np.savez(recording, dcs=raw.dcs_lsb.numpy(), saturated=saturated.numpy())
    write_wiggle(table, {24e6: WiggleTable((0.0,) * 4), 10e6: WiggleTable((0.0,) * 4)})
    common = ("--fov-deg", FOV_DEG, "--wiggle", table, "--out", tmp_path / "out")

    def run(*words):
        return main([str(w) for w in ("unwrap", "correct", recording, *common, *words)])

    return run


def read_pcd(content):
    """Points of a binary PCD file, by what its header says."""
    header = {}
    while "DATA" not in header:
        line, _, content = content.partition(b"\n")
        if not line.startswith(b"#"):
            name, *values = line.decode("ascii").split()
            header[name] = values
    kinds = {"F": "f", "U": "u", "I": "i"}
    of_each = zip(header["FIELDS"], header["TYPE"], header["SIZE"], header["COUNT"], strict=True)
    dtype = np.dtype([(f, f"<{kinds[t]}{s}", (int(c),)) for f, t, s, c in of_each])
    assert header["VERSION"] == ["0.7"] and header["DATA"] == ["binary"]
    assert len(header["VIEWPOINT"]) == 7
    count = int(header["POINTS"][0])
    assert count == int(header["WIDTH"][0]) * int(header["HEIGHT"][0])
    assert len(content) == count * dtype.itemsize
    points = np.frombuffer(content, dtype)
    return {name: points[name][:, 0] for name in header["FIELDS"]}


def test_pcd_holds_the_points_of_the_ply_and_the_amplitude(corrected, tmp_path):
    assert corrected() == 0
    ply = trimesh.load(tmp_path / "out/00000/points.ply").vertices
    assert corrected("--points", "pcd", "--overwrite") == 0
    for number, ahead_m in enumerate(AHEAD_M):
        points = read_pcd((tmp_path / f"out/0000{number}/points.pcd").read_bytes())
        valid = np.load(tmp_path / f"out/0000{number}/valid.npy")
        assert valid.sum() == valid.size - (number == 0)
        np.testing.assert_allclose(points["x"], ahead_m, atol=1e-4)
        for name, way in (("y", LEFT), ("z", UP)):
            expected = (ahead_m * way / FOCAL).expand(HEIGHT, WIDTH).numpy()[valid]
            np.testing.assert_allclose(points[name], expected, atol=1e-4)
        np.testing.assert_allclose(points["intensity"], AMPLITUDE.numpy()[valid], rtol=1e-5)
        if number == 0:
            together = np.stack([points[name] for name in "xyz"], 1)
            np.testing.assert_allclose(together, ply, atol=1e-6)


def test_a_cloud_without_points_is_a_file_too():
    points = read_pcd(encode_pcd(np.empty((0, 4), np.float32)))
    assert [len(values) for values in points.values()] == [0] * 4


def test_the_log_holds_depth_along_the_axis_and_an_organised_cloud(corrected, tmp_path):
    path = tmp_path / "logs" / "walls.mcap"
    words = ("--mcap", path, "--frame-rate-hz", 4, "--json", tmp_path / "n.json")
    assert corrected(*words) == 0
    assert len(json.loads((tmp_path / "n.json").read_text())["frames"]) == 3
    ros = get_typestore(Stores.ROS2_HUMBLE)
    found = {"sensor_msgs/msg/Image": [], "sensor_msgs/msg/PointCloud2": []}
    with path.open("rb") as file:
        for schema, _, message in make_reader(file, validate_crcs=True).iter_messages():
            decoded = ros.deserialize_cdr(message.data, schema.name)
            found[schema.name].append((message.log_time, decoded))
    images, clouds = found.values()
    assert (
        [time for time, _ in images] == [time for time, _ in clouds] == [0, 25 * 10**7, 5 * 10**8]
    )
    for number, ((_, image), (_, cloud)) in enumerate(zip(images, clouds, strict=True)):
        valid = np.load(tmp_path / f"out/0000{number}/valid.npy")
        millimetres = image.data.view("<u2").reshape(HEIGHT, WIDTH)
        # A wall across the view has one depth, though its radial distances grow to the corners.
        expected = np.where(valid, round(1000 * float(AHEAD_M[number])), 0)
        np.testing.assert_allclose(millimetres.astype(int), expected, atol=1)
        assert ((millimetres == 0) == ~valid).all()
        points = cloud.data.view("<f4").reshape(HEIGHT, WIDTH, 4)
        assert (np.isnan(points).all(-1) == ~valid).all()
        assert cloud.is_dense == bool(valid.all())
        radial_m = np.load(tmp_path / f"out/0000{number}/depth_m.npy")
        norm_m = np.linalg.norm(points[..., :3], axis=-1)
        np.testing.assert_allclose(norm_m[valid], radial_m[valid], rtol=1e-6)
        np.testing.assert_allclose(points[..., 3][valid], AMPLITUDE.numpy()[valid], rtol=1e-5)


def test_a_log_that_stands_is_not_overwritten_unasked(corrected, tmp_path, capsys):
    path = tmp_path / "walls.mcap"
    path.write_bytes(b"mine")
    assert corrected("--mcap", path) == 1
    assert "walls.mcap stands already; --overwrite" in capsys.readouterr().err
    assert path.read_bytes() == b"mine" and not (tmp_path / "out").exists()
    assert corrected("--mcap", path, "--overwrite") == 0
    assert path.read_bytes().startswith(b"\x89MCAP0\r\n")


def test_a_frame_rate_that_cannot_be_is_refused_before_anything_is_written(
    corrected, tmp_path, capsys
):
    assert corrected("--mcap", tmp_path / "walls.mcap", "--frame-rate-hz", -1) == 1
    assert "frame_rate_hz is -1; expected a positive number" in capsys.readouterr().err
    assert not (tmp_path / "out").exists() and not (tmp_path / "walls.mcap").exists()
