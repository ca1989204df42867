"""What exported files tell of themselves, and what is refused."""

import json

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from exports import (
    HEIGHT,
    UNAMBIGUOUS_M,
    WIDTH,
    export,
    run,
)

from agents.cli.entry import main
from shotenv.bank.opening import open_bank
from shotenv.config.keywords import env_config
from shotenv.dataset.export_inputs import bank_export_frames
from unwrap.export import checked_export
from unwrap.networks.predictor import load_unwrapper
from unwrap.signal.shots import Shots


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


@pytest.mark.parametrize("name", ["2.onnx", "4.onnx", "4.int8.onnx"])
def test_files_of_samples_tell_their_inputs_and_how_many_samples(fused, name):
    session = onnxruntime.InferenceSession(fused / name, providers=["CPUExecutionProvider"])
    shots, maps = int(name[0]), [1, HEIGHT, WIDTH]
    assert [(i.name, i.type, i.shape) for i in session.get_inputs()] == [
        ("gray", "tensor(uint16)", maps),
        ("dcs_lsb", "tensor(float)", [1, shots, HEIGHT, WIDTH]),
        ("saturated", "tensor(bool)", maps),
        ("offset_lsb", "tensor(float)", maps),
        ("noise_lsb", "tensor(float)", maps),
        ("shift_m", "tensor(float)", [1]),
    ]
    assert [(o.name, o.type, o.shape) for o in session.get_outputs()] == [
        ("predicted_m", "tensor(float)", maps),
        ("wraps", "tensor(int32)", maps),
        ("distance_m", "tensor(float)", maps),
        ("confidence", "tensor(float)", maps),
        ("valid", "tensor(bool)", maps),
    ]
    told = session.get_modelmeta().custom_metadata_map
    assert told["network"] == "toffusionnet" and told["shots"] == str(shots)
    assert told["every_row_and_column"] == ("2" if shots == 2 else "1")
    assert float(told["min_snr"]) == 3.0 and ("quantised" in told) == ("int8" in name)


@pytest.mark.parametrize(
    ("folder", "name", "outer"), [("written", "net.int8.onnx", 2), ("fused", "4.int8.onnx", 3)]
)
def test_convolutions_at_the_inputs_and_outputs_are_not_quantised(request, folder, name, outer):
    graph = onnx.load(request.getfixturevalue(folder) / name).graph
    makers = {made: node.op_type for node in graph.node for made in node.output}
    sources = [makers.get(node.input[0]) for node in graph.node if node.op_type == "Conv"]
    assert len(sources) - sources.count("DequantizeLinear") == outer
    assert sources.count("DequantizeLinear") > 15


def test_files_hold_no_path_of_the_machine(written, fused):
    for path in (*written.glob("*.onnx"), *fused.glob("*.onnx")):
        assert b"onnx_graph.py" not in path.read_bytes(), path


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
    frames = bank_export_frames(open_bank(tiny_bank), "test", 16, (HEIGHT, WIDTH), env_config())
    gray, wrapped_m = frames.inputs["gray"].numpy(), frames.wrapped_m.numpy()
    wraps = {
        n: run(written / n, gray=gray, wrapped_m=wrapped_m)["wraps"]
        for n in ("net.onnx", "net.int8.onnx")
    }
    same = (wraps["net.onnx"] == wraps["net.int8.onnx"]).mean()
    assert small["same_wraps"] == pytest.approx(same, abs=2e-3)
    truth_m = frames.truth_m.numpy()
    near = truth_m <= 25.0
    right = np.floor(truth_m[near] / UNAMBIGUOUS_M) == wraps["net.onnx"][near]
    assert numbers["onnx"]["wrap_accuracy"] == pytest.approx(right.mean(), abs=0.02)


def test_the_numbers_of_samples_are_those_of_the_files(fused, tiny_bank):
    numbers = json.loads((fused / "numbers.json").read_text())
    assert numbers["frames"] == "16 test frames of bank tiny, 4 samples each"
    assert numbers["int8"]["calibration"] == "24 train frames of bank tiny, 4 samples each"
    assert numbers["onnx"]["same_wraps"] > 0.999 and 0.5 < numbers["int8"]["same_wraps"] < 1
    frames = bank_export_frames(
        open_bank(tiny_bank), "test", 16, (HEIGHT, WIDTH), env_config(), Shots.FOUR
    )
    inputs = {name: values.numpy() for name, values in frames.inputs.items()}
    for key, name in (("onnx", "4.onnx"), ("int8", "4.int8.onnx")):
        distance_m, valid = (run(fused / name, **inputs)[what] for what in ("distance_m", "valid"))
        error_m = np.abs(distance_m - frames.truth_m.numpy())
        # A wrap is right where the distance is nearest to the truth.
        right = (error_m < UNAMBIGUOUS_M / 2)[frames.scored.numpy() & valid]
        assert numbers[key]["wrap_accuracy"] == pytest.approx(right.mean(), abs=0.03)
    assert numbers["int8"]["wrap_accuracy_torch"] == numbers["onnx"]["wrap_accuracy_torch"]


def test_an_export_that_disagrees_is_refused_and_leaves_no_file(
    capsys, monkeypatch, tmp_path, segmenting
):
    content = b"not looked at"

    def other_wraps(found, frames):
        assert found == content
        predicted_m = torch.zeros(frames.wrapped_m.shape)
        return {"predicted_m": predicted_m, "wraps": predicted_m.int() + 9}

    monkeypatch.setattr(checked_export, "to_onnx", lambda *_: content)
    monkeypatch.setattr(checked_export, "onnx_outputs", other_wraps)
    assert export(segmenting, "--out", tmp_path / "a.onnx", "--check-bank", "none") == 1
    err = capsys.readouterr().err
    assert "agree on the wrap of 0.000 %" in err and err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--sensor", "mlx75027"), "f1_hz is 6e+07; tofsegnet was trained for 2.4e+07"),
        (("--check-bank", "/no/bank"), "/no/bank"),
        (("--height", "8"), "height is 8"),
        (("--shots", "2"), "shots is 2; expected none, since tofsegnet looks at the gray image"),
    ],
)
def test_what_does_not_fit_is_one_sentence(capsys, tmp_path, segmenting, words, says):
    refused(capsys, tmp_path, segmenting, words, says)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--sensor", "mlx75027"), "f1_hz is 6e+07; toffusionnet was trained for 2.4e+07"),
        (("--shots", "8"), "shots is 8; expected 2 or 4"),
        (("--shots", "0"), "shots is 0; expected 2 or 4"),
    ],
)
def test_what_does_not_fit_samples_is_one_sentence(capsys, tmp_path, fused, words, says):
    refused(capsys, tmp_path, fused / "4.safetensors", words, says)


def refused(capsys, tmp_path, network, words, says):
    """The command fails with one sentence and leaves no file."""
    out = tmp_path / "a.onnx"
    assert main(["unwrap", "export", str(network), "--out", str(out), *words]) == 1
    err = capsys.readouterr().err
    assert says in err and err.count("\n") == 1 and not out.exists()
