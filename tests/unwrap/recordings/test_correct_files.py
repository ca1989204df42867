"""`shotenv unwrap correct`: walls at known distances, read and written in every layout."""

import json
import math
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from PIL import Image

from agents.cli.entry import main
from unwrap.networks.predictor import load_unwrapper
from unwrap.recordings.images import depth_png, read_folder, read_gray16
from unwrap.signal.frequencies import SPEED_OF_LIGHT_M_S, unambiguous_range_m
from unwrap.signal.wiggle import WiggleTable, write_wiggle

PAGE = Path(__file__).parents[3] / "docs" / "correct_and_export.md"
HEIGHT, WIDTH, AMPLITUDE_LSB, FOV_DEG = 24, 32, 900.0, 60.0
UNAMBIGUOUS_M = unambiguous_range_m(24e6)
GRAY = np.random.default_rng(3).integers(0, 4096, (HEIGHT, WIDTH)).astype(np.uint16)


def wall_m(ahead_m):
    """Radial distances of a wall across the view, `ahead_m` from the camera."""
    pixel = 2 * math.tan(math.radians(FOV_DEG) / 2) / WIDTH
    across = (np.arange(WIDTH) + 0.5 - WIDTH / 2) * pixel
    down = (np.arange(HEIGHT)[:, None] + 0.5 - HEIGHT / 2) * pixel
    return ahead_m * np.sqrt(1 + across**2 + down**2)


def words_of(distance_m, count, *, offset_lsb=0.0):
    """Noise-free converter words of a static scene."""
    samples = []
    for k in range(count):
        phase = 4 * math.pi * (24e6 if k < 4 else 10e6) * distance_m / SPEED_OF_LIGHT_M_S
        samples.append(AMPLITUDE_LSB * np.cos(phase - (k % 4) * math.pi / 2) + offset_lsb)
    return (np.stack(samples).round() + 2048).astype(np.uint16)


@pytest.fixture(scope="module")
def flat(tmp_path_factory):
    """A wiggle table of no error: the samples here are sines."""
    path = tmp_path_factory.mktemp("tables") / "flat.json"
    write_wiggle(path, {24e6: WiggleTable((0.0,) * 4), 10e6: WiggleTable((0.0,) * 4)})
    return path


@pytest.fixture
def correct(capsys, flat, tiny_unwrapper, tmp_path):
    """Runs the command into `tmp_path / "out"`."""

    def run(source, *words, status=0):
        common = ("--unwrapper", tiny_unwrapper, "--wiggle", flat, "--out", tmp_path / "out")
        found = main([str(w) for w in ("unwrap", "correct", source, *common, *words)])
        out, err = capsys.readouterr()
        assert found == status, err
        return out if status == 0 else err.splitlines()[-1]

    return run


def save_png(path, words):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(words).save(path)


def save_folder(folder, dcs, gray=None):
    for number, sample in enumerate(dcs):
        save_png(folder / f"dcs_{number}.png", sample)
    if gray is not None:
        save_png(folder / "gray.png", gray)


def test_eight_samples_of_a_wall_give_its_distance(correct, tmp_path):
    truth_m = wall_m(9.3)
    np.save(tmp_path / "wall.npy", words_of(truth_m, 8))
    correct(tmp_path / "wall.npy", "--json", tmp_path / "n.json")
    depth_m = np.load(tmp_path / "out/depth_m.npy")
    assert depth_m.dtype == np.float32 and np.load(tmp_path / "out/valid.npy").all()
    # Rounding to words is 1/2 LSB of 900.
    assert np.abs(depth_m - truth_m).max() < UNAMBIGUOUS_M / (2 * math.pi) / AMPLITUDE_LSB
    numbers = json.loads((tmp_path / "n.json").read_text())
    frame = numbers["frames"][0]
    assert numbers["shots"] == 8 and frame["valid_share"] == 1.0
    assert frame["median_m"] == pytest.approx(np.median(truth_m), abs=0.01)


