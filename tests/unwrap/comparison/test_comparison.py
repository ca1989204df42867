"""Methods compared: scores of known methods, memory, the whole table."""

import json

import numpy as np
import pytest
import torch
from PIL import Image
from safetensors.torch import load_file

from shotenv.bank.opening import open_bank
from shotenv.config.keywords import env_config
from shotenv.dataset.sensed_frames import SensedFrames
from shotenv.dataset.source import sources
from unwrap.comparison.compared_methods import (
    Estimate,
    Method,
    classical_methods,
    network_methods,
)
from unwrap.comparison.method_scores import (
    SCORED_AT_ONCE,
    accuracy_and_precision,
    score_methods,
)
from unwrap.comparison.table_figure import draw_frames
from unwrap.comparison.table_run import FIGURE, NUMBERS, PAGE, make_table
from unwrap.comparison.table_trainings import TableConfig, planned_trainings
from unwrap.depth.correction import correct_sensed
from unwrap.depth.metrics import MIN_DEPTH_M
from unwrap.networks.predictor import load_unwrapper
from unwrap.signal.shots import Shots


@pytest.fixture
def frames(tiny_bank):
    bank = open_bank(tiny_bank)
    return SensedFrames(bank, bank.frames("test"), env_config(bank=tiny_bank), range_m=30.0)


def test_a_perfect_method_has_no_error_and_a_blind_one_the_scene_s(frames):
    _, truth = frames.batch(range(len(frames)), draw=0, shots=None)
    scored = frames.scored(range(len(frames)), draw=0)
    places = iter([*range(len(frames)), *range(len(frames))])

    def perfect(sensed, sensor):
        return Estimate(truth.distance_m[[next(places)]], torch.ones_like(sensed.gray))

    def blind(sensed, sensor):
        return Estimate(torch.full_like(sensed.gray, torch.nan))

    methods = [
        Method("perfect", "none", (Shots.TWO, Shots.FOUR), perfect),
        Method("blind", "none", (Shots.TWO,), blind),
    ]
    rows = {(row["method"], row["shots"]): row for row in score_methods(methods, frames)}
    assert set(rows) == {("perfect", 2), ("perfect", 4), ("blind", 2)}
    best = rows["perfect", 2]
    assert best["mae_m"] == best["calibration_error"] == 0
    assert best["wrap_accuracy"] == best["class_accuracy"] == 1
    assert best["accuracy_percent"] == best["precision_percent"] == 100
    means = [truth.distance_m[i][scored[i]].double().mean() for i in range(len(frames))]
    # Depths are raised to MIN_DEPTH_M.
    expected_m = float(torch.stack(means).mean()) - MIN_DEPTH_M
    assert rows["blind", 2]["mae_m"] == pytest.approx(expected_m, abs=1e-5)
    assert "calibration_error" not in rows["blind", 2]


def test_frames_looked_at_together_score_as_one_by_one(frames, monkeypatch):
    def look(sensed, sensor):
        depth_m = correct_sensed(sensed, 12 * sensed.gray, sensor).distance_m
        if sensed.memory is not None:
            depth_m = torch.where(sensed.memory.known > 0, sensed.memory.distance_m, depth_m)
        return Estimate(depth_m, sensed.gray)

    methods = [Method(f"{i}", "none", (Shots.FOUR,), look, remembers=i > 0) for i in range(2)]
    alone = score_methods(methods, frames)
    # Three: no divisor of the frames of a clip, so that a batch holds the start of the next.
    monkeypatch.setitem(SCORED_AT_ONCE, "cpu", 3)
    assert score_methods(methods, frames) == alone


def test_what_remembers_gets_its_own_trusted_depth_moved(frames):
    shown = []

    def look(sensed, sensor):
        shown.append(sensed.memory)
        confidence = torch.ones_like(sensed.gray)
        confidence[:, :, :16] = 0.2
        return Estimate(torch.full_like(sensed.gray, 10.0), confidence)

    score_methods([Method("m", "none", (Shots.FOUR,), look, remembers=True)], frames)
    first = [number for number in range(len(frames)) if not frames.follows(number)]
    assert [i for i, memory in enumerate(shown) if memory is None] == first
    memory = shown[1]
    known = memory.known[0] > 0
    assert known[:, 20:].float().mean() > 0.5
    assert known[:, :10].float().mean() < 0.2
    assert (memory.distance_m[0][known] <= 10.0 + 1e-3).all()


