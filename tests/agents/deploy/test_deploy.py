"""Schedulers for a camera choose as torch does, and what cannot be exported is named."""

import ctypes
import json
import subprocess
from itertools import pairwise

import numpy as np
import pytest
import torch

from agents.cli.entry import main
from agents.deploy import camera_files
from agents.deploy.agreement import (
    CheckCases,
    best_allowed,
    cases_of,
    different_actions,
    random_cases,
    require_same_actions,
)
from agents.deploy.c_check import run_self_test
from agents.deploy.c_source import HEADER, SOURCE, VECTORS
from agents.deploy.camera_files import cost_of_choice, export_policy
from agents.deploy.camera_modes import mode_switching, modes_of_shots
from agents.deploy.onnx_policy import check_onnx, onnx_policy
from agents.evaluation.play import make_envs
from agents.policies.fixed import CyclePolicy, FixedPolicy, RandomPolicy
from agents.policies.learned import NetworkPolicy, Provenance
from agents.policies.recurrent import RecurrentPolicy
from agents.policies.score_networks import mean_network, score_network
from shotenv.config.keywords import env_config
from shotenv.decision.features import FEATURE_NAMES

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror")


def made(layers=(35, 64, 64, 3), activation="tanh"):
    torch.manual_seed(2)
    names = FEATURE_NAMES[: layers[0]]
    told = Provenance(algorithm="ppo */ int", feature_names=names, power_price=(0.01, 0.2))
    return NetworkPolicy(score_network(layers, activation), told)


def chosen_by_c(folder, cases):
    """Actions of the exported source, called for every case."""
    (folder / "many.c").write_text(
        '#include "shotenv_policy.h"\n'
        "void many(int n, const float *seen, const unsigned char *allowed, int *actions);\n"
        "void many(int n, const float *seen, const unsigned char *allowed, int *actions)\n"
        "{ int i; for (i = 0; i < n; ++i) actions[i] = shotenv_choose(\n"
        "  seen + (long)i * SHOTENV_FEATURES, allowed + 3L * i); }\n"
    )
    words = ["gcc", *FLAGS, "-O1", "-shared", "-fPIC", "many.c", SOURCE, "-o", "many.so", "-lm"]
    subprocess.run(words, cwd=folder, check=True)
    actions = np.empty(len(cases.actions), np.int32)
    seen, allowed = (np.ascontiguousarray(a) for a in (cases.observations, cases.allowed))
    pointers = (ctypes.c_void_p(a.ctypes.data) for a in (seen, allowed, actions))
    ctypes.CDLL(str(folder / "many.so")).many(len(actions), *pointers)
    return actions


@pytest.mark.parametrize(("activation", "count"), [("tanh", 1_000_000), ("relu", 100_000)])
def test_c_chooses_as_torch_a_million_times(tmp_path, activation, count):
    policy = made(activation=activation)
    export_policy(policy, tmp_path, onnx=False)
    cases = random_cases(policy, count, seed=5)
    assert (np.bincount(cases.actions, minlength=3) > 1000).all(), "else any code would do"
    actions = chosen_by_c(tmp_path, cases)
    assert different_actions(cases, actions) == 0
    # Rounding decides next to nothing.
    assert (actions != cases.actions).sum() <= 50


def test_members_of_a_mean_network_are_written_apart(tmp_path):
    torch.manual_seed(3)
    members = [score_network((35, 16, 8, 3), "tanh") for _ in range(5)]
    told = Provenance(algorithm="regression", feature_names=FEATURE_NAMES[:35])
    policy = NetworkPolicy(mean_network(members), told)
    found = export_policy(policy, tmp_path, onnx=False)
    # Five times 16 x 8 between the hidden layers, instead of 80 x 40.
    assert found["cost"]["multiply_accumulates"] == 35 * 80 + 5 * 16 * 8 + 40 * 3
    cases = random_cases(policy, 100_000, seed=6)
    assert different_actions(cases, chosen_by_c(tmp_path, cases)) == 0


