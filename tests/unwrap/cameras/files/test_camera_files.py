"""Every shipped camera's files, written as its format says, give the samples that were written."""

import numpy as np
import pytest
import torch
from camera_files import (
    KINECT_SIZE,
    planes,
    small_camera,
    whole,
    write_espros,
    write_kinect,
    write_raw12,
    write_wire,
)
from PIL import Image

from shotenv.config.reader import find_config, read_config
from unwrap.cameras import open_camera_recording
from unwrap.cameras.files import BinaryFrames, CameraDescription
from unwrap.signal.decoding import decode, distance_m
from unwrap.signal.frequencies import unambiguous_range_m

HEIGHT, WIDTH = 6, 8
SLOPE_M = 0.05 * np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH)
WALLS = [2.0 + SLOPE_M, 3.1 + SLOPE_M]


def described(name):
    return read_config(CameraDescription, find_config("camera", str(name)))


def opened(path, name, gray=None):
    return open_camera_recording(path, described(name), gray=gray)


def all_frames(recording):
    (frames,) = recording.pieces()
    return frames


def assert_distances(frames, walls, *, atol, columns=slice(None)):
    """Each frequency gives each wall, modulo its own range."""
    for k, hz in enumerate(frames.frequencies_hz):
        range_m = unambiguous_range_m(hz)
        found = distance_m(decode(frames.samples_lsb[:, k]).phase_rad, hz).numpy()
        off = (found - np.stack(walls) + range_m / 2) % range_m - range_m / 2
        assert np.abs(off[..., columns]).max() < atol * range_m


def test_espros_hdf5(tmp_path):
    stored = whole(planes("epc660", WALLS, [24e6]))[:, 0]
    stored[0, 1, 2, 3], stored[1, 0, 4, 5] = 64002, 64003
    write_espros(tmp_path / "a.h5", stored, times=[5.0, 5.1])
    frames = all_frames(opened(tmp_path / "a.h5", "epc660_hdf5"))
    assert frames.frequencies_hz == (24e6,) and not frames.made and frames.gray is None
    assert frames.timestamp_s == (5.0, 5.1) and frames.temperature_k is None
    assert frames.saturated.nonzero().tolist() == [[0, 2, 3], [1, 4, 5]]
    expected = torch.from_numpy(np.where(stored > 64000, 0, stored)).float()
    assert torch.equal(frames.samples_lsb[:, 0], expected)
    write_espros(tmp_path / "b.h5", whole(planes("epc660", WALLS, [12e6]))[:, 0], mhz=12.0)
    frames = all_frames(opened(tmp_path / "b.h5", "epc660_hdf5"))
    assert frames.frequencies_hz == (12e6,)
    assert_distances(frames, WALLS, atol=1e-3)


def test_gray_images_of_espros_are_a_file_of_their_own(tmp_path):
    write_espros(tmp_path / "a.h5", whole(planes("epc660", WALLS, [24e6]))[:, 0])
    gray = np.random.default_rng(0).integers(0, 4096, (2, HEIGHT, WIDTH))
    write_espros(tmp_path / "g.h5", gray, image_type="Grayscale")
    found = all_frames(opened(tmp_path / "a.h5", "epc660_hdf5", tmp_path / "g.h5")).gray
    np.testing.assert_allclose(found.numpy(), gray / 4095, atol=1e-6)
    Image.fromarray(gray[0].astype(np.uint16)).save(tmp_path / "g.png")
    with pytest.raises(ValueError, match=r"g\.png: gray images are \(1, 6, 8\); expected \(2, 6"):
        opened(tmp_path / "a.h5", "epc660_hdf5", tmp_path / "g.png")


