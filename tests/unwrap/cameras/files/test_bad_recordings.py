"""Recordings that are damaged, or not as described: a sentence that names file and frame."""

import os
import sys

import h5py
import numpy as np
import pytest
from camera_files import (
    planes,
    small_camera,
    whole,
    wire_header,
    write_espros,
    write_kinect,
    write_raw12,
    write_wire,
)

from shotenv.config.reader import ConfigError, find_config, read_config
from unwrap.cameras import dropped_frames, open_camera_recording, summary_of
from unwrap.cameras.files import CameraDescription

HEIGHT, WIDTH = 6, 8
WALLS = [np.full((HEIGHT, WIDTH), 2.0), np.full((HEIGHT, WIDTH), 2.5)]


def described(name):
    return read_config(CameraDescription, find_config("camera", str(name)))


def refused(path, name, gray=None):
    with pytest.raises(ValueError) as error:
        for _ in open_camera_recording(path, described(name), gray=gray).pieces():
            pass
    assert str(gray or path) in str(error.value)
    return str(error.value)


def dcs(camera="epc660", hz=24e6):
    return whole(planes(camera, WALLS, [hz]))[:, 0]


@pytest.fixture
def arducam(tmp_path):
    layout = {"height": HEIGHT, "width": WIDTH, "row_bytes": 12, "trailer_rows": 0}
    return small_camera(tmp_path, "arducam_b0548", layout=layout)


@pytest.fixture
def packed(tmp_path):
    write_raw12(tmp_path / "a.raw", whole(planes("arducam_b0548", WALLS, [90e6, 15e6])))
    return tmp_path / "a.raw"


def test_a_named_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "log.bin")
    assert "not a regular file" in refused(tmp_path / "log.bin", "epc660_wire")


@pytest.mark.parametrize("bytes_more", [-1, -100, 1, 12])
def test_packed_files_that_are_cut_off_or_padded(packed, arducam, bytes_more):
    whole_file = packed.read_bytes()
    packed.write_bytes((whole_file + bytes(12))[: len(whole_file) + bytes_more])
    frame, rest = (1, 576 + bytes_more) if bytes_more < 0 else (2, bytes_more)
    assert f"frame {frame} has {rest} bytes; expected 576" in refused(packed, arducam)


def test_files_that_are_not_there_or_empty(tmp_path, arducam):
    assert "no such file" in refused(tmp_path / "absent.raw", arducam)
    (tmp_path / "empty.raw").write_bytes(b"")
    assert "empty" in refused(tmp_path / "empty.raw", arducam)
    for name in ("epc660_hdf5", "kinect_v2", "epc660_wire", "mlx75027"):
        assert "no such file" in refused(tmp_path / "absent.npy", name)
    (tmp_path / "text.h5").write_text("no HDF5")
    for name in ("epc660_hdf5", "kinect_v2"):
        refused(tmp_path / "text.h5", name)


def test_a_folder_of_files_of_another_resolution(tmp_path, packed, arducam):
    (tmp_path / "all").mkdir()
    (tmp_path / "all" / "b.raw").write_bytes(packed.read_bytes())
    (tmp_path / "all" / "c.raw").write_bytes(bytes(100))
    told = refused(tmp_path / "all", arducam)
    assert "c.raw: frame 0 has 100 bytes; expected 576" in told


def test_frames_on_the_wire_that_are_cut_off(tmp_path):
    path = tmp_path / "a.bin"
    write_wire(path, dcs())
    content = path.read_bytes()
    path.write_bytes(content[:-1])
    assert "frame 1: 383 bytes follow its header; expected 384" in refused(path, "epc660_wire")
    path.write_bytes(content + b"\x03\x00")
    assert "frame 2: header of 2 bytes; expected 25" in refused(path, "epc660_wire")


def test_frames_on_the_wire_of_another_size_type_or_byte_order(tmp_path):
    path = tmp_path / "a.bin"
    write_wire(path, dcs())
    first = path.read_bytes()[: 25 + 2 * 4 * HEIGHT * WIDTH]
    small = wire_header(4, 4, 2) + bytes(2 * 4 * 8)
    path.write_bytes(first + small)
    assert "frame 1: 2 x 4 pixels; expected 6 x 8" in refused(path, "epc660_wire")
    path.write_bytes(first + wire_header(7, WIDTH, HEIGHT))
    assert "frame 1: type is 7; expected 4 (samples) or 3" in refused(path, "epc660_wire")
    swapped = bytes([first[0]]) + np.frombuffer(first[1:25], ">u2").astype("<u2").tobytes()
    path.write_bytes(swapped + first[25:])
    assert "frame 0: type is 1024" in refused(path, "epc660_wire")
    path.write_bytes(first[:25] + np.frombuffer(first[25:], "<u2").astype(">u2").tobytes())
    assert "frame 00000 holds" in (told := refused(path, "epc660_wire")) and "12 bits" in told


