import json

import numpy as np
import pytest

from agents.config.study_config import StudyConfig
from agents.evaluation.front_measures import compare_fronts, gap_closed
from agents.evaluation.play import drive_seeds, make_envs, play_drives
from agents.evaluation.price_sweep import (
    MIXTURES,
    PlayedFront,
    optimum_front,
    play_blind,
    play_front,
    prices_of,
)
from agents.optimum.fronts import Front
from agents.optimum.tabulation import tabulate
from agents.policies.fixed import FixedPolicy
from agents.policies.learned import NetworkPolicy, Provenance
from agents.policies.policy import Policy
from agents.policies.score_networks import score_network
from shotenv.config.keywords import env_config
from shotenv.decision.problem import open_problem

ONCE = np.ones(1)
STUDY = StudyConfig(bootstrap_draws=200)


def front(*points):
    """Of one clip of one frame."""
    energy, error = np.array(points, dtype=float).T
    return Front(energy[None], error[None], np.ones(1))


def test_two_points_are_mixed_on_the_line_between_them():
    line = front((1.0, 0.4), (0.25, 1.0))
    for share in (0.0, 0.3, 1.0):
        energy, error = 0.25 + 0.75 * share, 1.0 - 0.6 * share
        assert line.error_at(energy, ONCE) == pytest.approx(error)
        assert line.energy_at(error, ONCE) == pytest.approx(energy)
        np.testing.assert_allclose(line.mixture_at(error, ONCE), [share, 1 - share], atol=1e-12)


def test_the_hull_leaves_out_what_a_mixture_is_as_good_as():
    noisy = front((0.5, 1.1), (0.25, 1.2), (0.5, 0.7), (0.75, 0.65), (0.9, 0.4), (1.0, 0.45))
    # (0.75, 0.65) lies above the line from (0.5, 0.7) to (0.9, 0.4), which is 0.51 there.
    assert noisy.corners(ONCE).tolist() == [1, 2, 4]
    assert noisy.error_at(0.75, ONCE) == pytest.approx(0.7 - 0.3 * 0.25 / 0.4)


def test_the_hull_is_the_least_error_of_any_two_points_mixed():
    rng = np.random.default_rng(0)
    points = np.column_stack((rng.uniform(0.25, 1, 12), rng.uniform(0.3, 1.2, 12)))
    cloud, share = front(*points), np.linspace(0, 1, 2001)
    for energy in (0.4, 0.6, 0.8):
        mixed = [
            (share * a[1] + (1 - share) * b[1])[share * a[0] + (1 - share) * b[0] <= energy]
            for a in points
            for b in points
        ]
        best = min(errors.min() for errors in mixed if errors.size)
        assert cloud.error_at(energy, ONCE) == pytest.approx(best, abs=1e-3)


def test_beyond_its_ends_a_front_says_what_there_is():
    line = front((0.3, 1.0), (0.9, 0.4))
    assert line.error_at(0.2, ONCE) == np.inf, "no mixture spends that little"
    assert line.error_at(1.0, ONCE) == pytest.approx(0.4), "more energy buys nothing"
    assert line.energy_at(2.0, ONCE) == pytest.approx(0.3)
    assert line.energy_at(0.3, ONCE) == 1.0 and not line.reaches(0.3, ONCE)
    assert line.reaches(0.4, ONCE)


def test_clips_count_as_often_as_they_were_drawn():
    two = Front(np.array([[1.0, 3.0], [4.0, 8.0]]), np.array([[4.0, 2.0], [3.0, 1.0]]), np.ones(2))
    energy, error = two.means(np.array([2.0, 0.0]))
    assert energy.tolist() == [1.0, 3.0] and error.tolist() == [4.0, 2.0]


def test_hypervolume_is_the_area_that_the_points_dominate():
    # By hand, below and left of (1, 1.2): 0.25 x 0.2 from 0.25 to 0.5, then 0.5 x 0.8.
    assert front((0.5, 0.4), (0.25, 1.0)).hypervolume(1.2, ONCE) == pytest.approx(0.05 + 0.4)
    assert front((0.5, 0.4), (0.6, 0.9)).hypervolume(1.2, ONCE) == pytest.approx(0.4)
    assert front((0.5, 1.5)).hypervolume(1.2, ONCE) == 0.0


