"""Arrays to recordings: what is understood, and what is refused by name."""

import io
import pickle
import zipfile

import numpy as np
import pytest
import torch

from unwrap.recordings.recording import (
    ARRAYS,
    NoUsablePixelError,
    read_recording,
    recording_of,
    with_gray,
)
from unwrap.support import array_files as arrays_module
from unwrap.support.array_files import read_arrays

WORDS = np.random.default_rng(0).integers(1, 4095, (4, 6, 8)).astype(np.uint16)
GRAY = np.random.default_rng(1).integers(0, 4096, (6, 8)).astype(np.uint16)


class Canary:
    def __reduce__(self):
        return exec, ("raise SystemExit('unpickled')",)


def npy(array):
    content = io.BytesIO()
    np.save(content, array, allow_pickle=True)
    return content.getvalue()


def header(text):
    padded = text + " " * (117 - len(text)) + "\n"
    return b"\x93NUMPY\x01\x00" + len(padded).to_bytes(2, "little") + padded.encode()


def test_words_and_samples_are_the_same_recording():
    words = recording_of({"dcs": WORDS}, "x")
    signed = WORDS.astype(np.int16) - 2048
    for samples in (signed, signed.astype(np.float32), signed.astype(">f8"), signed.astype(">i4")):
        found = recording_of({"dcs": samples}, "x")
        assert torch.equal(found.raw.dcs_lsb, words.raw.dcs_lsb)
        assert torch.equal(found.raw.saturated, words.raw.saturated)
    assert words.raw.dcs_lsb.dtype == torch.float32 and words.names == ("",)


def test_what_overflows_or_is_flagged_is_saturated():
    words, flags = WORDS.copy(), np.zeros((6, 8), dtype=bool)
    words[0, 0, 0], words[3, 0, 1], flags[0, 2] = 0, 4095, True
    samples = words.astype(np.float32) - 2048
    for dcs in (words, samples):
        found = recording_of({"dcs": dcs, "saturated": flags}, "x").raw.saturated[0]
        assert found.nonzero().tolist() == [[0, 0], [0, 1], [0, 2]]


def test_npz_of_several_frames_comes_back(tmp_path):
    dcs = np.stack([WORDS, WORDS[::-1]])
    gray, offset = np.stack([GRAY, GRAY[::-1]]), np.linspace(-9, 9, 48).reshape(6, 8)
    np.savez_compressed(tmp_path / "two.npz", dcs=dcs, gray=gray, offset_lsb=offset)
    found = read_recording(tmp_path / "two.npz")
    assert found.names == ("00000", "00001")
    np.testing.assert_array_equal(found.raw.dcs_lsb.numpy(), dcs.astype(np.float32) - 2048)
    np.testing.assert_allclose(found.gray.numpy() * 4095, gray, atol=1e-3)
    np.testing.assert_allclose(found.offset_lsb.numpy(), offset, rtol=1e-6)
    second = found.frame(1)
    assert second.names == ("00001",) and torch.equal(second.gray, found.gray[1:])


def test_npy_in_any_order_of_axes_in_memory(tmp_path):
    np.save(tmp_path / "a.npy", np.asfortranarray(WORDS))
    found = read_recording(tmp_path / "a.npy")
    np.testing.assert_array_equal(found.raw.dcs_lsb[0].numpy(), WORDS.astype(np.float32) - 2048)
    assert found.gray is None and found.offset_lsb is None


def test_gray_words_are_those_the_networks_know():
    found = recording_of({"dcs": WORDS, "gray": GRAY}, "x").gray
    assert torch.equal(found[0], torch.from_numpy(GRAY).float() / 4095)
    fractions = recording_of({"dcs": WORDS, "gray": found[0].numpy()}, "x").gray
    assert torch.equal(fractions, found)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"dcs": WORDS[:3]}, "dcs has shape"),
        ({"dcs": WORDS[0]}, "dcs has shape"),
        ({"dcs": WORDS[:, :0]}, "dcs has shape"),
        ({"dcs": WORDS.astype(np.uint8)}, "dcs is uint8"),
        ({"dcs": WORDS > 9}, "dcs is bool"),
        ({"dcs": WORDS.astype(complex)}, "dcs is complex128"),
        ({"dcs": WORDS.astype(np.int16)}, "or words as unsigned integers"),
        ({"dcs": WORDS * np.uint16(16)}, "expected 12 bits"),
        ({"dcs": WORDS.astype(np.uint64) + 2**40}, "expected 12 bits"),
        ({"dcs": np.full((2, 3, 4), np.nan)}, r"dcs holds NaN or infinity at \[0, 0, 0, 0\]"),
        ({"gray": GRAY[:5]}, "gray has shape"),
        ({"gray": GRAY.astype(np.uint8)}, "gray is uint8"),
        ({"gray": GRAY.astype(float)}, r"outside 0\.\.1"),
        ({"gray": np.full((6, 8), np.nan)}, "gray holds NaN"),
        ({"gray": np.full((6, 8), 4096, np.uint16)}, r"outside 0\.\.4095"),
        ({"offset_lsb": np.zeros((5, 8))}, "offset_lsb is float64"),
        ({"offset_lsb": GRAY}, "offset_lsb is uint16"),
        ({"offset_lsb": np.full((6, 8), np.inf)}, "offset_lsb holds NaN or inf"),
        ({"saturated": GRAY}, "saturated is uint16"),
        ({"saturated": np.zeros((2, 6, 8), bool)}, "saturated has shape"),
    ],
)
def test_arrays_that_do_not_fit_are_named(change, says):
    with pytest.raises(ValueError, match=f"^here: .*{says}"):
        recording_of({"dcs": WORDS, **change}, "here")


