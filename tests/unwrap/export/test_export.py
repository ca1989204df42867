"""`shotenv unwrap export`: ONNX files equal torch."""

import re
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from exports import (
    HEIGHT,
    UNAMBIGUOUS_M,
    WIDTH,
    export,
    images,
    run,
    samples,
    sensed_of,
    write_samples_network,
)

from shotenv.sensor.description import description_of
from unwrap.depth.correction import correct_sensed
from unwrap.depth.merge import merge_nearest, merge_segmentation
from unwrap.export.export_frames import made_up_frames
from unwrap.export.onnx_conversion import onnx_outputs, to_onnx, torch_outputs
from unwrap.export.onnx_graph import exported_network
from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.weight_files import save_weights
from unwrap.signal.sensed import wrapped_distance_m
from unwrap.signal.shots import Shots

PAGE = Path(__file__).parents[3] / "docs" / "correct_and_export.md"


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
