"""The thermal guard: whatever a policy asks for, the laser does not trip."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from agents.evaluation.play import play_drives
from agents.policies.fixed import FixedPolicy
from agents.policies.guard import GuardedPolicy, ThermalGuard, largest_rises_k
from shotenv.config.keywords import env_config
from shotenv.decision.features import FEATURE_NAMES, heat_margin, heat_margin_k
from shotenv.env.vector import ShotScheduleVectorEnv

NAMES = ("other", "heat_margin")
STAGES = {"junction_resistance_k_per_w": 2.0, "junction_time_constant_s": 0.5}


def seen(margin_k):
    feature = heat_margin(torch.tensor(margin_k)).numpy()
    return np.stack([np.zeros_like(feature), feature], axis=-1)


def test_feature_tells_the_margin():
    margin_k = torch.linspace(-30.0, 30.0, 101)
    np.testing.assert_allclose(heat_margin_k(heat_margin(margin_k).numpy()), margin_k, atol=1e-4)


def test_actions_are_lowered_to_what_the_margin_allows():
    guard = ThermalGuard(NAMES, (0.0, 0.2, 0.5))
    observation = seen([-1.0, 0.1, 0.3, 0.6])
    assert guard(observation, np.full(4, 2)).tolist() == [0, 0, 1, 2]
    assert guard(observation, np.full(4, 1)).tolist() == [0, 0, 1, 1]
    assert guard(observation, np.full(4, 0)).tolist() == [0, 0, 0, 0]
    assert GuardedPolicy(FixedPolicy(8), guard).act(observation[2]) == 1


def test_without_margins_nothing_is_changed_while_the_laser_works():
    guard = ThermalGuard(NAMES, (0.0, 0.0, 0.0))
    assert guard(seen([0.01, 5.0]), np.array([2, 1])).tolist() == [2, 1]


def test_missing_feature_is_named():
    with pytest.raises(ValueError, match="no 'heat_margin'"):
        ThermalGuard(("other",), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("laser", [{}, STAGES])
def test_guarded_always_8_never_trips_where_always_8_does(tiny_kwargs, laser):
    kwargs = {**tiny_kwargs, "split": "all", "laser": laser, "frames_per_drive": 60}
    guard = ThermalGuard(FEATURE_NAMES, largest_rises_k(env_config(**kwargs)))
    seeds = list(range(6))

    def tripped(policy) -> np.ndarray:
        envs = ShotScheduleVectorEnv(6, autoreset_mode="Disabled", remember=True, **kwargs)
        return (play_drives(policy, envs, seeds).shots == 0).sum(axis=1)

    # Else the drives prove nothing about the guard.
    assert (tripped(FixedPolicy(8)) > 0).any()
    assert (tripped(GuardedPolicy(FixedPolicy(8), guard)) == 0).all()
