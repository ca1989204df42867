"""Small things to measure on: banks, networks and configurations that take seconds."""

from __future__ import annotations

from pathlib import Path

import torch

from shotenv.config import SensorConfig, find_config, read_config
from tests.conftest import write_tiny_bank
from unwrap.networks import TofRegNet, save_weights


def tiny_problem(folder: Path) -> dict[str, object]:
    """Arguments of an environment on the bank of the tests, written below `folder` where missing.

    16 clips of 4 frames, 32 x 24 pixels, of closed forms; and an untrained network.
    """
    bank, weights = folder / "tiny", folder / "tiny.safetensors"
    if not bank.exists():
        sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
        write_tiny_bank(bank, sensor)
        torch.manual_seed(0)
        network = TofRegNet(width=4)
        told = {"network": "tofregnet", "width": 4, "range_m": 30.0, "f1_hz": sensor.f1_hz}
        save_weights(weights, network, told)
    return {"bank": str(bank), "unwrapper": str(weights), "frames_per_drive": 32}
