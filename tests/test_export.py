"""`shotenv unwrap export`: ONNX files equal torch, and stand only where they do."""

import dataclasses
import json

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from agents import exporting
from agents.cli import main
from agents.export_frames import choose_bank, export_frames
from agents.onnx_files import Exported
from shotenv.bank import BankError, open_bank
from unwrap.correction import SensorDescription
from unwrap.merge import merge_nearest, merge_segmentation
from unwrap.nets import TofSegNet
from unwrap.network import Settings
from unwrap.unwrapper import load_unwrapper
from unwrap.weights import save_weights
from unwrap.zoo import build

HEIGHT, WIDTH = 48, 64
UNAMBIGUOUS_M = 299_792_458.0 / 48e6


def export(*words):
    return main(["unwrap", "export", *map(str, words), "--height", "48", "--width", "64"])


def images(count, seed=0):
    """Gray images and wrapped maps that the export has never seen."""
    random = np.random.default_rng(seed)
    gray = random.integers(0, 4096, (count, HEIGHT, WIDTH)).astype(np.uint16)
    wrapped_m = random.uniform(0, UNAMBIGUOUS_M, gray.shape).astype(np.float32)
    return gray, wrapped_m


def run(path, gray, wrapped_m):
    """Outputs by name, each [N, H, W]."""
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    frames = [
        session.run(None, {"gray": gray[i : i + 1], "wrapped_m": wrapped_m[i : i + 1]})
        for i in range(len(gray))
    ]
    maps = map(np.concatenate, zip(*frames, strict=True))
    return dict(zip((output.name for output in session.get_outputs()), maps, strict=True))


@pytest.fixture(scope="module")
def written(tmp_path_factory, tiny_bank, tiny_unwrapper):
    """Folder of a TofRegNet's files: net.onnx, net.int8.onnx, numbers.json."""
    folder = tmp_path_factory.mktemp("onnx")
    words = ("--int8", "--check-bank", tiny_bank, "--json", folder / "numbers.json")
    assert export(tiny_unwrapper, "--out", folder / "net.onnx", *words) == 0
    return folder


@pytest.fixture(scope="module")
def segmenting(tmp_path_factory):
    """Path of an untrained TofSegNet whose classes vary from pixel to pixel."""
    torch.manual_seed(0)
    network = TofSegNet(4)
    network.head.weight.data.mul_(30.0)
    path = tmp_path_factory.mktemp("weights") / "seg.safetensors"
    save_weights(path, network, {"network": "tofsegnet", "width": 4, "classes": 5, "f1_hz": 24e6})
    return path


def test_onnx_equals_the_unwrapper_and_the_merge(written, tiny_unwrapper):
    gray, wrapped_m = images(3)
    found = run(written / "net.onnx", gray, wrapped_m)
    predicted_m = load_unwrapper(tiny_unwrapper).predict(torch.from_numpy(gray)).distance_m
    expected_m = merge_nearest(predicted_m, torch.from_numpy(wrapped_m), UNAMBIGUOUS_M, 6.2)
    np.testing.assert_allclose(found["predicted_m"], predicted_m.numpy(), atol=2e-2)
    same = np.abs(found["distance_m"] - expected_m.numpy()) < 0.05
    assert same.mean() > 0.999
    trusted = wrapped_m < 6.2
    rebuilt_m = wrapped_m + UNAMBIGUOUS_M * found["wraps"]
    np.testing.assert_allclose(rebuilt_m[trusted], found["distance_m"][trusted], atol=1e-4)
    assert found["wraps"].dtype == np.int32 and set(np.unique(found["wraps"])) >= {0, 1}


