"""Each argument of policies, of tuning and of the sensor, given as something else, is named."""

from __future__ import annotations

import inspect
from dataclasses import fields, replace

import pytest
import torch

import agents
import shotenv
import unwrap
from agents.policies.scheduler_files import Provenance
from agents.policies.score_networks import score_network
from shotenv.decision.features import FEATURE_NAMES
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.offsets import OffsetPattern

SQUARE = torch.rand(2, 2)
KINDS = (None, "x", b"x", {}, object(), 1j, SQUARE, SQUARE.to(torch.complex64), SQUARE.numpy())
LIMITS = (*KINDS, [1.0], float("nan"), -1.0, float("-inf"), 10**400, -(10**400), True)
COSTS = (*LIMITS, float("inf"), 1e300)
FRAMES = (*COSTS, 0, 1, 2.5)
SHARES = (*KINDS, 3, [1.0], [1, 2, "x"], [1, 2, -1], [1, 2, 1e300], [1, 2, 1j], [[1], 2, 3])
SEEDS = (*COSTS, 1.5)
SHOTS = (*COSTS, 3, 2.5)
NAMES = (*KINDS, 3, [1], ["speed"], FEATURE_NAMES[:1])
LISTS = (*KINDS, 3, [None], ["x"], [1j], [object()])

LOOKS = {
    "feature_names": NAMES,
    "period": FRAMES,
    "change": LIMITS,
    "amplitude_change": LIMITS,
    "reference_frame": [value for value in (*COSTS, 2, 0.5) if value is not True],
}
BANDIT = {
    "feature_names": NAMES,
    "width": COSTS,
    "ridge": (*COSTS, 0.0),
    "forget": [value for value in (*COSTS, 0.0, 1.1) if value is not True],
    "energy_shares": SHARES,
}
NAMED = {"feature_names": FEATURE_NAMES}
POLICIES = {
    agents.PersistencePolicy: (
        NAMED | {"limit": 0.1, "period": 8},
        {"feature_names": NAMES, "limit": LIMITS, "period": FRAMES},
    ),
    agents.LookAndHoldPolicy: (
        NAMED | {"limit": 0.1, "period": 8, "change": 0.1},
        LOOKS | {"limit": LIMITS},
    ),
    agents.LookAndWeighPolicy: (
        NAMED | {"period": 8, "change": 0.1},
        LOOKS | {"energy_shares": SHARES} | dict.fromkeys(("gain", "heat_price", "near_k"), COSTS),
    ),
    agents.LinUcbPolicy: (NAMED | {"width": 0.1}, BANDIT),
    agents.ThompsonPolicy: (NAMED | {"width": 0.1}, BANDIT | {"seed": SEEDS}),
    agents.FixedPolicy: ({"shots": 2}, {"shots": SHOTS}),
    agents.CyclePolicy: ({"period": 2}, {"period": FRAMES, "shots": SHOTS, "otherwise": SHOTS}),
    agents.DistanceHysteresisPolicy: (
        NAMED | {"near": 0.2, "far": 0.4},
        {"feature_names": NAMES, "near": LIMITS, "far": (*LIMITS, 0.1)}
        | {"few": SHOTS, "more": SHOTS},
    ),
    agents.WakeOnChangePolicy: (
        NAMED | {"change": 0.1, "still_frames": 4},
        {"feature_names": NAMES, "change": LIMITS, "still_frames": (*COSTS[:9], 0, 2.5)}
        | {"asleep": SHOTS},
    ),
    agents.MotionPolicy: (
        NAMED | dict.fromkeys(("way_m", "turn_rad", "change"), 0.1),
        {"feature_names": NAMES, "otherwise": SHOTS}
        | dict.fromkeys(("way_m", "turn_rad", "change"), LIMITS),
    ),
    agents.UnsurePolicy: (
        NAMED | {"confidence": 0.5, "disagreement": 0.1},
        {"feature_names": NAMES, "confidence": LIMITS, "disagreement": LIMITS}
        | {"otherwise": SHOTS},
    ),
    agents.SnrThresholdPolicy: (
        NAMED | {"threshold": 0.5, "below": 8, "above": 2},
        {"feature_names": NAMES, "threshold": LIMITS, "below": SHOTS, "above": SHOTS},
    ),
    agents.RandomPolicy: ({}, {"seed": SEEDS}),
    agents.MixturePolicy: (
        {"probabilities": (0.5, 0.5, 0.0)},
        {"probabilities": (*SHARES, (0.5, 0.5, 0.5)), "seed": SEEDS},
    ),
    agents.SnrTwoThresholdPolicy: (
        NAMED | {"low": 0.1, "high": 0.2},
        {"feature_names": NAMES, "low": LIMITS, "high": (*LIMITS, 0.05)}
        | dict.fromkeys(("below", "between", "above"), SHOTS),
    ),
    agents.NetworkPolicy: (
        {
            "network": score_network((1, 3), "relu"),
            "provenance": Provenance(algorithm="none", feature_names=("power",)),
        },
        {
            "network": (*KINDS, torch.nn.Linear(1, 3), score_network((2, 3), "relu")),
            "provenance": KINDS,
        },
    ),
}

