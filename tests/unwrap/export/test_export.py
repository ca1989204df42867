"""`shotenv unwrap export`: ONNX files equal torch, and stand only where they do."""

import json
import re
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from agents.cli.entry import main
from shotenv.bank.opening import open_bank
from shotenv.config.keywords import env_config
from shotenv.dataset.export_inputs import bank_export_frames
from shotenv.sensor.description import description_of
from unwrap.depth.correction import correct_sensed
from unwrap.depth.merge import merge_nearest, merge_segmentation
from unwrap.export import checked_export
from unwrap.export.export_frames import made_up_frames
from unwrap.export.onnx_conversion import onnx_outputs, to_onnx, torch_outputs
from unwrap.export.onnx_graph import exported_network
from unwrap.networks.network import Settings
from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.registry import build_network
from unwrap.networks.tofsegnet import TofSegNet
from unwrap.networks.weight_files import save_weights
from unwrap.signal.frames import RawFrame
from unwrap.signal.sensed import Sensed, wrapped_distance_m
from unwrap.signal.shots import Shots

PAGE = Path(__file__).parents[3] / "docs" / "correct_and_export.md"
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


def samples(shots, count=2, seed=0):
    """Gray images with samples of `shots` at all amplitudes, by the names of the inputs."""
    random = np.random.default_rng(seed)
    gray, wrapped_m = images(count, seed)
    amplitude_lsb = 10 ** random.uniform(0, 3, gray.shape)
    phase_rad = 2 * np.pi * wrapped_m / UNAMBIGUOUS_M
    words = np.stack([amplitude_lsb * np.cos(phase_rad - k * np.pi / 2) for k in range(shots)], 1)
    offset_lsb = random.normal(0, 2, gray.shape)
    offset_lsb[:, :8] = 0
    dcs_lsb = (words + offset_lsb[:, None]).round().astype(np.float32)
    # Rows of a cosine that is minus 0, as rounding gives it, and of no light at all.
    dcs_lsb[:, :2, :2] = [[[-0.0]], [[50.0]]]
    dcs_lsb[:, 2:, :2] = 0.0
    dcs_lsb[:, :, 2] = 0.0
    return {
        "gray": gray,
        "dcs_lsb": dcs_lsb,
        "saturated": random.random(gray.shape) < 0.1,
        "offset_lsb": offset_lsb.astype(np.float32),
        "noise_lsb": random.uniform(1, 5, gray.shape).astype(np.float32),
        "shift_m": random.normal(0, 0.05, count).astype(np.float32),
    }


def sensed_of(inputs):
    """What the library takes in place of the inputs of a file."""
    of = {name: torch.from_numpy(values) for name, values in inputs.items()}
    raw, gray = RawFrame(of["dcs_lsb"], of["saturated"]), of["gray"].float() / 4095
    return Sensed(gray, raw, of["offset_lsb"], of["noise_lsb"], of["shift_m"])


def run(path, **inputs):
    """Outputs by name, each [N, H, W]."""
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    frames = [
        session.run(None, {name: values[i : i + 1] for name, values in inputs.items()})
        for i in range(len(inputs["gray"]))
    ]
    maps = map(np.concatenate, zip(*frames, strict=True))
    return dict(zip((output.name for output in session.get_outputs()), maps, strict=True))


def write_samples_network(path, name="toffusionnet", **metadata):
    """An untrained network that looks at samples, whose predictions vary from pixel to pixel."""
    torch.manual_seed(0)
    network = build_network(name, Settings(width=4))
    last = network.judge[-1] if name == "toffusionnet" else network.head
    last.weight.data.mul_(30.0 if name == "toffusionnet" else 1000.0)
    last.bias.data.zero_()
    save_weights(path, network, {"network": name, "width": 4, "f1_hz": 24e6, **metadata})
    return path


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


