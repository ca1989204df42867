"""What a table tells of drives: made-up ones, whose measures are known."""

import dataclasses

import numpy as np
import pytest

from agents.config.study_config import StudyConfig
from agents.evaluation.play import FIXED_POLICIES, PlayedDrives
from agents.evaluation.summary import best_fixed, best_rival, difference, summary, tails
from shotenv.decision.features import FEATURE_NAMES


def made_up_played(rewards):
    shape = np.shape(rewards)
    ones = np.ones(shape)
    return PlayedDrives(
        seeds=np.arange(shape[0]),
        shots=np.full(shape, 4),
        asked=np.full(shape, 4),
        observations=np.zeros((*shape, len(FEATURE_NAMES)), np.float32),
        reward=np.asarray(rewards, float),
        laser_energy_j=ones,
        energy_j=2 * ones,
        depth_mae_m=0.1 * ones,
        wrap_accuracy=0.9 * ones,
        within_0p1m=0.4 * ones,
        temporal_error_m=0.2 * ones,
        temperature_k=300 * ones,
        family=np.full(shape, "garage"),
        clip=np.broadcast_to(np.arange(shape[0])[:, None] // 2, shape),
        power_price=np.zeros(shape[0]),
        reward_per_price=np.zeros(shape),
        life_used_h=ones,
    )


def test_summary_pairs_every_policy_with_the_best_fixed_choice():
    study = StudyConfig(bootstrap_draws=500)
    base = np.random.default_rng(0).normal(-1, 1, (6, 4))
    played = {name: made_up_played(base - i) for i, name in enumerate(FIXED_POLICIES)}
    played["scheduler"] = made_up_played(base + 0.5)
    results = summary(played, study, scheduler="scheduler", drive_s=2.0)
    assert results["best_fixed"] == best_fixed(played) == "always_2"
    assert results["paired_to_best_fixed"]["scheduler"] == pytest.approx(
        {"difference": 2.0, "low": 2.0, "high": 2.0}
    )
    assert results["best_rival"] == best_rival(played, "scheduler") == "always_2"
    assert results["paired_to_best_rival"]["difference"] == pytest.approx(2.0)
    assert results["paired_to_best_fixed"]["always_4"]["difference"] == pytest.approx(-4.0)
    assert results["policies"]["scheduler"]["energy_j"] == {"mean": 8.0, "low": 8.0, "high": 8.0}
    assert results["families"]["scheduler"] == {"garage": [0.0, 1.0, 0.0]}
    # A joule in each of four frames, in two seconds.
    assert results["policies"]["scheduler"]["laser_wh_per_h"] == pytest.approx(2.0)
    assert results["policies"]["scheduler"]["life_factor"]["mean"] == pytest.approx(1.0)
    assert difference(played["scheduler"], played["scheduler"], study).value == 0.0


def test_temporal_errors_are_looked_up_by_the_shots_of_both_frames():
    made_up = made_up_played(np.zeros((1, 5)))
    played = dataclasses.replace(made_up, shots=np.array([[2, 8, 0, 4, 4]]))
    # Metres that tell frame, action before and action now.
    of_actions = np.add.outer(
        10.0 * np.arange(5), [[0.0, 0.1, 0.2], [1.0, 1.1, 1.2], [2, 2.1, 2.2]]
    )
    found = played.with_temporal_errors(of_actions[None])
    np.testing.assert_allclose(found.temporal_error_m, [[np.nan, 10.2, np.nan, np.nan, 41.1]])
    assert found.per_drive["temporal_error_m"] == pytest.approx([(10.2 + 41.1) / 2])
    total, count = found.per_clip()["temporal_error_m"]
    assert total == pytest.approx([51.3]) and count.tolist() == [2.0]


def test_of_clips_that_know_a_measure_not_the_interval_is_that_of_the_others():
    study = StudyConfig(bootstrap_draws=200)
    played = made_up_played(np.zeros((8, 3)))
    error_m = np.repeat([0.1, 0.3, 0.2, np.nan], 2)[:, None] * np.ones((8, 3))
    few = {n: dataclasses.replace(played, temporal_error_m=error_m) for n in FIXED_POLICIES}
    none = dataclasses.replace(played, temporal_error_m=np.full((8, 3), np.nan))
    results = summary({**few, "rule": none}, study, scheduler="rule", drive_s=2.0)["policies"]
    known = results["always_2"]["temporal_error_m"]
    assert known["mean"] == pytest.approx(0.2) and 0.09 < known["low"] < known["high"] < 0.31
    assert results["rule"]["temporal_error_m"] is None
    assert results["rule"]["within_0p1m"]["mean"] == pytest.approx(0.4)


def test_tails_tell_what_means_hide():
    played = made_up_played(np.zeros((4, 5)))
    error_m = 0.1 * np.ones((4, 5))
    error_m[3] = 2.0  # clip 1, beside a drive without fault
    shots = np.full((4, 5), 8)
    shots[0, 2] = 0
    family = np.where(np.arange(4)[:, None] < 2, "garage", "tunnel") * np.ones((1, 5), object)
    error_m[0, 2] = np.nan
    temperature_k = 300 + np.arange(20.0).reshape(4, 5)
    told = tails(
        dataclasses.replace(
            played,
            depth_mae_m=error_m,
            shots=shots,
            family=family.astype(str),
            temperature_k=temperature_k,
        ),
        drive_s=0.5,
    )
    assert told["worst_clip"] == {
        "clip": 1,
        "family": "tunnel",
        "depth_mae_m": pytest.approx((2.0 + 0.1) / 2),
    }
    assert told["depth_mae_p95_m"] == 2.0 and told["highest_temperature_k"] == 319.0
    assert told["tripped_drives_share"] == 0.25 and told["laser_wh_per_h"] == 10.0
    assert told["median"]["depth_mae_m"] == pytest.approx(0.1)
