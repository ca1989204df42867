"""The made-up frame by which a thinned bank tells that scene features have other formulas now."""

import math

import pytest

from shotenv.decision import features as features_file, scenes as scenes_file
from shotenv.decision.features import SCENE_FEATURES
from shotenv.decision.scenes import probe_features


def test_the_frame_shows_something_of_every_feature(sensor):
    found = probe_features(sensor)
    assert list(found) == [feature.name for feature in SCENE_FEATURES]
    assert all(math.isfinite(value) and abs(value) > 0.01 for value in found.values())


@pytest.mark.parametrize("place", range(len(SCENE_FEATURES)))
def test_another_formula_shows_in_its_feature_alone(monkeypatch, sensor, place):
    feature = SCENE_FEATURES[place]
    other = feature._replace(value=lambda seen: 1.01 * feature.value(seen))
    before = probe_features(sensor)
    changed = (*SCENE_FEATURES[:place], other, *SCENE_FEATURES[place + 1 :])
    monkeypatch.setattr(scenes_file, "SCENE_FEATURES", changed)
    after = probe_features(sensor)
    assert [name for name in after if abs(after[name] - before[name]) > 1e-4] == [feature.name]


def test_another_way_to_spread_shows(monkeypatch, sensor):
    before = probe_features(sensor)
    monkeypatch.setattr(features_file, "frame_spreads", features_file.frame_means)
    after = probe_features(sensor)
    assert abs(after["gray_std"] - before["gray_std"]) > 1e-2
