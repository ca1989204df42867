"""The bank: what is written is read back, damage is named, nothing is overwritten."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
import torch

from shotenv.bank.clip_arrays import MappedClips
from shotenv.bank.files.layout import ARRAYS, BankError, frame_bytes
from shotenv.bank.files.store import read_clip_record, verify, write_clip, write_manifest
from shotenv.bank.opening import open_bank

FRAMES, HEIGHT, WIDTH = 3, 6, 8


def clip_arrays(seed: int) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    arrays = {
        name: random.random((FRAMES, *spec.channels, HEIGHT, WIDTH)).astype(spec.dtype)
        for name, spec in ARRAYS.items()
    }
    arrays["gray"] = random.integers(0, 4096, (FRAMES, HEIGHT, WIDTH)).astype(np.uint16)
    return arrays


def clip_metadata(
    name: str, seed: int, split: str = "train", family: str = "garage"
) -> dict[str, object]:
    per_frame = [float(number) for number in range(FRAMES)]
    keys = ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
    return {"name": name, "family": family, "seed": seed, "split": split} | dict.fromkeys(
        keys, per_frame
    )


def write_small_bank(folder, splits):
    records = [
        write_clip(folder / "clips" / f"c{i}", clip_arrays(i), clip_metadata(f"c{i}", i, split))
        for i, split in enumerate(splits)
    ]
    write_manifest(folder, "small", records, (HEIGHT, WIDTH))
    return folder


@pytest.fixture
def bank_folder(tmp_path):
    return write_small_bank(tmp_path, ("train", "train", "test"))


@pytest.fixture
def shifted_bank(tmp_path):
    return write_small_bank(tmp_path, ("train", "train", "train", "test", "shift"))


def test_what_is_written_is_read_back(bank_folder):
    bank = open_bank(bank_folder)
    assert len(bank) == 3 * FRAMES
    index = FRAMES + 1
    expected = clip_arrays(1)
    frame = bank.frame(index)
    for name in ARRAYS:
        found = frame.gray if name == "gray" else getattr(frame.exposure, name)[0]
        np.testing.assert_array_equal(found.numpy(), expected[name][1])
    assert frame.clip.name == "c1"
    assert frame.time_s == 1.0


def test_a_batch_holds_the_single_frames(bank_folder):
    bank = open_bank(bank_folder)
    indices = torch.tensor([5, 0, 8])
    batch = bank.exposure(indices)
    for row, index in enumerate(indices.tolist()):
        single = bank.frame(index).exposure
        assert torch.equal(batch.correlation[row], single.correlation[0])
        assert torch.equal(batch.distance_m[row], single.distance_m[0])


def test_frame_bytes_is_what_a_frame_takes(bank_folder):
    sizes = sum(path.stat().st_size for path in (bank_folder / "clips" / "c0").glob("*.npy"))
    header = 128 * len(ARRAYS)
    assert sizes == FRAMES * frame_bytes(HEIGHT, WIDTH) + header


def test_only_so_many_clips_are_mapped_at_a_time(bank_folder):
    folders = [bank_folder / "clips" / f"c{number}" for number in range(3)]
    clips = MappedClips(folders, most=2)
    first, second = clips[0], clips[1]
    assert clips[0] is first and clips[1] is second and clips[0] is first
    clips[2]  # closes the second, which is unused for longest
    assert clips[0] is first
    again = clips[1]
    assert again is not second
    assert all(torch.equal(again[name], second[name]) for name in ARRAYS)


def test_pickle_opens_the_same_bank(bank_folder):
    bank = open_bank(bank_folder)
    again = pickle.loads(pickle.dumps(bank))
    assert again.fingerprint == bank.fingerprint


def test_splits(bank_folder):
    bank = open_bank(bank_folder)
    assert [clip.name for clip in bank.splits("test")] == ["c2"]
    assert len(bank.splits("all")) == 3
    with pytest.raises(BankError, match=r"'validation', but bank .* only has train, test; choose"):
        bank.splits("validation")


def test_all_leaves_the_shift_split_out(shifted_bank):
    bank = open_bank(shifted_bank)
    assert [clip.split for clip in bank.splits("all")] == ["train"] * 3 + ["test"]
    assert [clip.name for clip in bank.splits("shift")] == ["c4"]
    assert bank.frames("shift").tolist() == list(range(4 * FRAMES, 5 * FRAMES))


def test_clutter_is_in_the_train_split_alone(tmp_path):
    kinds = [("train", "garage")] * 3 + [("test", "garage"), ("train", "clutter")]
    records = [
        write_clip(tmp_path / "clips" / f"c{i}", clip_arrays(i), clip_metadata(f"c{i}", i, *kind))
        for i, kind in enumerate(kinds)
    ]
    write_manifest(tmp_path, "cluttered", records, (HEIGHT, WIDTH))
    bank = open_bank(tmp_path)
    found = {"train": ["garage"] * 3 + ["clutter"], "test": ["garage"], "all": ["garage"] * 4}
    for split, families in found.items():
        assert [clip.family for clip in bank.splits(split)] == families
    # The random split would deal it to its test part as well.
    dealt = [bank.frames(part, by="frame") for part in ("train", "validation", "test")]
    assert sorted(torch.cat(dealt).tolist()) == list(range(4 * FRAMES))


def test_a_bank_without_shift_clips_says_so(bank_folder):
    with pytest.raises(BankError, match=r"'shift', but bank .* only has train, test"):
        open_bank(bank_folder).splits("shift")


def test_frames_by_clip_are_those_of_the_clips(bank_folder):
    bank = open_bank(bank_folder)
    assert bank.frames("train").tolist() == list(range(2 * FRAMES))
    assert bank.frames("test").tolist() == list(range(2 * FRAMES, 3 * FRAMES))


def test_frames_by_frame_are_dealt_at_random_without_the_shift(shifted_bank):
    bank = open_bank(shifted_bank)
    parts = {name: bank.frames(name, by="frame") for name in ("train", "validation", "test")}
    assert [len(part) for part in parts.values()] == [10, 1, 1]
    assert sorted(torch.cat(list(parts.values())).tolist()) == list(range(4 * FRAMES))
    assert torch.equal(bank.frames("train", by="frame"), parts["train"])
    assert bank.frames("train", by="frame", seed=1).tolist() != parts["train"].tolist()
    with pytest.raises(BankError, match="'shift'; by frame"):
        bank.frames("shift", by="frame")


@pytest.mark.parametrize("index", [-1, 9])
def test_index_outside_is_refused(bank_folder, index):
    with pytest.raises(IndexError, match=r"expected 0\.\.8"):
        open_bank(bank_folder).frame(index)


def test_writing_to_a_bank_array_leaves_the_file_alone(bank_folder):
    bank = open_bank(bank_folder)
    bank.exposure(torch.tensor([0])).active.zero_()
    assert verify(bank_folder) == ()


def test_flipped_bit_is_found_by_verify(bank_folder):
    path = bank_folder / "clips" / "c1" / "active.npy"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    assert verify(bank_folder) == ("clips/c1/active.npy",)


def damage_truncate(folder):
    path = folder / "clips" / "c0" / "ambient.npy"
    path.write_bytes(path.read_bytes()[:-8])
    return "ambient.npy"


def damage_missing(folder):
    (folder / "clips" / "c2" / "gray.npy").unlink()
    return "gray.npy"


def damage_pickle(folder):
    array = np.array([{"never": "unpickled"}], dtype=object)
    np.save(folder / "clips" / "c0" / "active.npy", array, allow_pickle=True)
    return "active.npy"


def damage_json(folder):
    (folder / "manifest.json").write_text('{"schema_version": 1, ')
    return "manifest.json"


def damage_traversal(folder):
    content = json.loads((folder / "manifest.json").read_text())
    content["clips"][0]["folder"] = "clips/../../elsewhere"
    del content["digest"]
    (folder / "manifest.json").write_text(json.dumps(content))
    return "manifest.json"


def damage_schema(folder):
    content = json.loads((folder / "manifest.json").read_text())
    content["schema_version"] = 99
    del content["digest"]
    (folder / "manifest.json").write_text(json.dumps(content))
    return "schema_version"


def header_of(path) -> tuple[int, bytes]:
    """Where the text of an array file's header begins, and the text."""
    content = path.read_bytes()
    length = int.from_bytes(content[8:10], "little")
    return 10, content[10 : 10 + length]


