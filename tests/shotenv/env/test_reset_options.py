"""Options of reset, and drives that come again."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import shotenv
from shotenv.decision import measurement_cache


def make(kwargs, **changes):
    return gymnasium.make(shotenv.ENV_ID, **{**kwargs, **changes})


def make_vec(kwargs, **changes):
    return gymnasium.make_vec(shotenv.ENV_ID, 3, **{**kwargs, **changes})


def test_a_drive_can_be_had_again_by_its_seed(tiny_kwargs):
    first, second = make(tiny_kwargs), make(tiny_kwargs)
    _, told = first.reset(seed=1)
    again = second.reset(seed=99, options={"drive": told["drive_seed"]})
    assert data_equivalence(first.reset(seed=1), again)
    assert data_equivalence(first.step(2), second.step(2))
    # The next one is what it would have been, since the drive took no random number.
    assert data_equivalence(second.reset(), make(tiny_kwargs).reset(seed=99))


def test_a_drive_of_ones_own_number(tiny_kwargs):
    env, envs = make(tiny_kwargs), make_vec(tiny_kwargs)
    observation, info = env.reset(options={"drive": 5})
    assert info["drive_seed"] == 5
    observations, infos = envs.reset(options={"drive": 5})
    assert infos["drive_seed"].tolist() == [5, 5, 5]
    assert all(np.array_equal(row, observation) for row in observations)
    _, infos = envs.reset(options={"drive": [7, 5, np.int64(6)]})
    assert infos["drive_seed"].tolist() == [7, 5, 6]
    mask = np.array([False, True, False])
    _, infos = envs.reset(options={"drive": 9, "reset_mask": mask})
    assert (
        infos["drive_seed"].tolist() == [0, 9, 0] and infos["_drive_seed"].tolist() == mask.tolist()
    )


def test_families_can_be_chosen(tiny_kwargs):
    env = make(tiny_kwargs)
    names = env.unwrapped.family_names
    _, info = env.reset(seed=0, options={"families": ["garage", "tunnel"]})
    seen = {names[info["family"]]}
    for _ in range(32):
        *_, info = env.step(0)
        seen.add(names[info["family"]])
    assert seen == {"garage", "tunnel"}


def test_what_is_set_of_the_sensor_shifts_nothing_else(tiny_kwargs):
    env, chosen = make(tiny_kwargs), {"laser_power_w": 3, "integration_s": 4e-4, "ambient_k": 280.0}
    _, drawn = env.reset(seed=3)
    for name, value in chosen.items():
        _, info = env.reset(seed=3, options={name: value})
        assert info[name] == value
        others = {"drive_seed", "family", "laser_power_w", "integration_s", "ambient_k"} - {name}
        assert all(info[other] == drawn[other] for other in others)
    _, info = env.reset(seed=3, options=chosen)
    assert {name: info[name] for name in chosen} == chosen
    # More light, less noise: what was set is what the sensor works with.
    errors = []
    for power_w in (0.05, 50.0):
        env.reset(options={"drive": 1, "laser_power_w": power_w, "families": ["night_road"]})
        errors.append(env.step(2)[-1]["laser_energy_j"])
    assert errors[1] == pytest.approx(1000 * errors[0])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"drive_seed": 5},
            "options has 'drive_seed'; expected some of drive, families, laser_power",
        ),
        ({"reset_mask": np.ones(1, bool)}, "options has 'reset_mask'"),
        (5, "options is 5; expected a mapping"),
        ({"drive": -1}, "drive is -1; expected the seed of a drive"),
        ({"drive": 1.0}, "drive is 1.0"),
        ({"drive": True}, "drive is True"),
        ({"drive": 2**63}, "drive is 9223372036854775808"),
        ({"drive": [1]}, r"drive is \[1\]"),
        (
            {"families": "garage"},
            "families is 'garage'; expected a list of some of garage, night_road",
        ),
        ({"families": []}, r"families is \[\]"),
        ({"families": ["motorway"]}, r"families is \['motorway'\].*in split 'train'"),
        (
            {"laser_power_w": 0.0},
            "laser_power_w is 0.0; expected a number of W above 0 and below 100",
        ),
        ({"laser_power_w": 5000}, "laser_power_w is 5000"),
        ({"laser_power_w": "5 W"}, "laser_power_w is '5 W'"),
        (
            {"integration_s": 0.01},
            "integration_s is 0.01; expected a number of s above 0 and below",
        ),
        ({"integration_s": float("nan")}, "integration_s is nan"),
        (
            {"ambient_k": 25.0},
            "ambient_k is 25.0; expected a number of K above 233.15 and below 3",
        ),
        ({"ambient_k": 350.0}, "ambient_k is 350.0"),
        ({"power_price": -0.1}, "power_price is -0.1; expected a number of"),
        ({"power_price": [0.01, 0.1]}, r"power_price is \[0.01, 0.1\]"),
    ],
)
def test_a_wrong_option_is_named(tiny_kwargs, options, words):
    env = make(tiny_kwargs)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=words):
        env.reset(options=options)
    # Refused, and nothing has changed.
    env.step(0)


def test_a_wrong_option_of_a_vector_is_named(tiny_kwargs):
    envs = make_vec(tiny_kwargs)
    with pytest.raises(ValueError, match="options has 'seeds'; expected some of reset_mask, drive"):
        envs.reset(options={"seeds": 5})
    with pytest.raises(ValueError, match=r"drive is \[1, 2\]; expected .* or 3 of them"):
        envs.reset(options={"drive": [1, 2]})


def played_seeds(env, rounds):
    return [env.reset()[1]["drive_seed"] for _ in range(rounds)]


def test_the_same_drives_come_again_in_rounds(tiny_kwargs):
    env, other = make(tiny_kwargs, drives=4), make(tiny_kwargs, drives=4)
    first = [env.reset(seed=0)[1]["drive_seed"], *played_seeds(env, 7)]
    assert sorted(first[:4]) == sorted(first[4:]) == [0, 1, 2, 3]
    assert [other.reset(seed=0)[1]["drive_seed"], *played_seeds(other, 7)] == first
    orders = {(env.reset(seed=s)[1]["drive_seed"], *played_seeds(env, 3)) for s in range(6)}
    assert len(orders) > 1, "the order follows from the seed"


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_cache_is_worth_something_where_drives_come_again(tiny_kwargs, mode, monkeypatch):
    measured = []

    def counted(problem, drive, step, shots, *rest, **named):
        measured.append(len(step))
        return plain(problem, drive, step, shots, *rest, **named)

    plain = measurement_cache.measure_frames
    monkeypatch.setattr(measurement_cache, "measure_frames", counted)
    kwargs = {**tiny_kwargs, "frames_per_drive": 4, "autoreset_mode": mode, "drives": 2}
    remembering, forgetting = make_vec(kwargs, remember=True), make_vec(kwargs)
    assert data_equivalence(remembering.reset(seed=0), forgetting.reset(seed=0))
    for step in range(30):
        actions = np.full(3, 2)
        assert data_equivalence(remembering.step(actions), forgetting.step(actions))
        if step == 9:
            once = sum(measured)
    # Two drives of four frames; later rounds find all of them.
    assert sum(measured) == once <= 24


def test_what_was_set_is_not_mistaken_for_what_is_remembered(tiny_kwargs):
    remembering, forgetting = make(tiny_kwargs, remember=True), make(tiny_kwargs)
    for options in ({}, {"laser_power_w": 0.2}, {"integration_s": 1e-4}, {"families": ["tunnel"]}):
        for env in (remembering, forgetting):
            env.reset(options={"drive": 3, **options})
        for action in (2, 0):
            assert data_equivalence(remembering.step(action), forgetting.step(action))
