"""Packed arrays: light rounded as float16 is, all else exact; damage is named."""

from __future__ import annotations

import struct
import sys
import tracemalloc

import numpy as np
import pytest
import torch
from backports import zstd

from shotenv.bank.files import packed as module
from shotenv.bank.files.folders import bank_folder
from shotenv.bank.files.layout import ARRAYS, BankError, array_file, frame_bytes
from shotenv.bank.files.packed import HEAD, PackedArray, packed
from shotenv.bank.files.store import verify, write_clip, write_manifest
from shotenv.bank.opening import open_bank
from shotenv.config.bank import BankConfig
from shotenv.config.reader import find_config, merged, read_config

FRAMES, HEIGHT, WIDTH = 3, 16, 24
SHAPES = {name: (*spec.channels, HEIGHT, WIDTH) for name, spec in ARRAYS.items()}


@pytest.fixture(scope="module")
def arrays() -> dict[str, np.ndarray]:
    """Light over nine decades, sky, black, and gray of twelve bits."""
    random = np.random.default_rng(0)

    def light(name: str) -> np.ndarray:
        decades = 10.0 ** random.uniform(-9, 0, (FRAMES, *SHAPES[name]))
        return (0.037 * decades).astype(np.float32)

    made = {name: light(name) for name in ("correlation", "active", "ambient")}
    made["correlation"] *= random.choice([-1, 1], made["correlation"].shape).astype(np.float32)
    made["ambient"][1] = 0
    made["distance_m"] = random.uniform(0.1, 90, (FRAMES, *SHAPES["gray"])).astype(np.float32)
    made["distance_m"][:, :2] = np.inf
    made["gray"] = random.integers(0, 4096, (FRAMES, *SHAPES["gray"])).astype(np.uint16)
    return made


def write_bank(folder, config: BankConfig, arrays) -> None:
    per_frame = ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
    records = []
    for number, split in enumerate(("train", "validation", "test")):
        about = {"name": f"c{number}", "family": "garage", "seed": number, "split": split}
        about |= dict.fromkeys(per_frame, [0.0] * FRAMES)
        where = folder / "clips" / f"c{number}"
        moved = {name: np.roll(array, number, axis=0) for name, array in arrays.items()}
        records.append(write_clip(where, moved, about, storage=config.storage))
    write_manifest(folder, config.name, records, (HEIGHT, WIDTH), config)


@pytest.fixture
def config(sensor) -> BankConfig:
    size = {"camera": {"width": WIDTH, "height": HEIGHT}, "world": {"frames_per_clip": FRAMES}}
    return merged(BankConfig(name="small", sensor=sensor), {**size, "storage": "float16"})


@pytest.fixture
def banks(config, arrays, tmp_path):
    """The same bank mapped and packed."""
    folders = tmp_path / "mapped", tmp_path / "packed"
    write_bank(folders[0], merged(config, {"storage": "float32"}), arrays)
    write_bank(folders[1], config, arrays)
    return tuple(open_bank(folder) for folder in folders)


def test_light_is_rounded_to_eleven_bits_and_all_else_is_exact(banks):
    mapped, packed_bank = banks
    rows = torch.tensor([8, 0, 4, 4])  # in any order, of several clips
    for indices in (rows, rows[:1]):
        exact, found = mapped.exposure(indices), packed_bank.exposure(indices)
        assert torch.equal(found.distance_m, exact.distance_m)
        assert torch.equal(packed_bank.distance_m(indices), exact.distance_m)
        assert torch.equal(packed_bank.gray(indices), mapped.gray(indices))
        for name in ("correlation", "active", "ambient"):
            one, other = getattr(exact, name), getattr(found, name)
            assert one.dtype == other.dtype == torch.float32 and one.shape == other.shape
            # Half a unit of the last place; of what is darkest, of its smallest step.
            allowed = one.abs() * 2.0**-11 + float(one.abs().max()) * 2.0**-38
            assert ((one - other).abs() <= allowed).all()
            assert torch.equal(other == 0, one == 0) or name != "ambient"
    assert packed_bank.splits("test") == mapped.splits("test")


def test_frames_are_read_alone_and_may_be_written_to(banks):
    for name in ("distance_m", "gray"):
        read = getattr(banks[1], name)
        frame = read(torch.tensor([2]))
        kept = frame.clone()
        frame.zero_()  # It shares nothing with the file or the next reader.
        assert torch.equal(read(torch.tensor([2])), kept) and kept.any()


def test_any_tool_for_zstandard_reads_the_file(arrays):
    file = b"".join(packed("distance_m", arrays["distance_m"]))
    planes = np.frombuffer(zstd.decompress(file), np.uint8).reshape(FRAMES, 4, -1)
    values = np.ascontiguousarray(planes.transpose(0, 2, 1)).view("<f4")
    assert np.array_equal(values.ravel(), arrays["distance_m"].ravel())


def test_banks_of_before_stay_what_they_are(config):
    """Their folder's name is a digest of the configuration, which had no `storage`."""
    wide = read_config(BankConfig, find_config("bank", "wide"))
    assert wide.storage == "float32" and bank_folder(wide).name == "wide-25502d68"
    assert bank_folder(config) != bank_folder(merged(config, {"storage": "float32"}))
    assert frame_bytes(120, 160) == 883_200 > frame_bytes(120, 160, "float16")


def test_verifying_names_the_packed_file(banks):
    folder = banks[1].folder
    assert verify(folder) == ()
    path = folder / "clips" / "c1" / "active.zst"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(bytes(content))
    assert verify(folder) == ("clips/c1/active.zst",)


