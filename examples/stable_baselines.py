"""PPO and DQN of stable-baselines3: the adapter first, then as with every other environment.

python examples/stable_baselines.py --algorithm DQN --steps 100000
"""

from typing import Literal

import gymnasium as gym
from jsonargparse import auto_cli
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

import shotenv  # noqa: F401 - registers the environments
from agents import Sb3VecEnv


def main(
    algorithm: Literal["PPO", "DQN"] = "PPO",
    steps: int = 100_000,
    envs: int = 16,
    drives: int = 12,
    environment: dict | None = None,
) -> float:
    """Train, and tell the mean return on test drives.

    Parameters
    ----------
    algorithm
        Which of the two.
    steps
        Frames to learn from.
    envs
        Drives at a time.
    drives
        Test drives that it is judged on.
    environment
        Arguments of the environment, such as {"bank": "starter"}.
    """
    chosen = environment or {}
    # stable-baselines3 has vector environments of its own kind; without the adapter it takes this
    # one for a single environment, and its message does not tell what is wrong.
    many = Sb3VecEnv(
        gym.make_vec("shotenv/ShotSchedule-v0", num_envs=envs, autoreset_mode="SameStep", **chosen)
    )
    if algorithm == "PPO":
        model = PPO("MlpPolicy", many, gamma=0.95, n_steps=256, verbose=1)
    else:
        model = DQN("MlpPolicy", many, gamma=0.95, gradient_steps=4, verbose=1)
    model.learn(steps)

    test = gym.make("shotenv/ShotSchedule-v0", drives=drives, **{**chosen, "split": "test"})
    mean, deviation = evaluate_policy(model, Monitor(test), n_eval_episodes=drives)
    print(f"{algorithm}: {mean:.2f} a drive, standard deviation {deviation:.2f}")
    return mean


if __name__ == "__main__":
    auto_cli(main)
