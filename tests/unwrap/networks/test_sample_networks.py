"""An environment whose network looks at the samples of each acquisition."""

from __future__ import annotations

import json

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env

import shotenv
from agents.cli.entry import main
from agents.evaluation.play import play_drives
from agents.optimum.tabulation import drive_of
from agents.policies.fixed import FixedPolicy
from agents.report.strip import take_strip
from shotenv.config.keywords import env_config
from shotenv.decision.acquire import acquire_depth
from shotenv.decision.problem import open_problem
from shotenv.decision.transition import reset
from shotenv.env.vector import ShotScheduleVectorEnv
from shotenv.laser.energy import NetworkWork
from unwrap.depth.correction import correct
from unwrap.networks.network import Settings
from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.registry import build_network
from unwrap.networks.weight_files import save_weights
from unwrap.signal.calibrated import decode_at
from unwrap.signal.decoding import distance_m
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.signal.sensed import Sensed, wrapped_and_valid
from unwrap.signal.shots import Shots

RANGE_M = unambiguous_range_m(24e6)
STEP = torch.tensor([3, 3])
SEEDS = [21, 22]


def write(path, f1_hz=24e6):
    """An untrained TofFusionNet whose curves vary from pixel to pixel."""
    torch.manual_seed(0)
    network = build_network("toffusionnet", Settings(width=4, f1_hz=f1_hz))
    network.judge[-1].weight.data.mul_(30.0)
    save_weights(path, network, {"network": "toffusionnet", "width": 4, "f1_hz": f1_hz})
    return str(path)


@pytest.fixture(scope="module")
def fusing(tiny_kwargs, tmp_path_factory):
    """Keyword arguments of an environment with such a network."""
    return {**tiny_kwargs, "unwrapper": write(tmp_path_factory.mktemp("net") / "f.safetensors")}


@pytest.fixture
def problem(fusing):
    return open_problem(env_config(**fusing))


def test_gymnasium_accepts(fusing):
    check_env(gymnasium.make(shotenv.ENV_ID, render_mode="rgb_array", **fusing).unwrapped)


def played(envs, seed):
    """Observations and rewards of random actions over a whole drive; each row an environment."""
    actions = np.random.default_rng(0).integers(0, 3, (envs.problem.config.frames_per_drive, 3))
    seen = [envs.reset(seed=seed)[0]]
    for chosen in actions[:, : envs.num_envs]:
        observation, reward, *_ = envs.step(chosen)
        seen += [observation, reward]
    return seen


def test_a_drive_is_the_same_alone_in_a_batch_and_remembered(fusing):
    short = {**fusing, "frames_per_drive": 12, "autoreset_mode": "Disabled"}
    alone, several, again = (
        played(ShotScheduleVectorEnv(n, remember=kept, **short), 7)
        for n, kept in ((1, False), (3, False), (3, True))
    )
    for one, many, remembered in zip(alone, several, again, strict=True):
        np.testing.assert_array_equal(one[0], many[0])
        np.testing.assert_array_equal(many, remembered)


def acquired(problem, shots):
    drive = reset(problem, SEEDS).drive
    return drive, acquire_depth(problem, drive, STEP, shots)


@pytest.mark.parametrize("shots", [Shots.TWO, Shots.FOUR])
def test_depth_lies_in_the_wrap_that_the_network_finds_in_the_samples(problem, fusing, shots):
    drive, made = acquired(problem, shots)
    sensed = Sensed(
        problem.bank.gray(drive.frame(STEP)).float() / 4095,
        made.raw,
        drive.offsets.calibrated_lsb,
        made.noise_lsb,
        drive.drift_m,
    )
    own_m = (
        load_unwrapper(fusing["unwrapper"]).predict_sensed(sensed, problem.description).distance_m
    )
    assert torch.equal(made.predicted_m, own_m)
    wrapped_m, valid = wrapped_and_valid(sensed, problem.description)
    trusted = made.depth.valid & (wrapped_m < problem.description.saturation_range_m)
    wraps = (own_m - wrapped_m) / RANGE_M
    assert (valid == made.depth.valid).float().mean() > 0.99
    assert len(wraps[trusted].round().unique()) > 1
    expected_m = wrapped_m + wraps.round().clamp(min=0) * RANGE_M
    torch.testing.assert_close(
        made.depth.distance_m[trusted], expected_m[trusted], rtol=0, atol=1e-3
    )


