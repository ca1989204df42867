"""The variants: images in the observation, and a reward that is a vector."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
import torch

import shotenv
from shotenv.decision import TERMS
from shotenv.env.image_observation import SIZE


def make(env_id, kwargs, **changes):
    return gymnasium.make(env_id, **{**kwargs, **changes})


def test_the_image_shows_gray_now_and_depth_before(tiny_kwargs):
    env = make(shotenv.IMAGE_ENV_ID, tiny_kwargs)
    observation, _ = env.reset(seed=0)
    assert env.observation_space["image"].shape == (3, 60, 80)
    problem = env.unwrapped.problem
    for action in (2, 0):
        state = env.unwrapped.state
        gray_lsb = problem.bank.gray(state.drive.frame(state.step))[0].float()
        # Pixels of the tiny bank are larger than those of the image: corners lie within one.
        corner = (gray_lsb[0, 0] / 4095 * 255).round()
        assert observation["image"][0, 0, 0] == pytest.approx(float(corner), abs=1)
        observation, *_ = env.step(action)
        depth, validity = observation["image"][1:]
        assert validity.any() and np.array_equal(depth > 0, (validity > 0) & (depth > 0))
        assert not depth[validity == 0].any()
    assert not env.reset()[0]["image"][1:].any(), "nothing has been seen of a new drive"


def test_depth_is_averaged_over_valid_pixels(tiny_kwargs):
    """Against the acquisition itself, pooled in plain NumPy."""
    from shotenv.env.image_observation import acquired_again, depth_images

    env = make(shotenv.IMAGE_ENV_ID, tiny_kwargs).unwrapped
    env.reset(seed=1)
    before = env.state
    env.step(2)
    depth = acquired_again(env.problem, before, 8).depth
    (found,) = depth_images(env.problem, before, torch.tensor([8]))
    distance_m, valid = depth.distance_m[0].numpy(), depth.valid[0].numpy()
    rows, columns = distance_m.shape
    for i, j in ((0, 0), (30, 40), (59, 79), (44, 13), (20, 66)):
        # Areas as adaptive pooling cuts them: from the floor to the ceiling of i H / 60.
        part = np.s_[
            i * rows // SIZE[0] : -(-(i + 1) * rows // SIZE[0]),
            j * columns // SIZE[1] : -(-(j + 1) * columns // SIZE[1]),
        ]
        share = valid[part].mean()
        mean_m = distance_m[part][valid[part]].mean() if share else 0.0
        assert found[1, i, j] == pytest.approx(255 * share, abs=0.51)
        range_m = env.problem.config.sensor.max_range_m
        assert found[0, i, j] == pytest.approx(min(255 * mean_m / range_m, 255), abs=0.51)


def test_a_frame_without_laser_shows_no_depth(tiny_kwargs):
    laser = {"trip_k": 318.0, "release_k": 314.0, "ambient_k": [304.15, 310.15]}
    hot = {"laser": laser, "protect": False, "frames_per_drive": 256}
    env = make(shotenv.IMAGE_ENV_ID, tiny_kwargs, **hot)
    env.reset(seed=0, options={"ambient_k": 313.9, "laser_power_w": 90.0})
    for _ in range(256):
        observation, _, _, _, info = env.step(2)
        assert observation["image"][2].any() == (info["shots"] > 0)
        if info["tripped"]:
            break
    assert info["tripped"]


def test_the_state_beside_the_image_is_the_features(tiny_kwargs):
    image, plain = (make(name, tiny_kwargs) for name in (shotenv.IMAGE_ENV_ID, shotenv.ENV_ID))
    assert np.array_equal(image.reset(seed=2)[0]["state"], plain.reset(seed=2)[0])
    for action in (2, 1):
        left, right = image.step(action), plain.step(action)
        assert np.array_equal(left[0]["state"], right[0]) and left[1] == right[1]


def test_objectives_are_minus_the_terms(tiny_kwargs):
    env, plain = (make(name, tiny_kwargs) for name in (shotenv.MO_ENV_ID, shotenv.ENV_ID))
    unwrapped = env.unwrapped
    assert unwrapped.objectives == TERMS and unwrapped.reward_dim == len(TERMS)
    assert unwrapped.reward_space.shape == (len(TERMS),)
    env.reset(seed=0)
    plain.reset(seed=0)
    for action in (0, 1, 2):
        _, reward, _, _, info = env.step(action)
        assert reward.dtype == np.float32 and reward in unwrapped.reward_space
        assert np.array_equal(reward, -info["vector_reward"])
        assert np.array_equal(info["vector_reward"], plain.step(action)[-1]["vector_reward"])


def test_rewards_of_a_vector_of_objectives(tiny_kwargs):
    kwargs = {**tiny_kwargs, "frames_per_drive": 2}
    envs = gymnasium.make_vec(shotenv.MO_ENV_ID, 3, **kwargs)
    envs.reset(seed=0)
    for step in range(3):
        _, rewards, *_, infos = envs.step(np.array([0, 1, 2]))
        assert rewards.shape == (3, len(TERMS)) and rewards.dtype == np.float32
        # The third step starts new drives, and pays nothing.
        assert np.array_equal(rewards, -infos["vector_reward"]) and rewards.any() == (step < 2)


def test_weights_times_objectives_are_a_reward(tiny_kwargs):
    """What the wrappers of mo-gymnasium do with it."""
    weights = np.array([1.0, 0.0, 0.04, 0.5])
    env = gymnasium.wrappers.TransformReward(
        make(shotenv.MO_ENV_ID, tiny_kwargs), lambda reward: float(weights @ reward)
    )
    env.reset(seed=0)
    _, reward, _, _, info = env.step(2)
    assert reward == pytest.approx(-weights @ list(info["reward_terms"].values()))


@pytest.mark.parametrize("env_id", [shotenv.ENV_ID, shotenv.IMAGE_ENV_ID, shotenv.MO_ENV_ID])
def test_an_action_of_another_kind_is_named(tiny_kwargs, env_id):
    env = make(env_id, tiny_kwargs).unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action is .*; expected 0"):
        env.step(np.array([0, 1]))
