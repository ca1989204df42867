import numpy as np
import pytest

from agents.policies.bandits import LinUcbPolicy, ThompsonPolicy
from agents.policies.fixed import CyclePolicy, FixedPolicy, MixturePolicy
from agents.policies.looking import LookAndHoldPolicy, LookAndWeighPolicy, PersistencePolicy
from agents.policies.practice import FAMILIES_OF_PRACTICE
from agents.policies.readings import Readings
from agents.policies.rules import SnrThresholdPolicy, SnrTwoThresholdPolicy
from agents.policies.watching import (
    DistanceHysteresisPolicy,
    MotionPolicy,
    UnsurePolicy,
    WakeOnChangePolicy,
)
from shotenv.decision.features import FEATURE_NAMES

NAMES = FEATURE_NAMES


def seen(**features):
    """An observation of these features, all others 0."""
    observation = np.zeros(len(NAMES), np.float32)
    for name, value in features.items():
        observation[NAMES.index(name)] = value
    return observation


def since(frames):
    return 1 - np.exp(-frames / 16)


def looked(frames=0.0, two=0.0, four=0.0, **features):
    """`frames` after a frame of 8 DCS that found these regrets, error terms."""
    return seen(
        since_eight=since(frames), regret_of_two=4 * two, regret_of_four=4 * four, **features
    )


def shots_of(policy, *observations):
    """Shots in consecutive frames, the same for one environment and in a batch."""
    policy.reset()
    one = [policy.act(observation) for observation in observations]
    assert all(isinstance(action, int) for action in one)
    policy.reset()
    batch = [policy.act(np.stack([observation] * 2)) for observation in observations]
    np.testing.assert_array_equal(np.stack(batch), np.stack([one, one], axis=1))
    return [(2, 4, 8)[action] for action in one]


def test_readings_are_in_units():
    observation = looked(24.0, 0.2, 0.05, ego_speed=-0.2, yaw_rate=0.4, power_price=0.09 / 0.14)
    read = Readings(NAMES, *NAMES)
    assert read.frames_since_eight(observation) == pytest.approx(24, abs=1e-4)
    np.testing.assert_allclose(read.regrets(observation), [0.2, 0.05, 0], rtol=1e-6)
    assert read.power_price(observation) == pytest.approx(0.09, rel=1e-6)
    assert read.speed_m_s(observation) == pytest.approx(3) and read.yaw_rate_rad_s(
        observation
    ) == pytest.approx(0.2)
    assert np.isinf(read.frames_since_eight(seen(since_eight=1.0)))


def test_mixture_draws_its_shares_and_repeats():
    policy, batch = MixturePolicy((0.5, 0.2, 0.3), seed=4), np.zeros((20_000, 3))
    drawn = policy.act(batch)
    np.testing.assert_allclose(np.bincount(drawn) / len(drawn), (0.5, 0.2, 0.3), atol=0.02)
    policy.reset()
    np.testing.assert_array_equal(policy.act(batch), drawn)
    assert str(policy) == "at random 50% 2 DCS, 20% 4 DCS, 30% 8 DCS"


def test_two_thresholds_make_three_bands():
    policy = SnrTwoThresholdPolicy(NAMES, 0.2, 0.5)
    ratios = [seen(signal_to_noise=ratio) for ratio in (0.1, 0.25, 0.49, 0.5, 0.9)]
    assert shots_of(policy, *ratios) == [8, 4, 4, 2, 2]


def test_hysteresis_keeps_its_mode_between_the_limits():
    policy = DistanceHysteresisPolicy(NAMES, 0.4, 0.6)
    distances = [seen(network_distance=d) for d in (0.5, 0.3, 0.5, 0.7, 0.5)]
    assert shots_of(policy, *distances) == [8, 2, 2, 8, 8]


def test_sensor_sleeps_after_still_frames_and_wakes_with_change():
    policy = WakeOnChangePolicy(NAMES, 0.1, still_frames=2)
    changes = [seen(gray_change=c) for c in (0.0, 0.0, 0.05, 0.2, 0.0, 0.0)]
    assert shots_of(policy, *changes) == [8, 8, 2, 8, 8, 2]


def test_motion_asks_for_eight_once_way_turn_or_change_are_behind():
    policy = MotionPolicy(NAMES, way_m=3.0, turn_rad=0.2, change=0.3)
    standing, fast = looked(9.0), looked(9.0, ego_speed=0.3)
    assert shots_of(policy, standing, fast, looked(1.0, ego_speed=0.3)) == [2, 8, 2]
    assert shots_of(policy, looked(9.0, yaw_rate=0.5), looked(9.0, yaw_rate=-0.1)) == [8, 2]
    assert shots_of(policy, looked(1.0, change_since_eight=0.4), seen(since_eight=1.0)) == [8, 8]


