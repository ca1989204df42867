"""Plain PPO learns the default problem; a file each, so that trainings run side by side."""

import pytest


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_ppo_with_library_defaults_beats_every_fixed_choice(over_fixed):
    # Two thirds of what the page of the problem gives it, which is enough.
    over = over_fixed("PPO", steps=52 * 2048)
    assert over.keys() == {"always_2", "always_4", "always_8"}
    for fixed, difference in over.items():
        assert difference["low"] > 0.0, f"{fixed}: {difference}"


def test_an_agent_that_cannot_look_is_shown_the_rest(learnability):
    hidden = learnability.visible(looking=False) == 0.0
    assert hidden.sum() == len(learnability.LOOKED)
    assert (learnability.visible(looking=True) == 1.0).all()
    agent = learnability.train("PPO", seed=0, looking=False, steps=1)
    drives = learnability.played({"agent": agent}, drives=2)
    assert drives["agent"].reward.shape == drives["always_2"].reward.shape == (2, 256)