def test_frames_on_the_wire(tmp_path):
    stored = whole(planes("epc660", WALLS, [24e6], amplitude=1500))[:, 0]
    stored[0, 2, 0, 0], stored[0, 3, 0, 1], stored[1, 0, 5, 7] = -2048, 2047, 64003 - 2048
    gray = np.random.default_rng(0).integers(0, 4096, (2, HEIGHT, WIDTH))
    write_wire(tmp_path / "a.bin", stored, gray=gray, celsius=[31.5, -4.25])
    frames = all_frames(opened(tmp_path / "a.bin", "epc660_wire"))
    np.testing.assert_allclose(frames.gray.numpy(), gray / 4095, atol=1e-6)
    np.testing.assert_allclose(frames.temperature_k, [304.65, 268.9])
    np.testing.assert_allclose(frames.integration_s, [4e-4, 4e-4])
    assert frames.saturated.nonzero().tolist() == [[0, 0, 0], [0, 0, 1], [1, 5, 7]]
    good = ~frames.saturated.numpy()[:, None].repeat(4, axis=1)
    np.testing.assert_array_equal(frames.samples_lsb[:, 0].numpy()[good], stored[good])
    write_wire(tmp_path / "b.bin", whole(planes("epc660", WALLS, [24e6]))[:, 0])
    frames = all_frames(opened(tmp_path / "b.bin", "epc660_wire"))
    assert frames.gray is None
    assert_distances(frames, WALLS, atol=1e-3)


@pytest.mark.parametrize("name", ["mlx75027", "mlx75027_reversed"])
def test_plain_arrays_and_their_two_orders(tmp_path, name):
    stored = whole(planes(name, WALLS, [60e6], offset=12))[:, 0].astype(np.int16)
    np.save(tmp_path / "a.npy", stored)
    frames = all_frames(opened(tmp_path / "a.npy", name))
    assert_distances(frames, WALLS, atol=1e-3)
    assert frames.samples_lsb.mean().round() == 12  # The offset stays in the samples.
    other = {"mlx75027": "mlx75027_reversed", "mlx75027_reversed": "mlx75027"}[name]
    with pytest.raises(AssertionError):
        assert_distances(all_frames(opened(tmp_path / "a.npy", other)), WALLS, atol=1e-2)
    np.save(tmp_path / "one.npy", stored[0])
    assert_distances(all_frames(opened(tmp_path / "one.npy", name)), WALLS[:1], atol=1e-3)
    np.savez(
        tmp_path / "a.npz",
        dcs=whole(planes(name, WALLS, [20e6]))[:, 0],
        gray=np.full((2, HEIGHT, WIDTH), 0.5),
        frequencies_hz=20e6,
        temperature_k=[300.0, 301.0],
        laser_power_w=2.5,
    )
    frames = all_frames(opened(tmp_path / "a.npz", name))
    assert frames.frequencies_hz == (20e6,) and frames.temperature_k == (300.0, 301.0)
    assert frames.laser_power_w == (2.5, 2.5) and frames.gray.eq(0.5).all()
    assert_distances(frames, WALLS, atol=1e-3)


def test_a_gray_image_among_the_planes(tmp_path):
    passive = {"where": "plane", "plane": 2}
    camera = small_camera(tmp_path, "mlx75027", passive=passive)
    stored = whole(planes("mlx75027", WALLS, [60e6]))[:, 0]
    gray = np.random.default_rng(0).integers(0, 4096, (2, HEIGHT, WIDTH))
    five = np.insert(stored, 2, gray, axis=1)
    np.save(tmp_path / "a.npy", five)
    frames = all_frames(opened(tmp_path / "a.npy", camera))
    np.testing.assert_allclose(frames.gray.numpy(), gray / 4095, atol=1e-6)
    assert_distances(frames, WALLS, atol=1e-3)


