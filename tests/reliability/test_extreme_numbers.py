"""Numbers of a configuration that nobody means: refused by name, or played with finite results.

A walk over every number of the environment's configuration.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel

from agents.config import AgentConfig, StudyConfig
from shotenv import ShotScheduleEnv, env_config
from shotenv.bank.compatibility import BAKED_FIELDS
from shotenv.config import BankConfig, ConfigError, EnvConfig, configs_dir, merged, read_config
from unwrap.training import TrainConfig

ABSURD = (-1e300, 1e300, 10**30, math.nan, math.inf, -math.inf)
NONE_PLAYS = {*BAKED_FIELDS, "frame_rate_hz", "max_range_m", "release_k"}
"""Fields whose ends are all refused: `pocket` has its own, or they lie between two others."""
LARGEST_REWARD = 1e20
"""Far from the ends of float32; weights at their own ends reach it nearly."""


def numbers_of(model: type[BaseModel], section: BaseModel, *place: str) -> Iterator[tuple]:
    """Place, bounds and value of every number, or pair of numbers, of a configuration."""
    for name, field in model.model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            yield from numbers_of(type(value), value, *place, name)
        elif isinstance(value, bool):
            continue
        elif isinstance(value, int | float):
            yield (*place, name), field.metadata, value
        elif isinstance(value, tuple) and value and isinstance(value[0], int | float):
            yield (*place, name), [], value


def nested(place: tuple[str, ...], value: object) -> dict:
    for name in reversed(place):
        value = {name: value}
    return value


def ends_of(bounds: list, value: float) -> list[float]:
    """The bounds themselves, and what lies just beyond an open one."""
    kind, found = type(value), []
    for bound in bounds:
        match bound:
            case Ge(end) | Le(end):
                found.append(end)
            case Gt(end):
                found.append(end + (1 if kind is int else 1e-3))
            case Lt(end):
                found.append(end - (1 if kind is int else 1e-3))
    return [kind(one) for one in found]


ENV = list(numbers_of(EnvConfig, env_config()))
OTHERS = [
    (model, *found)
    for model, section in (
        (AgentConfig, AgentConfig()),
        (StudyConfig, StudyConfig()),
        (BankConfig, read_config(BankConfig, configs_dir() / "bank" / "starter.yaml")),
        (TrainConfig, TrainConfig()),
    )
    for found in numbers_of(model, section)
]


def wrong(value: object) -> list[object]:
    if isinstance(value, tuple):
        return [(one,) * len(value) for one in ABSURD] + [(value[0], one) for one in ABSURD]
    return list(ABSURD)


def test_the_walk_sees_every_section():
    sections = {place[0] for place, _, _ in ENV if len(place) > 1}
    assert sections == {"sensor", "laser", "reward"} and len(ENV) > 60
    assert len(OTHERS) > 60


@pytest.mark.parametrize(("place", "bounds", "value"), ENV, ids=lambda v: str(v)[:40])
def test_absurd_numbers_are_refused_by_name(place, bounds, value):
    for one in wrong(value):
        with pytest.raises(ConfigError) as caught:
            env_config(**nested(place, one))
        assert place[-1] in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("model", "place", "bounds", "value"), OTHERS, ids=lambda v: str(v)[:40])
def test_absurd_numbers_of_other_files_are_refused_by_name(model, place, bounds, value):
    base = (
        read_config(BankConfig, configs_dir() / "bank" / "starter.yaml")
        if model is BankConfig
        else model()
    )
    for one in wrong(value):
        with pytest.raises(ConfigError) as caught:
            merged(base, nested(place, one))
        assert place[-1] in str(caught.value)


def plays(config: dict) -> None:
    """Play a few frames; whatever is delivered must be finite and of a sensible size."""
    env = ShotScheduleEnv(**config)
    try:
        for seed in range(2):
            observation, _ = env.reset(seed=seed)
            for action in (2, 0, 1):
                observation, reward, _, over, _ = env.step(action)
                assert np.isfinite(observation).all() and np.abs(observation).max() <= 2
                assert math.isfinite(reward) and abs(reward) < LARGEST_REWARD
                if over:
                    env.reset()
    finally:
        env.close()


PAIRS = (
    ("sensor", "integration_s", (1e-9, 3.8e-3)),
    ("laser", "optical_power_w", (1e-9, 1e4)),
    ("laser", "ambient_k", (200.0, 330.0)),
    ("reward", "power", (1e-300, 1e6)),
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "ends"),
    [
        *((place, ends_of(bounds, value)) for place, bounds, value in ENV if bounds),
        *(
            ((section, name), [(pair[0],) * 2, pair, (pair[1],) * 2])
            for section, name, pair in PAIRS
        ),
        # Between the hottest surroundings and the temperature that trips.
        (("laser", "release_k"), [318.2, 337.1]),
    ],
    ids=lambda v: str(v)[:40],
)
def test_what_is_taken_plays_with_finite_results(place, ends):
    played = 0
    for end in ends:
        config = {"frames_per_drive": 4} | nested(place, end)
        try:
            plays(config)
            played += 1
        except ValueError as error:
            # An end that does not go together with the other fields, or with the bank.
            told = (place[-1], "eight samples take", "bank pocket")
            assert any(word in str(error) for word in told), error
    assert played or place[-1] in NONE_PLAYS, place