def write_header(path, text: bytes) -> None:
    begin, before = header_of(path)
    content = path.read_bytes()
    padded = text.ljust(len(before) - 1)[: len(before) - 1] + b"\n"
    path.write_bytes(content[:begin] + padded + content[begin + len(before) :])


def damage_bracket(folder):
    path = folder / "clips" / "c1" / "correlation.npy"
    write_header(path, header_of(path)[1].replace(b")", b" "))
    return "correlation.npy"


def damage_keys(folder):
    path = folder / "clips" / "c1" / "gray.npy"
    write_header(path, b"{1: 2, 'shape': (3,)}")
    return "gray.npy"


def damage_brackets(folder):
    path = folder / "clips" / "c1" / "gray.npy"
    write_header(path, b"(" * 1000)
    return "gray.npy"


@pytest.mark.parametrize(
    "damage",
    [
        damage_truncate,
        damage_missing,
        damage_bracket,
        damage_brackets,
        damage_keys,
        damage_pickle,
        damage_json,
        damage_traversal,
        damage_schema,
    ],
)
def test_damaged_bank_is_refused_with_the_file_named(bank_folder, damage):
    name = damage(bank_folder)
    with pytest.raises(BankError, match=name) as refused:
        open_bank(bank_folder)
    if name.endswith(".npy"):
        assert "and render the bank again" in str(refused.value)


