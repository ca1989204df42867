"""A drive of a bank as an emulated camera serves it, and that camera."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import torch

from shotenv.config import find_config, read_config
from shotenv.decision import noise_of
from shotenv.live import EpcCamera
from shotenv.sensor import acquire_prefixes, incident_light
from unwrap.cameras.files import CameraDescription
from unwrap.signal import Shots

EXAMPLES = Path(__file__).parents[2] / "examples"


def client_of(server, laser_power_w=5.0, integration_s=4e-4, **changes):
    """The client of an emulated camera of 24 x 32 pixels."""
    told = {
        "description": read_config(CameraDescription, find_config("camera", "epc660_wire")),
        "frequencies_hz": (24e6, 10e6),
        "laser_power_w": laser_power_w,
        "integration_s": integration_s,
        "size": (24, 32),
        "timeout_s": 60.0,
    }
    return EpcCamera("127.0.0.1", server.port, **(told | changes))


def example_module(name):
    """The module of a file in `examples/`, which lie beside each other."""
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # dataclasses look their module up
        spec.loader.exec_module(module)
    return sys.modules[name]


def samples_of_drive(problem, drive, step):
    """Eight samples [8, H, W] of the frame at `step` as the environment takes them, and the full.

    The flags of acquisitions of 2, 4 and 8 samples are put on the last of each.
    """
    at = torch.tensor([step])
    light = incident_light(problem.bank.exposure(drive.frame(at)), drive.sensitivity)
    noise = noise_of(drive, at, problem.bank.height, problem.bank.width)
    taken = acquire_prefixes(
        light, problem.config.sensor, shots=Shots.EIGHT, noise=noise, offsets=drive.offsets
    )
    full = np.zeros((8, problem.bank.height, problem.bank.width), bool)
    for shots, raw in taken.items():
        full[int(shots) - 1] = raw.saturated[0].numpy()
    return taken[Shots.EIGHT].dcs_lsb[0].numpy(), full


def served_drive(problem, drive):
    """All frames of a drive, a batch of one, as the camera has them in store."""
    emulated = example_module("emulated_camera")
    frames = []
    for step in range(drive.frames.shape[1]):
        frame = drive.frames[:, step]
        frames.append(
            emulated.ServedFrame(
                problem.bank.gray(frame)[0].numpy(),
                round(float(problem.gray_exposure_s[frame]) * 1e6),
                emulated.wire_words(*samples_of_drive(problem, drive, step)),
            )
        )
    return frames
