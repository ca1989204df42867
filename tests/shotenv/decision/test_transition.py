"""The transition: batches, reward, heat, and the table of all outcomes."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import pytest
import torch

from shotenv.bank.predictions import keep_predictions
from shotenv.config.env import RewardConfig
from shotenv.config.keywords import env_config
from shotenv.config.reader import ConfigError
from shotenv.decision.drive import chain_clips
from shotenv.decision.features import FEATURE_NAMES, LIMIT, TOLD, frame_means
from shotenv.decision.outcomes import outcomes_of_all_actions
from shotenv.decision.problem import open_problem
from shotenv.decision.rewards import TERMS, reward, reward_terms
from shotenv.decision.score import no_depth, score_depth
from shotenv.decision.state import observe
from shotenv.decision.transition import SHOTS_OF_ACTION, allowed_actions, reset, step
from shotenv.laser.cost import ShotCost
from unwrap.networks.predictor import load_unwrapper
from unwrap.support.process_state import torch_threads
from unwrap.support.tensors import concatenate, put, take


@pytest.fixture(scope="module")
def problem(tiny_kwargs, session_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        return open_problem(env_config(**tiny_kwargs, split="all"))


def score(distance, valid, truth, scored, scale=0.5):
    return score_depth(
        torch.tensor([[distance]]),
        torch.tensor([[valid]]),
        torch.tensor([[truth]]),
        torch.tensor([[scored]]),
        error_scale_m=scale,
        unambiguous_m=6.25,
        range_m=25.0,
    )


def test_score_by_hand():
    """The third pixel's best guess is right, the fourth has none."""
    nan, inf = float("nan"), float("inf")
    found = score(
        [2.5, 9.0, 3.0, nan, 1.0],
        [True, True, False, False, True],
        [2.0, 2.0, 3.0, 4.0, inf],
        [True, True, True, True, False],
    )
    assert found.error.item() == pytest.approx((0.5 + 7 / 7.5 + 0 + 1) / 4)
    assert found.depth_mae_m.item() == pytest.approx((0.5 + 7) / 2)
    assert found.depth_rmse_m.item() == pytest.approx(((0.25 + 49) / 2) ** 0.5)
    assert found.wrap_accuracy.item() == pytest.approx(1 / 4)
    assert found.valid_share.item() == pytest.approx(2 / 4)
    assert found.within_0p1m.item() == 0.0


def test_close_are_pixels_that_are_valid_and_err_by_less_than_ten_centimetres():
    found = score(
        [2.09, 1.91, 2.11, 2.0, 2.0],
        [True, True, True, False, True],
        [2.0, 2.0, 2.0, 2.0, 2.0],
        [True, True, True, True, False],
    )
    assert found.within_0p1m.item() == 2 / 4


def test_maps_of_different_shapes_are_not_scored():
    with pytest.raises(ValueError, match="one shape"):
        score([1.0, 2.0], [True], [9.0, 9.0], [True, True])


def test_a_frame_without_scored_pixels_costs_nobody_anything():
    found = score([1.0, 2.0], [True, False], [9.0, 9.0], [False, False])
    assert found.error.item() == 0.0
    assert found.valid_share.item() == found.within_0p1m.item() == 1.0


def cost_where(one, **values):
    fields = [field.name for field in dataclasses.fields(ShotCost)]
    return ShotCost(**{name: values.get(name, 0.0) * one for name in fields})


def test_reward_is_what_is_saved_against_four_samples():
    one = torch.ones(1, dtype=torch.float64)
    cost = cost_where(one, energy_j=2.0, duty=0.02)
    eight = cost_where(one, energy_j=5.0, duty=0.08)
    terms = reward_terms(no_depth(1, 25.0), cost, eight, torch.tensor([True]))
    assert {name: value.item() for name, value in terms.items()} == {
        "error": 1.0,
        "duty": 0.25,
        "power": 0.4,
        "tripped": 1.0,
    }
    weights = RewardConfig(error=2.0, duty=0.4, power=0.5, trip=0.3, scale=10.0)
    reference = {"error": 0.1 * one, "duty": 0.5 * one, "power": 0.6 * one, "tripped": 0.0 * one}
    # The price is each drive's own, not that of the weights.
    taken, four = 2.0 + 0.1 + 0.4 * 0.25 + 0.3, 0.2 + 0.2 + 0.6 * 0.25
    found = reward(terms, reference, 0.25 * one, weights)
    assert found.item() == pytest.approx(10.0 * (four - taken))


