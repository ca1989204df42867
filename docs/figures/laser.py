"""Figures of the laser: energy, efficiency, heat, trip, ageing, eye safety."""

from __future__ import annotations

import math

import numpy as np
import torch

from figures.stage import (
    BLUE,
    GRAY,
    GREEN,
    INTEGRATION_S,
    LASER,
    POWER_W,
    RED,
    Made,
    Row,
    axes,
    label,
)
from shotenv.laser import (
    ENERGY_PARTS,
    NetworkWork,
    ShotCost,
    efficiency_at,
    emitted_power_w,
    laser_step,
    shot_cost,
    start_laser,
)
from shotenv.laser.ageing import ageing_rate
from unwrap import load_unwrapper

PERIOD_S, AMBIENT_K = 0.1, 307.15  # assumed: 10 Hz on a warm day, 34 C
START_K = 300.0  # assumed: any will do, what is shown are rises
BOLTZMANN_EV_PER_K = 8.617333262e-5  # CODATA 2018
IMAGE = (120, 160)
"""Pixels of the image that the network reads."""


def _cost(shots: list[int], temperature_k: torch.Tensor) -> ShotCost:
    one = torch.ones(len(shots), dtype=torch.float64)
    return shot_cost(
        torch.tensor(shots),
        LASER,
        optical_power_w=emitted_power_w(POWER_W * one, temperature_k, LASER),
        temperature_k=temperature_k,
        integration_s=INTEGRATION_S * one,
        frame_period_s=PERIOD_S,
        network=NetworkWork(gray=load_unwrapper("tofregnet").macs(*IMAGE)),
    )


def laser_energy() -> Made:
    """Where the energy of a frame goes, by number of samples."""
    figure, (panel,) = axes("Energy of a frame at 10 Hz: 7 W, 600 µs, junction at 25 °C")
    shots = [0, 2, 4, 8]
    cost = _cost(shots, torch.full((4,), 298.15, dtype=torch.float64))
    bottom = np.zeros(4)
    colours = (RED, "#e59866", GREEN, GRAY, BLUE)
    for part, colour in zip(ENERGY_PARTS, colours, strict=True):
        values = 1e3 * getattr(cost, part).numpy()
        name = part.removesuffix("_energy_j")
        panel.bar(range(4), values, bottom=bottom, color=colour, label=name, width=0.6)
        bottom += values
    panel.set_xticks(range(4), ["none (laser off)", "2", "4", "8"])
    panel.set_ylim(0, 105)
    label(panel, "samples of the frame", "energy, mJ", loc="upper left")
    on_s = 8 * INTEGRATION_S
    by_hand = on_s * (POWER_W / LASER.efficiency + LASER.driver_power_w)
    # Eight samples and the gray image are read out.
    by_hand += 9 * LASER.readout_energy_j + LASER.static_power_w * PERIOD_S
    by_hand += LASER.energy_per_mac_j * load_unwrapper("tofregnet").macs(*IMAGE)
    return figure, [
        Row("energy of a frame of 8 DCS", f"{1e3 * by_hand:.2f} mJ", f"{bottom[3]:.2f} mJ")
    ]


def laser_heat() -> Made:
    """Answer of two thermal stages to a step, and trips of a laser that takes 8 in every frame."""
    figure, panels = axes("0.4 W from time 0", "8 DCS in every frame", widths=(1, 1.2))
    cost = _cost([8], torch.tensor([298.15], dtype=torch.float64))
    step = ShotCost(**{**vars(cost), "heat_j": torch.tensor([0.4 * PERIOD_S]).double()})
    times, junction_k, case_k = _step_response(step)
    by_hand_k = (
        START_K
        - LASER.junction_resistance_k_per_w
        * 0.4
        * np.expm1(-times / LASER.junction_time_constant_s)
        - LASER.thermal_resistance_k_per_w * 0.4 * np.expm1(-times / LASER.thermal_time_constant_s)
    )
    panels[0].plot(
        times, by_hand_k - START_K, color=GRAY, lw=3, alpha=0.5, label="two exponentials"
    )
    panels[0].plot(times, junction_k - START_K, "--", color=RED, label="junction")
    panels[0].plot(times, case_k - START_K, color=BLUE, label="case")
    label(panels[0], "time, s", "rise above ambient, K")
    _trips(panels[1])
    worst, after = np.abs(junction_k - by_hand_k).max(), round(30 / PERIOD_S)
    return figure, [
        Row(
            "junction 30 s after a step of 0.4 W",
            f"{by_hand_k[after] - START_K:.4f} K",
            f"{junction_k[after] - START_K:.4f} K",
        ),
        Row("largest difference over the step", "0 K", f"{worst:.0e} K"),
    ]


def _step_response(step: ShotCost) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    ambient_k = torch.tensor([START_K], dtype=torch.float64)
    state, junction, case = start_laser(ambient_k), [], []
    for _ in range(401):
        junction.append(float(state.temperature_k))
        case.append(float(state.temperature_k - state.junction_rise_k))
        state = laser_step(state, step, ambient_k, LASER, PERIOD_S)
    return PERIOD_S * np.arange(401), np.array(junction), np.array(case)


