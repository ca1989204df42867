"""Figure of lamps in band: what a lumen brings at 940 nm, and a street by kinds of lamps."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import torch

from figures.stage import BLUE, GRAY, RED, SENSOR, Made, Row, axes, label, show
from shotenv.config import CameraConfig, WorldConfig
from shotenv.render import render_frame
from shotenv.sensor.gray import capture_gray
from shotenv.world import draw_world
from shotenv.world.families import traffic
from shotenv.world.geometry import World, lights

FILAMENTS_K = {"halogen": 3000.0, "incandescent": 2700.0}
SECOND_RADIATION_M_K = 1.438776877e-2
LUMENS_PER_W = 683.0
CAMERA = CameraConfig(width=96, height=72, gray_instants=1)
SEED = 0


def lamps() -> Made:
    """W in band per lm by kind beside Planck's, and gray images of one street."""
    figure, (bars, *panels) = axes(
        "In band by kind", "LED street lamps", "and head lamps", widths=(1.1, 1.0, 1.0)
    )
    rows = [
        Row(f"{kind} lamp, power within 940 ± 15 nm", f"{filament_w_lm(kelvin):.2e} W/lm",
            f"{lights.IN_BAND_W_PER_LM[kind]:.2e} W/lm")
        for kind, kelvin in FILAMENTS_K.items()
    ]  # fmt: skip
    kinds = sorted(lights.IN_BAND_W_PER_LM, key=lights.IN_BAND_W_PER_LM.__getitem__)
    names = [kind.replace("_", " ") for kind in kinds]
    bars.barh(names, [lights.IN_BAND_W_PER_LM[kind] for kind in kinds], color=BLUE)
    for kind, kelvin in FILAMENTS_K.items():
        bars.plot(filament_w_lm(kelvin), kinds.index(kind), "|", color=RED, ms=14)
    # Direct sun of ASTM G173 over its lumens.
    bars.axvline(lights.G173_IRRADIANCE / 1e5, color=GRAY, ls=":")
    bars.set(xscale="log", xlim=(1e-7, 1e-2))
    label(bars, "W/lm; red: Planck, dotted: sun", "")
    for panel, headlamps in zip(panels, (False, True), strict=True):
        words = gray_words(street("led", headlamps))
        show(figure, panel, np.sqrt(words / 4095), cmap="gray", vmin=0.0, vmax=0.3)
        panel.set(xticks=[], yticks=[], xlabel=f"median word {np.median(words):.0f}", ylabel="")
    return figure, rows


def filament_w_lm(kelvin: float) -> float:
    """W within 925 to 955 nm over lm of a black body; luminosity after Wyman et al. (2013)."""
    band, visible = np.arange(925.0, 955.01, 0.1), np.arange(380.0, 780.01, 0.1)

    def planck(nm):
        return nm**-5.0 / np.expm1(SECOND_RADIATION_M_K / (nm * 1e-9 * kelvin))

    def lobe(mean, below, above):
        slope = np.where(visible < mean, below, above)
        return np.exp(-0.5 * ((visible - mean) * slope) ** 2)

    luminosity = 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322)
    lumens = LUMENS_PER_W * np.trapezoid(luminosity * planck(visible), visible)
    return float(np.trapezoid(planck(band), band) / lumens)


def street(kind: lights.LampKind, headlamps: bool) -> World:
    """The same street with lamps of one kind, and with halogen head lamps of the ego or none."""
    lighting = replace(traffic.STREET_LIGHTING, shares={kind: 1.0})
    with patch.object(traffic, "STREET_LIGHTING", lighting):
        world = draw_world("night_road", SEED, WorldConfig())
    others = [lamp for lamp in world.light.lamps if not lamp.rides]
    halogen = lights.Lighting((700.0, 700.0), {"halogen": 1.0})
    with patch.object(lights, "LOW_BEAM", halogen):
        own = lights.ego_headlights(np.random.default_rng(0)) if headlamps else ()
    return replace(world, light=replace(world.light, lamps=(*others, *own)))


def gray_words(world: World) -> np.ndarray:
    """Gray image [H, W] in words of the converter, with the sensor's noise."""
    frame = render_frame(world, 0.0, CAMERA, SENSOR, seed=0)
    ambient = torch.from_numpy(np.asarray(frame.ambient))[None]
    noise = torch.randn(ambient.shape, generator=torch.Generator().manual_seed(0))
    return capture_gray(ambient, SENSOR, noise=noise)[0][0].numpy()
