"""Recordings as the writers make them: read again, and beside files by independent code."""

import dataclasses
import itertools

import h5py
import numpy as np
import pytest
import torch
from camera_files import (
    ordered,
    small_camera,
    write_kinect,
    write_raw12,
    write_wire,
)

from shotenv.config.reader import find_config, read_config
from unwrap.cameras import CameraFrames, open_camera_recording
from unwrap.cameras.files import CameraDescription
from unwrap.cameras.writing import stored_frames, write_camera_recording

FRAMES, HEIGHT, WIDTH = 3, 6, 8
SMALL = {"height": HEIGHT, "width": WIDTH, "row_bytes": 16, "trailer_rows": 2, "trailer_bytes": 5}


def described(path):
    return read_config(CameraDescription, find_config("camera", str(path)))


def delivered(frequencies_hz, *, size=(HEIGHT, WIDTH), high=900, opposite=False, frames=FRAMES):
    """Frames of random whole samples, with gray images and settings; none of them is full.

    `opposite` ones cancel, and are even, as those are that come of phasors.
    """
    random = np.random.default_rng(7)
    shape = frames, len(frequencies_hz), 4, *size
    samples = random.integers(-high, high, shape).astype(np.float32)
    if opposite:
        samples[:, :, 2:] = -samples[:, :, :2]
    flags = torch.zeros(shape, dtype=torch.bool)
    return CameraFrames(
        samples_lsb=torch.from_numpy(samples),
        saturated=flags.any(2).any(1),
        gray=torch.from_numpy(random.integers(0, 4096, (frames, *size)).astype(np.float32) / 4095),
        frequencies_hz=tuple(frequencies_hz),
        made=False,
        names=tuple(f"{n:05d}" for n in range(frames)),
        temperature_k=(303.25,) * frames,
        integration_s=(6e-4,) * frames,
        laser_power_w=(2.5,) * frames,
        timestamp_s=tuple(0.1 * n for n in range(frames)),
        saturated_samples=flags,
    )


def flagged(frames, *places):
    """The frames with these samples (frame, frequency, sample, row, column) full."""
    flags = frames.saturated_samples.clone()
    for place in places:
        flags[place] = True
    return dataclasses.replace(frames, saturated_samples=flags, saturated=flags.any(2).any(1))


def with_sample(frames, place, value):
    samples = frames.samples_lsb.clone()
    samples[place] = value
    return dataclasses.replace(frames, samples_lsb=samples)


def again(folder, frames, camera):
    """The frames written and read, and the files."""
    written = write_camera_recording(folder, "drive", frames, camera)
    recording = open_camera_recording(written.recording, camera, gray=written.gray)
    return recording.read(0, len(recording.names)), written


TOLD = ("temperature_k", "integration_s", "laser_power_w", "timestamp_s")
CAMERAS = {
    "epc660_hdf5": ((24e6,), {}, ("timestamp_s",), ".h5", "_gray.h5"),
    "epc660_wire": ((24e6,), {}, ("temperature_k", "integration_s"), ".bin", None),
    "mlx75027": ((60e6,), {}, TOLD, ".npz", None),
    "mlx75027_reversed": ((60e6,), {}, TOLD, ".npz", None),
    "imx556": ((100e6, 20e6), {"layout": SMALL}, (), ".raw", "_gray.npy"),
    "arducam_b0548": ((90e6, 15e6), {"layout": SMALL}, (), ".raw", "_gray.npy"),
    "kinect_v2_dump": (
        (120e6, 80e6, 16e6),
        {"layout": {"height": HEIGHT, "width": WIDTH}},
        (),
        ".raw",
        "_gray.npy",
    ),
    "phasor_video": ((30e6,), {}, TOLD, ".npz", "_gray.npy"),
}
"""Frequencies, changes for a small image, what is told beside the samples, and endings of files."""