def _trips(panel) -> None:
    """Junction temperature with and without derating."""
    ambient_k = torch.tensor([AMBIENT_K], dtype=torch.float64)
    times = PERIOD_S * np.arange(200)
    for laser, name, colour in (
        (LASER.model_copy(update={"derate_per_k": 0.0}), "not derated", RED),
        (LASER, "derated", BLUE),
    ):
        state, found = start_laser(ambient_k), []
        for _ in times:
            found.append(float(state.temperature_k) - 273.15)
            shots = [0 if state.tripped else 8]
            one = torch.ones(1, dtype=torch.float64)
            cost = shot_cost(
                torch.tensor(shots),
                laser,
                optical_power_w=emitted_power_w(POWER_W * one, state.temperature_k, laser),
                temperature_k=state.temperature_k,
                integration_s=INTEGRATION_S * one,
                frame_period_s=PERIOD_S,
            )
            state = laser_step(state, cost, ambient_k, laser, PERIOD_S)
        panel.plot(times, found, color=colour, label=name)
    for kelvin, name in ((LASER.trip_k, "trip"), (LASER.release_k, "release")):
        panel.hlines(kelvin - 273.15, 0, 20, color=GRAY, ls="--", lw=0.8)
        panel.text(20.2, kelvin - 273.15, name, va="center", color=GRAY)
    panel.set_xlim(0, 23)
    label(panel, "time, s", "junction, °C", loc="lower right")


def laser_curves() -> Made:
    """Efficiency, power and rate of ageing over temperature."""
    figure, panels = axes("Efficiency and power", "Ageing")
    kelvin = np.linspace(288.15, 358.15, 281)
    celsius = kelvin - 273.15
    panels[0].plot(celsius, efficiency_at(kelvin, LASER), color=BLUE, label="efficiency")
    power = emitted_power_w(1.0, kelvin, LASER)
    panels[0].plot(celsius, power, color=RED, label="power over that asked for")
    panels[0].vlines(LASER.trip_k - 273.15, 0, 1.05, color=GRAY, ls="--", label="trip")
    panels[0].set_ylim(0, 1.6)
    label(panels[0], "junction, °C", "share", loc="upper right")
    rated_w = LASER.rated_power_w / LASER.efficiency
    for share, colour in ((0.8, GREEN), (1.0, BLUE), (1.2, RED)):
        rate = ageing_rate(share * rated_w, kelvin, LASER)
        panels[1].plot(celsius, rate, color=colour, label=f"{share:g} of rated current")
    panels[1].set_yscale("log")
    panels[1].axvline(LASER.rated_k - 273.15, color=GRAY, ls=":")
    label(panels[1], "junction, °C", "rated hours per hour of light")
    kelvin_10 = np.array([333.15, 343.15])
    rate = ageing_rate(rated_w, kelvin_10, LASER)
    by_hand = math.exp(LASER.activation_energy_ev / BOLTZMANN_EV_PER_K * (1 / 333.15 - 1 / 343.15))
    return figure, [
        Row("ageing at 70 °C over that at 60 °C", f"{by_hand:.3f}", f"{rate[1] / rate[0]:.3f}")
    ]


def laser_eye() -> Made:
    """Running average of the power for eyes."""
    figure, (panel,) = axes("Average that the cap is for")
    cost = _cost([8], torch.tensor([298.15], dtype=torch.float64))
    mean_w = float(cost.optical_j) / PERIOD_S
    ambient_k = torch.tensor([START_K], dtype=torch.float64)
    state, found = start_laser(ambient_k), []
    off = _cost([0], torch.tensor([298.15], dtype=torch.float64))
    for frame in range(500):
        found.append(float(state.eye_power_w))
        state = laser_step(state, cost if frame < 300 else off, ambient_k, LASER, PERIOD_S)
    times = PERIOD_S * np.arange(500)
    window_s = LASER.eye_window_s
    expected = np.where(
        times <= 30,
        -mean_w * np.expm1(-times / window_s),
        -mean_w * np.expm1(-30 / window_s) * np.exp(-(times - 30) / window_s),
    )
    panel.plot(times, expected, color=GRAY, lw=3, alpha=0.5, label="closed form")
    panel.plot(times, found, "--", color=BLUE, label="8 DCS for 30 s, then none")
    panel.axhline(LASER.eye_limit_w, color=RED, ls=":", label="cap")
    panel.axhline(mean_w, color=GREEN, ls=":", label="mean power of a frame")
    panel.set_ylim(0, 0.48)
    label(panel, "time, s", "power, W", loc="upper center", ncols=2)
    after_s = -window_s * math.log1p(-LASER.eye_limit_w / mean_w)
    first_s = times[np.array(found) > LASER.eye_limit_w][0]
    return figure, [
        Row(
            "8 DCS of 7 W exceed the cap after",
            f"{after_s:.2f} s",
            f"{first_s:.1f} s (frames of {PERIOD_S:g} s)",
        )
    ]
