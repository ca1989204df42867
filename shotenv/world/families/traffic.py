"""What moves on a site, and what stands in rows along it. The ego's lane is centred on y = 0."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shotenv.world.families.following import (
    ahead_of_ego,
    behind_others,
    to_the_wall,
    walk_across,
    with_pause,
)
from shotenv.world.geometry import (
    Arc,
    Lamp,
    Mesh,
    Mover,
    Pose,
    Route,
    Site,
    ground_speed_m_s,
    lights,
    materials as m,
)
from shotenv.world.things import cycles, furniture, people, plants, shelters, vehicles
from unwrap.support import Range

HEADLAMP_M2 = 0.05
"""Area of the face of a head light."""
HEADLAMP_CUTOFF_COS = float(np.cos(0.5))
TAIL_LAMPS = lights.Lighting((4.0, 12.0), {"led": 0.6, "incandescent": 0.4})
"""Intensity to the rear, cd (UNECE R7: 4 to 12 for one lamp); shares assumed."""
TAIL_LAMP_M2 = 0.04
"""Area of the face of a tail lamp."""
RED_SHARE = 0.2
"""Share of a bulb's lumens that a red cover lets through; it lets all of the near infrared
through. Assumed."""
STREET_LIGHTING = lights.Lighting((5.0, 30.0), {"led": 0.6, "sodium": 0.3, "metal_halide": 0.1})
"""Illuminance straight below a street lamp, lx, between those of EN 13201 for quiet and busy
streets; range and shares assumed."""
TRIES = 4
"""Places that are tried for something that moves, before it is left out."""
DrawPasser = Callable[[np.random.Generator, float], tuple[Mover, float]]
"""Draws who passes and their speed in m/s, given how wet it is."""


def passer_by(rng: np.random.Generator, wetness: float) -> tuple[Mover, float]:
    """Somebody along a road, on foot, running or on a kick scooter, and their speed in m/s."""
    speed = rng.uniform(0.7, 1.8) if rng.random() < 0.75 else 0.0
    kind = rng.random()
    if speed and kind < 0.06:
        return cycles.kick_scooter(rng), 2.0 * speed
    if speed and kind < 0.12:
        return people.adult(rng), rng.uniform(2.4, 3.6)
    return people.somebody(rng, speed, wetness), speed


def crosser(rng: np.random.Generator, wetness: float) -> tuple[Mover, float]:
    """Somebody who crosses a road, on foot or on a bicycle, and their speed in m/s."""
    if rng.random() < 0.2:
        return cycles.cyclist(rng), rng.uniform(2.0, 5.0)
    speed = rng.uniform(0.7, 1.8)
    return people.somebody(rng, speed, wetness), speed


def put_walkers(
    site: Site,
    rng: np.random.Generator,
    count: tuple[int, int],
    y: Range,
    z: float = 0.0,
    draw: DrawPasser = passer_by,
) -> None:
    """People who stand or move along the road, either way: at least count[0], below count[1]."""
    # Beyond where the ego will stop: who stood in its way would be left out anyhow.
    near = site.travel_m + 0.9
    # As far as people are more than a few pixels, and within the room where there is one.
    far = max(near, min(near + 17.0, site.room[1, 0] - 0.5))
    for _ in range(rng.integers(*count)):
        somebody, speed = draw(rng, site.weather.wetness)
        # Half of them are passed on the way, where there is room beside it.
        first = min(2.0, near) if rng.random() < 0.5 else near
        for _ in range(TRIES):
            yaw = rng.integers(2) * np.pi + rng.uniform(-0.05, 0.05)
            place = (rng.uniform(first, far), rng.uniform(*y), z)
            if site.put_moving(somebody, strolling(site, rng, Pose(place, yaw), speed)):
                break


def strolling(site: Site, rng: np.random.Generator, start: Pose, speed_m_s: float) -> Route:
    """Straight on, mostly without a stop, or up to a wall."""
    left_m = to_the_wall(site, start) - 0.8
    if 1.0 < left_m < speed_m_s * site.duration_s:
        begin_s = rng.uniform(-1.0, 0.3 * site.duration_s)
        return walk_across(site, Arc(start, 1.0), begin_s, left_m, speed_m_s)
    stop_s, pause_s = rng.uniform(0.0, 1.5 * site.duration_s), rng.uniform(2.0, 8.0)
    if speed_m_s == 0.0 or rng.random() > 0.2:
        return Arc(start, speed_m_s)
    return with_pause(site, Arc(start, 1.0), speed_m_s, stop_s, stop_s + pause_s)


def put_crossers(
    site: Site,
    rng: np.random.Generator,
    y: Range,
    near: float = 1.5,
    draw: DrawPasser = crosser,
) -> None:
    """Up to two who cross before the ego, from one of the `y` to the other, or wait to do so."""
    span = min(7.0, site.room[1, 0] - site.travel_m - near - 0.5)
    for _ in range(rng.integers(0, 3)):
        somebody, speed = draw(rng, site.weather.wetness)
        for _ in range(TRIES):
            side = rng.choice([-1.0, 1.0])
            # Where the ego will stop or, as often, where it will have passed.
            x = site.travel_m + near + max(span, 0.0) * rng.uniform() ** 1.5
            x = x if rng.random() < 0.5 else rng.uniform(min(6.0, x), x)
            yaw = side * np.pi / 2 + rng.uniform(-0.2, 0.2)
            path = Arc(Pose((x, y[0] if side > 0 else y[1], 0.0), yaw), 1.0)
            walk = (y[1] - y[0]) / max(speed, 0.3)
            # Under way when the clip begins, or from a moment within it on.
            begin_s = rng.uniform(-0.8 * walk, 0.8 * site.duration_s)
            if speed == 0.0 or rng.random() < 0.15:
                # Waits for all that passes.
                begin_s = site.duration_s + 1.0
            if site.put_moving(
                somebody, walk_across(site, path, begin_s, y[1] - y[0], max(speed, 0.3))
            ):
                break


def put_vehicle_ahead(site: Site, rng: np.random.Generator) -> None:
    """Perhaps vehicles ahead in the ego's lane: close in a queue, further off when fast."""
    if rng.random() < 0.4:
        return
    ego_speed = abs(ground_speed_m_s(site.ego, 0.0))
    y, reaction_s = rng.uniform(-0.3, 0.3), rng.uniform(0.3, 1.2)
    # The rear of the vehicle that comes next: what the ego goes before it reacts stays free.
    rear = 1.2 + rng.uniform(0.0, 4.0) + ego_speed * (reaction_s + rng.uniform(0.0, 0.8))
    unrest, period_s, phase = rng.uniform(0.0, 0.25), rng.uniform(5.0, 15.0), rng.uniform()
    # Where the ego stands all the time, the queue before it may set off.
    leaves_s = rng.uniform(-2.0, 1.2 * site.duration_s)
    sets_off = site.travel_m == 0.0 and rng.random() < 0.5
    for place in range(1 + (rng.random() < 0.3)):
        tail = tail_radiance(rng) if site.night else 0.0
        narrow = place == 0 and rng.random() < 0.12
        vehicle = cycles.cyclist(rng) if narrow else vehicles.traffic(rng, 0.0, tail)
        back, nose, _ = extent(vehicle)
        path = Arc(Pose((rear - back, y, 0.0)), 1.0)
        # Who is further ahead does everything earlier.
        route = ahead_of_ego(site, path, (place + 1) * reaction_s, unrest, period_s, phase)
        if sets_off:
            delay_s = 0.0 if place else reaction_s
            route = walk_across(site, path, leaves_s + delay_s, 200.0, rng.uniform(4.0, 10.0))
        if not site.put_moving(vehicle, route):
            return
        rear += nose - back + rng.uniform(1.5, 4.0) + ego_speed * (reaction_s + 0.3)


