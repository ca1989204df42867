"""Figures of the renderer itself: its own error, and the laser's emission profile."""

from __future__ import annotations

import math
import statistics
import time
from typing import NamedTuple

import mitsuba as mi
import numpy as np
import torch
from matplotlib.ticker import NullFormatter

from figures.stage import (
    BLUE,
    CAMERA,
    GRAY,
    GREEN,
    INTEGRATION_S,
    POWER_W,
    RED,
    SENSOR,
    Made,
    Row,
    apart_m,
    axes,
    label,
    plate,
    rays,
    rendered,
    wall,
    world,
)
from shotenv.config import CameraConfig, EmissionConfig, WorldConfig
from shotenv.config.families import FAMILIES, SHIFT_FAMILIES
from shotenv.render import FrameRenderer, Instants, RenderedFrame, stock_path, stock_scene
from shotenv.sensor import capture_gray, electrons_per_radiance_second
from shotenv.world import draw_world
from shotenv.world.geometry.meshes import join
from unwrap.signal import decode, distance_m, unambiguous_range_m

SEEDS = (3, 14)
"""Worlds of each family."""
WELL_EXPOSED = 0.01
"""Share of the gray image's full scale above which its light is judged."""
COUNTED = 0.95
"""Share of the pixels that are judged: an edge behind a pane or in a mirror lies in the others,
where few rays tell how much of a pixel is on either side of it."""


class Errors(NamedTuple):
    """The renderer's error beside the sensor's noise, rms on smooth pixels where SNR > 5.

    Attributes
    ----------
    every_m, counted_m : float
        Error in distance of all those pixels, and of all but the worst: the share `COUNTED`.
    sensor_m : float
        Standard deviation of the distance of 4 DCS by the sensor's noise.
    gray : float
        Median error of the gray image where it is well exposed, a share; NaN where next to
        nothing is.
    """

    every_m: float
    counted_m: float
    sensor_m: float
    gray: float


def renderer_error() -> Made:
    """Error between seeds beside the sensor's noise, by family; error over time."""
    figure, panels = axes("Error in distance, rms", "Laser light in a closed room", widths=(1.4, 1))
    names = (*FAMILIES, *SHIFT_FAMILIES)
    found = {name: _of_family(name) for name in names}
    place = np.arange(len(names))
    best = f"renderer, best {100 * COUNTED:.0f} %"
    for field, shift, colour, name in (
        ("counted_m", -0.27, GREEN, best),
        ("every_m", 0.0, BLUE, "renderer, all"),
        ("sensor_m", 0.27, GRAY, "sensor, 4 DCS"),
    ):
        values = [1e3 * getattr(found[family], field) for family in names]
        panels[0].barh(place + shift, values, 0.26, color=colour, label=name)
    panels[0].set_yticks(place, [name.replace("_", " ") for name in names])
    panels[0].invert_yaxis()
    panels[0].set_xlim(right=1.6 * max(1e3 * found[name].sensor_m for name in names))
    label(panels[0], "mm", "", loc="lower right")
    _error_over_time(panels[1])
    rows = [
        Row(
            f"renderer's error, {name.replace('_', ' ')}: distance, all smooth pixels; best "
            f"{100 * COUNTED:.0f} %; gray image, median where well exposed",
            f"sensor, 4 DCS: {1e3 * found[name].sensor_m:.0f} mm",
            f"{1e3 * found[name].every_m:.0f} mm; {1e3 * found[name].counted_m:.0f} mm; "
            + ("(dark)" if math.isnan(found[name].gray) else f"{100 * found[name].gray:.1f} %"),
        )
        for name in names
    ]
    for name in names:
        taken, *bias = map(_percent, _of_gray_filter(name))
        about = "bias, mean; rms; 99 % of pixels within"
        quantity = f"filter of ambient light, {name.replace('_', ' ')}: {about}"
        rows.append(Row(quantity, f"noise taken: {taken} rms", "; ".join(bias)))
    return figure, rows


def _percent(share: float) -> str:
    return "below its noise" if math.isnan(share) else f"{100 * share:.1f} %"