def test_means_are_the_same_on_any_number_of_threads():
    maps = torch.rand(3, 240, 320, generator=torch.Generator().manual_seed(0))
    means = []
    for count in (1, 2):
        with torch_threads(count):
            means += [frame_means(maps), torch.cat([frame_means(one[None]) for one in maps])]
    assert all(torch.equal(means[0], other) for other in means)


def test_scores_are_those_of_a_slow_loop_over_the_batch():
    generator = torch.Generator().manual_seed(1)
    truth = 30 * torch.rand(3, 24, 32, generator=generator)
    distance = truth + 4 * torch.randn(truth.shape, generator=generator)
    valid, counted = torch.rand(2, *truth.shape, generator=generator) > 0.2
    found = score_depth(
        distance, valid, truth, counted, error_scale_m=0.5, unambiguous_m=6.25, range_m=25.0
    )
    for b in range(3):
        errors = (distance[b] - truth[b]).abs().double()
        good = counted[b] & valid[b]
        bounded = (errors / (errors + 0.5))[counted[b]].mean()
        assert found.error[b].item() == pytest.approx(bounded.item(), rel=1e-6)
        assert found.depth_mae_m[b].item() == pytest.approx(errors[good].mean().item(), rel=1e-6)
        squares = errors[good].square().mean().sqrt()
        assert found.depth_rmse_m[b].item() == pytest.approx(squares.item(), rel=1e-6)
        right = (good & (errors < 3.125)).sum() / counted[b].sum()
        assert found.wrap_accuracy[b].item() == pytest.approx(right.item(), rel=1e-6)
        close = (good & (errors < 0.1)).sum() / counted[b].sum()
        assert found.within_0p1m[b].item() == pytest.approx(close.item(), rel=1e-6)
        share = good.sum() / counted[b].sum()
        assert found.valid_share[b].item() == pytest.approx(share.item(), rel=1e-6)


def test_rows_of_nested_values():
    count = len(dataclasses.fields(ShotCost))
    state = ShotCost(*(torch.arange(4.0) + 10 * i for i in range(count)))
    rows = torch.tensor([3, 1])
    part = take(state, rows)
    assert part.readout_energy_j.tolist() == [23.0, 21.0]
    changed = put(state, rows, ShotCost(*(torch.zeros(2) for _ in range(count))))
    assert changed.static_energy_j.tolist() == [30.0, 0.0, 32.0, 0.0]
    assert state.static_energy_j.tolist() == [30.0, 31.0, 32.0, 33.0]
    assert concatenate([part, part]).driver_energy_j.tolist() == [13.0, 11.0] * 2


def runs_of(frames):
    """Consecutive bank frames of a drive, one list for each clip that it plays."""
    runs = [[frames[0]]]
    for before, frame in pairwise(frames):
        if frame == before + 1 and frame % 4:
            runs[-1].append(frame)
        else:
            runs.append([frame])
    return runs


def test_a_drive_plays_whole_clips_of_its_split(problem):
    clips = problem.bank.splits("train")
    frames = chain_clips(clips, 101, generator=torch.Generator().manual_seed(0)).tolist()
    assert len(frames) == 101
    assert {clip.frames for clip in clips} == {4}
    assert {clip.start % 4 for clip in clips} == {0}
    runs = runs_of(frames)
    # From the middle of the first clip and to the middle of the last one; all others whole.
    assert all(run[0] % 4 == 0 for run in runs[1:])
    assert all(run[-1] % 4 == 3 for run in runs[:-1])
    order = [problem.bank.clip_of(run[0]) for run in runs]
    assert all(clip.split == "train" for clip in order)
    assert all(a is not b for a, b in pairwise(order))
    assert len({clip.name for clip in order}) == len(clips)


