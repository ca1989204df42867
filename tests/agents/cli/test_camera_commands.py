"""`shotenv camera describe` and `unwrap correct --camera`, on files as cameras write them."""

import json
import math

import numpy as np
import pytest
import torch
import trimesh
from camera_files import (
    planes,
    small_camera,
    whole,
    write_espros,
    write_kinect,
    write_raw12,
    write_wire,
)

from agents.cli.entry import main
from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.tofregnet import TofRegNet
from unwrap.networks.weight_files import save_weights
from unwrap.signal.frequencies import unambiguous_range_m

HEIGHT, WIDTH = 12, 16
SLOPE_M = 0.002 * np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH)
GRAY = np.random.default_rng(3).integers(0, 4096, (HEIGHT, WIDTH))


@pytest.fixture
def shotenv_run(capsys):
    def run(*words, status=0):
        found = main([str(word) for word in words])
        out, err = capsys.readouterr()
        assert found == status, err
        return (out, err) if status == 0 else err.splitlines()[-1]

    return run


@pytest.fixture
def correct(shotenv_run, tmp_path):
    def run(*words, status=0):
        out = ("--out", tmp_path / "out")
        return shotenv_run("unwrap", "correct", *words, *out, status=status)

    return run


def array_of(tmp_path, distances_m, hz=(60e6,), name="mlx75027", **noise):
    path = tmp_path / "a.npy"
    stored = whole(planes(name, distances_m, hz, **noise))
    np.save(path, stored.reshape(len(stored), -1, *stored.shape[-2:]).astype(np.int16))
    return path


def depth_of(folder, name="depth_m.npy"):
    return np.load(folder / name)


def off(found_m, true_m, range_m):
    """Differences of distances modulo a range."""
    return np.abs((found_m - true_m + range_m / 2) % range_m - range_m / 2)


