import json

import numpy as np
import pytest
import torch
from unwrap_bank import FRAMES, HEIGHT, WIDTH, write_bank

from unwrap.data import Augmentation, BankFrames, EpochShuffle

STILL = Augmentation(flip_horizontal=False, flip_vertical=False, contrast=0, brightness=0)


@pytest.fixture
def bank(tmp_path):
    return write_bank(tmp_path / "bank", train=2)


def ramp():
    gray = torch.linspace(0, 0.5, 8 * 4 * 6).reshape(8, 1, 4, 6)
    return gray, 10 * gray[:, 0]


def test_frames_of_a_split(bank):
    frames = BankFrames(bank, "train", 30.0)
    gray, depth_m = frames[3]
    stored = np.load(bank / "clips/train-1/gray.npy")[1]
    assert len(frames) == len(frames.families) == 2 * FRAMES
    assert gray.shape == (1, HEIGHT, WIDTH)
    assert gray.dtype == depth_m.dtype == torch.float32
    np.testing.assert_allclose(gray[0].numpy() * 4095, stored, atol=1e-3)


def test_sky_counts_as_the_largest_depth(bank):
    _, depth_m = BankFrames(bank, "test", 30.0)[0]
    assert (depth_m[:4] == 30).all()
    assert (BankFrames(bank, "test", 5.0)[0][1] <= 5).all()


def test_unknown_split_is_named(bank):
    with pytest.raises(ValueError, match="'holdout'"):
        BankFrames(bank, "holdout", 30.0)


def test_missing_manifest_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"manifest\.json"):
        BankFrames(tmp_path, "train", 30.0)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"clips": [{"name": "a"}]}', '{"clips": 3}'])
def test_damaged_manifest_is_named(bank, text):
    (bank / "manifest.json").write_text(text)
    with pytest.raises(ValueError, match=r"manifest\.json"):
        BankFrames(bank, "train", 30.0)


def test_clip_outside_the_bank_is_refused(bank):
    manifest = json.loads((bank / "manifest.json").read_text())
    manifest["clips"][0]["folder"] = "../elsewhere"
    (bank / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(ValueError, match="outside the bank"):
        BankFrames(bank, "train", 30.0)


@pytest.mark.parametrize("damage", ["missing", "truncated", "pickled", "shape", "type"])
def test_damaged_array_is_named(bank, damage):
    path = bank / "clips/train-0/gray.npy"
    array = np.load(path)
    content = path.read_bytes()
    path.unlink()
    if damage == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "pickled":
        np.save(path, np.array([{}], dtype=object), allow_pickle=True)
    elif damage == "shape":
        np.save(path, array[0])
    elif damage == "type":
        np.save(path, array.astype(np.int32))
    with pytest.raises(ValueError, match=r"gray\.npy"):
        BankFrames(bank, "train", 30.0)


def test_augmentation_without_effects_changes_nothing():
    gray, depth_m = ramp()
    varied = STILL(gray, depth_m, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(varied[0], gray)
    torch.testing.assert_close(varied[1], depth_m)


@pytest.mark.parametrize(("which", "axis"), [("flip_horizontal", -1), ("flip_vertical", -2)])
def test_gray_and_depth_are_mirrored_together_in_about_half_the_images(which, axis):
    gray, depth_m = ramp()
    flags = {"flip_horizontal": False, "flip_vertical": False, which: True}
    augment = Augmentation(**flags, contrast=0, brightness=0)
    new_gray, new_depth_m = augment(gray, depth_m, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(new_depth_m, 10 * new_gray[:, 0])
    mirrored = [
        torch.allclose(new, old.flip(axis)) for new, old in zip(new_gray, gray, strict=True)
    ]
    kept = [torch.allclose(new, old) for new, old in zip(new_gray, gray, strict=True)]
    assert all(m != k for m, k in zip(mirrored, kept, strict=True))
    assert 0 < sum(mirrored) < len(gray)


def test_contrast_and_brightness_stay_within_their_limits():
    gray = torch.full((500, 1, 2, 2), 0.25)
    augment = Augmentation(flip_horizontal=False, contrast=0.5, brightness=0.2)
    new, _ = augment(gray, gray[:, 0], generator=torch.Generator().manual_seed(0))
    assert new.min() >= 0.25**1.5 / 1.2 - 1e-6
    assert new.max() <= 0.25 ** (1 / 1.5) * 1.2 + 1e-6
    assert new.std() > 0.02


def test_augmentation_depends_on_the_generator_alone():
    gray, depth_m = ramp()
    draws = [
        Augmentation()(gray, depth_m, generator=torch.Generator().manual_seed(s)) for s in (1, 1, 2)
    ]
    assert torch.equal(draws[0][0], draws[1][0])
    assert not torch.equal(draws[0][0], draws[2][0])


def test_order_depends_on_seed_and_epoch_alone():
    sampler = EpochShuffle(50, seed=3)
    first = list(sampler)
    assert sorted(first) == list(range(50)) != first
    sampler.set_epoch(1)
    assert list(sampler) != first
    sampler.set_epoch(0)
    assert list(sampler) == first
