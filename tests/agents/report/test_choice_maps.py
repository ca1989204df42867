import dataclasses

import numpy as np
import pytest
from report_sample import made_up_choices

from agents.evaluation.play import PlayedDrives
from agents.report.choice_charts import choice_map
from agents.report.choice_maps import choice_maps
from shotenv.decision.features import FEATURE_NAMES


def played_at(price, asked, shots, **features):
    """One drive, in which the policy saw these features and nothing else."""
    frames = len(asked)
    seen = np.zeros((1, frames, len(FEATURE_NAMES)), np.float32)
    for name, values in features.items():
        seen[0, :, FEATURE_NAMES.index(name)] = values
    nothing = {field.name: np.zeros((1, frames)) for field in dataclasses.fields(PlayedDrives)}
    return PlayedDrives(
        **nothing
        | {
            "asked": np.array([asked]),
            "shots": np.array([shots]),
            "observations": seen,
            "power_price": np.array([price]),
        }
    )


def observed_margin(kelvin):
    return np.log1p(kelvin) / 3.0


@pytest.fixture(scope="module")
def maps():
    cheap = played_at(
        0.01,
        # The first frame has no measurement before it; in the fifth the laser is off.
        asked=[2, 8, 8, 4, 2, 2],
        shots=[2, 8, 4, 4, 0, 2],
        signal_to_noise=[0.0, 0.25, 0.25, 0.95, 0.05, 1.0],
        network_distance=[0.9, 0.1, 0.1, 0.3, 0.9, 2.0],
        heat_margin=observed_margin(np.array([90.0, 1.5, 1.5, 5.0, 90.0, 70.0])),
    )
    dear = played_at(
        0.1,
        asked=[8, 2],
        shots=[8, 2],
        signal_to_noise=[0.0, 0.25],
        network_distance=[0.0, 0.1],
        heat_margin=observed_margin(np.array([5.0, 5.0])),
    )
    return choice_maps([cheap, dear], range_m=20.0)


def cells_of(told):
    """Counts of the cells that have any, by the edges or the mark that they begin with."""
    columns, rows = (told[side].get("marks") or told[side]["edges"] for side in "xy")
    return {
        (columns[i], rows[j]): tuple(counts)
        for j, row in enumerate(told["counts"])
        for i, counts in enumerate(row)
        if any(counts)
    }


def test_choices_are_counted_by_what_was_observed(maps):
    signal_and_distance, margin_and_price = maps
    assert cells_of(signal_and_distance) == {
        (0.2, 2.0): (1, 0, 2),  # what was asked for, not what was granted
        (0.9, 6.0): (0, 1, 0),
        (0.9, 38.0): (1, 0, 0),  # beyond both scales: in the last cell of each
    }
    assert cells_of(margin_and_price) == {
        (1.0, 0.01): (0, 0, 2),
        (4.0, 0.01): (0, 1, 0),
        (64.0, 0.01): (1, 0, 0),
        (4.0, 0.1): (1, 0, 0),
    }


def test_maps_end_where_there_are_no_more_frames(maps):
    signal, margin = maps[0]["x"]["edges"], maps[1]["x"]["edges"]
    assert signal == [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    assert margin[0] == 1.0 and margin[-2:] == [64.0, None]
    assert np.shape(maps[0]["counts"])[1] == len(signal) - 1


def test_a_drive_without_laser_has_empty_maps():
    dark = played_at(0.1, asked=[8, 8], shots=[8, 0])
    for told in choice_maps([dark], range_m=20.0):
        assert np.sum(told["counts"]) == 0 and np.isnan(choice_map(told).data[0].z).all()


def test_a_cell_shows_its_mean_and_tells_its_frames():
    signal_and_distance, margin_and_price = made_up_choices()["maps"]
    (heat,) = choice_map(signal_and_distance).data
    assert heat.z[1][0] == pytest.approx(0.6 * 2 + 0.2 * 4 + 0.2 * 8) and heat.z[0][2] == 8
    assert np.isnan(heat.z).sum() == 4, "no colour without frames"
    assert "signal-to-noise 0.1 to 0.2" in heat.customdata[1][0]
    assert "mean predicted distance 6 to 8 m" in heat.customdata[1][0]
    assert "<b>10 frames</b>: 2 DCS 60%, 4 DCS 20%, 8 DCS 20%" in heat.customdata[1][0]
    other = choice_map(margin_and_price)
    assert (
        "below the laser's trip 64 K and more<br>price of power 0.01"
        in (other.data[0].customdata[0][2])
    )
    assert list(other.layout.yaxis.ticktext) == ["0.01", "0.1"]
    assert list(other.layout.xaxis.ticktext) == ["32", "48", "64", ""]
