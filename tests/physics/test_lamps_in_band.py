"""Rendered night by kind of lamp: head lamps on a wall, and the gray image of a street."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from render_worlds import ALBEDO, DARK, MIDDLE, SMALL, at, mesh, wall, world

from shotenv.config.bank import BankConfig, CameraConfig
from shotenv.config.reader import find_config, read_config
from shotenv.sensor.gray import capture_gray
from shotenv.world.draw import draw_world
from shotenv.world.families import traffic
from shotenv.world.geometry import Lamp, lights

pytestmark = pytest.mark.render
CAMERA = CameraConfig(width=32, height=24, samples_per_pixel=16, gray_instants=1, bounces=2)
CUTOFF_COS = math.cos(0.45)


def low_beam(kind, monkeypatch) -> Lamp:
    """A head lamp of 700 lm at the camera, aimed at what is ahead."""
    monkeypatch.setattr(lights, "LOW_BEAM", lights.Lighting((700.0, 700.0), {kind: 1.0}))
    intensity = lights.low_beam_intensity(np.random.default_rng(0), CUTOFF_COS)
    return Lamp((0.0, 0.0, 1.0), intensity, 0.1, (1.0, 0.0, 0.0), CUTOFF_COS, rides=True)


def test_a_halogen_head_lamp_lights_a_wall_hundreds_of_times_as_an_led_one(monkeypatch):
    from shotenv.render.backend import start_mitsuba

    start_mitsuba()
    from shotenv.render.integrator import trace

    seen = {}
    for kind in ("halogen", "led"):
        lit = replace(DARK, lamps=(low_beam(kind, monkeypatch),))
        seen[kind] = trace(world(mesh(wall(5.0)), light=lit), at(0.0), SMALL, seed=0).ambient[0]
    # 700 lm in a cone of half this solid angle, on a Lambertian wall at 5 m.
    on_axis = 700.0 * 9.8e-4 / (math.pi * (1.0 - CUTOFF_COS)) / (5.0**2 + 0.1**2)
    assert seen["halogen"][MIDDLE] == pytest.approx(on_axis * ALBEDO / math.pi, rel=0.01)
    assert seen["halogen"][MIDDLE] / seen["led"][MIDDLE] == pytest.approx(980.0, rel=0.01)


def test_a_street_at_night_is_as_bright_as_its_kind_of_lamps(monkeypatch):
    """What is bright in the gray image of the same street: nothing by LED lamps."""
    from shotenv.render.frame import render_frame

    config = read_config(BankConfig, find_config("bank", "starter"))
    street, radiance, gray = traffic.STREET_LIGHTING, {}, {}
    for kind in ("led", "sodium", "metal_halide"):
        of_one_kind = replace(street, shares={kind: 1.0})
        monkeypatch.setattr(traffic, "STREET_LIGHTING", of_one_kind)
        night = draw_world("night_road", 1, config.world)
        lamps = [one for one in night.light.lamps if one.carrier is None and not one.rides]
        assert len(lamps) > 2
        # Without head lamps, which would be all that is seen.
        night = replace(night, light=replace(night.light, lamps=tuple(lamps)))
        frame = render_frame(night, 0.0, CAMERA, config.sensor, seed=0)
        ambient = torch.from_numpy(np.asarray(frame.ambient))
        words, exposure_s = capture_gray(ambient[None], config.sensor, noise=None)
        assert exposure_s.item() == pytest.approx(config.sensor.gray_max_exposure_s)
        # Below the lamps, not what lies in the dark.
        radiance[kind] = ambient.quantile(0.9).item()
        gray[kind] = words.float().quantile(0.9).item()
    assert radiance["led"] < 0.6 * radiance["sodium"] < 0.3 * radiance["metal_halide"]
    assert gray["led"] < 1 < gray["metal_halide"] < 10