@pytest.mark.parametrize("name", CAMERAS)
def test_what_was_written_is_read_again(tmp_path, name):
    frequencies, changes, told, ending, gray_ending = CAMERAS[name]
    camera = described(small_camera(tmp_path, name, **changes))
    made = name in ("kinect_v2_dump", "phasor_video")
    frames = delivered(frequencies, opposite=made)
    found, written = again(tmp_path, frames, camera)
    assert written.recording.name == f"drive{ending}"
    gray_name = None if written.gray is None else written.gray.name
    assert gray_name == (None if gray_ending is None else f"drive{gray_ending}")
    assert found.frequencies_hz == frames.frequencies_hz and found.made == made
    # Three phases are rounded as they are stored, and the four samples made of them.
    off = (found.samples_lsb - frames.samples_lsb).abs().max()
    assert off <= {"kinect_v2_dump": 1.2, "phasor_video": 1e-9}.get(name, 0)
    assert torch.equal(found.gray, frames.gray)
    assert not found.saturated.any() and not found.saturated_samples.any()
    for field in TOLD:
        expected = getattr(frames, field) if field in told else None
        if expected is None:
            assert getattr(found, field) is None
        else:
            np.testing.assert_allclose(getattr(found, field), expected, rtol=1e-12)


@pytest.mark.parametrize("axes", list(itertools.product((False, True), repeat=3)))
def test_the_image_is_turned_back(tmp_path, axes):
    turned = dict(zip(("transpose", "flip_rows", "flip_columns"), axes, strict=True))
    camera = described(small_camera(tmp_path, "mlx75027", axes=turned))
    frames = flagged(delivered((60e6,)), (1, 0, 3, 4, 2))
    found, _ = again(tmp_path, frames, camera)
    assert torch.equal(found.samples_lsb, frames.samples_lsb)
    assert torch.equal(found.gray, frames.gray)
    assert torch.equal(found.saturated_samples, frames.saturated_samples)


@pytest.mark.parametrize("layout", ["FPHW", "HWFP", "WPHF"])
@pytest.mark.parametrize("plane", [None, 0, 2, 4])
def test_arrays_lie_as_their_axes_say(tmp_path, layout, plane):
    passive = {"where": "recording"} if plane is None else {"where": "plane", "plane": plane}
    camera = described(small_camera(tmp_path, "mlx75027", layout={"axes": layout}, passive=passive))
    frames = flagged(delivered((60e6,)), (2, 0, 1, 5, 7), (0, 0, 0, 0, 0))
    found, written = again(tmp_path, frames, camera)
    with np.load(written.recording) as file:
        sizes = {"F": FRAMES, "P": 4 + (plane is not None), "H": HEIGHT, "W": WIDTH}
        assert file["dcs"].shape == tuple(sizes[letter] for letter in layout)
        assert file["dcs"].dtype == np.int16
        # Planes are those at 0, 180, 90 and 270 degrees.
        planes = file["dcs"].transpose([layout.index(letter) for letter in "FPHW"])
    planes = planes if plane is None else np.delete(planes, plane, axis=1)
    np.testing.assert_array_equal(planes, frames.samples_lsb[:, 0, [0, 2, 1, 3]].numpy())
    assert torch.equal(found.samples_lsb, frames.samples_lsb)
    assert torch.equal(found.gray, frames.gray)
    assert torch.equal(found.saturated_samples, frames.saturated_samples)
    assert found.saturated.nonzero().tolist() == [[0, 0, 0], [2, 5, 7]]


def opposite_planes(name, frames):
    """Planes [F, K, P, H, W] that independent code makes of samples whose opposites cancel."""
    parts = frames.samples_lsb[:, :, :2].numpy()
    return np.stack([ordered(name, *frame.swapaxes(0, 1)) for frame in parts])


def test_wire_frames_are_the_bytes_of_an_independent_writer(tmp_path):
    frames = dataclasses.replace(
        delivered((24e6,)),
        integration_s=(4e-4,) * FRAMES,
        temperature_k=(273.15 + 31.5,) * FRAMES,
    )
    _, written = again(tmp_path, frames, described("epc660_wire"))
    gray = np.rint(frames.gray.numpy() * 4095)
    write_wire(tmp_path / "other.bin", frames.samples_lsb[:, 0].numpy(), gray=gray)
    assert written.recording.read_bytes() == (tmp_path / "other.bin").read_bytes()