def test_a_frame_on_the_wire_without_its_gray_image(tmp_path):
    gray = np.zeros((1, HEIGHT, WIDTH), np.int64)
    write_wire(tmp_path / "a.bin", dcs()[:1], gray=gray)
    write_wire(tmp_path / "b.bin", dcs()[1:])
    path = tmp_path / "c.bin"
    path.write_bytes((tmp_path / "a.bin").read_bytes() + (tmp_path / "b.bin").read_bytes())
    assert "frame 1 has no gray image" in refused(path, "epc660_wire")
    path.write_bytes(wire_header(3, WIDTH, HEIGHT) + bytes(96))
    assert "no frame of samples" in refused(path, "epc660_wire")


def test_hdf5_of_another_type_size_or_frequency(tmp_path):
    path = tmp_path / "a.h5"
    write_espros(path, dcs()[:, 0], image_type="Distance")
    assert "image_type is 'Distance'; expected 'DCS'" in refused(path, "epc660_hdf5")
    write_espros(path, dcs()[:, :3])
    assert "shape (2, 3, 6, 8); expected [N, 4, H, W]" in refused(path, "epc660_hdf5")
    write_espros(path, dcs(), mhz=20.0)
    assert "frequencies are 20 MHz; expected 1 of 24 MHz" in refused(path, "epc660_hdf5")
    write_espros(path, dcs(), times=[0.0])
    assert "timestamps has 1 entries; expected 2" in refused(path, "epc660_hdf5")
    write_espros(path, dcs())
    with h5py.File(path, "a") as file:
        file.attrs["roi"] = (0, 0, 320, 240)
    assert "6 x 8; expected 240 x 320" in refused(path, "epc660_hdf5")
    with h5py.File(path, "a") as file:
        del file["frames_0"]
    assert "frames_0 is missing; it has timestamps" in refused(path, "epc660_hdf5")


def test_words_that_are_no_samples(tmp_path):
    path, frames = tmp_path / "a.h5", dcs()
    frames[1, 2, 3, 4] = 2048
    write_espros(path, frames)
    told = refused(path, "epc660_hdf5")
    assert "frame 00001 holds 2048 in plane 2 at row 3, column 4" in told
    assert "expected words of -2048..2047 (12 bits)" in told
    write_espros(path, dcs() + 0.25, dtype=np.float32)
    assert "whole numbers" in refused(path, "epc660_hdf5")
    frames = dcs().astype(float)
    frames[0, 0, 0, 5] = np.nan
    write_espros(path, frames, dtype=np.float64)
    assert "frame 00000 holds nan in plane 0 at row 0, column 5" in refused(path, "epc660_hdf5")
    # In 16 bits the code for overflow is a sample like others: nobody can tell them apart.
    write_espros(path, dcs(), dtype=np.int16)
    assert "int16, in which the code 64002 is -1534" in refused(path, "epc660_hdf5")


def test_kinect_logs_with_a_hole_or_cut_off(tmp_path):
    path = tmp_path / "a.h5"
    write_kinect(path, np.zeros((3, 9, 424, 512), np.int64))
    with h5py.File(path, "a") as file:
        del file["Frame_1"]
    assert "frame Frame_1 is missing between others" in refused(path, "kinect_v2")
    with h5py.File(path, "a") as file:
        file["Frame_1/Ir"] = np.zeros(1000, np.int8)
    assert "frame Frame_1: Ir is int8 of 1000; expected 2984960 bytes" in refused(path, "kinect_v2")


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        (lambda frames: frames[:, :2], "2 planes; expected 4"),
        (lambda frames: frames[0, 0], "2 axes, shape (6, 8); expected F, P, H, W"),
        (lambda frames: frames.astype(np.int32) * 8, "words of -2048..2047 (12 bits)"),
        (lambda frames: frames.byteswap(), "words of -2048..2047 (12 bits)"),
        (lambda frames: frames.astype(complex), "numbers are complex128"),
        (lambda frames: frames + np.inf, "frame 00000 holds inf"),
    ],
)
def test_arrays_that_are_not_as_described(tmp_path, changed, says):
    np.save(tmp_path / "a.npy", changed(dcs("mlx75027", 60e6).astype(np.int16)))
    assert says in refused(tmp_path / "a.npy", "mlx75027")


def test_arrays_that_are_damaged_or_pickled(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, dcs("mlx75027", 60e6))
    path.write_bytes(path.read_bytes()[:-5])
    assert "bytes follow" in refused(path, "mlx75027")
    np.save(path, np.array([{}], dtype=object), allow_pickle=True)
    assert "never read" in refused(path, "mlx75027")
    np.savez(tmp_path / "a.npz", dcs=dcs("mlx75027", 60e6), frequencies_hz=[59e6])
    told = refused(tmp_path / "a.npz", "mlx75027")
    assert "frequencies are 59 MHz; expected 1 of 100 MHz" in told
    np.savez(tmp_path / "a.npz", dcs=dcs("mlx75027", 60e6), temperature_k=[300.0, np.nan])
    assert "frame 00001 has a temperature_k of nan" in refused(tmp_path / "a.npz", "mlx75027")
    np.savez(tmp_path / "a.npz", dcs=dcs("mlx75027", 60e6), temperature_k=[300.0] * 3)
    assert "expected one number, or 2" in refused(tmp_path / "a.npz", "mlx75027")


