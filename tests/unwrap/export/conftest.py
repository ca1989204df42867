"""Networks exported once for all tests of exports."""

import pytest
import torch
from exports import HEIGHT, WIDTH, export, write_samples_network

from unwrap.networks.tofsegnet import TofSegNet
from unwrap.networks.weight_files import save_weights


@pytest.fixture(scope="package")
def written(tmp_path_factory, tiny_bank, tiny_unwrapper):
    """Folder of a TofRegNet's files: net.onnx, net.int8.onnx, numbers.json."""
    folder = tmp_path_factory.mktemp("onnx")
    words = ("--int8", "--check-bank", tiny_bank, "--json", folder / "numbers.json")
    assert export(tiny_unwrapper, "--out", folder / "net.onnx", *words) == 0
    return folder


@pytest.fixture(scope="package")
def segmenting(tmp_path_factory):
    """Path of an untrained TofSegNet whose classes vary from pixel to pixel."""
    torch.manual_seed(0)
    network = TofSegNet(4)
    network.head.weight.data.mul_(30.0)
    path = tmp_path_factory.mktemp("weights") / "seg.safetensors"
    save_weights(path, network, {"network": "tofsegnet", "width": 4, "classes": 5, "f1_hz": 24e6})
    return path


@pytest.fixture(scope="package")
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