@pytest.fixture(scope="module")
def fused(tmp_path_factory, tiny_bank):
    """Folder of two TofFusionNets, 4 and 2, the second trained on frames half as high and wide.

    The second is taken at its word (`--merge none`). Holds 4.safetensors, 4.onnx, 4.int8.onnx,
    numbers.json; 2.safetensors, 2.onnx.
    """
    folder = tmp_path_factory.mktemp("onnx")
    small = {"trained_height": HEIGHT // 2, "trained_width": WIDTH // 2}
    four = write_samples_network(folder / "4.safetensors")
    two = write_samples_network(folder / "2.safetensors", **small)
    words = ("--int8", "--check-bank", tiny_bank, "--json", folder / "numbers.json")
    assert export(four, "--out", folder / "4.onnx", *words) == 0
    few = ("--shots", "2", "--merge", "none", "--check-bank", "none")
    assert export(two, "--out", folder / "2.onnx", *few) == 0
    return folder


@pytest.fixture(autouse=True)
def in_float32(monkeypatch):
    """Networks compute as the files do, on processors that would take bfloat16 as well."""
    monkeypatch.setattr("torch.cpu.get_capabilities", dict, raising=False)


def test_onnx_equals_the_unwrapper_and_the_merge(written, tiny_unwrapper):
    gray, wrapped_m = images(3)
    found = run(written / "net.onnx", gray=gray, wrapped_m=wrapped_m)
    predicted_m = load_unwrapper(tiny_unwrapper).predict(torch.from_numpy(gray)).distance_m
    expected_m = merge_nearest(predicted_m, torch.from_numpy(wrapped_m), UNAMBIGUOUS_M, 6.2)
    np.testing.assert_allclose(found["predicted_m"], predicted_m.numpy(), atol=2e-2)
    same = np.abs(found["distance_m"] - expected_m.numpy()) < 0.05
    assert same.mean() > 0.999
    trusted = wrapped_m < 6.2
    rebuilt_m = wrapped_m + UNAMBIGUOUS_M * found["wraps"]
    np.testing.assert_allclose(rebuilt_m[trusted], found["distance_m"][trusted], atol=1e-4)
    assert found["wraps"].dtype == np.int32 and set(np.unique(found["wraps"])) >= {0, 1}


@pytest.mark.slow
def test_the_floor_merge_of_classes_is_equation_8(tmp_path, segmenting):
    path = tmp_path / "seg.onnx"
    assert export(segmenting, "--out", path, "--merge", "floor", "--check-bank", "none") == 0
    gray, wrapped_m = images(2)
    wrapped_m = wrapped_m.clip(0, 6.1)
    found = run(path, gray=gray, wrapped_m=wrapped_m)
    with torch.inference_mode():
        fractions = torch.from_numpy(gray).float()[:, None] / 4095
        classes = load_unwrapper(segmenting).network(fractions).argmax(1)
    expected_m = merge_segmentation(classes, torch.from_numpy(wrapped_m), UNAMBIGUOUS_M, 6.2)
    assert len(classes.unique()) > 2
    assert (found["wraps"] == classes.numpy()).mean() > 0.999
    assert (np.abs(found["distance_m"] - expected_m.numpy()) < 1e-3).mean() > 0.999


@pytest.mark.slow
def test_a_large_frame_is_thinned_inside_the_file(tmp_path, segmenting):
    small = {"trained_height": HEIGHT // 2, "trained_width": WIDTH // 2}
    unwrapper, path = load_unwrapper(segmenting), tmp_path / "small.safetensors"
    save_weights(path, unwrapper.network, {**unwrapper.metadata, **small})
    assert export(path, "--out", tmp_path / "small.onnx", "--check-bank", "none") == 0
    gray, wrapped_m = images(2)
    found = run(tmp_path / "small.onnx", gray=gray, wrapped_m=wrapped_m)
    predicted_m = load_unwrapper(path).predict(torch.from_numpy(gray)).distance_m.numpy()
    assert (np.abs(found["predicted_m"] - predicted_m) < 1e-2).mean() > 0.999
    seen = unwrapper.predict(torch.from_numpy(gray[:, ::2, ::2].copy())).distance_m.numpy()
    assert (np.abs(found["predicted_m"][:, ::2, ::2] - seen) < 1e-2).mean() > 0.999
    told = onnxruntime.InferenceSession(tmp_path / "small.onnx").get_modelmeta()
    assert told.custom_metadata_map["every_row_and_column"] == "2"


def test_the_pages_example_runs(capsys, monkeypatch, tmp_path, fused):
    inputs = samples(4, count=1)
    words = (inputs["dcs_lsb"][0] + 2048).astype(np.uint16)
    np.savez(
        tmp_path / "frame.npz", dcs=words, gray=inputs["gray"][0], saturated=inputs["saturated"][0]
    )
    example = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[-1]
    monkeypatch.chdir(tmp_path)
    exec(example.replace("toffusionnet.onnx", str(fused / "4.onnx")), {})
    assert re.search(r"median \d+\.\d\d m", capsys.readouterr().out)


@pytest.mark.parametrize("shots", [2, 4])
def test_samples_become_what_the_unwrapper_and_the_correction_make_of_them(fused, sensor, shots):
    inputs, description = samples(shots), description_of(sensor)
    found, sensed = run(fused / f"{shots}.onnx", **inputs), sensed_of(inputs)
    looked = load_unwrapper(fused / f"{shots}.safetensors").predict_sensed(sensed, description)
    merge = "none" if shots == 2 else "nearest"
    depth = correct_sensed(sensed, looked.distance_m, description, merge=merge)
    np.testing.assert_array_equal(found["valid"], depth.valid.numpy())
    assert 0.5 < found["valid"].mean() < 0.95
    for name, expected in (
        ("predicted_m", looked.distance_m),
        ("distance_m", depth.distance_m),
        ("confidence", looked.confidence),
    ):
        assert (np.abs(found[name] - expected.numpy()) < 1e-3).mean() > 0.999, name
    wrapped_m = wrapped_distance_m(sensed, description).numpy()
    kept = found["valid"] & (wrapped_m < 6.2)
    rebuilt_m = wrapped_m + UNAMBIGUOUS_M * found["wraps"]
    assert (np.abs(rebuilt_m - found["distance_m"])[kept] < 1e-3).mean() > 0.999
    assert len(np.unique(found["wraps"][kept])) > 2


@pytest.mark.parametrize(
    "name",
    [
        "phasenet",
        "agresti_net",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("su_net", "chen_net")),
    ],
)
def test_peers_that_look_at_samples_serve_as_well(tmp_path, sensor, name):
    unwrapper = load_unwrapper(write_samples_network(tmp_path / "peer.safetensors", name))
    network = exported_network(unwrapper, description_of(sensor), "nearest")
    frames = made_up_frames("test", 2, (HEIGHT, WIDTH), description_of(sensor), Shots.TWO)
    content = to_onnx(network, frames.one_by_one()[0], {})
    found, expected = onnx_outputs(content, frames), torch_outputs(network, frames)
    assert list(found) == list(expected)
    assert (found["wraps"] == expected["wraps"]).float().mean() > 0.999
    assert len(found["wraps"].unique()) > 1
    assert ((found["predicted_m"] - expected["predicted_m"]).abs() < 1e-2).float().mean() > 0.999


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