def _of_gray_filter(family: str) -> tuple[float, float, float, float]:
    """Noise that the filter takes, and its bias: mean, rms, and what 99 % of pixels are within.

    Shares of the light of pixels above a tenth of the mean; from 32 frames, 512 paths a pixel.
    The rms is NaN where the noise of these frames hides it.
    """
    from shotenv.render.integrator import trace
    from shotenv.render.surfaces import Surroundings

    scene = draw_world(family, SEEDS[0], WorldConfig())
    surroundings, steps = Surroundings(scene), range(4)
    gray = Instants(
        tuple(0.5 - 1e-3 * (step + 0.5) / 4 for step in steps),
        laser=(False,) * 4,
        passive=(True,) * 4,
        draw=tuple(steps),
        frequency_hz=(0.0,) * 4,
        theta_rad=(0.0,) * 4,
    )

    def images(camera: CameraConfig) -> np.ndarray:
        frames = (
            trace(scene, gray, camera, seed=seed, surroundings=surroundings).ambient
            for seed in range(500, 532)
        )
        return np.array([frame.mean(axis=0) for frame in frames], np.float64)

    off, on = images(CameraConfig(gray_filter_m=0.0)), images(CameraConfig())
    mean = off.mean(axis=0)
    lit = mean > 0.1 * mean.mean()
    # The same seeds: most noise is in both. What is left is independent in halves of the frames,
    # so that the mean of the halves' product is the square of the bias alone.
    one, other = ((on - off)[half::2].mean(axis=0)[lit] / mean[lit] for half in (0, 1))
    squares = [(image.var(axis=0, ddof=1)[lit] / mean[lit] ** 2).mean() for image in (off, on)]
    bias = (one + other) / 2
    square = (one * other).mean()
    rms = math.sqrt(square) if square > 0 else math.nan
    taken = math.sqrt(max(0.0, squares[0] - squares[1]))
    return taken, abs(bias.mean()), rms, np.quantile(np.abs(bias), 0.99)


def _of_family(family: str) -> Errors:
    """Of the worlds of a family: root of the mean of their squares."""
    squares = np.square([_of_world(family, seed) for seed in SEEDS])
    gray = squares[:, -1][~np.isnan(squares[:, -1])]
    means = (*squares[:, :-1].mean(axis=0), gray.mean() if len(gray) else math.nan)
    return Errors(*np.sqrt(means))


def _of_world(family: str, seed: int) -> Errors:
    """Of a frame rendered with two seeds: rms of their difference over the root of 2."""
    renderer = FrameRenderer(draw_world(family, seed, WorldConfig()), SENSOR)
    one, other = (renderer.frame(0.5, CameraConfig(), seed=number) for number in (100, 101))
    sigma, snr = sensor_noise_m(one)
    counted = smooth(one.distance_m) & (snr > 5)
    range_m = unambiguous_range_m(SENSOR.f1_hz)
    apart = apart_m(_measured_m(one), _measured_m(other), range_m)[counted]
    squares = np.sort(apart**2)[: int(COUNTED * len(apart))]
    first, second = (_gray_words(frame) for frame in (one, other))
    exposed = first > WELL_EXPOSED * (2**SENSOR.adc_bits - 1)
    apart_gray = np.abs(first - second)[exposed] / (first + second)[exposed]
    return Errors(
        every_m=np.sqrt((apart**2).mean() / 2),
        counted_m=np.sqrt(squares.mean() / 2),
        sensor_m=np.sqrt((sigma[counted] ** 2).mean()),
        # By night and where LED lamps shine there may be next to nothing that is well exposed.
        gray=np.median(apart_gray) * math.sqrt(2) if exposed.sum() > 100 else math.nan,
    )


def _gray_words(frame: RenderedFrame) -> np.ndarray:
    """Gray image without the sensor's noise, LSB."""
    ambient = torch.from_numpy(np.asarray(frame.ambient))
    return capture_gray(ambient[None], SENSOR, noise=None)[0][0].double().numpy()


def _measured_m(frame: RenderedFrame) -> np.ndarray:
    phase = decode(torch.from_numpy(frame.correlation[:4])).phase_rad
    return distance_m(phase, SENSOR.f1_hz).numpy()


def sensor_noise_m(frame: RenderedFrame) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviation of the distance of 4 DCS by the sensor's noise, and the SNR of one."""
    per_radiance = electrons_per_radiance_second(SENSOR) * INTEGRATION_S
    signal, ambient = frame.active * per_radiance * POWER_W, frame.ambient * per_radiance
    noise = np.sqrt(signal + ambient + 2 * SENSOR.read_noise_e**2)
    snr = SENSOR.contrast * signal / noise
    per_radian_m = unambiguous_range_m(SENSOR.f1_hz) / (2 * math.pi)
    return per_radian_m / (math.sqrt(2) * np.maximum(snr, 1e-9)), snr


def smooth(true_m: np.ndarray) -> np.ndarray:
    """Pixels whose four neighbours are about as far."""
    near = np.where(np.isfinite(true_m) & (true_m < 25.0), true_m, 1e9)
    even = near < 25.0
    for axis in (0, 1):
        for step in (1, -1):
            even &= np.abs(np.roll(near, step, axis) - near) < 0.05 * near
    even[[0, -1]] = even[:, [0, -1]] = False
    return even


def closed_room(albedo: float = 0.6):
    """A closed room of 5 x 4 x 3 m with the camera at its back wall, and a box in it."""
    sides = [plate((2.4, y, 1.0), (2.6, 0, 0), (0, 0, 1.5), albedo=albedo) for y in (-2.0, 2.0)]
    sides += [plate((2.4, 0, z), (2.6, 0, 0), (0, 2, 0), albedo=albedo) for z in (-0.5, 2.5)]
    ends = [plate((x, 0, 1.0), (0, 2, 0), (0, 0, 1.5), albedo=albedo) for x in (-0.2, 5.0)]
    box = plate((3.0, 0.5, 0.2), (0, 0.6, 0), (0, 0, 0.7), albedo=albedo)
    return join([*sides, *ends, box])


