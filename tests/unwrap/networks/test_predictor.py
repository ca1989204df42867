"""Networks from files: what they predict, and which files are refused."""

import pickle

import pytest
import torch
from raw_frames import RANGE_M
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from unwrap.networks.predictor import FRAMES_AT_ONCE, SHIPPED, label_of, load_unwrapper
from unwrap.networks.tofregnet import TofRegNet
from unwrap.networks.tofsegnet import TofSegNet
from unwrap.networks.weight_files import save_weights


def metadata(name, **changes):
    base = {"network": name, "width": 4, "classes": 5, "range_m": 30.0, "f1_hz": 24e6}
    return base | {"bank": "none", "config": {}} | changes


@pytest.fixture(params=["tofregnet", "tofsegnet"])
def path(request, tmp_path):
    torch.manual_seed(0)
    network = TofRegNet(4) if request.param == "tofregnet" else TofSegNet(4)
    path = tmp_path / f"{request.param}.safetensors"
    save_weights(path, network, metadata(request.param))
    return path


@pytest.mark.parametrize("name", ["tofregnet", "tofsegnet", "toffusionnet"])
def test_shipped_networks_are_small_and_say_what_they_are(name):
    unwrapper = load_unwrapper(name)
    assert unwrapper.name == name
    assert (SHIPPED / f"{name}.safetensors").stat().st_size <= 8e6
    assert unwrapper.metadata["f1_hz"] == 24e6


def test_equal_networks_are_equal_files(path):
    one, content = load_unwrapper(path), path.read_bytes()
    for _ in range(5):  # The library orders six words by chance.
        save_weights(path, one.network, metadata(one.name))
        assert path.read_bytes() == content
    assert load_unwrapper(path).metadata == one.metadata


def test_a_label_tells_the_weights_without_loading_them(path, monkeypatch):
    unwrapper = load_unwrapper(path)
    monkeypatch.setattr("unwrap.networks.predictor.load_weights", None)
    label = label_of(path)
    assert (label.network, label.fingerprint) == (unwrapper.name, unwrapper.fingerprint)


@pytest.mark.parametrize("content", [None, b"no weights", b""])
def test_a_label_of_what_is_no_network_is_refused(tmp_path, content):
    path = tmp_path / "odd.safetensors"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=r"odd\.safetensors: unusable network file"):
        label_of(path)


def test_prediction_is_that_of_the_network(path):
    unwrapper = load_unwrapper(path)
    gray = torch.rand(3, 40, 50)
    prediction = unwrapper.predict(gray)
    assert prediction.distance_m.shape == prediction.confidence.shape == gray.shape
    assert prediction.distance_m.dtype == torch.float32
    assert 0 <= prediction.confidence.min() <= prediction.confidence.max() <= 1
    with torch.inference_mode():
        output = unwrapper.network(gray[:, None])
    # What predicts is fused or compiled, and maybe in bfloat16: it is near, not equal.
    if unwrapper.name == "tofregnet":
        assert (prediction.distance_m - output).abs().mean() < 0.1
    else:
        likeliest = (prediction.distance_m / RANGE_M).long()
        assert (likeliest == output.argmax(1)).float().mean() > 0.95


def test_prediction_does_not_depend_on_the_batch(path):
    unwrapper = load_unwrapper(path)
    gray = torch.rand(3, 32, 32)
    together = unwrapper.predict(gray).distance_m
    alone = torch.cat([unwrapper.predict(image[None]).distance_m for image in gray])
    assert torch.equal(together, alone)


def test_many_frames_at_once_give_what_one_by_one_gives(path, monkeypatch):
    unwrapper, gray = load_unwrapper(path), torch.rand(5, 64, 96)
    alone = unwrapper.predict(gray)
    monkeypatch.setitem(FRAMES_AT_ONCE, "cpu", 2)
    at_once = unwrapper.predict(gray)
    assert at_once.distance_m.shape == at_once.confidence.shape == gray.shape
    # Arithmetic in bfloat16 may round another way; an untrained class may then be another.
    assert ((at_once.distance_m - alone.distance_m).abs() < 0.1).float().mean() > 0.95


def test_words_and_fractions_give_the_same(path):
    unwrapper = load_unwrapper(path)
    words = torch.randint(0, 4096, (1, 32, 32)).to(torch.uint16)
    fractions = words.float() / 4095
    assert torch.equal(unwrapper.predict(words).distance_m, unwrapper.predict(fractions).distance_m)


@pytest.mark.parametrize(
    "gray",
    [
        torch.zeros(8, 8),
        torch.zeros(0, 8, 8),
        torch.zeros(1, 8, 8).int(),
        torch.full((1, 8, 8), 2.0),
        torch.full((1, 8, 8), -0.1),
        torch.full((1, 8, 8), torch.nan),
        torch.full((1, 8, 8), 5000).to(torch.uint16),
    ],
)
def test_predict_refuses_other_images(path, gray):
    with pytest.raises(ValueError, match="gray"):
        load_unwrapper(path).predict(gray)


def test_macs_of_the_stem_and_growth_with_the_image(path):
    unwrapper = load_unwrapper(path)
    assert unwrapper.macs(64, 64) == 4 * unwrapper.macs(32, 32)
    assert unwrapper.macs(33, 32) == unwrapper.macs(64, 32)
    assert unwrapper.macs(32, 32) > 16 * 16 * 3 * 49 * 4


def test_fingerprint_follows_the_weights(path):
    one = load_unwrapper(path)
    assert load_unwrapper(path).fingerprint == one.fingerprint
    with torch.no_grad():
        one.network.head.bias.add_(1)
    save_weights(path, one.network, metadata(one.name))
    assert load_unwrapper(path).fingerprint != one.fingerprint


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"absent\.safetensors.*no such file"):
        load_unwrapper(tmp_path / "absent.safetensors")


class Canary:
    def __reduce__(self):
        return exec, ("raise SystemExit('unpickled')",)


@pytest.mark.parametrize("damage", ["empty", "truncated", "flipped", "pickled", "torch", "header"])
def test_damaged_file_is_named_and_never_unpickled(path, damage):
    content = bytearray(path.read_bytes())
    if damage == "flipped":
        content[-100] ^= 1
    elif damage == "header":
        content[:8] = (2**60).to_bytes(8, "little")
    replaced = {
        "empty": b"",
        "truncated": bytes(content[:-50]),
        "pickled": pickle.dumps(Canary()),
    }
    path.write_bytes(replaced.get(damage, bytes(content)))
    if damage == "torch":
        torch.save({"weights": torch.zeros(3)}, path)
    with pytest.raises(ValueError, match=rf"{path.name}: unusable network file .*train it again"):
        load_unwrapper(path)


@pytest.mark.parametrize(
    "change",
    [
        {"width": "8"},
        {"width": "10000000"},
        {"network": "other"},
        {"schema": "99"},
        {"sha256": "0"},
    ],
)
def test_metadata_that_does_not_fit_is_refused(path, change):
    with safe_open(path, framework="pt") as file:
        words = file.metadata() | change
    save_file(load_file(path), path, words)
    with pytest.raises(ValueError, match=path.name):
        load_unwrapper(path)


def test_safetensors_of_something_else_is_refused(tmp_path):
    save_file({"a": torch.zeros(2)}, tmp_path / "a.safetensors")
    with pytest.raises(ValueError, match=r"a\.safetensors.*schema"):
        load_unwrapper(tmp_path / "a.safetensors")