def written(tmp_path, name, *, still=False):
    """A recording of two frames of a camera, its description and the distances in it."""
    walls = [2.0 + SLOPE_M, (2.0 if still else 2.7) + SLOPE_M]
    path, small = tmp_path / "recording", {"height": HEIGHT, "width": WIDTH}
    if name == "epc660_hdf5":
        write_espros(path, whole(planes("epc660", walls, [24e6]))[:, 0])
        return path, name, walls
    if name == "epc660_wire":
        gray = np.stack((GRAY, GRAY))
        write_wire(path, whole(planes("epc660", walls, [24e6]))[:, 0], gray=gray)
        return path, name, walls
    if name in ("mlx75027", "mlx75027_reversed"):
        return array_of(tmp_path, walls, name=name), name, walls
    if name == "phasor_video":
        stored = planes(name, walls, [30e6], amplitude=1.5)[:, 0]
        np.save(tmp_path / "a.npy", np.moveaxis(stored, 1, -1))
        return tmp_path / "a.npy", name, walls
    if name in ("imx556", "arducam_b0548"):
        hz = {"imx556": [100e6, 20e6], "arducam_b0548": [90e6, 15e6]}[name]
        layout = {**small, "row_bytes": WIDTH * 3 // 2, "trailer_rows": 0, "trailer_bytes": 7}
        write_raw12(path, whole(planes(name, walls, hz)), trailer=bytes(7))
        return path, small_camera(tmp_path, name, layout=layout), walls
    stored = whole(planes("kinect_v2", walls, [80e6, 16e6, 120e6]))
    content = stored.reshape(2, 9, HEIGHT, WIDTH).transpose(0, 2, 3, 1)
    content.astype("<i4").tofile(path)
    lens = {"center_px": [7.5, 5.5], "radial": [0, 0, 0]}
    return path, small_camera(tmp_path, "kinect_v2_dump", layout=small, lens=lens), walls


@pytest.mark.parametrize(
    ("name", "range_m"),
    [
        ("epc660_hdf5", unambiguous_range_m(24e6)),
        ("epc660_wire", unambiguous_range_m(24e6)),
        ("mlx75027", unambiguous_range_m(60e6)),
        ("mlx75027_reversed", unambiguous_range_m(60e6)),
        ("phasor_video", unambiguous_range_m(30e6)),
        ("imx556", 1e3),
        ("arducam_b0548", 1e3),
        ("kinect_v2_dump", 1e3),
    ],
)
def test_every_camera_goes_through_describe_and_correct(
    correct, shotenv_run, tmp_path, name, range_m
):
    path, camera, walls = written(tmp_path, name, still=True)
    known = ("--known-distance", walls[0][6, 8], "--at", "6,8", "--json", tmp_path / "d.json")
    out, _ = shotenv_run("camera", "describe", path, "--camera", camera, *known)
    found = json.loads((tmp_path / "d.json").read_text())
    assert found["frames"] == 2 and "not stored: laser_power_w" in out
    assert "2 frames of 12 x 16" in out.splitlines()[0]
    assert any(way["described"] and way["fits"] for way in found["labellings"])
    path, camera, walls = written(tmp_path, name)
    # Without a network: one frequency stays wrapped, two and three unwrap each other.
    _, err = correct(path, "--camera", camera, "--unwrapper", "none")
    assert "warning" not in err
    for frame, wall in enumerate(walls):
        folder = tmp_path / "out" / f"{frame:05d}"
        valid, depth_m = depth_of(folder, "valid.npy"), depth_of(folder)
        assert valid.mean() > 0.99
        assert off(depth_m, wall, range_m)[valid].max() < 5e-3
        if range_m < 100:
            assert depth_m[valid].max() < range_m


def test_kinect_logs_at_full_size(correct, tmp_path):
    wall = 1.5 + np.arange(424 * 512).reshape(424, 512) / 3e5
    stored = planes("kinect_v2", [wall], [80e6, 16e6, 120e6], amplitude=4000)
    write_kinect(tmp_path / "a.h5", stored.reshape(1, 9, 424, 512))
    correct(tmp_path / "a.h5", "--camera", "kinect_v2", "--unwrapper", "none")
    folder = tmp_path / "out" / "Frame_0"
    valid = depth_of(folder, "valid.npy")
    assert not valid[:, [0, -1]].any() and valid[:, 1:-1].all()
    assert np.abs(depth_of(folder) - wall)[valid].max() < 5e-3
    points = np.asarray(trimesh.load(folder / "points.ply").vertices)
    assert len(points) == valid.sum()


def test_describe_tells_what_is_there_what_is_odd_and_what_is_not(shotenv_run, tmp_path):
    stored = whole(planes("epc660", [SLOPE_M + 2] * 5, [24e6], noise=4))[:, 0]
    stored[3, 1, 0, 0] = 64003
    write_espros(tmp_path / "a.h5", stored, times=[0, 0.1, 0.2, 0.6, 0.7])
    words = ("--camera", "epc660_hdf5", "--json", tmp_path / "n.json")
    out, _ = shotenv_run("camera", "describe", tmp_path / "a.h5", *words)
    for told in (
        "a.h5: epc660 (HDF5), 5 frames of 12 x 16, 4 samples at 24 MHz",
        "0.10 % of the pixels saturated",
        "unambiguous to 6.25 m",
        "a frame every 0.1 s",
        "not stored: gray; another file whose image_type is Grayscale",
        "not stored: temperature_k; constants.temperature_k",
        "odd: frame 00003 comes 0.4 s after frame 00002",
    ):
        assert told in out
    found = json.loads((tmp_path / "n.json").read_text())
    assert found["timestamp_s"] == [0.0, 0.7] and len(found["odd"]) == 1
    assert found["gray"] is None


def test_constants_of_a_description_stand_in_for_what_is_not_stored(shotenv_run, tmp_path):
    constants = {"temperature_k": 303.0, "integration_s": 4e-4}
    camera = small_camera(tmp_path, "mlx75027", constants=constants)
    words = (array_of(tmp_path, [SLOPE_M + 1]), "--camera", camera)
    out, _ = shotenv_run("camera", "describe", *words)
    assert "temperature 303 to 303 K" in out and "integration 0.0004 to 0.0004 s" in out
    assert "not stored: temperature_k, taken from the description" in out


@pytest.fixture
def small_network(tmp_path):
    """An untrained network for frames of 12 x 16 at 24 MHz."""
    torch.manual_seed(0)
    network = TofRegNet(width=4, range_m=12.0)
    network.head.weight.data.mul_(30.0)
    network.head.bias.data.zero_()
    metadata = {"network": "tofregnet", "width": 4, "range_m": 12.0, "f1_hz": 24e6}
    size = {"trained_height": HEIGHT, "trained_width": WIDTH}
    save_weights(tmp_path / "small.safetensors", network, {**metadata, **size})
    return tmp_path / "small.safetensors"


def test_a_network_of_another_frequency_serves_by_its_distance(
    correct, shotenv_run, tmp_path, small_network
):
    wall_m, range_m = 0.5 + SLOPE_M, unambiguous_range_m(60e6)
    path = array_of(tmp_path, [wall_m])
    np.save(tmp_path / "gray.npy", GRAY.astype(np.uint16))
    words = (path, "--camera", "mlx75027", "--gray", tmp_path / "gray.npy")
    _, err = correct(*words, "--unwrapper", small_network)
    assert "warning: tofregnet was trained at 24 MHz, not 60 MHz" in err and "2.50 m" in err
    gray = torch.from_numpy(GRAY.astype(np.uint16))[None]
    predicted_m = load_unwrapper(small_network).predict(gray).distance_m[0].numpy()
    wrapped_m = wall_m % range_m
    expected = wrapped_m + range_m * ((predicted_m - wrapped_m) / range_m).round().clip(0)
    assert len(np.unique(expected // range_m)) > 1
    np.testing.assert_allclose(depth_of(tmp_path / "out/00000"), expected, atol=3e-3)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--unwrapper", "tofsegnet"), "not 60, and for 160 x 120 pixels, of which 16 x 12 are no"),
        (("--unwrapper", "toffusionnet"), "and it looks at the samples; expected --unwrapper none"),
    ],
)
def test_networks_that_are_of_no_use_are_refused(correct, tmp_path, words, says):
    path = array_of(tmp_path, [SLOPE_M + 1])
    np.save(tmp_path / "gray.npy", GRAY.astype(np.uint16))
    gray = ("--gray", tmp_path / "gray.npy")
    assert says in correct(path, "--camera", "mlx75027", *gray, *words, status=1)
    assert not (tmp_path / "out").exists()


def test_no_simulated_wiggle_is_taken_away_unless_asked(correct, tmp_path):
    wall_m = 2.0 + SLOPE_M
    write_espros(tmp_path / "a.h5", whole(planes("epc660", [wall_m], [24e6]))[:, 0])
    words = (tmp_path / "a.h5", "--camera", "epc660_hdf5", "--unwrapper", "none", "--overwrite")
    correct(*words)
    assert np.abs(depth_of(tmp_path / "out/00000") - wall_m).max() < 2e-3
    correct(*words, "--wiggle", "simulated")
    # The table of the simulated epc660 bends distances by up to 24 mm.
    assert 0.01 < np.abs(depth_of(tmp_path / "out/00000") - wall_m).max() < 0.03
    simulated = ("--wiggle", "simulated", "--sensor", "mlx75027")
    assert "has tables at 60 and 25 MHz; expected 24 MHz" in correct(*words, *simulated, status=1)


def test_dropped_frames_are_told_and_the_others_corrected(correct, tmp_path):
    stored = whole(planes("epc660", [2 + SLOPE_M] * 4, [24e6]))[:, 0]
    write_espros(tmp_path / "a.h5", stored, times=[0, 0.1, 0.2, 0.5])
    _, err = correct(tmp_path / "a.h5", "--camera", "epc660_hdf5", "--unwrapper", "none")
    assert "warning: " in err and "a.h5: frame 00003 comes 0.3 s after frame 00002" in err
    assert (tmp_path / "out/00003/depth_m.npy").is_file()


def test_plain_recordings_need_no_network_for_the_wrapped_distance(correct, tmp_path):
    wall_m = 7.0 + SLOPE_M
    stored = whole(planes("epc660", [wall_m], [24e6]))[0, 0]
    np.save(tmp_path / "a.npy", stored)
    correct(tmp_path / "a.npy", "--unwrapper", "none")
    found = depth_of(tmp_path / "out")
    assert found.max() < unambiguous_range_m(24e6)
    np.testing.assert_allclose(found, wall_m - unambiguous_range_m(24e6), atol=2e-3)
    assert "--unwrapper none" in correct(tmp_path / "a.npy", "--overwrite", status=1)
    words = ("--unwrapper", "none", "--eight", "network", "--overwrite")
    assert "there is no network" in correct(tmp_path / "a.npy", *words, status=1)


@pytest.mark.parametrize("way", ["two_frequency", "kernel_density"])
def test_three_frequencies_unwrap_over_their_joint_range(correct, tmp_path, way):
    hz = [80e6, 16e6, 120e6]
    # Up to the end of the joint range, 18.74 m, fourteen wraps of 120 MHz; neighbours that vote
    # must see nearly the same distance.
    ramp_m = np.linspace(0.5, 18.2, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH)
    if way == "kernel_density":
        ramp_m = 17.0 + SLOPE_M
    stored = whole(planes("kinect_v2", [ramp_m], hz, amplitude=4000, noise=20)).reshape(9, -1)
    if way == "two_frequency":
        stored[3:6, 5] = 0  # No signal at 16 MHz alone.
    stored.T.astype("<i4").tofile(tmp_path / "recording")
    camera = small_camera(
        tmp_path,
        "kinect_v2_dump",
        layout={"height": HEIGHT, "width": WIDTH},
        lens={"center_px": [7.5, 5.5], "radial": [0, 0, 0]},
    )
    words = (tmp_path / "recording", "--camera", camera, "--eight", way)
    correct(*words)
    folder = tmp_path / "out/00000"
    valid, depth_m = depth_of(folder, "valid.npy"), depth_of(folder)
    np.testing.assert_allclose(depth_m[valid], ramp_m[valid], atol=0.02)
    if way == "two_frequency":
        assert valid.sum() == valid.size - 1 and not valid[0, 5] and np.isnan(depth_m[0, 5])
    else:
        assert valid.all()
    told = correct(*words[:3], "--eight", "network", "--overwrite", status=1)
    assert "three frequencies are unwrapped without wiggle tables and networks" in told


def test_points_and_log_have_the_lens_and_the_stored_times(correct, tmp_path):
    from mcap.reader import make_reader
    from rosbags.typesys import Stores, get_typestore

    stored = whole(planes("epc660", [2 + SLOPE_M] * 2, [24e6]))[:, 0]
    write_espros(tmp_path / "a.h5", stored, times=[5.0, 5.25])
    lens = {"horizontal_fov_deg": None, "focal_px": [10.0, 10.0], "center_px": [0.0, 0.0]}
    camera = small_camera(tmp_path, "epc660_hdf5", lens=lens)
    words = (tmp_path / "a.h5", "--camera", camera, "--unwrapper", "none", "--points", "pcd")
    correct(*words, "--mcap", tmp_path / "a.mcap")
    assert (tmp_path / "out/00001/points.pcd").is_file()
    store = get_typestore(Stores.ROS2_HUMBLE)
    with (tmp_path / "a.mcap").open("rb") as file:
        messages = list(make_reader(file).iter_messages(topics=["/camera/depth/points"]))
    times_ns = [message.log_time for *_, message in messages]
    assert times_ns[1] - times_ns[0] == 250_000_000
    content = store.deserialize_cdr(messages[0][2].data, "sensor_msgs/msg/PointCloud2").data
    cloud = np.asarray(content).view("<f4").reshape(HEIGHT, WIDTH, 4)
    # The principal point is the first pixel: it looks straight ahead, and all others right of it.
    np.testing.assert_allclose(cloud[0, 0, :3], [2.0, 0.0, 0.0], atol=2e-3)
    np.testing.assert_allclose(cloud[0, :, 1] / cloud[0, :, 0], -np.arange(WIDTH) / 10, atol=1e-5)
    assert "stands already" in correct(*words, "--mcap", tmp_path / "a.mcap", status=1)


def test_samples_that_tell_no_noise_need_it_told(correct, tmp_path):
    path, _, walls = written(tmp_path, "phasor_video")
    camera = small_camera(tmp_path, "phasor_video", noise_lsb=None)
    words = (path, "--camera", camera, "--unwrapper", "none")
    assert "do not tell their noise" in correct(*words, status=1)
    correct(*words, "--noise-lsb", "0.4")
    assert depth_of(tmp_path / "out/00000", "valid.npy").all()
    correct(*words, "--noise-lsb", "0.51", "--overwrite", status=1)
    assert len(walls) == 2


def test_where_the_last_frame_is_bad_nothing_is_written(correct, tmp_path, monkeypatch):
    monkeypatch.setattr("unwrap.cameras.camera_recording.PIECE_BYTES", 4 * 4 * HEIGHT * WIDTH)
    path = array_of(tmp_path, [SLOPE_M + 1 + 0.1 * number for number in range(3)])
    stored = np.load(path)
    stored[2, 3, 4, 5] = 3000
    np.save(path, stored)
    words = (path, "--camera", "mlx75027", "--unwrapper", "none")
    assert "a.npy: frame 00002 holds 3000" in correct(*words, status=1)
    assert not (tmp_path / "out").exists()
    np.save(path, np.clip(stored, -2000, 2000))
    out, _ = correct(*words, "--json", tmp_path / "n.json")
    assert out.count("% valid") == 3
    assert len(json.loads((tmp_path / "n.json").read_text())["frames"]) == 3
    assert "stands already; --overwrite" in correct(*words, status=1)


def test_points_lie_where_the_lens_looks(correct, tmp_path):
    focal, height, width = 10.0, HEIGHT, WIDTH
    right = (np.arange(width) - (width - 1) / 2) / focal
    down = (np.arange(height)[:, None] - (height - 1) / 2) / focal
    distance_m = 1.2 * np.sqrt(1 + right**2 + down**2)  # a wall 1.2 m ahead
    lens = {"horizontal_fov_deg": None, "focal_px": [focal, focal]}
    camera = small_camera(tmp_path, "mlx75027", lens=lens)
    path = array_of(tmp_path, [distance_m])
    correct(path, "--camera", camera, "--unwrapper", "none")
    ahead, left, up = np.asarray(trimesh.load(tmp_path / "out/00000/points.ply").vertices).T
    np.testing.assert_allclose(ahead, 1.2, atol=2e-3)
    np.testing.assert_allclose(left.reshape(height, width)[0], -1.2 * right, atol=2e-3)
    np.testing.assert_allclose(up.reshape(height, width)[:, 0], -1.2 * down[:, 0], atol=2e-3)
    assert math.isclose(left.max(), 1.2 * right[-1], abs_tol=2e-3)


@pytest.mark.parametrize(
    ("words", "says", "status"),
    [
        (("--camera", "absent"), "camera is 'absent'; expected one of arducam_b0548, blaze", 2),
        (("--camera", "mlx75027", "--at", "1,2"), "at is given without known_distance", 2),
        (("--camera", "mlx75027", "--known-distance", "1", "--at", "1x2"), "at is '1x2'", 2),
        (("--camera", "mlx75027", "--known-distance", "1", "--at", "99,2"), "at is 99,2", 1),
        (("--camera", "blaze"), "described for simulation", 1),
    ],
)
def test_what_cannot_be_described_is_one_sentence(shotenv_run, tmp_path, words, says, status):
    path = array_of(tmp_path, [SLOPE_M + 1])
    assert says in shotenv_run("camera", "describe", path, *words, status=status)