def test_doubt_of_the_network_or_of_two_shots_asks_for_eight():
    policy = UnsurePolicy(NAMES, 0.5, 0.1)
    sure = {"network_confidence": 0.6, "two_from_four": 0.2}
    cases = (sure, sure | {"network_confidence": 0.4}, sure | {"two_from_four": 0.5})
    assert shots_of(policy, *(seen(**case) for case in cases)) == [4, 8, 8]


def test_persistence_holds_what_was_enough_and_looks_again():
    policy = PersistencePolicy(NAMES, 0.1, period=4)
    frames = [looked(n, 0.2, 0.05) for n in (0, 1, 2, 3, 0)]
    assert shots_of(policy, seen(since_eight=1.0), *frames) == [8, 4, 4, 4, 8, 4]
    assert shots_of(policy, looked(1, 0.05, 0.2), looked(1, 0.3, 0.3)) == [2, 8]


def test_look_and_hold_looks_after_a_change_of_gray_or_amplitude():
    policy = LookAndHoldPolicy(NAMES, 0.1, period=16, change=0.3, amplitude_change=0.2)
    still = looked(0, 0.05, 0.02, amplitude=0.5)
    held = looked(3, 0.05, 0.02, amplitude=0.5)
    changed = looked(4, 0.05, 0.02, amplitude=0.5, change_since_eight=0.5)
    dimmed = looked(4, 0.05, 0.02, amplitude=0.4)
    assert shots_of(policy, still, held, changed, still, held, dimmed) == [2, 2, 8, 2, 2, 8]
    assert shots_of(policy, still, looked(14, 0.05), looked(15, 0.05)) == [2, 8, 8]


def test_amplitude_is_compared_with_the_look_or_with_the_frame_after_it():
    # 2 DCS read another amplitude than the look did, here from the second frame on.
    frames = [looked(n, 0.05, amplitude=a) for n, a in ((0, 0.5), (1, 0.4), (2, 0.4), (3, 0.3))]
    from_look, from_next = (LookAndHoldPolicy(NAMES, 0.1, 16, 0.3, 0.2, frame) for frame in (0, 1))
    assert shots_of(from_look, *frames) == [2, 8, 8, 8]
    assert shots_of(from_next, *frames) == [2, 2, 2, 8]
    assert "every 16 frames, after a change of 0.3, and after one of 0.2 in" in str(from_next)
    assert "since the frame after it" in str(from_next) and "since the look" in str(from_look)
    assert str(LookAndHoldPolicy(NAMES, 0.1, 16, np.inf)).startswith("8 DCS every 16 frames, then")


def test_look_and_weigh_weighs_regret_against_the_observed_price():
    policy = LookAndWeighPolicy(NAMES, 16, 0.3, energy_shares=(0.4, 0.6, 1.0))

    def at(price, **more):
        return looked(1, 0.1, 0.03, power_price=price / (price + 0.05), **more)

    # 0.1 + 0.4 p, 0.03 + 0.6 p and p are least above 0.35, between, and below 0.075.
    cool = {"heat_margin": 1.5}
    assert shots_of(policy, *(at(p, **cool) for p in (0.05, 0.1, 0.3, 0.4))) == [8, 4, 4, 2]
    heated = LookAndWeighPolicy(
        NAMES, 16, 0.3, heat_price=0.5, near_k=1.0, energy_shares=(0.4, 0.6, 1.0)
    )
    assert shots_of(heated, at(0.05, **cool), at(0.05, heat_margin=0.0)) == [8, 2]


@pytest.mark.parametrize("kind", [LinUcbPolicy, ThompsonPolicy])
def test_bandits_look_first_and_learn_from_eight_alone(kind):
    policy = kind(NAMES, width=0.05)
    price = {"power_price": 0.1 / 0.15, "gray_mean": 0.5}
    first = seen(since_eight=1.0, **price)
    cheap = looked(0, 0.0, 0.0, last_eight=1, **price)
    assert shots_of(policy, first, *[cheap] * 8)[-1] == 2
    assert shots_of(policy, first)[0] == 8
    dear = looked(0, 0.4, 0.4, last_eight=1, **price)
    assert shots_of(policy, first, *[dear] * 8)[-1] == 8
    # Without a frame of 8 DCS nothing is told, and what is held stays as it was.
    blind = looked(3, 0.4, 0.4, last_two=1, **price)
    policy.reset()
    policy.act(first)
    before = policy._precision.copy()
    policy.act(blind)
    np.testing.assert_array_equal(policy._precision, before)