@pytest.mark.parametrize("name", ["imx556", "arducam_b0548"])
def test_packed_words_are_the_bytes_of_an_independent_writer(tmp_path, name):
    camera = described(small_camera(tmp_path, name, layout=SMALL))
    frames = delivered(CAMERAS[name][0], opposite=True)
    written = write_camera_recording(tmp_path, "drive", frames, camera)
    planes = opposite_planes(name, frames).astype(np.int64)
    write_raw12(tmp_path / "other.raw", planes, row_bytes=16, trailer=bytes(2 * 16 + 5))
    ours, other = (
        np.frombuffer(path.read_bytes(), np.uint8)
        for path in (written.recording, tmp_path / "other.raw")
    )
    group = 4 * HEIGHT * 16 + 2 * 16 + 5
    ours, other = ours.reshape(-1, group), other.reshape(-1, group)
    # Three bytes hold two pixels; the independent writer fills the rest of a row with 0xAA.
    places = np.arange(group)
    padding = (places < 4 * HEIGHT * 16) & (places % 16 >= WIDTH * 3 // 2)
    np.testing.assert_array_equal(ours[:, ~padding], other[:, ~padding])
    assert not ours[:, padding].any()


def test_logs_of_the_kinect_are_the_bytes_of_an_independent_writer(tmp_path):
    camera = described("kinect_v2")
    frames = delivered((120e6, 80e6, 16e6), size=(424, 512), high=4000, opposite=True, frames=1)
    # A full sample of a frequency fills its three images.
    frames = flagged(frames, (0, 1, 2, 100, 200))
    _, written = again(tmp_path, frames, camera)
    stored = stored_frames(frames, camera).planes
    # Images come at 80, 16 and 120 MHz.
    full = [(0, plane, 100, 200) for plane in range(3)]
    write_kinect(tmp_path / "other.h5", np.where(stored == 32767, 0, stored), saturated=full)
    with h5py.File(written.recording) as ours, h5py.File(tmp_path / "other.h5") as other:
        assert list(ours) == list(other) == ["Frame_0"]
        images = [file["Frame_0/Ir"][()].view(np.uint8).reshape(10, -1) for file in (ours, other)]
    np.testing.assert_array_equal(images[0][:9], images[1][:9])
    # And what is stored is what three phases of these samples are, to a half.
    parts = frames.samples_lsb[0, [1, 2, 0], :2].numpy()
    expected = ordered("kinect_v2", *parts.swapaxes(0, 1)).reshape(9, 424, 512)
    assert np.abs(np.where(stored[0] == 32767, expected, stored[0]) - expected).max() <= 0.501


def test_hdf5_of_espros_has_what_its_maker_tells(tmp_path):
    camera = described("epc660_hdf5")
    frames = with_sample(flagged(delivered((24e6,)), (1, 0, 2, 3, 4)), (0, 0, 1, 2, 3), 2047.0)
    frames = flagged(frames, (0, 0, 1, 2, 3))
    found, written = again(tmp_path, frames, camera)
    with h5py.File(written.recording) as file, h5py.File(written.gray) as gray:
        assert (file.attrs["image_type"], gray.attrs["image_type"]) == ("DCS", "Grayscale")
        assert file.attrs["mod_frequency"] == 24.0
        assert file.attrs["roi"].tolist() == gray.attrs["roi"].tolist() == [0, 0, WIDTH, HEIGHT]
        samples = file["frames_0"][()]
        # The converter overflows at the end of its range; a tap is full within it.
        assert samples[0, 1, 2, 3] == 64002 and samples[1, 2, 3, 4] == 64003
        assert np.count_nonzero(samples > 2047) == 2
        np.testing.assert_array_equal(gray["frames_0"], np.rint(frames.gray.numpy() * 4095))
        np.testing.assert_allclose(file["timestamps"], [0.0, 0.1, 0.2])
    assert torch.equal(found.saturated_samples, frames.saturated_samples)


@pytest.mark.parametrize(
    ("name", "low", "high"), [("imx556", -2048, 2047), ("arducam_b0548", -1024, 1023)]
)
def test_without_a_code_a_full_sample_is_an_end_of_the_range(tmp_path, name, low, high):
    camera = described(small_camera(tmp_path, name, layout=SMALL))
    frames = flagged(delivered(CAMERAS[name][0]), (0, 0, 1, 2, 3), (1, 1, 3, 4, 5))
    frames = with_sample(with_sample(frames, (0, 0, 1, 2, 3), -40.0), (1, 1, 3, 4, 5), 40.0)
    found, _ = again(tmp_path, frames, camera)
    assert torch.equal(found.saturated_samples, frames.saturated_samples)
    assert found.samples_lsb[0, 0, 1, 2, 3] == low and found.samples_lsb[1, 1, 3, 4, 5] == high
    good = ~frames.saturated_samples
    assert torch.equal(found.samples_lsb[good], frames.samples_lsb[good])


def test_of_two_frequencies_a_camera_has_its_own(tmp_path):
    frames = delivered((24e6, 10e6))
    for name, told in (("epc660_wire", (24e6,)), ("mlx75027", (24e6,))):
        found, _ = again(tmp_path, frames, described(name))
        assert found.frequencies_hz == told
        assert torch.equal(found.samples_lsb, frames.samples_lsb[:, :1])
    # In the order of its planes, whichever is higher.
    camera = described(small_camera(tmp_path, "mlx75027", frequencies_hz=[10e6, 24e6]))
    (tmp_path / "two").mkdir()
    found, written = again(tmp_path / "two", frames, camera)
    assert found.frequencies_hz == (24e6, 10e6)
    assert torch.equal(found.samples_lsb, frames.samples_lsb)
    with np.load(written.recording) as file:
        np.testing.assert_array_equal(file["dcs"][:, 0], frames.samples_lsb[:, 1, 0])


def test_two_samples_of_four(tmp_path):
    camera = described(small_camera(tmp_path, "mlx75027", samples={"phase_deg": [90, 0]}))
    frames = delivered((60e6,))
    found, _ = again(tmp_path, frames, camera)
    assert torch.equal(found.samples_lsb, frames.samples_lsb[:, :, :2])


def no_settings(frames):
    return dataclasses.replace(frames, temperature_k=None)


def as_it_is(frames):
    return frames


@pytest.mark.parametrize(
    ("name", "changes", "change", "error"),
    [
        ("imx556", {}, as_it_is, "images are 6 x 8; expected 480 x 640, as imx556 has them"),
        (
            "imx556",
            {"layout": SMALL, "frequencies_hz": [50e6, 20e6]},
            as_it_is,
            "frequencies are 100 and 20 MHz; expected 50 and 20 MHz, as imx556 has them",
        ),
        ("kinect_v2", {}, as_it_is, r"planes of a frame are \(9, 6, 8\); expected \(9, 424, 512\)"),
        ("epc660_wire", {}, no_settings, r"temperature_k is missing; epc660 \(wire\) stores one"),
        (
            "epc660_wire",
            {"layout": {"height": 4}},
            as_it_is,
            r"images are 6 x 8; expected at most 4 x 320, the chip of epc660 \(wire\)",
        ),
        (
            "mlx75027",
            {"layout": {"axes": "PHW"}},
            as_it_is,
            "3 frames; expected one, as layout.axes of mlx75027 is 'PHW'",
        ),
        ("blaze", {}, as_it_is, "blaze is described for simulation; it has no recordings"),
        (
            "imx556",
            {"layout": SMALL, "words": {"ends_overflow": False}},
            lambda frames: flagged(frames, (0, 0, 0, 0, 0)),
            "1 samples are full or overflow; imx556 has no word for it",
        ),
        (
            "kinect_v2_dump",
            {"layout": {"height": 6, "width": 8, "dtype": "<i2"}, "words": {"saturation": [40000]}},
            lambda frames: flagged(frames, (0, 0, 0, 0, 0)),
            "numbers are int32 from -?[0-9]+ to 40000; expected what <i2 of kinect_v2",
        ),
    ],
)
def test_what_a_camera_cannot_hold_is_named(tmp_path, name, changes, change, error):
    camera = described(small_camera(tmp_path, name, **changes))
    frequencies = CAMERAS.get(name, ((120e6, 80e6, 16e6),))[0]
    with pytest.raises(ValueError, match=error):
        again(tmp_path, change(delivered(frequencies)), camera)
    assert not list(tmp_path.glob("drive*"))


def test_nothing_is_written_over(tmp_path):
    camera, frames = described("mlx75027"), delivered((60e6,))
    (tmp_path / "drive.npz").write_text("mine")
    with pytest.raises(ValueError, match=r"drive\.npz is there already; nothing is written over"):
        again(tmp_path, frames, camera)
    assert (tmp_path / "drive.npz").read_text() == "mine"
