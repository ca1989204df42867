"""Daylight indoors: aiming at the opening changes the noise, not the light."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shotenv.config.bank import BankConfig, CameraConfig
from shotenv.config.reader import find_config, read_config
from shotenv.world.draw import draw_world

CAMERA = CameraConfig(width=32, height=24, samples_per_pixel=64, gray_instants=4, bounces=2)


@pytest.mark.render
@pytest.mark.parametrize("family", ["garage", "tunnel"])
def test_aiming_at_the_opening_keeps_the_mean(family):
    from shotenv.render.frame import render_frame

    config = read_config(BankConfig, find_config("bank", "starter"))
    worlds = (draw_world(family, seed, config.world) for seed in range(40))
    open_ended = (w for w in worlds if w.light.indoor and w.light.indoor.opening)
    world = next(w for w in open_ended if w.light.indoor.high[0] > 8.0)
    by_chance = replace(world, light=replace(world.light, indoor=None))
    aimed = render_frame(world, 0.0, CAMERA, config.sensor, seed=0)
    plain = render_frame(by_chance, 0.0, CAMERA, config.sensor, seed=1)
    # Only surfaces: the sky seen directly is the same in both and would hide a difference.
    inside = aimed.distance_m < world.light.indoor.high[0]
    assert inside.mean() > 0.3
    expected = plain.ambient[inside].mean()
    assert aimed.ambient[inside].mean() == pytest.approx(expected, rel=0.05)
