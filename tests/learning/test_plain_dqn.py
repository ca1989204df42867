"""Plain DQN learns the default problem; a file each, so that trainings run side by side."""

import pytest


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_dqn_with_library_defaults_beats_every_fixed_choice(over_fixed):
    over = over_fixed("DQN")
    assert over.keys() == {"always_2", "always_4", "always_8"}
    for fixed, difference in over.items():
        assert difference["low"] > 0.0, f"{fixed}: {difference}"
