"""The regression learns what actions are worth, from what it meets, and can be interrupted."""

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from agents.config.agent import AgentConfig, RegressionConfig
from agents.evaluation.play import FIXED_POLICIES, make_envs, play_drives
from agents.policies.fixed import FixedPolicy
from agents.policies.learned import load_policy
from agents.policies.score_networks import widths_of
from agents.training.checkpoint import CHECKPOINT
from agents.training.fitting import Frames, fit, regret
from agents.training.regression import RegressionTrainer, Straying
from agents.training.scheduler import branches_of, priced, validation_prices
from shotenv.config.keywords import env_config
from shotenv.decision.features import FEATURE_NAMES

PRICE = (0.01, 0.35)
SMALL = AgentConfig(
    algorithm="regression",
    hidden=(8,),
    seed=3,
    regression=RegressionConfig(rounds=3, horizon=3, members=2, passes=3, batch_size=64),
)


def guessing(count, seed):
    """Frames in which the sign of the first of two elements says what is worth most."""
    generator = torch.Generator().manual_seed(seed)
    observations = 2 * torch.rand(count, 2, generator=generator) - 1
    worth = torch.randn(count, 1, generator=generator) + torch.zeros(count, 3)
    worth[torch.arange(count), torch.where(observations[:, 0] > 0, 2, 0)] += 4.0
    return Frames(observations, worth)


def test_regret_is_what_the_chosen_actions_lack():
    frames = Frames(torch.zeros(2, 1), torch.tensor([[1.0, 5.0, 2.0], [3.0, 2.0, 0.0]]))
    network = torch.nn.Linear(1, 3)
    torch.nn.init.zeros_(network.weight)
    for action, lost in enumerate((2.0, 0.5, 3.0)):
        with torch.no_grad():
            network.bias.copy_(torch.eye(3)[action])
        assert regret(network, frames) == pytest.approx(lost)


def known_frames(count, seed):
    """Frames of all features, of which the first two say in a line what each action is worth."""
    generator = torch.Generator().manual_seed(seed)
    observations = torch.randn(count, len(FEATURE_NAMES), generator=generator)
    weight = torch.tensor([[1.0, 0.0, -1.0], [0.0, 2.0, -2.0]])
    return Frames(observations, observations[:, :2] @ weight + torch.tensor([0.3, -0.3, 0.0]))


def test_without_hidden_layers_the_fit_is_a_ridge_regression():
    training, judging = known_frames(4096, 0), known_frames(512, 1)
    network = fit(training, judging, SMALL.model_copy(update={"hidden": ()}), seed=0)
    assert widths_of(network) == (len(FEATURE_NAMES), 3)
    with torch.no_grad():
        scores, worth = network(judging.observations), judging.worth
    torch.testing.assert_close(scores, worth - worth.mean(1, keepdim=True), atol=0.02, rtol=0.0)
    assert regret(network, judging) < 0.001


@pytest.mark.parametrize("hidden", [(), (8,)])
def test_what_is_not_shown_changes_no_score(hidden):
    training, judging = known_frames(1024, 0), known_frames(256, 1)
    names = FEATURE_NAMES[1], FEATURE_NAMES[30]
    learner = SMALL.regression.model_copy(update={"unseen": names, "passes": 2})
    config = SMALL.model_copy(update={"hidden": hidden, "regression": learner})
    network = fit(training, judging, config, seed=0)
    seen, changed = judging.observations, judging.observations.clone()
    changed[:, [1, 30]] += 5.0
    with torch.no_grad():
        assert torch.equal(network(seen), network(changed))
        changed[:, 0] += 5.0
        assert not torch.equal(network(seen), network(changed))


def test_features_that_there_are_none_of_are_refused(tiny_kwargs, tmp_path):
    drives = branches_of(env_config(**tiny_kwargs), "train", [0])
    learner = SMALL.regression.model_copy(update={"unseen": ("mood",)})
    config = SMALL.model_copy(update={"regression": learner})
    with pytest.raises(ValueError, match="feature_names has no 'mood'"):
        RegressionTrainer(drives, drives, config, lambda policy: 0.0, tmp_path)


def test_a_fit_tells_what_actions_are_worth_beside_each_other():
    training, judging = guessing(2048, 0), guessing(512, 1)
    learner = RegressionConfig(members=3, noise=0.05, passes=8, batch_size=256)
    config = SMALL.model_copy(update={"regression": learner})
    network = fit(training, judging, config, seed=0)
    assert widths_of(network) == (2, 3 * 8, 3), "members side by side"
    always_four = torch.nn.Linear(2, 3)
    torch.nn.init.constant_(always_four.weight, 0.0)
    with torch.no_grad():
        always_four.bias.copy_(torch.tensor([0.0, 1.0, 0.0]))
    assert regret(network, judging) < 0.2 < 3.0 < regret(always_four, judging)
    # In the units of what was given, and up to what is common to all actions.
    dearer = Frames(training.observations, 10 * training.worth + torch.arange(2048.0)[:, None])
    seen = judging.observations
    torch.testing.assert_close(
        fit(dearer, judging, config, seed=0)(seen), 10 * network(seen), rtol=0.02, atol=0.1
    )
    again, other = (fit(training, judging, config, seed=seed) for seed in (0, 1))
    assert torch.equal(network[0].weight, again[0].weight)
    assert not torch.equal(network[0].weight, other[0].weight)


