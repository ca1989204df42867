"""Passive light: aiming at openings changes the noise, not the light; which lamps shine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shotenv.config.bank import BankConfig, CameraConfig
from shotenv.config.reader import find_config, read_config
from shotenv.world.draw import draw_world
from shotenv.world.geometry import lights, materials as m, meshes
from shotenv.world.geometry.model import Indoor, Lamp, Light, World
from shotenv.world.geometry.motion import Arc, Pose
from shotenv.world.things import buildings

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


@pytest.mark.render
def test_aiming_at_two_openings_keeps_the_mean():
    from shotenv.render.frame import render_frame

    config = read_config(BankConfig, find_config("bank", "starter"))
    concrete = m.Material(0.3, 0.3)
    # A tube of 20 m with the camera 4 m behind its entrance: the exit is far, the entrance near.
    section = [(-3.0, 0.0), (-3.0, 4.0), (3.0, 4.0), (3.0, 0.0)]
    tube = buildings.tunnel_tube(section, (-4.0, 16.0), concrete)
    ground = meshes.patch((-60.0, 60.0), (-60.0, 60.0), 0.0, concrete)
    mouth = (-3.0, 0.0), (3.0, 4.0)
    indoor = Indoor((-4.0, -3.1, -1.0), (16.0, 3.1, 4.0), mouth, mouth)
    light = Light(5.0, lights.direction(2.8, 0.4), 0.3, 0.4, (), indoor)
    ego = Arc(Pose((0.0, 0.0, 1.5)))
    world = World("tunnel", 0, meshes.join([tube, ground]), (), light, ego)
    by_chance = replace(world, light=replace(light, indoor=None))
    one_forgotten = replace(world, light=replace(light, indoor=replace(indoor, entrance=None)))
    aimed, plain, half = (
        render_frame(one, 0.0, CAMERA, config.sensor, seed=seed)
        for seed, one in enumerate((world, by_chance, one_forgotten))
    )
    inside = aimed.distance_m < 14.0
    assert inside.mean() > 0.3
    expected = plain.ambient[inside].mean()
    assert aimed.ambient[inside].mean() == pytest.approx(expected, rel=0.05)
    # The sun stands behind the camera and shines in by the entrance.
    assert half.ambient[inside].mean() < 0.8 * expected


def test_the_nearest_lamps_shine_and_none_comes_on_at_once():
    from shotenv.render.backend import start_mitsuba

    start_mitsuba()
    from shotenv.render.light import lamp_table

    lamps = tuple(Lamp((10.0 * i, 1.0, 5.0), 2.0) for i in range(60))
    ground = meshes.patch((-60.0, 600.0), (-60.0, 60.0), 0.0, m.Material(0.3, 0.3))
    light = Light(0.0, (0.0, 0.0, 1.0), 1e-4, 1e-4, lamps)
    world = World("night_road", 0, ground, (), light, Arc(Pose((0.0, 0.0, 1.0)), 15.0))
    before: dict[float, float] = {}
    for time in np.arange(0.0, 25.6, 0.1):
        table = lamp_table(world, float(time))
        now = dict(zip(table[:, 0].tolist(), table[:, 3].tolist(), strict=True))
        place = world.ego.at(float(time)).position_m[0]
        for x in (10.0 * i for i in range(60)):
            if abs(x - place) < 50.0:
                assert now[x] == pytest.approx(2.0)
            if before:
                assert abs(now.get(x, 0.0) - before.get(x, 0.0)) < 0.5
        before = now
