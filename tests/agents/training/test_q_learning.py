"""DQN and QR-DQN by the same entry: they learn, the best is kept, and a run can be resumed."""

import sys

import numpy as np
import pytest
import torch
from test_training import FRAMES, NAMES, make_envs, validate

from agents.config.agent import AgentConfig, DqnConfig
from agents.policies.learned import load_policy
from agents.training.checkpoint import CHECKPOINT
from agents.training.q_learning import QLearner
from agents.training.sb3_vector import Sb3VecEnv
from shotenv.config.keywords import env_config

PRICED = env_config(reward={"power": (0.01, 0.35)})
LEARNER = DqnConfig(
    total_steps=1200,
    num_envs=4,
    buffer_size=1200,
    learning_starts=64,
    gradient_steps=4,
    batch_size=64,
    learning_rate=3e-3,
    gamma=0.0,
    target_update=16,
    quantiles=5,
    validations=3,
)


def learner(algorithm, out, check=validate, **changes):
    told = {"hidden": (32,), "seed": 2, "dqn": LEARNER, **changes}
    config = AgentConfig(algorithm=algorithm, **told)
    return QLearner(Sb3VecEnv(make_envs()), NAMES, FRAMES, config, check, out, PRICED)


@pytest.mark.parametrize("algorithm", ["dqn", "qrdqn"])
def test_both_learn_and_keep_the_best_policy(tmp_path, algorithm):
    returns = []

    def check(policy):
        returns.append(validate(policy))
        return returns[-1]

    best = learner(algorithm, tmp_path, check).run()
    assert not (tmp_path / "tensorboard").exists()
    assert len(returns) == LEARNER.validations
    assert validate(best) == max(returns) > 0.9
    kept = load_policy(tmp_path)
    assert kept.provenance.algorithm == algorithm and kept.provenance.power_price == (0.01, 0.35)
    assert (
        kept.provenance.training["dqn"]["quantiles"] == 5 and "ppo" not in kept.provenance.training
    )


@pytest.mark.parametrize("algorithm", ["dqn", "qrdqn"])
def test_what_is_kept_chooses_as_the_model_does(tmp_path, algorithm):
    one = learner(algorithm, tmp_path)
    observed = np.random.default_rng(0).uniform(-1, 1, (256, 2)).astype(np.float32)
    expected, _ = one.model.predict(observed, deterministic=True)
    assert len(np.unique(expected)) > 1
    np.testing.assert_array_equal(one.policy.act(observed), expected)


@pytest.mark.parametrize("algorithm", ["dqn", "qrdqn"])
@pytest.mark.parametrize("buffer_size", [1280, 480])
def test_interrupted_training_equals_uninterrupted(tmp_path, algorithm, buffer_size):
    """Also where the oldest steps have been forgotten."""
    dqn = LEARNER.model_copy(update={"buffer_size": buffer_size})
    whole = learner(algorithm, tmp_path / "whole", dqn=dqn)
    whole.run()
    calls = iter((0.25, 0.5))

    def interrupted(policy):
        if (found := next(calls, None)) is None:
            raise KeyboardInterrupt
        return found

    parts = learner(algorithm, tmp_path / "parts", interrupted, dqn=dqn)
    with pytest.raises(KeyboardInterrupt):
        parts.run()
    resumed = learner(algorithm, tmp_path / "parts", dqn=dqn)
    resumed.run()
    assert resumed.model.num_timesteps == resumed.rounds * resumed.round_steps
    assert resumed.model.exploration_rate == LEARNER.epsilon
    # The last networks, of which one is the target.
    for name, tensor in whole.model.policy.state_dict().items():
        assert torch.equal(tensor, resumed.model.policy.state_dict()[name]), name
    # What it learnt from is no longer wanted.
    assert (tmp_path / "parts" / CHECKPOINT).stat().st_size < 20_000


def test_a_missing_package_is_named_with_its_cure(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(ImportError, match="pip install sb3-contrib"):
        learner("qrdqn", tmp_path)


def test_curves_are_written_where_they_are_asked_for(tmp_path):
    tensorboard = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    one = learner("dqn", tmp_path, tensorboard=True)
    one.run()
    events = tensorboard.EventAccumulator(str(tmp_path / "tensorboard"))
    events.Reload()
    points = events.Scalars("validation/return")
    assert [point.step for point in points] == [one.round_steps * number for number in (1, 2, 3)]
    assert points[0].step > FRAMES * 4