def _error_over_time(panel) -> None:
    """Relative error of the laser's light over the time it takes, ours and `path`."""
    from shotenv.render.beam import emitted_sr
    from shotenv.render.integrator import trace
    from shotenv.render.surfaces import Surroundings

    scene = world(closed_room())
    surroundings = Surroundings(scene)
    once = Instants((0.0,), (True,), (False,), (0,), (0.0,), (0.0,))
    # A round cone, just wider than the view, which Mitsuba's spot has too.
    cone = EmissionConfig(profile="table", angle_deg=(0.0, 36.0), intensity=(1.0, 1.0))
    camera = CAMERA.model_copy(update={"width": 160, "height": 120, "bounces": 2, "emission": cone})
    spot = {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=[0.0, 0.0, 1.0], target=[1.0, 0.0, 1.0], up=[0.0, 0.0, 1.0]
        ),
        "intensity": 1 / emitted_sr(camera),
        "cutoff_angle": 36.0,
        "beam_width": 35.99,
    }
    stock = stock_scene(scene, 0.0, camera, laser=spot)

    def ours(samples: int, seed: int) -> np.ndarray:
        one = camera.model_copy(update={"samples_per_pixel": samples})
        return trace(scene, once, one, seed=seed, surroundings=surroundings).active[0]

    def path(samples: int, seed: int) -> np.ndarray:
        image = mi.render(stock, integrator=stock_path(camera), spp=samples, seed=seed)
        return np.array(image)[..., 0]

    for render, counts, colour, name in (
        (ours, (4, 16, 64), BLUE, "this renderer"),
        (path, (4, 16, 64, 256), RED, "Mitsuba's path"),
    ):
        points = []
        for samples in counts:
            render(samples, 0)
            start = time.perf_counter()
            images = np.array([render(samples, seed) for seed in range(1, 5)], np.float64)
            seconds = (time.perf_counter() - start) / 4
            share = np.sqrt((images.var(axis=0, ddof=1) / images.mean(axis=0) ** 2).mean())
            points.append((1e3 * seconds, 100 * share))
        panel.plot(*zip(*points, strict=True), "o-", color=colour, label=name)
    panel.set(xscale="log", yscale="log")
    # Less than two decades: numbers of their own between them would run into each other.
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.set_ylim(top=300)
    label(panel, "time of an image, ms", "error, % rms", loc="upper right")


def emission() -> Made:
    """Irradiance of a facing wall across the view, and a closed room's phase over edge softness."""
    figure, panels = axes("A facing wall, middle row", "A closed room's mean distance, 4 bounces")
    profiles = {
        "a knife's edge": (EmissionConfig(edge_softness_deg=0.0), GRAY),
        "edges of 6° (default)": (EmissionConfig(), BLUE),
        "edges of 20°": (EmissionConfig(edge_softness_deg=20.0), GREEN),
        "Gaussian, 60°": (EmissionConfig(profile="gaussian", fwhm_deg=60.0), RED),
    }
    camera = CAMERA.model_copy(update={"width": 81, "height": 61})
    ahead = rays(camera)[30, :, 0]
    angle = np.degrees(np.arccos(ahead)) * np.sign(np.arange(81) - 40)
    for name, (profile, colour) in profiles.items():
        one = camera.model_copy(update={"emission": profile})
        light = rendered(world(wall(5.0)), one).active[30]
        # Of the radiance albedo / pi x I x cos^3 / d^2, what the profile is.
        panels[0].plot(angle, light / ahead**3 * 25 * math.pi / 0.4, color=colour, label=name)
    panels[0].set_ylim(0, 2.1)
    label(panels[0], "angle from the axis, degrees", "W/sr per watt", loc="upper center", ncols=2)
    softness = np.array([0.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0])
    room, phases = world(closed_room()), []
    for degrees in softness:
        one = CAMERA.model_copy(
            update={
                "width": 32,
                "height": 24,
                "bounces": 4,
                "samples_per_pixel": 64,
                "emission": EmissionConfig(edge_softness_deg=float(degrees)),
            }
        )
        measured = _measured_m(rendered(room, one))
        phases.append(1e3 * statistics.mean(measured.ravel()))
    shift = np.array(phases) - phases[0]
    panels[1].plot(softness, shift, "o-", color=BLUE)
    label(panels[1], "width of the edges, degrees", "change of distance, mm")
    return figure, [
        Row(
            "closed room, mean distance with edges of 60° less that with a knife's edge",
            "(none)",
            f"{shift[-1]:.0f} mm",
        )
    ]