def damaged_headers(content: bytes) -> dict[str, bytes]:
    """A packed file whose header says what it should not."""
    ends = HEAD.size
    return {
        "no file": b"",
        "cut off in the header": content[:11],
        "cut off in the index": content[: ends + 5],
        "cut off in the last frame": content[:-1],
        "something behind": content + b"x",
        "another magic": b"\x28" + content[1:],
        "another mark": content[:8] + b"\x80" + content[9:],
        "no frames": content[:16] + struct.pack("<I", 0) + content[20:],
        "four billion frames": content[:16] + b"\xff" * 4 + content[20:],
        "frames more": content[:16] + struct.pack("<I", FRAMES + 1) + content[20:],
        "an exponent beyond": content[:20] + struct.pack("<i", 2**30) + content[24:],
        "a frame before the file": content[:ends] + bytes(8) + content[ends + 8 :],
        "a frame beyond the file": content[:ends] + b"\xff" * 8 + content[ends + 8 :],
    }


@pytest.mark.parametrize("damage", damaged_headers(bytes(100)))
def test_damaged_headers_are_refused_when_the_bank_is_opened(banks, damage):
    folder = banks[1].folder
    path = folder / "clips" / "c0" / "correlation.zst"
    path.write_bytes(damaged_headers(path.read_bytes())[damage])
    with pytest.raises(BankError, match=r"correlation\.zst is missing or damaged .*render"):
        open_bank(folder)
    path.unlink()
    with pytest.raises(BankError, match=r"correlation\.zst is missing or damaged \(no such file"):
        open_bank(folder)


def with_frame(path, frame: bytes) -> None:
    """Put `frame` into a packed file as its only one; the header is sound."""
    ends = struct.pack("<Q", len(frame))
    path.write_bytes(HEAD.pack(0x184D2A50, 24, b"SHOTPACK", 1, 0) + ends + frame)


def windowed(size: int) -> bytes:
    """A frame that asks for a window of 128 MB, and does not say how long it is."""
    options = {
        zstd.CompressionParameter.window_log: 27,
        zstd.CompressionParameter.content_size_flag: 0,
    }
    maker = zstd.ZstdCompressor(options=options)
    return maker.compress(bytes(size)) + maker.flush()


@pytest.mark.parametrize(
    "frame",
    [
        zstd.compress(bytes(10**8)),  # a bomb: 3 kB
        windowed(HEIGHT * WIDTH * 2),
        zstd.compress(bytes(HEIGHT * WIDTH * 2 - 1)),
        zstd.compress(bytes(HEIGHT * WIDTH * 2 + 1)),
        zstd.compress(bytes(HEIGHT * WIDTH * 2))[:-1],
        zstd.compress(bytes(HEIGHT * WIDTH * 2)) + b"x",
        zstd.compress(bytes(HEIGHT * WIDTH)) * 2,
        b"no frame at all",
    ],
    ids=["bomb", "window", "short", "long", "cut off", "more", "two", "none"],
)
def test_frames_that_are_not_a_frame_of_this_shape_are_refused(tmp_path, frame):
    with_frame(tmp_path / "active.zst", frame)
    array = PackedArray(tmp_path / "active.zst", "active", (HEIGHT, WIDTH))
    tracemalloc.start()
    try:
        with pytest.raises(BankError, match=r"frame 0 of .*active\.zst is damaged"):
            array.frame(0)
        assert tracemalloc.get_traced_memory()[1] < 10**6
    finally:
        tracemalloc.stop()


def test_every_flipped_byte_of_a_small_file_is_refused_or_read_as_a_frame(tmp_path, arrays):
    """Whatever is flipped: an error that names the file, or numbers of the right shape."""
    content = b"".join(packed("gray", arrays["gray"][:1]))
    path, refused = tmp_path / "gray.zst", 0
    for place in range(len(content)):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x41]) + content[place + 1 :])
        try:
            found = PackedArray(path, "gray", SHAPES["gray"]).frame(0)
            assert found.shape == SHAPES["gray"] and found.dtype == torch.uint16
        except BankError as error:
            assert "gray.zst" in str(error), place
            refused += 1
    assert refused > HEAD.size - 4  # all of the header but the exponent's low bytes


def test_infinite_light_is_refused(arrays):
    light = arrays["active"].copy()
    light[0, 0, 0] = np.inf
    with pytest.raises(BankError, match="active holds infinite light"):
        list(packed("active", light))


def test_black_and_tiny_light_are_kept(tmp_path):
    for light in (np.zeros((2, 4, 4)), np.full((2, 4, 4), 1e-38), np.full((2, 4, 4), 3e38)):
        path = tmp_path / "active.zst"
        path.write_bytes(b"".join(packed("active", light.astype(np.float32))))
        found = PackedArray(path, "active", (4, 4)).frame(1).numpy()
        assert np.allclose(found, light[1].astype(np.float32), rtol=2.0**-11, atol=0)


def test_without_the_package_it_is_one_sentence(monkeypatch, arrays):
    module._zstd.cache_clear()
    monkeypatch.setitem(sys.modules, "backports", None)
    monkeypatch.setitem(sys.modules, "compression", None)
    with pytest.raises(BankError, match=r"storage: float16.*pip install 'shotenv\[scale\]'"):
        list(packed("gray", arrays["gray"]))


def test_names_of_files():
    assert array_file("gray", "float32") == "gray.npy"
    assert array_file("gray", "float16") == "gray.zst"