def test_drives_are_cut_at_different_steps(problem):
    clips = problem.bank.splits("train")
    first = [
        len(
            runs_of(chain_clips(clips, 9, generator=torch.Generator().manual_seed(seed)).tolist())[
                0
            ]
        )
        for seed in range(40)
    ]
    # The first clip has four frames: drives begin at each of them.
    assert set(first) == {1, 2, 3, 4}
    again = chain_clips(clips, 9, generator=torch.Generator().manual_seed(7)).tolist()
    assert again == chain_clips(clips, 9, generator=torch.Generator().manual_seed(7)).tolist()


def rows_equal(one, many, row):
    for field in dataclasses.fields(one):
        left, right = getattr(one, field.name), getattr(many, field.name)
        if dataclasses.is_dataclass(left):
            rows_equal(left, right, row)
        elif isinstance(left, dict):
            assert all(torch.equal(left[k][0], right[k][row]) for k in left), field.name
        else:
            assert torch.equal(left[0], right[row]), field.name


def test_an_environment_in_a_batch_equals_the_one_alone(problem):
    seeds, actions = [11, 12, 13, 14, 15], torch.tensor([[0, 1, 2, 2, 0], [2, 2, 1, 0, 0]])
    many, alone = reset(problem, seeds), [reset(problem, [seed]) for seed in seeds]
    for chosen in actions:
        many, outcome = step(problem, many, chosen)
        for row in range(len(seeds)):
            alone[row], single = step(problem, alone[row], chosen[row : row + 1])
            rows_equal(single, outcome, row)
            rows_equal(alone[row], many, row)
            assert torch.equal(observe(problem, alone[row])[0], observe(problem, many)[row])


def test_the_table_holds_what_each_step_pays(problem):
    start = reset(problem, [21])
    table = outcomes_of_all_actions(problem, start.drive)
    state, actions = start, [2, 0, 1, 1, 2, 0]
    for frame, action in enumerate(actions):
        before = state
        state, outcome = step(problem, state, torch.tensor([action]))
        assert not bool(before.laser.tripped)
        assert outcome.reward.item() == table.reward[frame, action].item()
        assert outcome.cost.heat_j.item() == table.heat_j[frame, action].item()
        assert outcome.score.error.item() == table.terms["error"][frame, action].item()
        told = TOLD[int(outcome.shots)]
        assert torch.equal(state.seen.features[0, told], table.features[frame, action, told])
    assert set(table.terms) == set(TERMS)


FRAGILE = {
    "trip_k": 311.5,
    "release_k": 311.0,
    "ambient_k": [304.15, 310.15],
    "thermal_resistance_k_per_w": 115.0,
}


def test_a_hot_laser_trips_delivers_nothing_and_comes_back(tiny_kwargs):
    fragile = {**FRAGILE, "thermal_time_constant_s": 0.5}
    problem = open_problem(env_config(**tiny_kwargs, laser=fragile, protect=False))
    state, table_reward = reset(problem, [1]), None
    tripped, shots = [], []
    for _ in range(32):
        state, outcome = step(problem, state, torch.tensor([2]))
        tripped.append(bool(outcome.tripped))
        shots.append(int(outcome.shots))
        if outcome.tripped:
            table_reward = len(tripped) - 1, outcome.reward.item()
            assert outcome.terms["error"].item() == 1.0
            assert outcome.score.valid_share.item() == 0.0
            assert outcome.cost.laser_energy_j.item() == 0.0
    assert not tripped[0] and any(tripped)
    assert [s == 0 for s in shots] == tripped
    # It came back at least once.
    assert any(a and not b for a, b in pairwise(tripped))
    table = outcomes_of_all_actions(problem, state.drive)
    frame, paid = table_reward
    assert paid == table.tripped_reward[frame].item()