def tail_radiance(rng: np.random.Generator) -> float:
    """Radiance of the face of a tail lamp in band, W m-2 sr-1."""
    kind = TAIL_LAMPS.draw_kind(rng)
    intensity = lights.IN_BAND_W_PER_LM[kind] * m.log_uniform(rng, TAIL_LAMPS.amount)
    # LEDs are red of themselves; bulbs are white behind a red cover.
    bulb = intensity / RED_SHARE if kind == "incandescent" else intensity
    return lights.face_radiance(bulb, TAIL_LAMP_M2)


def extent(mover: Mover) -> tuple[float, float, float]:
    """Rear and front end, and half the width of what stands at the origin, metres."""
    corners = mover.at_rest.corners
    return float(corners[..., 0].min()), float(corners[..., 0].max()), float(corners[..., 1].max())


def put_oncoming(site: Site, rng: np.random.Generator, lane: float) -> None:
    """Vehicles in the other lane, coming closer, stopped at a light or standing in a queue."""
    x = rng.uniform(5.0, 28.0) + 0.5 * site.travel_m
    red = (rng.uniform(5.0, 20.0), rng.uniform(2.0, 10.0)) if rng.random() < 0.25 else None
    # More of them come in a long clip.
    count = int(rng.integers(0, 3) + rng.poisson(0.06 * site.duration_s))
    for _ in range(min(count, 4)):
        speed = rng.uniform(3.0, 14.0) if rng.random() < 0.75 else 0.0
        start = Pose((x, lane + rng.uniform(-0.2, 0.3), 0.0), np.pi)
        put_approaching(site, rng, start, speed, red=red)
        x += rng.uniform(9.0, 30.0)
        red = None


