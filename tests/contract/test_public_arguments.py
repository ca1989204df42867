"""Every public function, given arguments of another kind, type, size or range: refused by name."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import agents
import shotenv
import unwrap
from unwrap.signal import RawFrame

MAP, FOUR = torch.rand(1, 16, 16), torch.rand(1, 4, 16, 16)
CLEAR = torch.zeros(1, 16, 16, dtype=torch.bool)
RAW, SENSOR = RawFrame(FOUR, CLEAR), unwrap.SensorDescription()
OTHER_KINDS = (
    *(MAP.numpy(), None, "x", [1.0, 2.0], {}, object()),
    *(MAP.to(torch.complex64), MAP.long(), torch.zeros(0), torch.rand(2, 2), torch.rand(2, 3, 5)),
)
NUMBERS = ("x", None, [1.0], MAP, float("nan"), -1.0, float("inf"), 1e300, 1e-300, 10**400, 1j)
PATHS = (MAP, None, 3, [], b"x", object())
OTHERS_WORDS = re.compile(
    "required positional|supported between|operand|object (is|has|of type) |subscriptable|"
    "iterable|attribute|unhashable|is ambiguous|expected (np|Tensor)|argument '"
)


def merge_cases():
    for name in ("merge_nearest", "merge_regression", "merge_segmentation"):
        merge, usual = getattr(unwrap, name), [MAP, MAP, 6.2, 6.0]
        for place in range(4):

            def call(value, merge=merge, place=place, usual=usual):
                return merge(*usual[:place], value, *usual[place + 1 :])

            kinds = OTHER_KINDS if place < 2 else NUMBERS
            # Classes may be whole numbers.
            some = [k for k in kinds if not (name == "merge_segmentation" and k is OTHER_KINDS[7])]
            yield pytest.param(call, some, id=f"{name}-{place}")


def loss_cases():
    names = ("scale_invariant_loss", "depth_guided_loss", "ssim_loss", "regression_loss")
    for name in names:
        loss = getattr(unwrap, name)
        yield pytest.param(lambda v, loss=loss: loss(v, MAP), OTHER_KINDS, id=f"{name}-prediction")
        yield pytest.param(lambda v, loss=loss: loss(MAP, v), OTHER_KINDS, id=f"{name}-truth")


CASES = [
    pytest.param(call, wrong, id=name)
    for name, call, wrong in (
        (
            "decode",
            lambda v: unwrap.decode(v),
            (*OTHER_KINDS[:-1], torch.full((4, 2, 2), torch.nan)),
        ),
        (
            "decode-offset",
            lambda v: unwrap.decode(FOUR, offset_lsb=v),
            [kind for kind in OTHER_KINDS if kind is not None],
        ),
        ("distance_m", lambda v: unwrap.distance_m(v, 24e6), OTHER_KINDS[:8]),
        ("correct-raw", lambda v: unwrap.correct(v, MAP, SENSOR), OTHER_KINDS),
        (
            "correct-samples",
            lambda v: unwrap.correct(replace(RAW, dcs_lsb=v), MAP, SENSOR),
            OTHER_KINDS,
        ),
        (
            "correct-saturated",
            lambda v: unwrap.correct(replace(RAW, saturated=v), MAP, SENSOR),
            OTHER_KINDS,
        ),
        ("correct-prediction", lambda v: unwrap.correct(RAW, v, SENSOR), OTHER_KINDS),
        ("correct-sensor", lambda v: unwrap.correct(RAW, MAP, v), OTHER_KINDS),
        *(
            (
                f"correct-{name}",
                lambda v, name=name: unwrap.correct(RAW, MAP, SENSOR, **{name: v}),
                [kind for kind in OTHER_KINDS if kind is not None],
            )
            for name in ("offset_lsb", "shift_m", "merge", "eight")
        ),
        (
            "correct-noise",
            lambda v: unwrap.correct(RAW, MAP, SENSOR, noise_lsb=v),
            (*OTHER_KINDS[2:], -1.0, float("nan"), -MAP, MAP * torch.nan),
        ),
        ("metrics", lambda v: unwrap.depth_metrics(v, MAP, ~CLEAR), OTHER_KINDS),
        ("metrics-truth", lambda v: unwrap.depth_metrics(MAP, v, ~CLEAR), OTHER_KINDS),
        ("metrics-valid", lambda v: unwrap.depth_metrics(MAP, MAP, v), OTHER_KINDS),
        *(
            (
                f"unwrap_dual-{place}",
                lambda v, place=place: unwrap.unwrap_dual(
                    *[*(MAP, MAP, 24e6, 10e6)[:place], v, *(MAP, MAP, 24e6, 10e6)[place + 1 :]],
                    max_range_m=25.0,
                ),
                OTHER_KINDS if place < 2 else NUMBERS,
            )
            for place in range(4)
        ),
        (
            "unwrap_dual-range",
            lambda v: unwrap.unwrap_dual(MAP, MAP, 24e6, 10e6, max_range_m=v),
            NUMBERS,
        ),
        (
            "unwrap_frequencies",
            lambda v: unwrap.unwrap_frequencies(v, (24e6, 10e6), max_range_m=25.0),
            OTHER_KINDS[:-2],  # The others are two phases.
        ),
        ("load_unwrapper", lambda v: unwrap.load_unwrapper(v), (*PATHS, "nowhere")),
        ("load_policy", lambda v: agents.load_policy(v), (*PATHS, "nowhere")),
        ("open_bank", lambda v: shotenv.open_bank(v, render=False), (*PATHS, "nowhere")),
        ("env_config", lambda v: shotenv.env_config(v), (*PATHS, "nowhere")),
        *(
            (f"env-{name}", lambda v, name=name: shotenv.ShotScheduleEnv(**{name: v}), PATHS)
            for name in ("bank", "sensor", "unwrapper", "reward", "split")
            if name not in ("reward", "sensor")
        ),
        (
            "vector",
            lambda v: shotenv.ShotScheduleVectorEnv(num_envs=v),
            (0, -1, 1.5, "x", None, MAP),
        ),
        ("TofRegNet", lambda v: unwrap.TofRegNet(width=v), (0, -1, 1.5, "x", None, 10**9)),
        ("TofSegNet", lambda v: unwrap.TofSegNet(width=v), (0, -1, 1.5, "x", None, 10**9)),
        ("unambiguous_range_m", lambda v: unwrap.unambiguous_range_m(v), NUMBERS),
        ("Sb3VecEnv", lambda v: agents.Sb3VecEnv(v), PATHS),
    )
]


@pytest.mark.parametrize(("call", "wrong"), [*CASES, *merge_cases(), *loss_cases()])
def test_wrong_arguments_are_refused_by_name(call, wrong):
    for value in wrong:
        with pytest.raises((TypeError, ValueError)) as caught:
            call(value)
        told = str(caught.value)
        assert re.search(r"\b(is|has|have|are|holds?) |: Input |shapes differ|unusable", told), told
        # Python's, NumPy's and torch's own tell of lines of code, or that this test called without
        # all that is required; tensors and arrays fill pages.
        assert not OTHERS_WORDS.search(told) and "\n" not in told and len(told) < 300, told


def test_a_network_of_gray_images_names_what_it_was_given():
    unwrapper = unwrap.load_unwrapper("tofregnet")
    for value, says in (
        (np.zeros((1, 16, 16), np.float32), "gray is ndarray; expected a torch tensor"),
        (None, "gray is NoneType"),
        (torch.rand(16, 16), "gray has shape"),
        (torch.zeros(1, 16, 16).to(torch.complex64), "gray is torch.complex64"),
        (-MAP, "gray holds values outside 0..1"),
        (MAP * torch.nan, "or NaN"),
        (torch.zeros(0, 16, 16), "not empty"),
    ):
        with pytest.raises((TypeError, ValueError), match=says):
            unwrapper.predict(value)


LEFT_OUT = {
    "Bank": "abstract",
    "Policy": "abstract",
    "Prediction": "holds results, made by networks",
    "Unwrapper": "made by load_unwrapper; the test above calls it",
    "FAMILIES_OF_PRACTICE": "no function",
    "Tuned": "holds results of tune",
    "EnvConfig": "a pydantic model: tests of the configuration walk over its fields",
}
"""Public names that are neither in this walk nor in that of `test_every_argument`, and why."""


def test_every_public_name_is_walked_over_or_left_out_with_a_reason():
    files = Path(__file__), Path(__file__).with_name("test_every_argument.py")
    text = "".join(f.read_text(encoding="utf-8").partition("LEFT_OUT = {")[0] for f in files)
    names = {*unwrap.__all__, *shotenv.__all__, *agents.__all__}
    mentioned = {name for name in names if re.search(rf"\b{name}\b", text)}
    constants = {name for name in names if name.endswith("ENV_ID")}
    assert names - mentioned - constants == set(LEFT_OUT)