def test_c_chooses_as_torch_on_recorded_observations(
    tmp_path, tiny_kwargs, session_cache, monkeypatch
):
    monkeypatch.setenv("SHOTENV_CACHE", session_cache)
    envs = make_envs(env_config(**tiny_kwargs), "train", 4, "Disabled")
    observation, _ = envs.reset(seed=[1, 2, 3, 4])
    random, recorded = RandomPolicy(0), [observation.copy()]
    for _ in range(envs.problem.config.frames_per_drive - 1):
        recorded.append(envs.step(random.act(observation))[0].copy())
    policy = made()
    export_policy(policy, tmp_path, onnx=False)
    cases = cases_of(policy, np.concatenate(recorded))
    assert different_actions(cases, chosen_by_c(tmp_path, cases)) == 0


@pytest.mark.parametrize("layers", [(5, 3), (35, 8, 3)])
def test_exported_files_and_what_a_choice_costs(tmp_path, layers):
    policy = made(layers)
    found = export_policy(policy, tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == set(found["files"])
    assert found["cost"]["microseconds"] > 0 and found["onnx_largest_difference"] < 1e-4
    parameters = sum(p.numel() for p in policy.network.parameters())
    assert found["cost"]["weight_bytes"] == 4 * parameters
    macs = sum(a * b for a, b in pairwise(layers))
    assert cost_of_choice(policy).multiply_accumulates == macs
    header = (tmp_path / HEADER).read_text()
    assert all(name in header for name in policy.feature_names) and "ppo  int" in header


def test_the_onnx_file_takes_any_number_and_keeps_the_guard():
    policy = made((5, 8, 3), "relu")
    content = onnx_policy(policy, {"algorithm": "ppo"})
    for count in (1, 7):
        assert check_onnx(content, random_cases(policy, count)) < 1e-5
    cases = random_cases(policy, 200)
    coldest = np.tile([True, False, False], (200, 1))
    other = CheckCases(cases.observations, coldest, cases.scores, cases.actions)
    with pytest.raises(ValueError, match="onnxruntime and torch choose differently in"):
        check_onnx(content, other)


def test_the_best_allowed_action_is_the_first_of_equals():
    scores = np.array([[1, 2, 3], [1, 3, 3], [5, 2, 3]], np.float32)
    allowed = np.array([[1, 1, 0], [1, 1, 1], [0, 0, 0]], bool)
    assert best_allowed(scores, allowed).tolist() == [1, 1, 0]


def test_actions_that_rounding_decides_are_not_different():
    cases = CheckCases(
        np.zeros((2, 1), np.float32),
        np.ones((2, 3), bool),
        np.array([[0, 1, 1 - 1e-6], [0, 1, 0.9]], np.float32),
        np.array([1, 1]),
    )
    assert different_actions(cases, np.array([2, 1])) == 0
    assert different_actions(cases, np.array([2, 2])) == 1
    with pytest.raises(ValueError, match="C and torch choose differently in 1 of 2"):
        require_same_actions("C", cases, np.array([2, 2]))


def test_c_files_that_choose_otherwise_are_not_written(tmp_path, monkeypatch):
    export_policy(made((5, 8, 3)), tmp_path, onnx=False)
    files = {name: (tmp_path / name).read_text() for name in (HEADER, SOURCE, VECTORS)}
    wrong = files | {SOURCE: files[SOURCE].replace("> scores[best]", "< scores[best]")}
    with pytest.raises(ValueError, match=r"shotenv_policy\.c fails its self-test: 64 vectors"):
        run_self_test(wrong)
    with pytest.raises(ValueError, match="fails its self-test"):
        run_self_test(files | {SOURCE: "int main(void) { return nothing; }"})
    source = camera_files.c_source
    monkeypatch.setattr(camera_files, "c_source", lambda p: source(p).replace("bias[j]", "0.0f"))
    with pytest.raises(ValueError, match="nothing was written"):
        export_policy(made((5, 8, 3)), tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_without_a_compiler_nothing_is_timed(tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    found = export_policy(made((5, 3)), tmp_path, onnx=False)
    assert found["cost"]["microseconds"] is None and (tmp_path / SOURCE).is_file()


def played(table, frames):
    """Modes of the frames that a camera takes by a table."""
    once = [e["mode"] for e in table["dynamicModeSwitching"] for _ in range(e["repeat"])]
    return [once[n % len(once)] for n in range(frames)]


@pytest.mark.parametrize("policy", [CyclePolicy(4), CyclePolicy(40, 8, 4), FixedPolicy(4)])
def test_a_camera_plays_the_cycle(policy):
    modes = {2: 1, 4: 2, 8: 3}
    table = mode_switching(policy, modes)
    expected = [modes[(2, 4, 8)[policy.act(np.zeros(1))]] for _ in range(100)]
    assert played(table, 100) == expected
    assert all(1 <= entry["repeat"] <= 15 for entry in table["dynamicModeSwitching"])


@pytest.mark.parametrize(
    ("policy", "modes", "says"),
    [
        (CyclePolicy(4), {8: 3}, "modes has no mode for 2 samples; expected one for each of 2, 8"),
        (CyclePolicy(4), {8: 15, 2: 1}, "modes has 15 for 8 samples; expected 0 to 14"),
        (CyclePolicy(110), {8: 1, 2: 2}, "110 frames takes 9 entries of at most 15 frames"),
        (RandomPolicy(0), {8: 1, 2: 2, 4: 3}, "has no cycle of at most 120 frames"),
    ],
)
def test_cycles_that_a_camera_cannot_play_are_named(policy, modes, says):
    with pytest.raises(ValueError, match=says):
        mode_switching(policy, modes)


@pytest.mark.parametrize(
    ("pairs", "says"),
    [(["8"], "'8'"), (["3=1"], "'3=1'"), (["8=x"], "'8=x'"), (["8=1", "8=2"], "8 samples twice")],
)
def test_modes_of_another_form_are_named(pairs, says):
    with pytest.raises(ValueError, match=f"modes has {says}"):
        modes_of_shots(pairs)


def test_the_command_line(tmp_path, capsys):
    made((35, 8, 3)).save(tmp_path / "agent")

    def run(*words):
        status = main(["export", *map(str, words)])
        out, err = capsys.readouterr()
        return status, out, err

    agent, out = tmp_path / "agent", tmp_path / "out"
    status, said, _ = run(agent, "--out", out, "--json", tmp_path / "found.json")
    assert status == 0 and "multiply-accumulates" in said and "microseconds" in said
    assert json.loads((tmp_path / "found.json").read_text())["cost"]["weight_bytes"] == 1260
    status, _, _ = run("cycle:4:8:2", "--modes", "8=3", "2=1", "--out", out)
    table = json.loads((out / "dynamic_mode_switching.json").read_text())
    assert status == 0 and played(table, 5) == [3, 1, 1, 1, 3]
    (tmp_path / "file").write_text("")
    for words, code, names in (
        ((tmp_path / "none",), 1, "holds no scheduler"),
        ((agent, "--out", tmp_path / "file" / "out", "--c-only"), 2, "file"),
        ((agent, "--modes", "8=1"), 2, "modes are of a cycle"),
        (("cycle:4:8:2",), 1, "no mode for 2, 8 samples"),
        (("cycle:4:7:2", "--modes", "8=1"), 1, "shots is 7"),
    ):
        status, _, err = run(*words)
        assert status == code and names in err


def test_a_scheduler_with_a_memory_is_refused(tmp_path, capsys):
    told = Provenance(algorithm="recurrent_ppo", feature_names=("power",))
    network = RecurrentPolicy(torch.nn.LSTM(1, 4), score_network((4, 3), "tanh"), told)
    network.save(tmp_path / "agent")
    assert main(["export", str(tmp_path / "agent"), "--out", str(tmp_path / "out")]) == 1
    assert "RecurrentPolicy, which remembers what is in no observation" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