def put_approaching(
    site: Site,
    rng: np.random.Generator,
    start: Pose,
    speed_m_s: float,
    draw: Callable[[np.random.Generator, float], Mover] = vehicles.traffic,
    red: tuple[float, float] | None = None,
) -> None:
    """A vehicle seen from the front that brakes for what is ahead; lit in the dark."""
    # In garages and tunnels too, whatever the time of day.
    lit = site.night or site.indoor is not None
    intensity = lights.low_beam_intensity(rng, HEADLAMP_CUTOFF_COS) if lit else 0.0
    vehicle = draw(rng, lights.face_radiance(intensity, HEADLAMP_M2))
    # Lamps are fixed to its first piece.
    carrier = len(site.moving)
    if put_driver(site, vehicle, start, speed_m_s, red) and intensity:
        site.lamps += head_lights(vehicle.at_rest, intensity, carrier)


def put_driver(
    site: Site,
    vehicle: Mover,
    start: Pose,
    speed_m_s: float,
    red: tuple[float, float] | None = None,
) -> bool:
    """A vehicle that goes straight on at a speed where nothing is in its way."""
    rear, nose, half = extent(vehicle)
    route = behind_others(site, start, (rear, nose), half, speed_m_s, red)
    return site.put_moving(vehicle, route)


def head_lights(mesh: Mesh, intensity_w_sr: float, carrier: int) -> list[Lamp]:
    """Head lights of a vehicle, which they move with: two, or one on what is narrow."""
    # A little before the body, which would otherwise stand in their light.
    nose, half = float(mesh.corners[..., 0].max()) + 0.15, float(mesh.corners[..., 1].max())
    sides = (0.0,) if half < 0.6 else (0.3 - half, half - 0.3)
    ahead = lights.direction(0.0, -0.03)
    return [
        Lamp((nose, y, 0.75), intensity_w_sr, 0.1, ahead, HEADLAMP_CUTOFF_COS, carrier=carrier)
        for y in sides
    ]


def put_cyclist(site: Site, rng: np.random.Generator, y: float) -> None:
    """Perhaps somebody on a bicycle at the edge of the lane."""
    if rng.random() < 0.3:
        x, speed = site.travel_m * rng.uniform() + rng.uniform(4.0, 12.0), rng.uniform(2.5, 6.5)
        put_driver(site, cycles.cyclist(rng), Pose((x, y, 0.0)), speed)


def put_row(
    site: Site,
    rng: np.random.Generator,
    draw: Callable[[np.random.Generator], Mesh],
    y: float,
    every_m: float,
    yaw: float,
    z: float = 0.0,
    share: float = 1.0,
    spread: float = 0.2,
) -> None:
    """Things along the road at about equal distances, some left out."""
    for x in np.arange(rng.uniform(1.0, 1.0 + every_m), site.travel_m + 28.0, every_m):
        if rng.random() < share:
            along, across = rng.uniform(-0.15, 0.15) * every_m, rng.uniform(-1, 1) * spread
            site.put(draw(rng), x + along, y + across, yaw, z)


def put_street_lamps(
    site: Site, rng: np.random.Generator, y: float, every_m: float, z: float = 0.0
) -> None:
    """Lamp posts on the right whose arms reach over the road; by night they shine."""
    height = rng.uniform(4.5, 7.5)
    intensity = lights.intensity_above(rng, STREET_LIGHTING, height) if site.night else 0.0
    area = furniture.LAMP_HEAD_M[0] * furniture.LAMP_HEAD_M[1]
    radiance = lights.face_radiance(intensity, area)
    for x in np.arange(rng.uniform(-8.0, 8.0), site.travel_m + 50.0, every_m):
        placed = site.put(furniture.lamp_post(rng, height, radiance), x, y, np.pi / 2, z)
        if placed and site.night:
            head = (float(x), y + 1.5, z + height - 0.1)
            site.lamps.append(Lamp(head, intensity, 0.3, cutoff_cos=float(np.cos(1.25))))


def draw_one(
    rng: np.random.Generator, things: tuple[Callable[[np.random.Generator], Mesh], ...]
) -> Mesh:
    """One of several things; what is listed twice comes twice as often."""
    return things[rng.integers(len(things))](rng)


def roadside_thing(rng: np.random.Generator) -> Mesh:
    """Something from the edge of a country road."""
    return draw_one(
        rng,
        (plants.tree, plants.tree, plants.shrub, plants.shrub, plants.shrub, furniture.sign,
         furniture.pole, furniture.delineator, furniture.delineator, furniture.cone,
         furniture.chevron_board, furniture.bench),
    )  # fmt: skip


def pavement_thing(rng: np.random.Generator) -> Mesh:
    """Something from a town's pavement."""
    return draw_one(
        rng,
        (furniture.bollard, furniture.sign, furniture.sign, furniture.crate, furniture.rubbish_bin,
         plants.tree, plants.bush, furniture.pole, furniture.cone, furniture.cabinet,
         furniture.letter_box, furniture.planter, cycles.bicycle, shelters.pavement_glass),
    )  # fmt: skip