def test_with_eight_samples_it_decides_only_where_the_frequencies_disagree(problem):
    drive, made = acquired(problem, Shots.EIGHT)
    alone = correct(
        made.raw, None, problem.description, noise_lsb=made.noise_lsb, shift_m=drive.drift_m
    )
    agree = alone.valid
    assert 0.3 < agree.float().mean() < 1
    # Without a prediction torch decodes, with one a compiled loop: equal but for rounding.
    torch.testing.assert_close(
        made.depth.distance_m[agree], alone.distance_m[agree], rtol=0, atol=1e-5
    )
    first = decode_at(0, made.raw, problem.description, shift_m=drive.drift_m)
    guessed = ~agree & made.depth.valid
    assert guessed.any()
    wraps = (made.depth.distance_m - distance_m(first.phase_rad, 24e6)) / RANGE_M
    own_wraps = (made.predicted_m - distance_m(first.phase_rad, 24e6)) / RANGE_M
    trusted = guessed & (distance_m(first.phase_rad, 24e6) < problem.description.saturation_range_m)
    assert torch.equal(wraps[trusted].round(), own_wraps[trusted].round().clamp(min=0))


def test_a_strip_shows_what_was_played(fusing):
    envs = ShotScheduleVectorEnv(1, **{**fusing, "frames_per_drive": 6}, autoreset_mode="Disabled")
    strip = take_strip(envs.problem, play_drives(FixedPolicy(4), envs, [5]))
    drive = drive_of(envs.problem, 5)
    for i, frame in enumerate(strip.frame.tolist()):
        made = acquire_depth(envs.problem, drive, torch.tensor([frame]), Shots.FOUR)
        counted = made.depth.valid & (made.scored > 0)
        error_m = (made.depth.distance_m - made.truth_m)[counted].abs().double()
        assert strip.depth_mae_m[i] == pytest.approx(error_m.mean().item(), rel=1e-5)
        seen_m = torch.from_numpy(strip.corrected_m[i])
        assert torch.equal(seen_m, made.depth.distance_m[0].to(torch.float16))


def test_what_is_seen_before_any_sample_is_the_shipped_gray_networks(problem, tiny_kwargs):
    gray = open_problem(env_config(**{**tiny_kwargs, "unwrapper": "tofregnet"}))
    clips = [torch.arange(clip.start, clip.start + clip.frames) for clip in problem.clips]
    frames = torch.cat(clips)
    assert torch.equal(problem.scenes.features[frames], gray.scenes.features[frames])
    assert torch.isfinite(problem.scenes.features[frames]).all()


def test_both_networks_cost_energy(problem, fusing):
    size = problem.bank.height, problem.bank.width
    used = [load_unwrapper(name).macs(*size) for name in ("tofregnet", fusing["unwrapper"])]
    assert problem.network_work == tuple(used) and min(used) > 0


def test_a_gray_networks_prediction_is_the_kept_one(tiny_kwargs):
    problem = open_problem(env_config(**tiny_kwargs))
    unwrapper = load_unwrapper(tiny_kwargs["unwrapper"])
    drive, made = acquired(problem, Shots.FOUR)
    direct_m = unwrapper.predict(problem.bank.gray(drive.frame(STEP))).distance_m
    assert problem.fusion is None
    assert torch.equal(made.predicted_m, direct_m.to(torch.float16).float())
    work = NetworkWork(gray=unwrapper.macs(problem.bank.height, problem.bank.width))
    assert problem.network_work == work


def test_evaluate_scores_each_acquisitions_own_prediction(fusing, tmp_path, capsys):
    words = ["--bank", fusing["bank"], "--split", "test", "--json", str(tmp_path / "n.json")]
    assert main(["unwrap", "evaluate", fusing["unwrapper"], *words]) == 0
    methods = json.loads((tmp_path / "n.json").read_text())["methods"]
    own = [methods[f"{shots:d} DCS prediction"] for shots in Shots]
    assert own[0] != own[1] and "prediction" not in methods
    assert all(0 < scores["wrap_accuracy"] < 1 for scores in own)
    for shots in (2, 4):
        merged = methods[f"{shots} DCS nearest"]["wrap_accuracy"]
        assert merged == pytest.approx(
            methods[f"{shots} DCS prediction"]["wrap_accuracy"], abs=0.05
        )
    assert "8 DCS prediction" in capsys.readouterr().out


def test_a_network_for_another_frequency_is_refused_at_once(tiny_kwargs, tmp_path):
    other = write(tmp_path / "other.safetensors", f1_hz=60e6)
    with pytest.raises(ValueError, match=r"f1_hz is 2\.4e\+07; toffusionnet was trained for 6e"):
        gymnasium.make(shotenv.ENV_ID, **{**tiny_kwargs, "unwrapper": other, "bank": "/none"})