def test_what_is_learnt_by_heart_is_not_kept():
    """Frames that say 8 DCS, judged where 2 are best: what was before it was learnt is kept."""
    observations = torch.rand(256, 2, generator=torch.Generator().manual_seed(0)) - 0.5
    training, judging = (Frames(observations, torch.eye(3)[[best] * 256]) for best in (2, 0))
    learner = RegressionConfig(members=1, passes=40, batch_size=32, learning_rate=1e-3)
    config = SMALL.model_copy(update={"regression": learner})
    kept = fit(training, judging, config, seed=1)
    assert regret(kept, judging) < 0.8 and regret(kept, training) > 0.2
    assert regret(fit(training, training, config, seed=1), training) == 0.0


def test_some_drives_stray_and_some_do_not():
    shares = np.array([0.0, 0.6, 1.0])
    policy = Straying(FixedPolicy(8), shares, np.random.default_rng(0))
    actions = np.stack([policy.act(np.zeros((3, 2))) for _ in range(3000)])
    np.testing.assert_allclose((actions != 2).mean(axis=0), shares * 2 / 3, atol=0.03)


@pytest.fixture(scope="module")
def drives():
    config = env_config(frames_per_drive=16, reward={"power": PRICE})
    return branches_of(config, "train", [1, 2, 3, 4]), branches_of(config, "validation", [1, 2])


def trainer(drives, out, validate=lambda policy: 0.0, config=SMALL):
    return RegressionTrainer(*drives, config, validate, out)


def test_an_interrupted_regression_goes_on_to_the_same_end(drives, tmp_path):
    rounds = iter(range(9))

    def rising(policy):
        return float(next(rounds))

    whole = trainer(drives, tmp_path / "whole", rising).run()
    assert whole.provenance.algorithm == "regression" and whole.provenance.power_price == PRICE
    calls = iter((0.0, None))

    def interrupted(policy):
        found = next(calls)
        if found is None:
            raise KeyboardInterrupt
        return found

    with pytest.raises(KeyboardInterrupt):
        trainer(drives, tmp_path / "parts", interrupted).run()
    load_policy(tmp_path / "parts")  # The best so far.
    resumed = trainer(drives, tmp_path / "parts", rising).run()
    for name, tensor in whole.network.state_dict().items():
        assert torch.equal(tensor, resumed.network.state_dict()[name]), name
    one, two = (load_file(tmp_path / run / CHECKPOINT) for run in ("whole", "parts"))
    assert one.keys() == two.keys() and all(torch.equal(one[name], two[name]) for name in one)
    # A finished run has nothing left to do.
    again = trainer(drives, tmp_path / "whole", interrupted).run()
    assert torch.equal(again.network[0].weight, whole.network[0].weight)


def test_the_best_round_is_kept_and_rounds_differ(drives, tmp_path):
    returns, seen = iter((1.0, 3.0, 2.0)), []

    def validate(policy):
        seen.append(policy.network[0].weight)
        return next(returns)

    best = trainer(drives, tmp_path, validate).run()
    assert torch.equal(best.network[0].weight, seen[1])
    assert not torch.equal(seen[0], seen[1]) and not torch.equal(seen[1], seen[2])


def test_checkpoints_of_other_runs_are_refused(drives, tmp_path):
    trainer(drives, tmp_path).run()
    other = SMALL.model_copy(update={"seed": 4})
    with pytest.raises(ValueError, match="another configuration"):
        trainer(drives, tmp_path, config=other).run()


def test_training_prices_replace_those_of_the_environment():
    config = env_config()
    assert priced(config, None) == config
    assert priced(config, PRICE).reward.power == PRICE
    assert priced(config, PRICE).reward.error == config.reward.error
    assert validation_prices((0.09, 0.09)) == [0.09]
    prices = validation_prices(PRICE)
    steps = np.diff(np.log([*prices]))
    np.testing.assert_allclose(steps, np.log(35.0) / 4)
    assert prices[0] / PRICE[0] == pytest.approx(PRICE[1] / prices[-1])


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_one_scheduler_beats_every_fixed_choice_at_every_price(tmp_path):
    config = AgentConfig(
        algorithm="regression",
        regression=RegressionConfig(rounds=3, drives=48, validation_drives=16, members=3),
    )
    env = priced(env_config(), PRICE)
    training = branches_of(env, "train", list(range(48)))
    judging = branches_of(env, "validation", list(range(1000, 1016)))
    prices = validation_prices(PRICE)
    RegressionTrainer(
        training,
        judging,
        config,
        lambda policy: judging.mean_return(policy, prices),
        tmp_path,
    ).run()
    policy, seeds = load_policy(tmp_path), list(range(1000, 1032))
    envs = make_envs(env, "test", len(seeds), "Disabled")
    for price in (0.02, 0.04, 0.09, 0.2):
        fixed = [
            play_drives(one, envs, seeds, price=price).reward.sum(axis=1).mean()
            for one in FIXED_POLICIES.values()
        ]
        learnt = play_drives(policy, envs, seeds, price=price).reward.sum(axis=1).mean()
        assert learnt > max(fixed), f"price {price}: {learnt:.1f}, fixed {fixed}"