def played_front(points, policies=None, clips=6, spread=0.2, life=None):
    """The same points in every clip but for a factor of the error that clips have in common."""
    energy, error = np.array(points, dtype=float).T
    factor = 1 + spread * np.linspace(-1, 1, clips)[:, None]
    ones = np.ones((clips, 1))
    life_h = energy if life is None else np.array(life)
    return PlayedFront(
        Front(ones * energy, factor * error, np.ones(clips)),
        tuple(0.1 * (i + 1) for i in range(len(points))),
        tuple(policies or ["some"] * len(points)),
        returns=ones * energy,
        life_used_h=ones * life_h,
        temperature_k=300 + 20 * ones * energy,
    )


BLIND = played_front([(0.25, 1.2), (0.5, 1.2), (0.9, 0.48)], ["always_2", "always_4", "always_8"])
BEST = played_front([(0.3, 0.6), (0.6, 0.4)], life=(np.nan, np.nan))
COOL = 0.42 * (1 + 0.2 * np.linspace(-1, 1, 6))


def compared(**families):
    return compare_fronts(families, BLIND, BEST, COOL, STUDY, scheduler=next(iter(families)))


def test_blind_closes_nothing_and_the_optimum_all_of_the_gap():
    told = compared(own=BLIND, other=BEST)
    for name, closed in (("own", 0.0), ("blind", 0.0), ("other", 1.0), ("optimum", 1.0)):
        assert told["measures"][name]["gap_closed"] == pytest.approx(
            {"mean": closed, "low": closed, "high": closed}, abs=1e-12
        )
    assert told["differences"]["other"]["gap_closed"]["difference"] == pytest.approx(-1.0)
    assert told["measures"]["own"]["energy_saved_at_equal_error"]["mean"] == pytest.approx(0.0)


def test_measures_of_a_front_of_two_points_follow_from_its_line():
    # From (0.3, 0.9) to (0.7, 0.4): the error of always 8 is 0.48, at 0.7 - 0.4 x 0.08 / 0.5.
    own = compared(own=played_front([(0.3, 0.9), (0.7, 0.4)]))["measures"]["own"]
    energy = 0.7 - 0.4 * 0.08 / 0.5
    assert own["energy_saved_at_equal_error"]["mean"] == pytest.approx(1 - energy / 0.9)
    # Life is used as energy is, and 20 K go with all of it.
    assert own["life_factor_at_equal_error"]["mean"] == pytest.approx(0.9 / energy)
    assert own["cooler_k_at_equal_error"]["mean"] == pytest.approx(20 * (0.9 - energy))
    allowed = 0.7 - 0.4 * (0.48 * 1.25 - 0.4) / 0.5
    assert own["energy_saved_at_25_percent_more"]["mean"] == pytest.approx(1 - allowed / 0.9)
    # Errors of all clips rise and fall together: intervals of energies are points.
    assert own["energy_saved_at_equal_error"]["low"] == pytest.approx(1 - energy / 0.9)
    assert own["error_at_half_energy"]["mean"] == pytest.approx(0.65)
    assert own["error_at_half_energy"]["low"] < 0.65 < own["error_at_half_energy"]["high"]
    blind_m = 1.2 - 0.72 * 0.25 / 0.65
    assert own["below_blind_at_half_energy"]["mean"] == pytest.approx(1 - 0.65 / blind_m)
    # Cool 8 errs 0.42.
    energy = pytest.approx(0.7 - 0.4 * 0.02 / 0.5)
    assert own["energy_at_equal_error"] == {
        **dict.fromkeys(("mean", "low", "high"), energy),
        "reached": True,
    }


def test_a_single_point_is_mixed_with_blind_choices():
    told = compared(own=played_front([(0.5, 0.6)]))
    own = told["measures"]["own"]
    assert own["error_at_half_energy"]["mean"] == pytest.approx(0.6)
    # On the line from (0.5, 0.6) to always 8 at (0.9, 0.48).
    share = (0.6 - 1.1 * 0.48) / 0.12
    saved = 1 - (0.5 + 0.4 * share) / 0.9
    assert own["energy_saved_at_10_percent_more"]["mean"] == pytest.approx(saved)
    assert not own["energy_at_equal_error"]["reached"]
    assert own["energy_at_equal_error"]["mean"] == 1.0


