"""Every kind of file that is read: how one comes about, and what reads it.

What is only written is not here: MCAP, points, pages, C and ONNX files, recordings for Rerun.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from reliability.hostile_places import (
    packed,
    published,
    read_packed,
    read_published,
    read_unfinished,
    unfinished,
)
from reliability.hostile_recordings import (
    camera,
    picture,
    rays,
    read_camera,
    read_pictures,
    read_rays,
    read_recording,
    read_scene,
    read_truth,
    read_wiggle,
    recording,
    scene,
    truth,
    wiggle,
    xml,
)
from reliability.rows import ROOT

sys.path.insert(0, str(ROOT / "tests" / "helpers"))


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes
    ----------
    name : str
    make : callable
        Fills an empty folder with a file and what belongs to it; returns the file.
    read : callable
        Reads the file, and what belongs to it, as a user's call does.
    share : float
        Of the changes that other kinds have: some take seconds to read.
    """

    name: str
    make: Callable[[Path], Path]
    read: Callable[[Path], object]
    share: float = 1.0


def _config(section: str, name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        # All of them: some name others beside them.
        shutil.copytree(ROOT / "configs", folder / "configs")
        return folder / "configs" / section / f"{name}.yaml"

    return make


def _read_config(module: str, model: str) -> Callable[[Path], object]:
    def read(path: Path) -> object:
        from importlib import import_module

        from shotenv.config import read_config

        return read_config(getattr(import_module(module), model), path)

    return read


def _text(name: str, text: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        (folder / name).write_text(text, encoding="utf-8")
        return folder / name

    return make


CALIBRATION = """name: bench
horizontal_fov_deg: 60.0
recordings:
- {file: dark.npz, kind: dark, temperature_k: 298.0, integration_s: 1.0e-3}
- {file: wall.npz, kind: wall, distance_m: 1.5, temperature_k: 298.0}
"""
RECORDINGS = """name: garage
frame_rate_hz: 10.0
laser_power_w: 5.0
recordings:
- {file: one.npz, truth: one.npy, family: garage, split: test, seed: 4}
- {file: two.npz, integration_s: 1.0e-3, ambient_k: 295.0}
"""
WAY = """unit_m: 1.0
up: z
lights:
  sun: {irradiance: 11.6, azimuth_deg: 30.0}
  lamps: [{position_m: [0, 0, 3], intensity_w_sr: 2.0}]
clips:
- split: train
  waypoints_m: [[0, 0, 1], [5, 0, 1]]
  speed_m_s: [[0, 1.0], [4, 1.0]]
"""
MATERIALS = "materials:\n  wall: {albedo: 0.4}\n  sign: {albedo: [0.2, 0.3], retro: 5.0}\n"


def _ego(folder: Path) -> Path:
    rows = ["ego_speed_m_s,yaw_rate_rad_s,gray_exposure_s", *["1.5,0.1,0.002"] * 8]
    return _text("ego.csv", "\n".join(rows) + "\n")(folder)


def _read_ego(path: Path) -> object:
    from shotenv.recorded.frame_tables import read_ego

    return read_ego(path, 8)


def _bank(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from tiny_banks import write_tiny_bank

        from shotenv.config import SensorConfig, find_config, read_config

        write_tiny_bank(folder / "bank", read_config(SensorConfig, find_config("sensor", "epc660")))
        return next((folder / "bank").rglob(name))

    return make


def _read_bank(path: Path) -> object:
    from shotenv.bank import open_bank, verify

    folder = next(one for one in path.parents if one.name == "bank")
    bank = open_bank(folder, render=False)
    bank.exposure(torch.arange(2))
    bank.gray(torch.arange(2))
    return verify(folder)


def _read_clip(path: Path) -> object:
    from shotenv.bank.files.store import read_clip_record

    return read_clip_record(path.parent)


def _thinned(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        shutil.copytree(ROOT / "shotenv" / "data" / "pocket", folder / "bank")
        return folder / "bank" / name

    return make


def _read_thinned(path: Path) -> object:
    from shotenv.bank import open_bank
    from shotenv.bank.thinned import _opened

    _opened.cache_clear()
    bank = open_bank(path.parent, render=False)
    network = bank.manifest.networks[0]  # type: ignore[attr-defined]
    bank.predictions(network).distance_of(torch.arange(2))  # type: ignore[attr-defined]
    bank.scene_features(network)  # type: ignore[attr-defined]
    return bank.exposure(torch.arange(2))


def _recorded(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from tiny_banks import write_tiny_bank
        from word_banks import record, write_folder

        from agents.cli.cameras import read_camera
        from shotenv.config import SensorConfig, env_config, find_config, read_config
        from shotenv.decision import open_problem
        from shotenv.recorded import import_bank

        sensor = find_config("sensor", "epc660")
        write_tiny_bank(folder / "tiny", read_config(SensorConfig, sensor))
        kwargs = {"bank": str(folder / "tiny"), "unwrapper": str(_weights(folder))}
        problem = open_problem(env_config(**kwargs, frames_per_drive=12, split="test"))
        told = write_folder(folder / "told", [record(problem, seed) for seed in (3, 4)])
        camera, _ = read_camera(str(told / "camera" / "bench.yaml"))
        import_bank(told, camera, sensor, folder / "bank")
        return next((folder / "bank").rglob(name))

    return make


def _read_recorded(path: Path) -> object:
    from shotenv.bank import open_bank

    folder = next(one for one in path.parents if one.name == "bank")
    bank: Any = open_bank(folder, render=False)
    bank.gray(torch.arange(2))
    return [bank.settings(clip) for clip in bank.clips]


def _weights(folder: Path) -> Path:
    from unwrap.networks import TofRegNet
    from unwrap.networks.weight_files import save_weights

    torch.manual_seed(0)
    metadata = {"network": "tofregnet", "width": 4, "range_m": 12.5, "f1_hz": 24e6}
    save_weights(folder / "net.safetensors", TofRegNet(width=4, range_m=12.5), metadata)
    return folder / "net.safetensors"


def _read_weights(path: Path) -> object:
    from unwrap.networks import load_unwrapper
    from unwrap.networks.weight_files import read_label

    read_label(path)
    return load_unwrapper(path).predict(torch.zeros(1, 16, 16))


def _scheduler(name: str, *, memory: bool = False) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from agents.policies import NetworkPolicy, Provenance, RecurrentPolicy, score_network
        from shotenv.decision import FEATURE_NAMES

        torch.manual_seed(0)
        told = Provenance(
            algorithm="ppo",
            feature_names=FEATURE_NAMES,
            power_price=(0.01, 0.3),
            training={"rounds": 3},
        )
        count = len(FEATURE_NAMES)
        policy = (
            RecurrentPolicy(torch.nn.LSTM(count, 8), score_network((8, 3), "tanh"), told)
            if memory
            else NetworkPolicy(score_network((count, 16, 3), "tanh"), told)
        )
        policy.save(folder)
        return folder / name

    return make


def _read_scheduler(path: Path) -> object:
    from agents.policies import load_policy

    policy = load_policy(path.parent)
    return policy.act(np.zeros(len(policy.feature_names), np.float32))


def _trained_zip(folder: Path) -> Path:
    import gymnasium as gym
    from stable_baselines3 import PPO

    from shotenv.decision import FEATURE_NAMES

    class Spaces(gym.Env):  # type: ignore[type-arg]
        observation_space = gym.spaces.Box(-2.0, 2.0, (len(FEATURE_NAMES),), np.float32)
        action_space = gym.spaces.Discrete(3)

    PPO("MlpPolicy", Spaces(), device="cpu").save(folder / "model.zip")
    return folder / "model.zip"


def _read_zip(path: Path) -> object:
    from agents.policies import load_policy

    return load_policy(path, trust=True)


def _checkpoint(folder: Path) -> Path:
    checkpoint, state = _checkpoint_of(folder)
    network = torch.nn.Linear(4, 3)
    checkpoint.save(network.state_dict(), state)
    return folder / "checkpoint.safetensors"


def _checkpoint_of(folder: Path) -> tuple[Any, Any]:
    from agents.policies import Provenance
    from agents.training.checkpoint import Checkpoint, TrainingState

    told = Provenance(algorithm="ppo", feature_names=("power",))
    return Checkpoint(folder, told), TrainingState(3, 1.0, 2.0, 1)


def _read_checkpoint(path: Path) -> object:
    network = torch.nn.Linear(4, 3)
    return _checkpoint_of(path.parent)[0].load(network.load_state_dict)


def _network_training() -> tuple[Any, Any]:
    from unwrap_source import Walls

    from unwrap.training import TrainConfig

    return TrainConfig(width=4, epochs=1, batch_size=1), lambda split: Walls(1)


def _network_checkpoint(folder: Path) -> Path:
    from unwrap.training import train

    config, walls = _network_training()
    train(config, walls, folder, progress=False)
    return folder / "tofregnet.ckpt"


def _read_network_checkpoint(path: Path) -> object:
    from unwrap.training import train

    config, walls = _network_training()
    return train(config, walls, path.parent, progress=False)


def _job(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from agents.evaluation import PlayedFront
        from agents.optimum import Front
        from agents.study.job_results import JobResult, write_result

        sums = np.random.default_rng(0).random((5, 2, 3))
        front = Front(sums[0], sums[1], np.array([4.0, 5.0]))
        played = PlayedFront(front, (0.1, 0.2, None), ("a", "b", "c"), *sums[2:])
        result = JobResult({"front": played, "blind": played}, 3.5, {"misses": sums[0]})
        write_result(folder / "job", result, {"policy": "ppo", "seed": 3})
        return folder / name

    return make


def _read_job(path: Path) -> object:
    from agents.study.job_results import read_result, stands

    stands(path.with_suffix(""), {"policy": "ppo", "seed": 3})
    return [front.rows for front in read_result(path.with_suffix("")).fronts.values()]


def _report(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from report_sample import (
            made_up_choices,
            made_up_results,
            made_up_strip,
            made_up_timeline,
        )

        from agents.report.results import write_strip
        from unwrap.support import write_json

        write_json(folder / "results.json", made_up_results())
        write_json(folder / "timeline.json", made_up_timeline())
        write_json(folder / "choices.json", made_up_choices())
        write_strip(folder / "frames.npz", made_up_strip())
        return folder / name

    return make


def _read_report(path: Path) -> object:
    from agents.report import write_report

    return write_report(path.parent)


KINDS = (
    Kind(
        "environment (YAML)", _config("env", "default"), _read_config("shotenv.config", "EnvConfig")
    ),
    Kind(
        "sensor (YAML)", _config("sensor", "epc660"), _read_config("shotenv.config", "SensorConfig")
    ),
    Kind("laser (YAML)", _config("laser", "vcsel"), _read_config("shotenv.config", "LaserConfig")),
    Kind("bank (YAML)", _config("bank", "starter"), _read_config("shotenv.config", "BankConfig")),
    Kind("training (YAML)", _config("agent", "ppo"), _read_config("agents.config", "AgentConfig")),
    Kind("study (YAML)", _config("study", "results"), _read_config("agents.config", "StudyPlan")),
    Kind(
        "camera (YAML)",
        _config("camera", "epc660_hdf5"),
        _read_config("unwrap.cameras.files", "CameraDescription"),
    ),
    Kind(
        "calibration (YAML)",
        _text("calibration.yaml", CALIBRATION),
        _read_config("unwrap.calibration", "BenchConfig"),
    ),
    Kind(
        "recordings (YAML)",
        _text("recordings.yaml", RECORDINGS),
        _read_config("shotenv.recorded.recordings_file", "RecordingsConfig"),
    ),
    Kind(
        "way through a scene (YAML)",
        _text("way.yaml", WAY),
        _read_config("shotenv.config", "ScenePathConfig"),
    ),
    Kind(
        "materials (YAML)",
        _text("materials.yaml", MATERIALS),
        _read_config("shotenv.config", "MaterialsConfig"),
    ),
    Kind("bank's contents", _bank("manifest.json"), _read_bank),
    Kind("clip's record", _bank("clip.json"), _read_clip),
    Kind("bank's array", _bank("correlation.npy"), _read_bank),
    Kind("thinned bank's contents", _thinned("thinned.json"), _read_thinned),
    Kind("thinned bank's arrays", _thinned("arrays.npz"), _read_thinned),
    Kind("recorded bank's contents", _recorded("recorded.json"), _read_recorded),
    Kind("recorded bank's array", _recorded("words.npy"), _read_recorded),
    Kind("network's weights", _weights, _read_weights),
    Kind("scheduler's description", _scheduler("agent.json"), _read_scheduler),
    Kind("scheduler's weights", _scheduler("policy.safetensors"), _read_scheduler),
    Kind("recurrent scheduler", _scheduler("agent.json", memory=True), _read_scheduler),
    Kind("trusted zip", _trained_zip, _read_zip),
    Kind("training's checkpoint", _checkpoint, _read_checkpoint),
    Kind("network training's checkpoint", _network_checkpoint, _read_network_checkpoint, 0.1),
    Kind("study's result (JSON)", _job("job.json"), _read_job),
    Kind("study's result (npz)", _job("job.npz"), _read_job),
    Kind("evaluation's results", _report("results.json"), _read_report, 0.1),
    Kind("evaluation's timeline", _report("timeline.json"), _read_report, 0.1),
    Kind("evaluation's choices", _report("choices.json"), _read_report, 0.1),
    Kind("evaluation's frames", _report("frames.npz"), _read_report),
    Kind("wiggle table", wiggle, read_wiggle),
    Kind("recording (npy)", recording("frames.npy"), read_recording),
    Kind("recording (npz)", recording("frames.npz"), read_recording),
    Kind("recording (PNG)", picture, read_pictures),
    Kind("rays of pixels", rays, read_rays),
    Kind("reference", truth, read_truth),
    Kind("ego motion (CSV)", _ego, _read_ego),
    Kind("recording (HDF5)", camera("epc660_hdf5", "log.h5"), read_camera("epc660_hdf5")),
    Kind("recording (wire)", camera("epc660_wire", "log.bin"), read_camera("epc660_wire")),
    Kind("recording (raw)", camera("arducam_b0548", "log.raw"), read_camera("arducam_b0548")),
    Kind("recording (Kinect)", camera("kinect_v2", "log.h5"), read_camera("kinect_v2")),
    Kind("scene (OBJ)", scene("scene.obj"), read_scene),
    Kind("scene (PLY)", scene("scene.ply"), read_scene),
    Kind("scene (STL)", scene("scene.stl"), read_scene),
    Kind("scene (GLB)", scene("scene.glb"), read_scene),
    Kind("scene (XML)", xml, read_scene),
    Kind("packed array", packed, read_packed),
    Kind("contents of a place", published("contents.json"), read_published),
    Kind("part of a place", published("parts/*/*.json"), read_published),
    Kind("file on a place", published("objects/*"), read_published),
    Kind("unfinished training on a place", unfinished, read_unfinished),
)
