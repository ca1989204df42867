import numpy as np

from shotenv.decision import recall
from shotenv.env.vector import ShotScheduleVectorEnv

SEEDS = [3, 4, 5]


def drive_along(envs, seed):
    """Observations and rewards of random actions over a whole drive."""
    actions = np.random.default_rng(seed)
    seen = [envs.reset(seed=SEEDS)[0]]
    for _ in range(envs.problem.config.frames_per_drive):
        observation, reward, *_ = envs.step(actions.integers(0, 3, envs.num_envs))
        seen += [observation, reward]
    return seen


def test_a_remembered_drive_is_the_same_drive(tiny_kwargs):
    plain = ShotScheduleVectorEnv(3, autoreset_mode="Disabled", **tiny_kwargs)
    remembering = ShotScheduleVectorEnv(3, autoreset_mode="Disabled", remember=True, **tiny_kwargs)
    for actions in (0, 1, 0):
        for one, other in zip(
            drive_along(plain, actions), drive_along(remembering, actions), strict=True
        ):
            np.testing.assert_array_equal(one, other)


def test_nothing_is_measured_twice(tiny_kwargs, monkeypatch):
    measured = []

    def counted(problem, drive, step, *chosen, real=recall.measure):
        measured.append(len(step))
        return real(problem, drive, step, *chosen)

    monkeypatch.setattr(recall, "measure", counted)
    envs = ShotScheduleVectorEnv(3, autoreset_mode="Disabled", remember=True, **tiny_kwargs)
    drive_along(envs, 0)
    once = sum(measured)
    drive_along(envs, 0)
    assert once == sum(measured) == 3 * tiny_kwargs["frames_per_drive"]