def test_gray_images_that_do_not_go_with_the_samples(tmp_path):
    path, gray = tmp_path / "a.npy", tmp_path / "gray.npy"
    np.save(path, dcs("mlx75027", 60e6))
    np.save(gray, np.zeros((2, 3, 4)))
    assert "gray images are (2, 3, 4); expected (2, 6, 8)" in refused(path, "mlx75027", gray)
    images = np.zeros((2, HEIGHT, WIDTH))
    images[1, 2, 3] = np.nan
    np.save(gray, images)
    with pytest.raises(ValueError, match=r"frame 00001 holds nan .*row 2, column 3"):
        list(open_camera_recording(path, described("mlx75027"), gray=gray).pieces())


def test_gray_images_where_the_description_has_none(tmp_path):
    camera = small_camera(tmp_path, "mlx75027", passive={"where": "file"})
    gray = np.zeros((2, HEIGHT, WIDTH))
    np.savez(tmp_path / "a.npz", dcs=dcs("mlx75027", 60e6), gray=gray)
    assert "passive.where of mlx75027 is 'file'" in refused(tmp_path / "a.npz", camera)


def test_frames_that_are_too_large(tmp_path, monkeypatch):
    np.save(tmp_path / "a.npy", dcs("mlx75027", 60e6))
    monkeypatch.setattr("unwrap.cameras.camera_recording.LARGEST_FRAME_BYTES", 700)
    assert "(4, 6, 8) samples is larger than" in refused(tmp_path / "a.npy", "mlx75027")


def test_frames_that_were_dropped_and_a_camera_that_warmed_up(tmp_path):
    frames = np.concatenate([dcs("mlx75027", 60e6)] * 3)
    times, temperatures = [0.0, 0.1, 0.2, 0.5, 0.6, 0.55], [300, 301, 302, 303, 304, 306]
    integration = [1e-3, 1e-3, 2e-3, 1e-3, 1e-3, 1e-3]
    np.savez(
        tmp_path / "a.npz",
        dcs=frames,
        timestamp_s=times,
        temperature_k=temperatures,
        integration_s=integration,
    )
    recording = open_camera_recording(tmp_path / "a.npz", described("mlx75027"))
    _, _, odd = summary_of(recording)
    assert [sentence.split(":")[0] for sentence in odd] == [
        "frame 00003 comes 0.3 s after frame 00002, where 0.1 s is usual",
        "frame 00005 is 0.05 s earlier than frame 00004 before it",
        "the temperature goes from 300.0 K in frame 00000 to 306.0 K in frame 00005",
        "the integration time changes from 0.001 s to 0.002 s in frame 00002",
    ]
    assert dropped_frames([0.0], ["a"]) == []


def test_hdf5_without_its_package(tmp_path, monkeypatch):
    write_espros(tmp_path / "a.h5", dcs())
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ImportError, match=r"a\.h5: .*pip install 'shotenv\[cameras\]'"):
        open_camera_recording(tmp_path / "a.h5", described("epc660_hdf5"))


@pytest.mark.parametrize(
    ("name", "changes", "says"),
    [
        ("mlx75027", {"layout": {"axes": "FPH"}}, "axes is 'FPH'"),
        ("mlx75027", {"samples": {"phase_deg": [0, 5, 180, 270]}}, "10 degrees apart"),
        ("mlx75027", {"samples": {"phase_deg": [0, 270]}}, "expected 0 and 90"),
        ("phasor_video", {"samples": {"phase_deg": [0, 90, 180]}}, "expected two for phasors"),
        ("mlx75027", {"frequencies_hz": [6e7, 6e7]}, "expected different ones"),
        ("mlx75027", {"words": {"stored_bits": 8}}, "stored_bits is 8"),
        ("mlx75027", {"words": {"bit": 12}}, "unknown key words.bit"),
        ("mlx75027", {"passive": {"where": "plane", "plane": 5}}, "expected 0 to 4"),
        ("imx556", {"layout": {"row_bytes": 959}}, "row_bytes is 959"),
        ("imx556", {"layout": {"height": None}}, "layout.height is missing"),
        ("mlx75027", {"lens": {"rays": "r.npy"}}, "several ways"),
        ("mlx75027", {"container": "tape"}, "container"),
    ],
)
def test_descriptions_that_cannot_be(tmp_path, name, changes, says):
    with pytest.raises(ConfigError) as error:
        described(small_camera(tmp_path, name, **changes))
    assert says in str(error.value)
