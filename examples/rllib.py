"""PPO of Ray's RLlib, whose remote runners step the native vector environment.

RLlib is no dependency of this package, and asks for one version of gymnasium: in a virtual
environment of its own, `pip install 'ray[rllib]' .` from a checkout. Tried with ray 2.60, which
brings gymnasium 1.2.2.

python examples/rllib.py --iterations 20 --runners 2
"""

import gymnasium as gym
from jsonargparse import auto_cli
from ray.rllib.algorithms.ppo import PPOConfig

# A runner is a process of its own, which has not imported shotenv: the words before the colon make
# gymnasium import it there.
ENV_ID = "shotenv:shotenv/ShotSchedule-v0"


def main(
    iterations: int = 3,
    runners: int = 1,
    envs: int = 16,
    drives: int = 12,
    environment: dict | None = None,
) -> float:
    """Train, and tell the mean return on test drives.

    Parameters
    ----------
    iterations
        Rounds of sampling and learning; each is one drive of 256 frames in every environment.
    runners
        Processes that sample.
    envs
        Drives at a time in each of them.
    drives
        Test drives that it is judged on.
    environment
        Arguments of the environment, such as {"config": "hot"}.
    """
    chosen = environment or {}
    config = (
        PPOConfig()
        .environment(ENV_ID, env_config=chosen)
        .env_runners(
            num_env_runners=runners,
            num_envs_per_env_runner=envs,
            # One batch of drives, not `envs` single environments one after another.
            gym_env_vectorize_mode=gym.VectorizeMode.VECTOR_ENTRY_POINT,
        )
        .training(
            gamma=0.95,
            lr=3e-4,
            train_batch_size_per_learner=256 * envs * max(runners, 1),
            minibatch_size=256,
            num_epochs=10,
        )
        .evaluation(
            evaluation_interval=iterations,  # once, after the last
            evaluation_duration=drives,
            evaluation_config={
                "env_config": {**chosen, "split": "test", "drives": drives},
                # Each environment plays the drives in an order of its own; one plays each once.
                "num_envs_per_env_runner": 1,
                "explore": False,
            },
        )
    )
    algorithm = config.build_algo()
    for iteration in range(iterations):
        told = algorithm.train()
        mean = told["env_runners"]["episode_return_mean"]
        print(f"iteration {iteration + 1}: {mean:.2f} a training drive")
    mean = told["evaluation"]["env_runners"]["episode_return_mean"]
    print(f"PPO: {mean:.2f} a test drive")
    algorithm.stop()
    return mean


if __name__ == "__main__":
    auto_cli(main)