@pytest.mark.parametrize("count", [2, 4])
def test_few_samples_lie_in_the_wrap_nearest_to_the_prediction(
    correct, tmp_path, tiny_unwrapper, count
):
    truth_m = wall_m(2.5)
    np.savez(tmp_path / "wall.npz", dcs=words_of(truth_m, count), gray=GRAY)
    correct(tmp_path / "wall.npz")
    depth_m = np.load(tmp_path / "out/depth_m.npy")
    wraps = (depth_m - truth_m) / UNAMBIGUOUS_M
    assert np.abs(wraps - wraps.round()).max() * UNAMBIGUOUS_M < 2e-3
    predicted_m = load_unwrapper(tiny_unwrapper).predict(torch.from_numpy(GRAY)[None]).distance_m
    expected = ((predicted_m[0].numpy() - truth_m) / UNAMBIGUOUS_M).round().clip(0)
    assert len(np.unique(expected)) > 1
    np.testing.assert_array_equal(wraps.round(), expected)


def test_who_tells_the_wraps_of_eight_samples_can_be_chosen(correct, tmp_path, tiny_unwrapper):
    truth_m = wall_m(9.3)
    np.savez(tmp_path / "wall.npz", dcs=words_of(truth_m, 8), gray=GRAY)
    found = {}
    for eight in ("two_frequency", "kernel_density", "network"):
        words = ("--overwrite", "--json", tmp_path / "n.json", "--eight", eight)
        correct(tmp_path / "wall.npz", *words)
        found[eight] = np.load(tmp_path / "out/depth_m.npy")
        assert json.loads((tmp_path / "n.json").read_text())["eight"] == eight
    np.testing.assert_allclose(found["two_frequency"], truth_m, atol=2e-3)
    np.testing.assert_allclose(found["kernel_density"], truth_m, atol=2e-3)
    # The untrained network is wrong, and decides nevertheless.
    predicted_m = load_unwrapper(tiny_unwrapper).predict(torch.from_numpy(GRAY)[None]).distance_m
    expected = ((predicted_m[0].numpy() - truth_m) / UNAMBIGUOUS_M).round().clip(-1)
    wraps = (found["network"] - truth_m) / UNAMBIGUOUS_M
    assert (expected != 0).any()
    assert (np.abs(wraps - expected) < 1e-3).mean() > 0.99  # Rounding decides halves.


def test_wraps_told_by_a_network_need_a_gray_image(correct, tmp_path):
    np.save(tmp_path / "wall.npy", words_of(wall_m(9.3), 8))
    refused = correct(tmp_path / "wall.npy", "--eight", "network", status=1)
    assert "eight is 'network' and there is no gray image" in refused
    assert not (tmp_path / "out").exists()


def test_points_lie_on_the_wall(correct, tmp_path):
    words = words_of(wall_m(4.0), 8)
    words[:, 5, 7] = 4095  # saturated: no point
    np.savez(tmp_path / "wall.npz", dcs=words, gray=GRAY)
    correct(tmp_path / "wall.npz")
    cloud = trimesh.load(tmp_path / "out/points.ply")
    assert (
        (tmp_path / "out/points.ply")
        .read_bytes()
        .startswith(b"ply\nformat binary_little_endian 1.0")
    )
    valid = np.load(tmp_path / "out/valid.npy")
    assert not valid[5, 7] and valid.sum() == valid.size - 1 == len(cloud.vertices)
    ahead, left, up = cloud.vertices.T
    np.testing.assert_allclose(ahead, 4.0, atol=2e-3)
    reach = 4.0 * math.tan(math.radians(30)) * (1 - 1 / WIDTH)
    assert left[0] == pytest.approx(reach, abs=2e-3)  # the first pixel is the upper left one
    assert left.min() == pytest.approx(-reach, abs=2e-3)
    assert up[0] == pytest.approx(reach * (HEIGHT - 1) / (WIDTH - 1), abs=2e-3)
    np.testing.assert_allclose(cloud.colors[:, 0], (GRAY[valid] / 4095 * 255).round(), atol=1)


def test_the_image_in_millimetres_equals_the_depth(correct, tmp_path):
    words = words_of(wall_m(7.7), 8)
    words[:, 0, 0] = 0
    np.save(tmp_path / "wall.npy", words)
    correct(tmp_path / "wall.npy")
    millimetres = read_gray16(tmp_path / "out/depth_mm.png")
    depth_m = np.load(tmp_path / "out/depth_m.npy")
    valid = np.load(tmp_path / "out/valid.npy")
    assert millimetres[0, 0] == 0 and np.isnan(depth_m[0, 0]) and not valid[0, 0]
    assert np.abs(millimetres[valid] - 1000.0 * depth_m[valid]).max() <= 0.501