def test_a_sensor_that_protects_itself_grants_less_and_never_trips(tiny_kwargs):
    long = {**tiny_kwargs, "frames_per_drive": 256}
    problem = open_problem(env_config(**long, laser=FRAGILE))
    state, taken = reset(problem, [1, 2, 3]), set()
    for _ in range(256):
        allowed = allowed_actions(problem, state).tolist()
        state, outcome = step(problem, state, torch.tensor([2, 2, 2]))
        assert outcome.asked.tolist() == [8, 8, 8] and not outcome.tripped.any()
        for shots, error, masks in zip(
            outcome.shots.tolist(), outcome.score.error.tolist(), allowed, strict=True
        ):
            # The most that is allowed as it is, or nothing where even two would be too much.
            most = max(int(n) for n, allows in zip(SHOTS_OF_ACTION, masks, strict=True) if allows)
            assert shots == most or (shots, most, error) == (0, 2, 1.0)
        taken |= set(outcome.shots.tolist())
    assert taken == {0, 2, 4, 8}


def test_always_four_with_a_cool_laser_returns_zero(problem):
    state = reset(problem, [5, 6])
    for _ in range(8):
        state, outcome = step(problem, state, torch.tensor([1, 1]))
        assert outcome.reward.tolist() == [0.0, 0.0]


def test_the_price_is_drawn_for_each_drive_and_seen(tiny_kwargs):
    config = env_config(**tiny_kwargs, reward={"power": [0.01, 0.1]})
    problem = open_problem(config)
    state = reset(problem, list(range(200)))
    price = state.drive.power_price
    assert 0.01 <= price.min() < 0.012 and 0.085 < price.max() <= 0.1
    # Log-uniform: half of them lie below the geometric mean.
    assert (price < 0.01**0.5 * 0.1**0.5).double().mean().item() == pytest.approx(0.5, abs=0.1)
    seen = observe(problem, state)[:, list(FEATURE_NAMES).index("power_price")].double()
    torch.testing.assert_close(seen, price / (price + 0.05), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("power", "says"),
    [
        ([0.2, 0.1], "expected low <= high"),
        ([0.0, 0.1], "begins above 0"),
        (-0.1, "expected weights from 0 to 1e[+]06"),
        ("dear", "power"),
    ],
)
def test_prices_that_cannot_be_drawn_are_refused(power, says):
    with pytest.raises(ConfigError, match=says):
        env_config(reward={"power": power})


def test_observations_stay_in_their_box_and_follow_the_state(problem):
    state = reset(problem, [31, 32])
    names = list(FEATURE_NAMES)
    first = observe(problem, state)
    assert first[:, names.index("time_left")].tolist() == [1.0, 1.0]
    assert first[:, names.index("last_eight")].tolist() == [0.0, 0.0]
    state, _ = step(problem, state, torch.tensor([2, 0]))
    second = observe(problem, state)
    assert second[:, names.index("last_eight")].tolist() == [1.0, 0.0]
    assert second[:, names.index("since_eight")][0] == 0.0
    assert second[:, names.index("since_eight")][1] > 0.9
    assert second[0, names.index("regret_of_four")] > 0.0
    assert second[1, names.index("regret_of_four")] == 0.0
    assert torch.isfinite(second).all() and second.abs().max() <= LIMIT


def test_predictions_are_kept_and_damage_is_mended(problem, tiny_kwargs, tmp_path, monkeypatch):
    monkeypatch.setenv("SHOTENV_CACHE", str(tmp_path))
    unwrapper = load_unwrapper(tiny_kwargs["unwrapper"])
    kept = keep_predictions(problem.bank, unwrapper)
    direct = unwrapper.predict(problem.bank.gray(torch.tensor([5])))
    assert (kept.of(torch.tensor([5])).distance_m - direct.distance_m).abs().max() < 0.02
    (file,) = tmp_path.glob("predictions/*/distance_m.npy")
    changed, before = file.stat().st_mtime_ns, kept.distance_m.clone()
    keep_predictions(problem.bank, unwrapper)
    assert file.stat().st_mtime_ns == changed
    content = file.read_bytes()
    file.write_bytes(content[:-2] + b"\x00\x7c")
    again = keep_predictions(problem.bank, unwrapper)
    assert file.read_bytes() == content
    assert torch.equal(again.distance_m, before)
