"""What moves on a site, and what stands in rows along it. The ego's lane is centred on y = 0."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shotenv.world.geometry import (
    Arc,
    Lamp,
    Mesh,
    Pose,
    Site,
    ground_speed_m_s,
    lights,
    materials as m,
)
from shotenv.world.things import cycles, furniture, people, plants, shelters, vehicles
from unwrap.support import Range

HEADLAMP_M2 = 0.05
"""Area of the face of a head light."""
HEADLAMP_W_SR = (0.05, 1.0)
"""Intensity of a head light in band: LED ones hardly shine there, halogen ones do; assumed."""
TAIL_RADIANCE = (0.02, 0.2)
"""Radiance of a tail lamp's face in band, W m-2 sr-1; an assumed range."""
STREET_IRRADIANCE = (1e-3, 2e-2)
"""Irradiance in band below a street lamp, W m-2; an assumed range."""
TRIES = 4
"""Places that are tried for something that moves, before it is left out."""
DrawPasser = Callable[[np.random.Generator, float], tuple[Mesh, float]]
"""Draws a mesh and its speed in m/s, given how wet it is."""


def passer_by(rng: np.random.Generator, wetness: float) -> tuple[Mesh, float]:
    """Somebody along a road, on foot or on a kick scooter, and their speed in m/s."""
    speed = rng.uniform(0.7, 1.8) if rng.random() < 0.75 else 0.0
    if speed and rng.random() < 0.06:
        return cycles.kick_scooter(rng), 2.0 * speed
    return people.somebody(rng, speed, wetness), speed


def crosser(rng: np.random.Generator, wetness: float) -> tuple[Mesh, float]:
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
        for _ in range(TRIES):
            yaw = rng.integers(2) * np.pi + rng.uniform(-0.05, 0.05)
            place = (rng.uniform(near, far), rng.uniform(*y), z)
            if site.put_moving(somebody, Arc(Pose(place, yaw), speed)):
                break


def put_crossers(
    site: Site,
    rng: np.random.Generator,
    y: Range,
    near: float = 1.5,
    draw: DrawPasser = crosser,
) -> None:
    """Up to two who cross in front of the ego and stay between `y` during the clip."""
    span = min(7.0, site.room[1, 0] - site.travel_m - near - 0.5)
    for _ in range(rng.integers(0, 3)):
        somebody, wish = draw(rng, site.weather.wetness)
        # In a long clip they walk slower, rather than through what stands beside the road.
        speed = min(wish, (y[1] - y[0]) / site.duration_s)
        # What is left to choose the start from, if the whole walk is to fit between the sides.
        room = y[1] - y[0] - speed * site.duration_s
        for _ in range(TRIES):
            start, side = y[0] + rng.uniform() * room, rng.choice([-1.0, 1.0])
            across = start if side > 0 else y[0] + y[1] - start
            x = site.travel_m + near + max(span, 0.0) * rng.uniform() ** 1.5
            yaw = side * np.pi / 2 + rng.uniform(-0.2, 0.2)
            if site.put_moving(somebody, Arc(Pose((x, across, 0.0), yaw), speed)):
                break


def put_vehicle_ahead(site: Site, rng: np.random.Generator) -> None:
    """Perhaps a vehicle ahead in the ego's lane: close in a queue, further off when fast."""
    if rng.random() < 0.4:
        return
    ego_speed = ground_speed_m_s(site.ego, 0.0)
    speed = ego_speed * rng.uniform(0.8, 1.15)
    # Braking shortens the gap during the clip.
    gap = 0.6 + rng.uniform(0.0, 3.5) + 0.8 * ego_speed * rng.uniform(0.3, 1.2)
    tail = m.log_uniform(rng, TAIL_RADIANCE) if site.night else 0.0
    vehicle = cycles.cyclist(rng) if rng.random() < 0.12 else vehicles.traffic(rng, 0.0, tail)
    # The gap is to its rear, however long it is.
    rear = float(vehicle.corners[..., 0].min())
    start = Pose((gap + 0.4 - rear, rng.uniform(-0.3, 0.3), 0.0))
    site.put_moving(vehicle, Arc(start, speed))


def put_oncoming(site: Site, rng: np.random.Generator, lane: float) -> None:
    """Up to two vehicles in the other lane, coming closer or standing in a queue."""
    for _ in range(rng.integers(0, 3)):
        speed = rng.uniform(3.0, 14.0) if rng.random() < 0.75 else 0.0
        x, y = rng.uniform(5.0, 28.0) + 0.5 * site.travel_m, lane + rng.uniform(-0.2, 0.3)
        put_approaching(site, rng, Arc(Pose((x, y, 0.0), np.pi), speed))


def put_approaching(
    site: Site,
    rng: np.random.Generator,
    motion: Arc,
    draw: Callable[[np.random.Generator, float], Mesh] = vehicles.traffic,
) -> None:
    """A vehicle seen from the front, in the dark with its head lights on."""
    # In garages and tunnels too, whatever the time of day.
    lit = site.night or site.indoor is not None
    intensity = m.log_uniform(rng, HEADLAMP_W_SR) if lit else 0.0
    mesh = draw(rng, lights.face_radiance(intensity, HEADLAMP_M2))
    if site.put_moving(mesh, motion) and intensity:
        site.lamps += head_lights(mesh, intensity, carrier=len(site.moving) - 1)


def head_lights(mesh: Mesh, intensity_w_sr: float, carrier: int) -> list[Lamp]:
    """Head lights of a vehicle, which they move with: two, or one on what is narrow."""
    # A little before the body, which would otherwise stand in their light.
    nose, half = float(mesh.corners[..., 0].max()) + 0.15, float(mesh.corners[..., 1].max())
    sides = (0.0,) if half < 0.6 else (0.3 - half, half - 0.3)
    ahead, cutoff = lights.direction(0.0, -0.03), float(np.cos(0.5))
    return [
        Lamp((nose, y, 0.75), intensity_w_sr, 0.1, ahead, cutoff, carrier=carrier) for y in sides
    ]


def put_cyclist(site: Site, rng: np.random.Generator, y: float) -> None:
    """Perhaps somebody on a bicycle at the edge of the lane."""
    if rng.random() < 0.3:
        x, speed = site.travel_m * rng.uniform() + rng.uniform(4.0, 12.0), rng.uniform(2.5, 6.5)
        site.put_moving(cycles.cyclist(rng), Arc(Pose((x, y, 0.0)), speed))


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
    intensity = lights.intensity_for(rng, STREET_IRRADIANCE, height) if site.night else 0.0
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
