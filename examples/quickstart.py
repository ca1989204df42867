"""Drive through one episode with random shots and say what it cost."""

import gymnasium as gym

import shotenv  # noqa: F401 - registers the environments

env = gym.make("shotenv/ShotSchedule-v0", reward={"power": 0.09})
observation, info = env.reset(seed=0)
total, over = 0.0, False
while not over:
    observation, reward, _, over, info = env.step(env.action_space.sample())
    total += reward
    print(f"{info['shots']} shots, {info['depth_mae_m']:.2f} m, {info['temperature_k']:.1f} K")
print(f"return {total:.1f}")