PLANE = torch.rand(2, 4, 5)
NEGATIVE = -PLANE
LIGHT = Exposure(torch.rand(2, 8, 4, 5), PLANE, PLANE, PLANE)
PLANES = (*KINDS, PLANE.long(), PLANE[0], NEGATIVE, PLANE * torch.nan, PLANE * 1e30)
EACH = torch.ones(2, dtype=torch.float64)
SETTINGS = (*KINDS, 1.0, [1.0, 1.0], EACH[:1], EACH.long(), -EACH, EACH * torch.nan, EACH * 1e300)
NORMALS = torch.rand(2, 4, 2, 4, 5)
EXPOSE = {
    "exposure": LIGHT,
    "sensor": shotenv.env_config().sensor,
    "shots": unwrap.Shots.FOUR,
    "laser_power_w": EACH,
    "integration_s": EACH,
    "noise": NORMALS,
    "offsets": OffsetPattern(PLANE, PLANE),
}
WRONG_EXPOSE = {
    "exposure": KINDS,
    "correlation": [*(replace(LIGHT, correlation=value) for value in PLANES[: len(KINDS)])]
    + [
        replace(LIGHT, correlation=value)
        for value in (LIGHT.correlation[:, :3], LIGHT.correlation * torch.inf)
    ],
    "active": [replace(LIGHT, active=value) for value in PLANES],
    "ambient": [replace(LIGHT, ambient=value) for value in PLANES],
    "sensor": KINDS,
    "shots": SHOTS,
    "laser_power_w": SETTINGS,
    "integration_s": SETTINGS,
    "noise": (*KINDS[1:], NORMALS[:, :3], NORMALS.long(), NORMALS * torch.nan, NORMALS * 1e30),
    "offsets": (*KINDS[1:], *(OffsetPattern(v, PLANE) for v in PLANES if v is not NEGATIVE)),
}
"""Argument, or part of `exposure`, to what it must not be."""


def named(call, name, wrong):
    """`call` of each wrong value ends in words of this project, which name the argument."""
    for value in wrong:
        with pytest.raises(
            (TypeError, ValueError), match=rf"\b{name}\b.*\b(is|are|has|holds|maps)\b"
        ):
            call(value)


@pytest.mark.parametrize("policy", POLICIES)
def test_policies_name_each_argument(policy):
    usual, wrong = POLICIES[policy]
    policy(**usual)
    # None is forgotten.
    assert set(wrong) == set(inspect.signature(policy).parameters)
    for name, values in wrong.items():
        named(lambda value, name=name: policy(**usual | {name: value}), name, values)


def test_the_acquisition_names_each_argument():
    assert torch.isfinite(shotenv.expose(**EXPOSE).dcs_lsb).all()
    parts = {field.name for field in fields(Exposure)}
    assert set(WRONG_EXPOSE) - parts == set(inspect.signature(shotenv.expose).parameters)
    for name, values in WRONG_EXPOSE.items():
        place = "exposure" if name in parts else name
        named(lambda value, place=place: shotenv.expose(**EXPOSE | {place: value}), name, values)


def test_what_a_sensor_may_meet_at_most_gives_finite_samples():
    strong = replace(LIGHT, correlation=LIGHT.correlation * 1e9, active=PLANE * 1e9)
    raw = shotenv.expose(**EXPOSE | {"exposure": strong, "laser_power_w": EACH * 1e9})
    assert torch.isfinite(raw.dcs_lsb).all()


def test_tuning_names_each_argument():
    config = shotenv.env_config(frames_per_drive=2)
    family = agents.PolicyFamily("one", lambda names: iter([agents.FixedPolicy(2)]))
    usual = {
        "families": [family],
        "envs": agents.tuning_envs(config, 1),
        "seeds": [1],
        "prices": [0.1],
    }

    def others(made):
        return [agents.PolicyFamily("none", lambda names: made)]

    wrong = {
        "families": LISTS,
        "envs": (*KINDS, agents.ThompsonPolicy),
        "seeds": (*LISTS, [-1], [1.5], [2**70]),
        "prices": (*LISTS, [-1.0], [float("nan")], [1e300], []),
    }
    assert set(wrong) == set(inspect.signature(agents.tune).parameters)
    assert agents.tune(**usual)["one"]
    for name, values in wrong.items():
        named(lambda value, name=name: agents.tune(**usual | {name: value}), name, values)
    for made in (None, [], [None]):
        with pytest.raises(ValueError, match="candidates of family 'none' are"):
            agents.tune(**usual | {"families": others(made)})
    named(lambda value: agents.tuning_envs(value, 1), "config", (*KINDS, 3))
    named(lambda value: agents.tuning_envs(config, value), "drives", (*KINDS, 0, -1, 2.5, 10**9))
