"""Plain DQN learns the default problem; a file each, so that trainings run side by side."""

import pytest


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_dqn_with_library_defaults_beats_the_short_choices_in_half_its_steps(over_fixed):
    """With all of them it beats 8 samples in every frame, too: `docs/learnability.py`."""
    over = over_fixed("DQN", steps=75_000)
    assert over.keys() == {"always_2", "always_4", "always_8"}
    for fixed in ("always_2", "always_4"):
        assert over[fixed]["low"] > 0.0, f"{fixed}: {over[fixed]}"
    assert over["always_8"]["difference"] > 0.0