def test_folders_of_images(tmp_path):
    camera = small_camera(tmp_path, "mlx75027", words={"signed": False, "mid_scale": 2048})
    stored = whole(planes("mlx75027", WALLS, [60e6]))[:, 0] + 2048
    for number, frame in enumerate(stored):
        folder = tmp_path / "recording" / f"{number}"
        folder.mkdir(parents=True)
        for plane, image in enumerate(frame):
            Image.fromarray(image.astype(np.uint16)).save(folder / f"dcs_{plane}.png")
        Image.fromarray(np.full((HEIGHT, WIDTH), 4095, np.uint16)).save(folder / "gray.png")
    frames = all_frames(opened(tmp_path / "recording", camera))
    assert frames.gray.eq(1.0).all()
    assert_distances(frames, WALLS, atol=1e-3)


def test_packed_raw12_at_full_size_with_a_trailer(tmp_path):
    camera = described("imx556")
    wall = 2.0 + np.arange(480 * 640).reshape(480, 640) / 1e5
    stored = whole(planes("imx556", [wall], [100e6, 20e6], amplitude=1800))
    write_raw12(tmp_path / "a.raw", stored, trailer=bytes(396))
    assert (tmp_path / "a.raw").stat().st_size == 2 * (4 * 460_800 + 396)
    frames = all_frames(open_camera_recording(tmp_path / "a.raw", camera))
    assert frames.frequencies_hz == (100e6, 20e6)
    assert torch.equal(frames.samples_lsb, torch.from_numpy(stored).float())
    assert_distances(frames, [wall], atol=1e-3)


@pytest.mark.parametrize(("row_bytes", "twelfth"), [(12, 0), (32, 1)])
def test_packed_raw12_with_padded_rows_and_eleven_bits(tmp_path, row_bytes, twelfth):
    layout = {"height": HEIGHT, "width": WIDTH, "row_bytes": row_bytes, "trailer_rows": 3}
    camera = small_camera(tmp_path, "arducam_b0548", layout=layout)
    stored = whole(planes("arducam_b0548", WALLS, [90e6, 15e6], amplitude=1000))
    stored[1, 1, 2, 3, 4] = -1024
    trailer = bytes(3 * row_bytes)
    write_raw12(tmp_path / "a.raw", stored, row_bytes=row_bytes, trailer=trailer, twelfth=twelfth)
    recording = opened(tmp_path / "a.raw", camera)
    assert recording.names == ("00000", "00001")
    frames = all_frames(recording)
    assert frames.saturated.nonzero().tolist() == [[1, 3, 4]]
    # The third plane is the cosine, the second the sine, the first and the fourth their opposites.
    good = ~frames.saturated.numpy()[:, None, None].repeat(2, axis=1).repeat(4, axis=2)
    np.testing.assert_array_equal(
        frames.samples_lsb.numpy()[good], stored[:, :, [2, 1, 0, 3]][good]
    )
    write_raw12(tmp_path / "a.raw", stored[:1], row_bytes=row_bytes, trailer=trailer)
    assert_distances(all_frames(opened(tmp_path / "a.raw", camera)), WALLS[:1], atol=1e-3)


def test_a_shipped_frame_of_the_arducam_has_2405_rows_a_frequency():
    source = BinaryFrames(find_config("camera", "arducam_b0548"), described("arducam_b0548"))
    assert source.frame_bytes == 2 * 2405 * 960


def test_kinect_logs(tmp_path):
    walls = [1.5 + np.arange(424 * 512).reshape(KINECT_SIZE) / 3e4]
    stored = planes("kinect_v2", walls, [80e6, 16e6, 120e6], amplitude=900)
    stored = stored.reshape(1, 9, *KINECT_SIZE)
    held = write_kinect(tmp_path / "a.h5", stored, saturated=[(0, 4, 100, 200)])
    recording = opened(tmp_path / "a.h5", "kinect_v2")
    assert recording.names == ("Frame_0",)
    read = recording.source.read(0, 1).planes
    held[0, 4, 100, 200] = 32767
    np.testing.assert_array_equal(read, held)
    frames = all_frames(recording)
    assert frames.made and frames.samples_lsb.shape == (1, 3, 4, *KINECT_SIZE)
    assert frames.frequencies_hz == (120e6, 80e6, 16e6)
    assert frames.saturated.nonzero().tolist() == [[0, 100, 200]]
    keep = torch.ones(512, dtype=torch.bool)
    keep[[0, 200, 511]] = False
    # Companding keeps 900 to within 4.
    assert_distances(frames, walls, atol=2e-3, columns=keep.numpy())
    cosine, sine, opposite, other = frames.samples_lsb[0, 0]
    assert torch.equal(cosine, -opposite) and torch.equal(sine, -other)


