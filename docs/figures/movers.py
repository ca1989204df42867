"""Figures of what moves in worlds: feet, and drivers who brake."""

from __future__ import annotations

import numpy as np

from figures.stage import BLUE, GRAY, GREEN, RED, Made, Row, axes, label
from shotenv.world.families.following import behind_others, walk_across
from shotenv.world.geometry import Arc, Pose, Site, rotation
from shotenv.world.geometry.gait import WALK_RATIO_M_S
from shotenv.world.geometry.mover import Rolling
from shotenv.world.things import people, vehicles

WALK_M_S = 1.3


def movers() -> Made:
    """Ankles of a walker along the way, and a driver who stops for somebody who crosses."""
    figure, panels = axes("Ankles of somebody at 1.3 m/s", "A driver and somebody who crosses")
    route = Arc(Pose((0.0, 0.0, 0.0)), WALK_M_S)
    walker = people.figure(np.random.default_rng(0), 1.77)
    pieces = walker.on(route, (0.0, 4.0))
    feet = [piece for piece in pieces if len(getattr(piece.motion, "above", ())) == 2]
    times = np.linspace(0.0, 3.0, 601)
    step_s = []
    for foot, colour in zip(feet, (BLUE, RED), strict=True):
        ankle = np.array([foot.motion.at(time).position_m for time in times])
        panels[0].plot(times, ankle[:, 0], color=colour)
        # A step falls where the ankle is farthest ahead of the body.
        ahead = ankle[:, 0] - WALK_M_S * times
        top = np.flatnonzero((ahead[1:-1] > ahead[:-2]) & (ahead[1:-1] >= ahead[2:]))
        step_s.append(float(np.mean(np.diff(times[top]))) / 2)
    panels[0].plot(times, WALK_M_S * times, color=GRAY, ls=":", label="body")
    label(panels[0], "time, s", "way, m")
    site = Site(Arc(Pose((0.0, -50.0, 1.0))), 16.0)
    crossing = Arc(Pose((40.0, -4.0, 0.0), np.pi / 2), 1.0)
    site.put_moving(
        people.adult(np.random.default_rng(0)), walk_across(site, crossing, 1.0, 8.0, 1.2)
    )
    car = vehicles.car(np.random.default_rng(1))
    drive = behind_others(site, Pose((0.0, 0.0, 0.0)), (-2.2, 2.2), 0.9, 9.0)
    panels[1].plot(site.times, drive.speeds_m_s, color=GREEN, label="speed, m/s")
    gap = 40.0 - 2.2 - np.array([drive.way_m(time) for time in site.times])
    panels[1].plot(site.times[gap > 0], gap[gap > 0], color=GRAY, label="way to the crossing, m")
    label(panels[1], "time, s", "", loc="upper right")
    wheel = next(piece.motion for piece in car.on(drive, (0.0, 16.0)) if rolls(piece.motion))
    slip_m = contact_slip_m(wheel, 3.0)
    cadence = 1 / float(np.mean(step_s))
    ratio = np.sqrt(WALK_M_S / WALK_RATIO_M_S) / (walker.height_m / 1.75) ** 0.75
    return figure, [
        Row(
            "steps per second at 1.3 m/s, 1.77 m tall",
            f"{ratio:.2f}",
            f"{cadence:.2f}",
        ),
        Row("speed of the lowest point of a rolling wheel", "0 m/s", f"{slip_m:.4f} m/s"),
    ]


def rolls(motion) -> bool:
    """Whether a motion is that of a wheel."""
    return isinstance(motion, Rolling)


def contact_slip_m(wheel: Rolling, time_s: float) -> float:
    """Speed over ground of the point of a wheel that touches it, m/s."""
    step_s, now = 1e-4, wheel.at(time_s)
    spot = rotation(now).T @ (0.0, 0.0, -wheel.radius_m)
    later = wheel.at(time_s + step_s)
    moved = rotation(later) @ spot + later.position_m - (0.0, 0.0, -wheel.radius_m)
    return float(np.linalg.norm((moved - now.position_m)[:2])) / step_s