def test_the_floor_merge_of_classes_is_equation_8(tmp_path, segmenting):
    path = tmp_path / "seg.onnx"
    assert export(segmenting, "--out", path, "--merge", "floor", "--check-bank", "none") == 0
    gray, wrapped_m = images(2)
    wrapped_m = wrapped_m.clip(0, 6.1)
    found = run(path, gray, wrapped_m)
    with torch.inference_mode():
        fractions = torch.from_numpy(gray).float()[:, None] / 4095
        classes = load_unwrapper(segmenting).network(fractions).argmax(1)
    expected_m = merge_segmentation(classes, torch.from_numpy(wrapped_m), UNAMBIGUOUS_M, 6.2)
    assert len(classes.unique()) > 2
    assert (found["wraps"] == classes.numpy()).mean() > 0.999
    assert (np.abs(found["distance_m"] - expected_m.numpy()) < 1e-3).mean() > 0.999


def test_a_large_frame_is_thinned_inside_the_file(tmp_path, segmenting):
    small = {"trained_height": HEIGHT // 2, "trained_width": WIDTH // 2}
    unwrapper, path = load_unwrapper(segmenting), tmp_path / "small.safetensors"
    save_weights(path, unwrapper.network, {**unwrapper.metadata, **small})
    assert export(path, "--out", tmp_path / "small.onnx", "--check-bank", "none") == 0
    gray, wrapped_m = images(2)
    found = run(tmp_path / "small.onnx", gray, wrapped_m)
    predicted_m = load_unwrapper(path).predict(torch.from_numpy(gray)).distance_m.numpy()
    assert (np.abs(found["predicted_m"] - predicted_m) < 1e-2).mean() > 0.999
    seen = unwrapper.predict(torch.from_numpy(gray[:, ::2, ::2].copy())).distance_m.numpy()
    assert (np.abs(found["predicted_m"][:, ::2, ::2] - seen) < 1e-2).mean() > 0.999
    told = onnxruntime.InferenceSession(tmp_path / "small.onnx").get_modelmeta()
    assert told.custom_metadata_map["every_row_and_column"] == "2"


@pytest.mark.parametrize("name", ["net.onnx", "net.int8.onnx"])
def test_files_tell_their_inputs_and_where_they_come_from(written, tiny_unwrapper, name):
    session = onnxruntime.InferenceSession(written / name, providers=["CPUExecutionProvider"])
    inputs = {i.name: (i.type, i.shape) for i in session.get_inputs()}
    shape = [1, HEIGHT, WIDTH]
    assert inputs == {"gray": ("tensor(uint16)", shape), "wrapped_m": ("tensor(float)", shape)}
    outputs = [(o.name, o.type, o.shape) for o in session.get_outputs()]
    assert outputs == [
        ("predicted_m", "tensor(float)", shape),
        ("wraps", "tensor(int32)", shape),
        ("distance_m", "tensor(float)", shape),
    ]
    told = session.get_modelmeta().custom_metadata_map
    assert told["network"] == "tofregnet" and told["width"] == "4" and told["sensor"] == "epc660"
    assert float(told["f1_hz"]) == 24e6 and told["merge"] == "nearest"
    assert told["fingerprint"] == load_unwrapper(tiny_unwrapper).fingerprint
    assert told["shotenv_version"] and ("quantised" in told) == ("int8" in name)


def test_weights_are_float32_and_quantised_ones_8_bits(written):
    def types(name):
        graph = onnx.load(written / name).graph
        return {onnx.TensorProto.DataType.Name(w.data_type) for w in graph.initializer if w.dims}

    assert "FLOAT" in types("net.onnx") and "FLOAT16" not in types("net.onnx")
    assert "INT8" not in types("net.onnx") and "INT8" in types("net.int8.onnx")


def test_the_numbers_are_those_of_the_files(written, tiny_bank):
    numbers = json.loads((written / "numbers.json").read_text())
    assert numbers["frames"] == "16 test frames of bank tiny"
    assert numbers["onnx"]["same_wraps"] > 0.999
    small = numbers["int8"]
    assert small["calibration"] == "24 train frames of bank tiny"
    assert small["bytes"] == (written / "net.int8.onnx").stat().st_size
    frames = export_frames(open_bank(tiny_bank), "test", 16, (HEIGHT, WIDTH), 24e6)
    gray, wrapped_m = frames.gray.numpy(), frames.wrapped_m.numpy()
    wraps = {n: run(written / n, gray, wrapped_m)["wraps"] for n in ("net.onnx", "net.int8.onnx")}
    same = (wraps["net.onnx"] == wraps["net.int8.onnx"]).mean()
    assert small["same_wraps"] == pytest.approx(same, abs=2e-3)
    truth_m = frames.truth_m.numpy()
    near = truth_m <= 25.0
    right = np.floor(truth_m[near] / UNAMBIGUOUS_M) == wraps["net.onnx"][near]
    assert numbers["onnx"]["wrap_accuracy"] == pytest.approx(right.mean(), abs=0.02)


def test_frames_of_a_bank_are_scaled_to_the_size(tiny_bank):
    bank = open_bank(tiny_bank)
    frames = export_frames(bank, "test", 4, (HEIGHT, WIDTH), 24e6)
    first = int(bank.frames("test")[0])
    assert torch.equal(frames.gray[0, ::2, 1::2].int(), bank.frame(first).gray.int())
    truth_m = frames.truth_m[0]
    known = truth_m.isfinite()
    turns = (truth_m - frames.wrapped_m[0])[known] / UNAMBIGUOUS_M
    # What moves, and the wiggle, keep the wrapped map from being the distance modulo the range.
    assert ((turns - turns.round()).abs() * UNAMBIGUOUS_M).median() < 0.05


def test_made_up_images_are_pinned_and_differ_between_splits():
    made = [export_frames(None, s, 2, (24, 40), 24e6) for s in ("test", "test", "train")]
    assert torch.equal(made[0].gray, made[1].gray) and not torch.equal(made[0].gray, made[2].gray)
    assert made[0].gray.shape == (2, 24, 40) and made[0].gray.dtype == torch.uint16
    gray = made[0].gray.float()
    assert gray.max() <= 4095 and gray.std() > 300
    assert made[0].wrapped_m.min() >= 0 and made[0].wrapped_m.max() < UNAMBIGUOUS_M
    assert made[0].truth_m is None and "made-up" in made[0].source


def test_which_bank_is_chosen(sensor, tiny_bank):
    assert choose_bank("none", sensor) is None
    assert choose_bank(None, sensor) is None  # the starter bank of an empty cache
    assert len(choose_bank(tiny_bank, sensor)) == 64
    with pytest.raises(BankError, match="/no/bank"):
        choose_bank("/no/bank", sensor)


def test_an_export_that_disagrees_is_refused_and_leaves_no_file(
    capsys, monkeypatch, tmp_path, segmenting
):
    content = b"not looked at"

    def other_wraps(found, frames):
        assert found == content
        predicted_m = torch.zeros(frames.gray.shape)
        return [predicted_m, predicted_m.int() + 9, predicted_m]

    monkeypatch.setattr(exporting, "to_onnx", lambda *_: content)
    monkeypatch.setattr(exporting, "run", other_wraps)
    assert export(segmenting, "--out", tmp_path / "a.onnx", "--check-bank", "none") == 1
    err = capsys.readouterr().err
    assert "agree on the wrap of 0.000 %" in err and err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_networks_that_need_samples_are_refused(segmenting):
    network = build("toffusionnet", Settings(width=4))
    unwrapper = dataclasses.replace(load_unwrapper(segmenting), name="fusing", network=network)
    with pytest.raises(ValueError, match="fusing needs the samples"):
        Exported(unwrapper, SensorDescription(), "nearest")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--sensor", "mlx75027"), "f1_hz is 6e+07; tofsegnet was trained for 2.4e+07"),
        (("--check-bank", "/no/bank"), "/no/bank"),
        (("--height", "8"), "height is 8"),
    ],
)
def test_what_does_not_fit_is_one_sentence(capsys, tmp_path, segmenting, words, says):
    out = tmp_path / "a.onnx"
    assert main(["unwrap", "export", str(segmenting), "--out", str(out), *words]) == 1
    err = capsys.readouterr().err
    assert says in err and err.count("\n") == 1 and not out.exists()