@pytest.mark.filterwarnings("ignore:Reading `.npy`:UserWarning")
def test_whatever_happens_to_a_header_the_bank_opens_or_names_the_file(bank_folder):
    path = bank_folder / "clips" / "c1" / "active.npy"
    begin, header = header_of(path)
    sound, random = path.read_bytes(), np.random.default_rng(0)
    refused = 0
    for _ in range(600):
        content = bytearray(sound)
        for place in random.integers(0, begin + len(header.rstrip()), random.integers(1, 4)):
            content[place] = random.choice(list(b"()[]{}'\",:0 \n\\#L\0\xff"))
        path.write_bytes(content)
        try:
            open_bank(bank_folder)
        except BankError as error:
            assert "active.npy" in str(error)
            refused += 1
    assert refused > 500


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("active", lambda a: a.astype(np.float64), "active is float64"),
        ("active", lambda a: a[:, :-1], "active is float32"),
        ("ambient", lambda a: np.where(a > 0.5, np.nan, a), "ambient holds NaN"),
    ],
)
def test_wrong_array_is_refused_and_nothing_is_left(tmp_path, name, change, message):
    arrays = clip_arrays(0)
    arrays[name] = change(arrays[name])
    with pytest.raises(BankError, match=message):
        write_clip(tmp_path / "clips" / "c", arrays, clip_metadata("c", 0))
    assert not list(tmp_path.rglob("*.npy"))


# NumPy's error, the second, has a message and no number.
@pytest.mark.parametrize(
    "told", [(28, "No space left on device"), ("7680 requested and 0 written",)]
)
def test_full_disk_leaves_nothing_behind(tmp_path, monkeypatch, told):
    def no_space(descriptor):
        raise OSError(*told)

    monkeypatch.setattr("shotenv.bank.files.store.os.fsync", no_space)
    with pytest.raises(BankError, match=told[-1]):
        write_clip(tmp_path / "clips" / "c", clip_arrays(0), clip_metadata("c", 0))
    assert not list(tmp_path.rglob("*.npy"))


def test_unfinished_clip_has_no_record(tmp_path):
    assert read_clip_record(tmp_path / "nothing") is None


def test_unknown_bank_names_the_known_ones():
    with pytest.raises(BankError, match="starter"):
        open_bank("no-such-bank")
