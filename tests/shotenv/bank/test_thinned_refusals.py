"""What a thinned bank refuses: neighbours, other weights, other formulas, and odd cells."""

from __future__ import annotations

import dataclasses

import pytest

from shotenv.bank.bank import require_full
from shotenv.bank.files.layout import BankError
from shotenv.bank.listing.contact_sheets import contact_sheet
from shotenv.bank.predictions import keep_predictions
from shotenv.bank.thinned import ThinnedBank
from shotenv.config.keywords import env_config
from shotenv.dataset.bank_scores import measure_unwrapping
from shotenv.dataset.export_inputs import choose_check_bank
from shotenv.dataset.sensed_frames import SensedFrames
from shotenv.dataset.thinning import thin_bank
from shotenv.decision.features import SCENE_FEATURES
from shotenv.decision.problem import open_problem
from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.tofregnet import TofRegNet
from unwrap.networks.weight_files import save_weights


@pytest.mark.parametrize(
    ("every", "ordinal"), [(2, "2nd"), (3, "3rd"), (8, "8th"), (12, "12th"), (21, "21st")]
)
def test_what_needs_neighbours_is_refused_by_name(thinned, monkeypatch, every, ordinal):
    monkeypatch.setattr(ThinnedBank, "every", every)
    words = f"bank small holds every {ordinal} pixel; images needs neighbours: choose a rendered"
    with pytest.raises(BankError, match=words):
        require_full(thinned, "images")


def test_a_full_bank_serves_everything(full):
    require_full(full, "images")


def test_a_network_that_needs_samples_is_refused_at_opening(thinned, tiny_kwargs):
    kwargs = {**tiny_kwargs, "bank": str(thinned.folder), "unwrapper": "toffusionnet"}
    with pytest.raises(BankError, match="small holds every 4th pixel; toffusionnet needs neigh"):
        open_problem(env_config(**kwargs))


def test_predictions_of_other_weights_are_refused(thinned, tiny_kwargs, tmp_path, sensor):
    path = tmp_path / "other.safetensors"
    metadata = {"network": "tofregnet", "width": 4, "range_m": 6.0, "f1_hz": sensor.f1_hz}
    save_weights(path, TofRegNet(width=4, range_m=6.0), metadata)
    kwargs = {**tiny_kwargs, "bank": str(thinned.folder)}
    own = thinned.manifest.networks[0].fingerprint[:16]
    words = f"tofregnet here has fingerprint .*, bank small holds predictions of {own}; thin the"
    with pytest.raises(BankError, match=words):
        open_problem(env_config(**{**kwargs, "unwrapper": str(path)}))
    with pytest.raises(BankError, match="holds predictions of tofregnet, not of tofsegnet"):
        open_problem(env_config(**{**kwargs, "unwrapper": "tofsegnet"}))
    with pytest.raises(ValueError, match=r"no-such-file.*unusable network file"):
        open_problem(env_config(**{**kwargs, "unwrapper": "no-such-file"}))


def test_networks_are_neither_trained_nor_checked_on_it(thinned, sensor, tiny_kwargs):
    config = env_config(bank=str(thinned.folder))
    with pytest.raises(BankError, match="training and judging networks needs neighbours"):
        SensedFrames(thinned, thinned.frames("train"), config, range_m=25.0)
    with pytest.raises(BankError, match="the check of an export needs neighbours"):
        choose_check_bank(str(thinned.folder), sensor)
    problem = open_problem(env_config(**tiny_kwargs).model_copy(update={"bank": config.bank}))
    with pytest.raises(BankError, match="the comparison of unwrapping methods needs neighbours"):
        measure_unwrapping(problem)
    with pytest.raises(BankError, match="the network tofregnet needs neighbours"):
        keep_predictions(thinned, load_unwrapper(tiny_kwargs["unwrapper"]))
    with pytest.raises(BankError, match="a contact sheet needs neighbours"):
        contact_sheet(thinned)


def test_another_range_than_that_of_the_scene_features_is_refused(thinned, tiny_kwargs):
    sensor = thinned.config.sensor.model_copy(update={"max_range_m": 20.0})
    config = env_config(**{**tiny_kwargs, "bank": str(thinned.folder)})
    words = r"sensor\.max_range_m is 20, but scene features of bank small were made with 25; choose"
    with pytest.raises(ValueError, match=words):
        open_problem(config.model_copy(update={"sensor": sensor}))


def test_a_bank_without_a_feature_of_today_is_refused(thinned, tiny_kwargs, monkeypatch):
    new = dataclasses.make_dataclass("Named", ["name"])("moonlight")
    monkeypatch.setattr("shotenv.decision.scenes.SCENE_FEATURES", (*SCENE_FEATURES, new))
    config = env_config(**{**tiny_kwargs, "bank": str(thinned.folder), "frames_per_drive": 31})
    with pytest.raises(BankError, match="small lacks the scene features moonlight; thin the bank"):
        open_problem(config)


def test_a_bank_with_features_of_another_formula_is_refused(thinned, tiny_kwargs, monkeypatch):
    last = SCENE_FEATURES[-1]
    other = last._replace(value=lambda scene: 1.1 * last.value(scene))
    monkeypatch.setattr("shotenv.decision.scenes.SCENE_FEATURES", (*SCENE_FEATURES[:-1], other))
    config = env_config(**{**tiny_kwargs, "bank": str(thinned.folder), "frames_per_drive": 33})
    words = "small has other formulas of the scene features yaw_rate; thin the bank again"
    with pytest.raises(BankError, match=words):
        open_problem(config)


def test_a_thinned_bank_is_not_thinned_again(thinned, tmp_path):
    with pytest.raises(BankError, match="small holds every 4th pixel; thinning needs"):
        thin_bank(thinned, tmp_path / "again")


@pytest.mark.parametrize("every", [1, 5, 7])
def test_cells_that_do_not_fill_the_frame_are_refused(full, tmp_path, every):
    with pytest.raises(BankError, match=f"every is {every}; expected at least 2, and a divisor"):
        thin_bank(full, tmp_path / "odd", every=every)


@pytest.mark.parametrize(
    ("networks", "words"),
    [
        (["toffusionnet"], "toffusionnet needs samples"),
        (["tofregnet", "tofregnet"], "expected at least one, and each name once"),
        ([], "expected at least one"),
    ],
)
def test_networks_that_cannot_be_kept_are_refused(full, tmp_path, networks, words):
    with pytest.raises(BankError, match=words):
        thin_bank(full, tmp_path / "odd", every=4, networks=networks)
    assert not (tmp_path / "odd").exists()


def test_nothing_is_overwritten(full, thinned, tiny_unwrapper):
    with pytest.raises(BankError, match="is not empty; choose another folder"):
        thin_bank(full, thinned.folder, every=4, networks=[tiny_unwrapper])
    assert not [path for path in thinned.folder.parent.iterdir() if path.name.startswith(".")]
