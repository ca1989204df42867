"""Small things to measure on: banks, recordings and configurations that take seconds."""

from __future__ import annotations

import subprocess
from pathlib import Path

import torch
import yaml

from reliability.processes import SHOTENV, environment
from shotenv.config import EnvConfig, SensorConfig, configs_dir, find_config, read_config
from tests.helpers.tiny_banks import write_tiny_bank
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


def write_small_bank_config(folder: Path, **changes: object) -> Path:
    """YAML file of a bank of ten clips of two frames: 32 x 24 pixels, a ray each per instant."""
    told = {
        "name": "small",
        "sensor": str(configs_dir() / "sensor" / "epc660.yaml"),
        "camera": {"width": 32, "height": 24, "samples_per_pixel": 1, "gray_instants": 1},
        "world": {"frames_per_clip": 2, "families": ["garage", "sunny_road"]},
        **{"seed": 5, "train_clips": 3, "validation_clips": 1, "test_clips": 1, "shift_clips": 0},
        **changes,
    }
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump(told))
    return path


def small_recordings(folder: Path, drives: int = 12) -> Path:
    """Folder of recordings of drives through the tiny bank, as an mlx75027 stores them."""
    out = folder / "recordings"
    told = {**tiny_problem(folder), "frames_per_drive": 256}
    words = [*SHOTENV, "record", "--camera", "mlx75027", "--drives", str(drives), "--out", str(out)]
    words += [f"--{name}={value}" for name, value in told.items()]
    subprocess.run(words, env=environment(folder / "cache"), check=True, capture_output=True)
    return out


def study_files(folder: Path, **changes: object) -> Path:
    """YAML file of a study on the tiny bank: a regression, a rule and chance, two seeds."""
    env = read_config(EnvConfig, configs_dir() / "env" / "default.yaml").model_dump(mode="json")
    env |= tiny_problem(folder) | {"frames_per_drive": 8}
    fast = {
        **{"algorithm": "regression", "power_price": [0.01, 0.2], "hidden": [4]},
        "regression": {
            **{"rounds": 2, "drives": 2, "validation_drives": 2, "horizon": 1},
            **{"members": 1, "passes": 1},
        },
    }
    for name, content in {"short": env, "fast": fast}.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
    plan = {
        "policies": [str(folder / "fast.yaml"), "random", "fixed"],
        "presets": [str(folder / "short.yaml")],
        "seeds": [0, 1],
        "study": {"drives": 2, "tuning_drives": 2, "prices": [0.02, 0.1], "bootstrap_draws": 100},
        **changes,
    }
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump(plan))
    return path