def test_kinect_dumps_one_file_a_frame(tmp_path):
    layout = {"height": HEIGHT, "width": WIDTH}
    camera = small_camera(tmp_path, "kinect_v2_dump", layout=layout)
    stored = whole(planes("kinect_v2", WALLS, [80e6, 16e6, 120e6], offset=31))
    (tmp_path / "dumps").mkdir()
    for name, frame in zip(("b", "c"), stored.reshape(2, 9, HEIGHT, WIDTH), strict=True):
        frame.transpose(1, 2, 0).astype("<i4").tofile(tmp_path / "dumps" / f"{name}.bin")
    recording = opened(tmp_path / "dumps", camera)
    assert recording.names == ("b", "c")
    frames = all_frames(recording)
    assert frames.made
    assert_distances(frames, WALLS, atol=1e-3)
    # Three phases cancel the offset, and tell the amplitude.
    np.testing.assert_allclose(frames.samples_lsb.square()[:, :, :2].sum(2).sqrt(), 600, atol=2)


def test_phasor_videos(tmp_path):
    stored = planes("phasor_video", WALLS, [30e6], amplitude=1.25)[:, 0]
    np.save(tmp_path / "a.npy", np.moveaxis(stored, 1, -1).astype(np.float32))
    frames = all_frames(opened(tmp_path / "a.npy", "phasor_video"))
    assert frames.made and frames.frequencies_hz == (30e6,)
    np.testing.assert_allclose(frames.samples_lsb[:, 0, :2], stored, atol=1e-6)
    assert_distances(frames, WALLS, atol=1e-4)


def test_the_image_is_turned_as_it_lies_in_the_view(tmp_path):
    axes = {"transpose": True, "flip_columns": True}
    camera = small_camera(tmp_path, "mlx75027", axes=axes)
    stored = whole(planes("mlx75027", WALLS, [60e6]))[:, 0].astype(np.int16)
    gray = np.arange(48).reshape(6, 8) / 48
    np.savez(tmp_path / "a.npz", dcs=stored, gray=np.stack((gray, gray)))
    recording = opened(tmp_path / "a.npz", camera)
    frames = all_frames(recording)
    assert recording.size == frames.saturated.shape[1:] == (WIDTH, HEIGHT)
    np.testing.assert_array_equal(
        frames.samples_lsb[0, 0, 0].numpy(), stored[0, 0].T[:, ::-1].astype(np.float32)
    )
    np.testing.assert_allclose(frames.gray[0], gray.T[:, ::-1], atol=1e-6)


def test_long_recordings_come_in_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr("unwrap.cameras.camera_recording.PIECE_BYTES", 3 * 4 * 4 * HEIGHT * WIDTH)
    walls = [WALLS[0] + 0.1 * number for number in range(7)]
    stored = whole(planes("mlx75027", walls, [60e6]))[:, 0].astype(np.int16)
    np.save(tmp_path / "a.npy", stored)
    recording = opened(tmp_path / "a.npy", "mlx75027")
    pieces = list(recording.pieces())
    assert [len(piece) for piece in pieces] == [3, 3, 1]
    assert pieces[1].names == ("00003", "00004", "00005")
    whole_again = torch.cat([piece.samples_lsb for piece in pieces])
    assert torch.equal(whole_again, recording.read(0, 7).samples_lsb)


def test_a_camera_for_simulation_has_no_recordings(tmp_path):
    with pytest.raises(ValueError, match="blaze is described for simulation"):
        opened(tmp_path / "a.raw", "blaze")
