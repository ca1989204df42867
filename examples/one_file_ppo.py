"""PPO in one file, in plain torch, on the native vector environment: read it from top to bottom.

python examples/one_file_ppo.py --steps 150000
"""

import time
from dataclasses import dataclass, field

import gymnasium as gym
import numpy as np
import torch
from jsonargparse import auto_cli
from torch import nn
from torch.distributions import Categorical

import shotenv  # noqa: F401 - registers the environments


@dataclass
class Config:
    """What can be set on the command line."""

    steps: int = 150_000
    """Frames to learn from, all environments together."""
    envs: int = 256
    """Drives at a time; a step of many costs each of them less."""
    rollout: int = 16
    """Frames of each drive between two updates."""
    epochs: int = 4
    """Passes over a rollout in an update."""
    minibatches: int = 4
    """Parts of a pass."""
    learning_rate: float = 1e-3
    gamma: float = 0.95
    """Discount of a frame. Heat lasts some seconds, what was seen of a scene less."""
    gae_lambda: float = 0.9
    """Weight of longer advantages (Schulman and others 2016)."""
    clip: float = 0.2
    """Most that a probability's ratio may move the loss."""
    entropy: float = 0.01
    """Weight of the entropy that keeps the policy trying."""
    width: int = 64
    """Neurons of each of the two hidden layers."""
    seed: int = 0
    drives: int = 24
    """Test drives that it is judged on."""
    environment: dict = field(default_factory=dict)
    """Arguments of the environment, such as {"bank": "starter"}."""


def perceptron(inputs: int, outputs: int, width: int) -> nn.Sequential:
    """Two hidden layers."""
    return nn.Sequential(
        *(nn.Linear(inputs, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh()),
        nn.Linear(width, outputs),
    )


def train(config: Config) -> nn.Module:
    """The trained actor: features [N, D] to logits [N, 3]."""
    torch.manual_seed(config.seed)
    envs = gym.make_vec(
        "shotenv/ShotSchedule-v0",
        num_envs=config.envs,
        autoreset_mode="SameStep",
        **config.environment,
    )
    features = envs.single_observation_space.shape[0]
    actor, critic = perceptron(features, 3, config.width), perceptron(features, 1, config.width)
    parameters = [*actor.parameters(), *critic.parameters()]
    optimizer = torch.optim.Adam(parameters, lr=config.learning_rate, fused=True)

    shape = config.rollout, config.envs
    observations, actions = torch.zeros(*shape, features), torch.zeros(shape, dtype=torch.int64)
    log_probabilities, rewards, values, ends = (torch.zeros(shape) for _ in range(4))
    seen = torch.from_numpy(envs.reset(seed=config.seed)[0])
    began, updates = time.perf_counter(), max(config.steps // (config.rollout * config.envs), 1)
    for update in range(updates):
        for t in range(config.rollout):
            with torch.no_grad():
                choice = Categorical(logits=actor(seen), validate_args=False)
                observations[t], values[t] = seen, critic(seen)[:, 0]
                actions[t] = choice.sample()
                log_probabilities[t] = choice.log_prob(actions[t])
            told, reward, _, over, info = envs.step(actions[t].numpy())
            rewards[t], ends[t] = torch.from_numpy(reward), torch.from_numpy(over)
            if over.any():
                # A drive is cut off and does not end: what would follow still counts.
                last = torch.from_numpy(np.stack(info["final_obs"][over]))
                with torch.no_grad():
                    rewards[t, over] += config.gamma * critic(last)[:, 0]
            seen = torch.from_numpy(told)

        # Advantages from the last frame backwards; a new drive has nothing to do with the old one.
        advantages, advantage = torch.zeros(shape), torch.zeros(config.envs)
        with torch.no_grad():
            following = critic(seen)[:, 0]
        for t in reversed(range(config.rollout)):
            goes_on = 1.0 - ends[t]
            surprise = rewards[t] + config.gamma * following * goes_on - values[t]
            advantage = surprise + config.gamma * config.gae_lambda * goes_on * advantage
            advantages[t], following = advantage, values[t]
        returns = (advantages + values).flatten()

        batch = [part.flatten(0, 1) for part in (observations, actions, log_probabilities)]
        advantages = advantages.flatten()
        for _ in range(config.epochs):
            for rows in torch.randperm(len(returns)).chunk(config.minibatches):
                seen_then, taken, log_then = (part[rows] for part in batch)
                choice = Categorical(logits=actor(seen_then), validate_args=False)
                ratio = (choice.log_prob(taken) - log_then).exp()
                gain = advantages[rows]
                gain = (gain - gain.mean()) / (gain.std() + 1e-8)
                clipped = ratio.clamp(1.0 - config.clip, 1.0 + config.clip)
                loss = -torch.minimum(ratio * gain, clipped * gain).mean()
                loss += 0.5 * (critic(seen_then)[:, 0] - returns[rows]).square().mean()
                loss -= config.entropy * choice.entropy().mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(parameters, 0.5)
                optimizer.step()
        frames = (update + 1) * config.rollout * config.envs
        pace = frames / (time.perf_counter() - began)
        print(f"{frames:8} frames, {pace:6.0f} a second, reward {rewards.mean():+.3f} a frame")
    return actor


def judge(choose, config: Config) -> np.ndarray:
    """Returns [drives] of a policy on test drives, the same for every policy."""
    envs = gym.make_vec(
        "shotenv/ShotSchedule-v0",
        num_envs=config.drives,
        autoreset_mode="Disabled",
        **{**config.environment, "split": "test"},
    )
    seen, _ = envs.reset(options={"drive": list(range(config.drives))})
    total, over = np.zeros(config.drives), np.zeros(config.drives, dtype=bool)
    while not over.all():
        seen, reward, _, over, _ = envs.step(choose(seen))
        total += reward
    return total


def main(config: Config) -> dict[str, float]:
    """Train, and compare with the fixed choices on the same drives."""
    torch.set_num_threads(1)  # the maps and networks are small: threads would wait for each other
    actor = train(config)

    def trained(seen: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return actor(torch.from_numpy(seen)).argmax(dim=1).numpy()

    returns = {"trained": judge(trained, config)}
    for action, shots in enumerate((2, 4, 8)):
        returns[f"always {shots}"] = judge(lambda seen, a=action: np.full(len(seen), a), config)
    for name, each in returns.items():
        ahead = returns["trained"] - each
        # Standard error over drives; those that share clips are not independent.
        error = ahead.std() / len(ahead) ** 0.5
        print(f"{name:9} {each.mean():8.2f} a drive; trained {ahead.mean():+.2f} +- {error:.2f}")
    return {name: float(each.mean()) for name, each in returns.items()}


if __name__ == "__main__":
    main(auto_cli(Config))
