"""PPO of Ray's RLlib on several runners; the policy becomes a scheduler for `shotenv evaluate`.

RLlib is no dependency of this package, and asks for one version of gymnasium, 1.2.2: it gets a
virtual environment of its own. In a checkout

    python -m venv rllib && rllib/bin/pip install -r examples/rllib-requirements.txt .
    rllib/bin/python examples/rllib_ppo.py --iterations 20 --runners 2 --out runs/rllib
    shotenv evaluate runs/rllib --env.bank pocket
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from jsonargparse import auto_cli
from torch import nn

from agents.policies import NetworkPolicy, Provenance, score_network
from shotenv.config import env_config
from shotenv.decision import FEATURE_NAMES

# A runner is a process of its own, which has not imported shotenv: the words before the colon make
# gymnasium import it there.
ENV_ID = "shotenv:shotenv/ShotSchedule-v0"
ACTIVATION = "tanh"
CHECKED = 256
"""Observations on which the scheduler has to choose as RLlib's policy does."""


def main(
    iterations: int = 3,
    runners: int = 2,
    envs: int = 16,
    drives: int = 12,
    environment: dict | None = None,
    out: Path = Path("runs/rllib"),
) -> float:
    """Train, tell the mean return on test drives, and write the policy as a scheduler.

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
        Arguments of the environment, such as {"config": "hot"}; the small bank by default.
    out
        Folder of the scheduler.
    """
    import ray
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

    chosen = {"bank": "pocket"} if environment is None else environment
    told = env_config(**chosen)  # What is wrong with it is told at once, here.
    config = (
        PPOConfig()
        .environment(ENV_ID, env_config=chosen)
        .env_runners(
            num_env_runners=runners,
            num_envs_per_env_runner=envs,
            # One batch of drives, not `envs` single environments one after another.
            gym_env_vectorize_mode=gym.VectorizeMode.VECTOR_ENTRY_POINT,
            # A runner on a busy core needs more than the minute after which its drives are dropped.
            sample_timeout_s=3600,
        )
        .rl_module(
            model_config=DefaultModelConfig(
                fcnet_hiddens=[64, 64], fcnet_activation=ACTIVATION, vf_share_layers=False
            )
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
            evaluation_sample_timeout_s=3600,
            evaluation_config={
                "env_config": {**chosen, "split": "test", "drives": drives},
                # Each environment plays the drives in an order of its own; one plays each once.
                "num_envs_per_env_runner": 1,
                "explore": False,
            },
        )
    )
    # Not whatever cluster was last started on this machine, unless it is asked for.
    ray.init(address=os.environ.get("RAY_ADDRESS", "local"))
    algorithm = config.build_algo()
    for iteration in range(iterations):
        result = algorithm.train()
        mean = result["env_runners"]["episode_return_mean"]
        print(f"iteration {iteration + 1}: {mean:.2f} a training drive")
    mean = result["evaluation"]["env_runners"]["episode_return_mean"]
    print(f"PPO: {mean:.2f} a test drive")
    module = algorithm.get_module()
    scheduler = NetworkPolicy(
        actor_network(module.state_dict()),
        Provenance(
            algorithm="rllib ppo",
            feature_names=FEATURE_NAMES,
            power_price=told.reward.power,
            environment=told.model_dump(mode="json"),
        ),
    )
    check(scheduler, module)
    algorithm.stop()
    ray.shutdown()
    scheduler.save(out)
    print(f"The scheduler is in {out}")
    return mean


def actor_network(weights: Mapping[str, torch.Tensor]) -> nn.Sequential:
    """The actor among the weights of RLlib's default module: features to a logit per action.

    Raises
    ------
    ValueError
        There is none of linear layers alone.
    """
    names = []
    for part in ("encoder.actor_encoder.net", "pi.net"):
        form = rf"{re.escape(part)}\.mlp\.(\d+)\.weight"
        places = (int(m[1]) for name in weights if (m := re.fullmatch(form, name)))
        names += [f"{part}.mlp.{place}" for place in sorted(places)]
    if not names or not names[-1].startswith("pi."):
        raise ValueError(f"the module has {', '.join(weights)}; expected an actor of linear layers")
    matrices = [weights[f"{name}.weight"] for name in names]
    network = score_network((matrices[0].shape[1], *(len(m) for m in matrices)), ACTIVATION)
    layers = [layer for layer in network if isinstance(layer, nn.Linear)]
    for layer, name in zip(layers, names, strict=True):
        layer.load_state_dict({part: weights[f"{name}.{part}"] for part in ("weight", "bias")})
    return network


def check(scheduler: NetworkPolicy, module: Any) -> None:
    """Raise ValueError where the scheduler's scores are not the logits of RLlib's module."""
    features = np.random.default_rng(0).normal(size=(CHECKED, len(FEATURE_NAMES)))
    observations = features.astype(np.float32)
    with torch.no_grad():
        logits = module.forward_inference({"obs": torch.from_numpy(observations)})
    expected = logits["action_dist_inputs"].numpy()
    found = scheduler.scores(observations)
    if (found.argmax(1) != expected.argmax(1)).any() or not np.allclose(found, expected, atol=1e-5):
        raise ValueError(
            f"scores differ from RLlib's logits by up to {np.abs(found - expected).max():.2g}; "
            "expected a module of linear layers and the chosen activation alone"
        )


if __name__ == "__main__":
    auto_cli(main)