def test_a_recording_without_samples_is_refused():
    with pytest.raises(ValueError, match="dcs is missing"):
        recording_of({"gray": GRAY}, "here")


def test_a_frame_of_saturated_pixels_alone_is_an_error_of_its_own():
    dcs = np.stack([WORDS, np.full_like(WORDS, 4095)])
    with pytest.raises(NoUsablePixelError, match="no usable pixel in frame 00001: all 48"):
        recording_of({"dcs": dcs}, "here")


def test_gray_images_of_another_file_are_checked_as_well():
    recording = recording_of({"dcs": WORDS}, "here")
    assert torch.equal(
        with_gray(recording, GRAY, "there").gray[0], torch.from_numpy(GRAY).float() / 4095
    )
    with pytest.raises(ValueError, match=r"^there: gray has shape"):
        with_gray(recording, GRAY.T, "there")


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (npy(np.array([Canary()], dtype=object)), "pickled"),
        (pickle.dumps(Canary()), "magic"),
        (b"", "magic|EOF"),
        (npy(WORDS)[:-3], "promises"),
        (npy(WORDS)[:40], "header|EOF"),
        (npy(WORDS) + b"more", "promises"),
        (header("{'descr': '<u2', 'fortran_order': False, 'shape': (9999999, 9999999)}"), "promis"),
        (header("{'descr': '<u2', 'fortran_order': False, 'shape': (-1, 4)}"), "promises"),
        (header("{'descr': '<u2', 'fortran_order': False, 'shape': 2 ** 9}"), "malformed"),
        (header("{'descr': '<u2', 'fortran_order': False, 'shape': (4, 6, 8)"), "malformed"),
        (header("__import__('os').abort()"), "malformed"),
        (b"\x93NUMPY\x01\x00" + (60000).to_bytes(2, "little") + b"(" * 60000, "malformed|large"),
        (b"\x93NUMPY\x03\x00" + bytes(90), "version"),
    ],
)
def test_damaged_arrays_are_named_and_never_unpickled(tmp_path, content, says):
    path = tmp_path / "a.npy"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=rf"a\.npy: .*({says})"):
        read_recording(path)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("dcs.npy", content)
    with pytest.raises(ValueError, match=rf"a\.npz: .*({says})"):
        read_recording(tmp_path / "a.npz")


def test_damaged_archives_are_named(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, dcs=WORDS)
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[80] ^= 255
    for content in (whole[:-30], bytes(flipped), b"PK" + bytes(60)):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"a\.npz"):
            read_recording(path)


def test_unknown_names_are_refused_since_they_may_be_misspelt(tmp_path):
    np.savez(tmp_path / "a.npz", dcs=WORDS, grey=GRAY)
    with pytest.raises(ValueError, match=r"holds 'grey'; expected some of dcs, gray"):
        read_recording(tmp_path / "a.npz")


def test_files_that_are_too_large_are_not_read(tmp_path, monkeypatch):
    np.save(tmp_path / "a.npy", np.zeros((4, 600, 600), np.uint16))
    np.savez_compressed(tmp_path / "a.npz", dcs=np.zeros((4, 600, 600), np.uint16))
    monkeypatch.setattr(arrays_module, "MAX_BYTES", 1 << 20)
    with pytest.raises(ValueError, match=r"a\.npy: 2880128 bytes; expected at most 1048576"):
        read_recording(tmp_path / "a.npy")
    with pytest.raises(ValueError, match=r"a\.npz: unpacks to more than 1 MiB"):
        read_recording(tmp_path / "a.npz")


def test_other_files_are_refused(tmp_path):
    (tmp_path / "a.txt").write_text("1 2 3")
    with pytest.raises(ValueError, match=r"a\.txt: expected an \.npy or \.npz file"):
        read_arrays(tmp_path / "a.txt", "dcs", ARRAYS)
    with pytest.raises(ValueError, match=r"absent\.npy: no such file"):
        read_arrays(tmp_path / "absent.npy", "dcs", ARRAYS)