def test_what_is_told_is_plain_json():
    told = compared(own=played_front([(0.3, 0.9), (0.7, 0.4)]))
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    assert "life_factor_at_equal_error" not in told["measures"]["optimum"]
    rows = BEST.rows
    assert json.loads(json.dumps(rows, allow_nan=False)) == rows
    assert rows[0]["life_used_per_frame_h"] is None and rows[0]["price"] == pytest.approx(0.1)


def test_without_an_optimum_no_gap_is_told():
    own = played_front([(0.3, 0.9), (0.7, 0.4)])
    told = compare_fronts({"own": own}, BLIND, None, COOL, STUDY, scheduler="own")
    assert set(told["measures"]) == {"own", "blind"}
    assert "gap_closed" not in told["measures"]["own"]


def test_where_there_is_no_gap_nothing_is_closed():
    same = np.array([0.5, 0.4])
    assert gap_closed(same, same, same) == 0.0


def network(price, names=("power_price",)):
    told = Provenance(algorithm="none", feature_names=names, power_price=price)
    return NetworkPolicy(score_network((len(names), 3), "tanh"), told)


def test_a_scheduler_is_played_at_the_prices_that_it_was_trained_for():
    prices = (0.01, 0.1, 0.35, 1.0)
    assert prices_of(network((0.05, 0.35)), prices) == (0.1, 0.35)
    assert prices_of(network((0.09, 0.09)), prices) == (0.09,)
    # One that does not observe the price plays the same at all.
    assert prices_of(network((0.01, 0.09), ("power",)), prices) == pytest.approx((0.03,))
    assert prices_of(network(None), prices) == ()
    with pytest.raises(ValueError, match=r"prices is 0.01, 0.1, 0.35, 1; .* from 0.4 to 0.5"):
        prices_of(network((0.4, 0.5)), prices)


class Knob(Policy):
    """2 DCS where power is dear, else 8."""

    reads_price = True

    def act(self, observation, info=None):
        return np.where(np.asarray(info["power_price"]) > 0.1, 0, 2)


@pytest.fixture(scope="module")
def drives():
    config = env_config("default", frames_per_drive=24)
    seeds = drive_seeds(STUDY, 3)
    return config, make_envs(config, "test", 3, "Disabled"), seeds


def test_a_front_plays_the_policy_of_each_price(drives):
    _, envs, seeds = drives
    two, knob, points = FixedPolicy(2), Knob(), []
    swept = play_front(lambda price: knob, envs, seeds, (0.05, 0.3), tick=points.append)
    np.testing.assert_allclose(swept.front.means(np.ones(len(swept.front.frames)))[0], [1, 0.25])
    assert points == [1, 1]
    fixed = play_front(lambda price: two, envs, seeds, (0.05, 0.3), names=lambda policy: "two")
    # Played once, its return at the other price is that of a play at it.
    again = play_drives(two, envs, seeds, price=0.3).per_drive["return"].mean()
    assert fixed.rows[1]["return"] == pytest.approx(again)
    assert fixed.rows[0]["return"] != pytest.approx(again)
    assert fixed.policies == ("two", "two") and fixed.prices == (0.05, 0.3)


def test_played_fronts_and_the_optimum_are_of_the_same_frames(drives):
    config, envs, seeds = drives
    blind = play_blind(envs, seeds)
    possible = tabulate(open_problem(config.model_copy(update={"split": "test"})), seeds)
    best = optimum_front(possible, (0.0, 5.0))
    np.testing.assert_array_equal(blind.front.frames, best.front.frames)
    assert len(blind.policies) == 3 + len(MIXTURES)
    energy, error = blind.front.means(np.ones(len(blind.front.frames)))
    np.testing.assert_allclose(energy[:3], [0.25, 0.5, 1.0])
    # Free energy: the optimum errs least of all; dear: it is always 2 DCS.
    best_energy, best_error = best.front.means(np.ones(len(best.front.frames)))
    assert best_error[0] <= error.min() and best_energy[1] == 0.25
    np.testing.assert_allclose(best_error[1], error[0])