def test_a_network_looks_once_at_a_batch_however_many_rules_merge(frames, tiny_unwrapper):
    unwrapper = load_unwrapper(tiny_unwrapper)
    looked = []

    class Counting:
        network = unwrapper.network

        def predict_sensed(self, sensed, sensor):
            looked.append(len(sensed))
            return unwrapper.predict_sensed(sensed, sensor)

    (training, *_) = planned_trainings(TableConfig(networks=("tofregnet",)))
    methods = list(network_methods(training, Counting()))
    assert [method.merge for method in methods] == ["none", "floor", "nearest"]
    rows = score_methods(methods, frames)
    assert len(rows) == 6 and len(looked) == 2 * len(frames)
    alone = [score_methods([method], frames)[1] for method in methods]
    assert alone == rows[1::2]


def test_the_figure_shows_whatever_networks_there_are(frames, tiny_unwrapper):
    unwrapper = load_unwrapper(tiny_unwrapper)
    one = draw_frames({"a": unwrapper}, frames, [0])
    two = draw_frames({"a": unwrapper, "b": unwrapper}, frames, [0])
    assert two.width > one.width and two.height == one.height


def test_accuracy_and_precision_of_known_errors():
    truth_m = torch.full((1, 2, 2), 10.0)
    depth_m = truth_m + torch.tensor([[1.0, 1.0], [3.0, 3.0]])
    found = accuracy_and_precision(depth_m, truth_m, torch.ones(1, 2, 2).bool(), 20.0)
    assert found == pytest.approx({"accuracy_percent": 90.0, "precision_percent": 95.0})


def test_the_paper_s_networks_are_trained_on_both_splits_and_truths():
    planned = list(planned_trainings(TableConfig()))
    papers = {
        (t.config.network, t.config.split_by, t.config.truth)
        for t in planned
        if t.recipe == "paper"
    }
    assert len(papers) == 8
    assert len({t.folder for t in planned}) == len(planned) == 8 + 1 + 4 + 1
    budgets = {(t.config.epochs, t.config.batch_size, t.config.width) for t in planned}
    assert len(budgets) == 1


@pytest.mark.slow
def test_the_table_is_made_once_and_goes_on_where_it_stopped(tiny_bank, tmp_path, monkeypatch):
    networks = ("tofregnet", "tofsegnet", "phasenet", "toffusionnet")
    config = TableConfig(bank=tiny_bank, width=4, epochs=1, batch_size=8, networks=networks)
    assert make_table(config, sources, tmp_path, only=["tofsegnet"]) == []
    assert not (tmp_path / PAGE).exists()
    rows = make_table(config, sources, tmp_path)
    assert json.loads((tmp_path / NUMBERS).read_text())["rows"] == rows
    keys = {(row["method"], row["shots"], row["merge"], row["split"], row["truth"]) for row in rows}
    assert len(keys) == len(rows)
    assert {row["split"] for row in rows} == {"clip", "frame"}
    assert {row["truth"] for row in rows} == {"rendered", "measured"}
    assert all(np.isfinite(row["mae_m"]) and 0 <= row["wrap_accuracy"] <= 1 for row in rows)
    page = (tmp_path / PAGE).read_text()
    assert all(row["method"] in page for row in rows)
    with Image.open(tmp_path / FIGURE) as picture:
        assert picture.width > 300

    def never(*_, **__):
        raise AssertionError("trained again")

    monkeypatch.setattr("unwrap.comparison.table_trainings.train", never)
    assert make_table(config, sources, tmp_path) == rows


@pytest.mark.slow
def test_networks_are_the_same_trained_in_workers(tiny_bank, tmp_path):
    config = TableConfig(bank=tiny_bank, width=4, epochs=1, batch_size=8, networks=("tofsegnet",))
    only = {"only": ["tofsegnet"]}
    assert make_table(config, sources, tmp_path / "here", **only) == []
    assert make_table(config, sources, tmp_path / "there", **only, workers=2) == []
    weights = sorted(
        path.relative_to(tmp_path / "here") for path in (tmp_path / "here").rglob("*.safetensors")
    )
    assert len(weights) == 4
    for path in weights:
        here, there = (load_file(tmp_path / side / path) for side in ("here", "there"))
        assert all(torch.allclose(here[name], there[name], atol=1e-5) for name in here)
    assert len(list((tmp_path / "there").glob("*.log"))) == 4


def test_an_unknown_network_is_named(tmp_path):
    with pytest.raises(ValueError, match="unet"):
        make_table(TableConfig(), sources, tmp_path, only=["unet"])


def test_two_frequencies_are_judged_without_rejection(frames):
    sensed, _ = frames.batch([0], draw=0, shots=Shots.EIGHT)
    assert correct_sensed(sensed, None, frames.sensor).distance_m.isnan().any()
    (method,) = (m for m in classical_methods(frames) if m.label.startswith("two frequencies"))
    depth_m = method.look(sensed, frames.sensor).depth_m
    assert torch.equal(depth_m.isnan(), sensed.raw.saturated)
