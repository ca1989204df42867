"""The laser's effects in the environment: energy told, derating measured, the table followed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from agents.evaluation.headroom import check_solvable
from agents.evaluation.play import make_envs, play_drives
from agents.optimum.dynamic import clairvoyant, greedy
from agents.optimum.outcome_table import play
from agents.optimum.tabulation import tabulate
from agents.policies.fixed import FixedPolicy, RandomPolicy
from shotenv.config.keywords import env_config
from shotenv.decision.acquire import acquire_depth
from shotenv.decision.measurement import measure_frames
from shotenv.decision.outcomes import outcomes_of_all_actions
from shotenv.decision.problem import open_problem
from shotenv.decision.transition import reset, step
from shotenv.env.single import ShotScheduleEnv
from shotenv.env.vector import ShotScheduleVectorEnv
from shotenv.laser.cost import ENERGY_PARTS
from shotenv.laser.energy import emitted_power_w
from unwrap.signal.shots import Shots

SEEDS = [1000, 1001, 1002]
TWO_STAGES = {
    "efficiency_slope_per_k": 0.003,
    "thermal_resistance_k_per_w": 120.0,
    "thermal_time_constant_s": 1.0,
    "junction_resistance_k_per_w": 80.0,
    "junction_time_constant_s": 0.3,
}


@pytest.fixture(scope="module")
def hot(tiny_kwargs):
    """Every effect on, and heat that builds up within a few frames."""
    detailed = env_config(laser="vcsel_detailed").laser.model_dump()
    laser = {**detailed, "thermal_time_constant_s": 2.0, "junction_time_constant_s": 0.5}
    laser |= {"eye_window_s": 1.0, "eye_limit_w": 0.15}
    return {**tiny_kwargs, "laser": laser, "protect": False}


@pytest.fixture(scope="module")
def problem(hot):
    return open_problem(env_config(**hot))


def warmed(problem, state, kelvin):
    """The same lasers at another temperature."""
    temperature_k = torch.full_like(state.laser.temperature_k, kelvin)
    return dataclasses.replace(
        state, laser=dataclasses.replace(state.laser, temperature_k=temperature_k)
    )


def test_the_energy_told_is_the_sum_of_its_parts_and_no_term_leaves_its_range(hot):
    env = ShotScheduleEnv(**hot)
    env.reset(seed=3)
    told = [env.step(action)[4] for action in [0, 1, 2] + [2] * 29]
    assert any(info["tripped"] for info in told)
    for info in told:
        assert sum(info[part] for part in ENERGY_PARTS) == pytest.approx(info["energy_j"])
        assert all(0.0 <= term <= 1.0 for term in info["reward_terms"].values())
        assert (info["life_used_h"] == 0.0) == (info["shots"] == 0)


def test_cost_tells_of_a_trip_and_of_too_much_light(hot):
    env = ShotScheduleEnv(**hot)
    env.reset(seed=3)
    told = [env.step(2)[4] for _ in range(32)]
    bright = [info["eye_power_w"] > hot["laser"]["eye_limit_w"] for info in told]
    tripped = [info["tripped"] for info in told]
    assert {(True, False), (False, True)} <= set(zip(bright, tripped, strict=True))
    expected = [float(one or other) for one, other in zip(bright, tripped, strict=True)]
    assert [info["cost"] for info in told] == expected


def test_a_derated_frame_is_measured_with_the_power_that_is_left(problem):
    state = warmed(problem, reset(problem, [5, 6]), 334.15)
    power_w = emitted_power_w(
        state.drive.laser_power_w, state.laser.temperature_k, problem.config.laser
    )
    torch.testing.assert_close(power_w, state.drive.laser_power_w * (1 - 0.03 * 6.0))
    _, outcome = step(problem, state, torch.tensor([1, 1]))
    derated = measure_frames(problem, state.drive, state.step, Shots.FOUR, power_w)
    full = measure_frames(problem, state.drive, state.step, Shots.FOUR)
    assert torch.equal(outcome.score.error, derated.score.error)
    assert (derated.features[:, 0] < full.features[:, 0]).all()
    torch.testing.assert_close(outcome.cost.optical_j, 4 * state.drive.integration_s * power_w)


def test_derating_does_not_excuse_pixels(problem):
    """Scored is what the undiminished laser could see."""
    state = reset(problem, [5])
    weak_w = 0.5 * state.drive.laser_power_w
    made = [
        acquire_depth(problem, state.drive, state.step, Shots.FOUR, power_w)
        for power_w in (None, weak_w)
    ]
    assert torch.equal(made[0].scored, made[1].scored)
    assert made[1].depth.amplitude.mean() < 0.65 * made[0].depth.amplitude.mean()


def test_a_cool_laser_is_not_derated(problem):
    state = warmed(problem, reset(problem, [5]), 320.0)
    _, outcome = step(problem, state, torch.tensor([2]))
    full = measure_frames(problem, state.drive, state.step, Shots.EIGHT)
    assert torch.equal(outcome.score.error, full.score.error)
    table = outcomes_of_all_actions(problem, state.drive)
    assert table.terms["error"][0, 2] == full.score.error[0]


def test_drives_in_a_batch_equal_those_alone(problem):
    random, seeds = np.random.default_rng(0), [11, 12, 13]
    many, alone = reset(problem, seeds), [reset(problem, [seed]) for seed in seeds]
    for _ in range(24):
        actions = torch.from_numpy(random.choice(3, 3, p=[0.2, 0.2, 0.6]))
        many, outcome = step(problem, many, actions)
        for row in range(3):
            alone[row], single = step(problem, alone[row], actions[row : row + 1])
            assert single.reward[0] == outcome.reward[row]
            for field in dataclasses.fields(many.laser):
                one, other = (getattr(state.laser, field.name) for state in (alone[row], many))
                assert one[0] == other[row]
    assert (many.laser.temperature_k > 328.15).any(), "nothing was derated"


def test_remembering_changes_nothing(hot):
    rewards = []
    for remember in (False, True):
        envs = ShotScheduleVectorEnv(3, autoreset_mode="Disabled", remember=remember, **hot)
        for _ in range(2):
            envs.reset(seed=[3, 4, 5])
            rewards.append([envs.step(np.array([2, 2, 1]))[1] for _ in range(32)])
    for other in rewards[1:]:
        np.testing.assert_array_equal(other, rewards[0])


@pytest.fixture(scope="module")
def two_stages(tiny_kwargs):
    return env_config(
        **{**tiny_kwargs, "frames_per_drive": 24, "laser": TWO_STAGES, "protect": False}
    )


def test_the_table_follows_two_stages_and_a_falling_efficiency(two_stages):
    problem = open_problem(two_stages.model_copy(update={"split": "test"}))
    table = tabulate(problem, SEEDS).table()
    envs = make_envs(two_stages, "test", len(SEEDS), "Disabled")
    for policy in (FixedPolicy(8), FixedPolicy(4), RandomPolicy(1)):
        played = play_drives(policy, envs, SEEDS)
        again = [{0: 0, 2: 0, 4: 1, 8: 2}[shots] for shots in played.shots.T.ravel().tolist()]
        actions = np.array(again).reshape(-1, len(SEEDS))
        on_table = play(table, lambda now, actions=actions: actions[now.frame])
        np.testing.assert_array_equal(played.shots == 0, on_table.actions < 0)
        np.testing.assert_allclose(
            played.per_drive["return"], table.returns(on_table.frame_cost), rtol=1e-9
        )
    assert (play(table, lambda now: np.full(3, 2)).actions < 0).any(), "nothing tripped"
    assert clairvoyant(table).cost.sum() <= greedy(table, guarded=True).cost.sum() + 1e-6


def test_the_optimum_refuses_a_derated_laser():
    detailed = env_config(laser="vcsel_detailed").laser
    with pytest.raises(ValueError, match=r"derate_per_k of laser vcsel_detailed is 0.03; expected"):
        check_solvable(detailed)
    check_solvable(env_config().laser)
