"""Networks written as ONNX files, and inputs that an export has never seen."""

import numpy as np
import onnxruntime
import torch

from agents.cli.entry import main
from unwrap.networks.network import Settings
from unwrap.networks.registry import build_network
from unwrap.networks.weight_files import save_weights
from unwrap.signal.frames import RawFrame
from unwrap.signal.sensed import Sensed

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