def test_distances_beyond_the_image_are_its_highest_value(tmp_path):
    (tmp_path / "far.png").write_bytes(
        depth_png(np.array([[70.0, 65.535, 1e-4, 3.0]]), np.array([[True, True, True, False]]))
    )
    assert read_gray16(tmp_path / "far.png").tolist() == [[65535, 65535, 1, 0]]


def test_the_picture_has_four_panels(correct, tmp_path):
    np.savez(tmp_path / "wall.npz", dcs=words_of(wall_m(5.0), 4), gray=GRAY)
    correct(tmp_path / "wall.npz")
    with Image.open(tmp_path / "out/picture.png") as picture:
        pixels = np.asarray(picture.convert("RGB"), dtype=int)
    assert pixels.shape[1] > 4 * 320
    # Gray in the first quarter, colours in the others.
    spread = np.ptp(pixels, axis=2)
    quarter = pixels.shape[1] // 4
    panel = spread[60:200, 30 : quarter - 30]
    assert panel.max() == 0 and spread[60:200, 2 * quarter + 30 : 3 * quarter - 30].mean() > 20


def test_a_folder_of_images_is_the_same_recording(correct, tmp_path):
    dcs = words_of(wall_m(3.0), 4)
    np.savez(tmp_path / "wall.npz", dcs=dcs, gray=GRAY)
    save_folder(tmp_path / "wall", dcs, GRAY)
    correct(tmp_path / "wall.npz")
    first = np.load(tmp_path / "out/depth_m.npy")
    correct(tmp_path / "wall", "--overwrite")
    np.testing.assert_array_equal(first, np.load(tmp_path / "out/depth_m.npy"))


def test_folders_of_images_are_frames(correct, tmp_path):
    walls = {"a": 2.0, "b": 3.0}
    for name, ahead_m in walls.items():
        save_folder(tmp_path / "walls" / name, words_of(wall_m(ahead_m), 8))
    assert read_folder(tmp_path / "walls").names == ("a", "b")
    out = correct(tmp_path / "walls")
    assert out.count("100.0 % valid") == 2
    for name, ahead_m in walls.items():
        depth_m = np.load(tmp_path / "out" / name / "depth_m.npy")
        np.testing.assert_allclose(depth_m, wall_m(ahead_m), atol=2e-3)


def test_gray_images_may_be_in_another_file(correct, tmp_path):
    np.save(tmp_path / "wall.npy", words_of(wall_m(3.0), 4))
    np.save(tmp_path / "gray.npy", GRAY)
    np.savez(tmp_path / "gray.npz", gray=GRAY)
    save_png(tmp_path / "gray.png", GRAY)
    depths = []
    for name in ("gray.npy", "gray.npz", "gray.png"):
        correct(tmp_path / "wall.npy", "--gray", tmp_path / name, "--overwrite")
        depths.append(np.load(tmp_path / "out/depth_m.npy"))
    np.testing.assert_array_equal(depths[0], depths[1])
    np.testing.assert_array_equal(depths[0], depths[2])


def test_the_offset_map_mends_two_samples(correct, tmp_path):
    truth_m = wall_m(3.0)
    offset = np.random.default_rng(0).normal(0, 40, truth_m.shape)
    np.savez(tmp_path / "wall.npz", dcs=words_of(truth_m, 2, offset_lsb=offset), gray=GRAY)
    np.save(tmp_path / "offset.npy", offset)

    def worst():
        apart = np.load(tmp_path / "out/depth_m.npy") - truth_m
        return np.abs(apart - UNAMBIGUOUS_M * (apart / UNAMBIGUOUS_M).round()).max()

    correct(tmp_path / "wall.npz")
    assert worst() > 0.05
    correct(tmp_path / "wall.npz", "--offset", tmp_path / "offset.npy", "--overwrite")
    assert worst() < 2e-3


def test_the_noise_decides_what_is_valid(correct, tmp_path):
    np.save(tmp_path / "wall.npy", words_of(wall_m(3.0), 8))
    correct(tmp_path / "wall.npy", "--noise-lsb", (AMPLITUDE_LSB - 2) / 3)
    assert np.load(tmp_path / "out/valid.npy").all()
    words = ("--noise-lsb", (AMPLITUDE_LSB + 2) / 3, "--overwrite")
    assert "no usable pixel" in correct(tmp_path / "wall.npy", *words, status=1)