def test_confidence_bounds_hold_doubt_against_fewer_shots():
    price = {"power_price": 0.05 / 0.1}
    first, cheap = seen(since_eight=1.0, **price), looked(0, 0.0, 0.0, last_eight=1, **price)
    assert shots_of(LinUcbPolicy(NAMES, width=0.0), first, cheap)[-1] == 2
    assert shots_of(LinUcbPolicy(NAMES, width=1.0), first, cheap)[-1] == 8


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: MixturePolicy((0.5, 0.6, 0.1)), "probabilities is .* add up to 1"),
        (lambda: MixturePolicy((1.5, -0.5, 0.0)), "probabilities is"),
        (lambda: SnrTwoThresholdPolicy(NAMES, 0.5, 0.2), r"high is 0\.2; expected at least 0\.5"),
        (lambda: DistanceHysteresisPolicy(NAMES, 0.5, 0.4), r"far is 0\.4; expected at least 0\.5"),
        (lambda: WakeOnChangePolicy(NAMES, 0.1, 0), "still_frames is 0; expected at least 1"),
        (lambda: WakeOnChangePolicy(NAMES, 0.1, 3, asleep=5), "asleep is 5"),
        (lambda: MotionPolicy(NAMES, -1.0, 0.2, 0.1), r"way_m is -1\.0"),
        (lambda: UnsurePolicy(NAMES, float("nan"), 0.1), "confidence is nan"),
        (lambda: PersistencePolicy(NAMES, 0.1, 1), "period is 1; expected at least 2"),
        (lambda: LookAndHoldPolicy(NAMES, -0.1, 8, 0.1), r"limit is -0\.1"),
        (lambda: LookAndHoldPolicy(NAMES, 0.1, 8, 0.1, 0.1, 2), "reference_frame is 2"),
        (lambda: LookAndWeighPolicy(NAMES, 8, 0.1, near_k=0), "near_k is 0"),
        (lambda: LookAndWeighPolicy(NAMES, 8, 0.1, gain=-1.0), r"gain is -1\.0"),
        (lambda: LookAndWeighPolicy(NAMES, 8, 0.1, heat_price=-0.1), r"heat_price is -0\.1"),
        (lambda: LookAndWeighPolicy(NAMES, 8, 0.1, energy_shares=(1, 2)), "energy_shares is"),
        (lambda: LinUcbPolicy(NAMES, 0.1, energy_shares=(0.3, -0.5, 1)), "energy_shares is"),
        (lambda: LinUcbPolicy(NAMES, 0.1, ridge=0.0), r"ridge is 0\.0"),
        (lambda: SnrThresholdPolicy(NAMES, float("nan"), 8, 2), "threshold is nan"),
        (lambda: SnrTwoThresholdPolicy(NAMES, 0.1, float("nan")), "high is nan"),
        (lambda: CyclePolicy(1), "period is 1"),
        (lambda: CyclePolicy(2.5), r"period is 2\.5; expected a whole number"),
        (lambda: CyclePolicy(np.inf), "period is inf; expected at least 2 and at most"),
        (lambda: WakeOnChangePolicy(NAMES, 0.1, 1.5), r"still_frames is 1\.5; expected a whole"),
        (lambda: LinUcbPolicy(NAMES, 0.1, forget=0.0), r"forget is 0\.0"),
        (lambda: ThompsonPolicy(NAMES, -0.1), r"width is -0\.1"),
        (lambda: LookAndHoldPolicy(("gray_mean",), 0.1, 8, 0.1), "feature_names has no"),
    ],
)
def test_bad_parameters_are_named(make, says):
    with pytest.raises(ValueError, match=says):
        make()


@pytest.mark.parametrize("family", FAMILIES_OF_PRACTICE, ids=lambda family: family.name)
def test_candidates_are_few_and_all_act(family):
    candidates = list(family.candidates(NAMES))
    assert 1 <= len(candidates) <= 110
    batch = np.random.default_rng(0).uniform(0, 0.9, (4, len(NAMES))).astype(np.float32)
    for policy in candidates:
        policy.reset()
        for _ in range(2):
            actions = policy.act(batch)
            assert actions.shape == (4,) and set(actions.tolist()) <= {0, 1, 2}
    # Words tell candidates apart, as reports need.
    if type(candidates[0]).__str__ is not object.__str__:
        assert len({str(policy) for policy in candidates}) == len(candidates)


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        (
            MotionPolicy(NAMES, 3, np.inf, 0.1),
            "8 DCS once 3 m or 0.1 of change lie behind",
        ),
        (MotionPolicy(NAMES, np.inf, np.inf, np.inf, 4), "8 DCS in the first frame, else 4"),
        (WakeOnChangePolicy(NAMES, 0.1, 4), "8 DCS until 4 frames without a change of 0.1, then 2"),
        (WakeOnChangePolicy(NAMES, np.inf, 4), "8 DCS until 4 frames, then 2"),
        (FixedPolicy(4), "always 4 DCS"),
    ],
)
def test_limits_that_nothing_exceeds_are_not_told(policy, words):
    assert str(policy).startswith(words)
