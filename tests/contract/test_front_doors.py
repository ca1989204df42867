"""Names that scripts elsewhere import: from the front doors, whatever moves behind them."""

from __future__ import annotations

import inspect

import pytest

import agents
import shotenv
import unwrap

PUBLIC = {
    unwrap: (
        *("Shots", "decode", "unambiguous_range_m", "distance_m", "unwrap_dual", "correct"),
        *("merge_regression", "merge_segmentation", "merge_nearest", "depth_metrics"),
        *("scale_invariant_loss", "depth_guided_loss", "ssim_loss", "regression_loss"),
        *("TofRegNet", "TofSegNet", "load_unwrapper", "SensorDescription"),
    ),
    shotenv: ("ENV_ID", "open_bank", "expose"),
    agents: ("FixedPolicy", "load_policy", "Sb3VecEnv"),
}


@pytest.mark.parametrize(
    ("door", "name"), [(door, n) for door, names in PUBLIC.items() for n in names]
)
def test_public_names_are_at_the_front_doors(door, name):
    assert not inspect.ismodule(getattr(door, name))
    assert name == "ENV_ID" or name in dir(door)


def test_signatures_are_the_ones_that_callers_rely_on():
    parameters = {
        name: list(inspect.signature(getattr(unwrap, name)).parameters) for name in PUBLIC[unwrap]
    }
    assert parameters["decode"][0] == "dcs"
    dual = ["phase1_rad", "phase2_rad", "f1_hz", "f2_hz", "max_range_m"]
    assert parameters["unwrap_dual"] == dual
    merged = ["wrapped_m", "unambiguous_m", "saturation_m"]
    assert parameters["merge_regression"] == parameters["merge_nearest"] == ["predicted_m", *merged]
    assert parameters["merge_segmentation"] == ["wraps", *merged]
    assert parameters["depth_metrics"] == ["prediction_m", "truth_m", "valid"]
    assert list(inspect.signature(agents.FixedPolicy(4).act).parameters) == ["observation", "info"]


def test_a_saved_policy_is_loaded_by_its_folder_and_nothing_else_is(tmp_path):
    with pytest.raises(ValueError, match="holds no scheduler"):
        agents.load_policy(tmp_path)