def test_nothing_is_overwritten_unasked(correct, tmp_path):
    np.save(tmp_path / "wall.npy", words_of(wall_m(3.0), 8))
    (tmp_path / "out").mkdir()
    (tmp_path / "out/picture.png").write_text("mine")
    told = correct(tmp_path / "wall.npy", status=1)
    assert "picture.png stands already; --overwrite" in told
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["picture.png"]
    correct(tmp_path / "wall.npy", "--overwrite")
    assert (tmp_path / "out/picture.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((tmp_path / "out").iterdir())) == 5


def test_the_example_of_the_documentation_runs(correct, tmp_path, monkeypatch, tiny_bank):
    example = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1]
    monkeypatch.chdir(tmp_path)
    exec(example.replace("starter", tiny_bank), {})
    assert "% valid" in correct("frame.npz")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "4 samples and no gray image"),
        (("--gray", "absent.png"), "absent.png: no such file"),
        (("--gray", "small.npy"), "small.npy: gray has shape (3, 4)"),
        (("--gray", "gray.npy", "--offset", "small.npy"), "small.npy: offset_lsb is uint16"),
        (("--gray", "gray.npy", "--wiggle", "one.json"), "no table at 1e+07 Hz"),
        (("--gray", "gray.npy", "--fov-deg", "200"), "fov_deg is 200"),
        (("--gray", "gray.npy", "--noise-lsb", "-1"), "noise_lsb is -1"),
        (("--gray", "gray.npy", "--unwrapper", "absent"), "absent"),
    ],
)
def test_what_does_not_fit_is_one_sentence_and_nothing_is_written(
    correct, tmp_path, monkeypatch, words, says
):
    monkeypatch.chdir(tmp_path)
    np.save("wall.npy", words_of(wall_m(3.0), 4))
    np.save("gray.npy", GRAY)
    np.save("small.npy", GRAY[:3, :4])
    write_wiggle(tmp_path / "one.json", {24e6: WiggleTable((0.0,) * 4)})
    assert says in correct("wall.npy", *words, status=1)
    assert not (tmp_path / "out").exists()


def chunk(kind, content):
    body = kind + content
    return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))


def png_that_claims(width, height):
    ihdr = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + ihdr + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda whole: whole[:-40], "dcs_1.png"),
        (lambda whole: whole[:20], "dcs_1.png"),
        (lambda whole: b"", "dcs_1.png"),
        (lambda whole: b"GIF89a" + bytes(100), "dcs_1.png"),
        (lambda whole: png_that_claims(9000, 9000), "dcs_1.png"),
        (lambda whole: png_that_claims(12000, 12000), "dcs_1.png: larger than 256 MiB|exceeds"),
        (lambda whole: png_that_claims(10**6, 10**6), "dcs_1.png: .*exceeds"),
    ],
)
def test_damaged_images_are_named(tmp_path, damage, says):
    save_folder(tmp_path, words_of(wall_m(3.0), 4))
    whole = (tmp_path / "dcs_1.png").read_bytes()
    (tmp_path / "dcs_1.png").write_bytes(damage(whole))
    with pytest.raises(ValueError, match=says):
        read_folder(tmp_path)


def test_other_images_and_gaps_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"no dcs_0\.png"):
        read_folder(tmp_path)
    save_folder(tmp_path, words_of(wall_m(3.0), 4))
    save_png(tmp_path / "dcs_3.png", GRAY.astype(np.uint8))
    with pytest.raises(ValueError, match=r"dcs_3\.png: mode L; expected 16-bit gray"):
        read_folder(tmp_path)
    save_png(tmp_path / "dcs_3.png", GRAY[:5])
    with pytest.raises(ValueError, match="expected one size"):
        read_folder(tmp_path)
    (tmp_path / "dcs_3.png").unlink()
    with pytest.raises(ValueError, match=r"samples \[0, 1, 2\]"):
        read_folder(tmp_path)


def test_frames_that_are_not_alike_are_named(tmp_path):
    save_folder(tmp_path / "a", words_of(wall_m(3.0), 8))
    save_folder(tmp_path / "b", words_of(wall_m(3.0), 4))
    with pytest.raises(ValueError, match=r"b: holds .*as a"):
        read_folder(tmp_path)
