"""A village street deep in snow. Held out from training."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shotenv.world.families.roads import BEHIND_M, REACH_M
from shotenv.world.families.traffic import (
    TRIES,
    draw_one,
    put_approaching,
    put_crossers,
    put_row,
    put_street_lamps,
    put_vehicle_ahead,
    put_walkers,
)
from shotenv.world.geometry import (
    Arc,
    Material,
    Mesh,
    Mover,
    Pose,
    Rigid,
    Site,
    materials as m,
    meshes,
)
from shotenv.world.things import axle, cab, nose_lamps, people, plants, vehicles


def lay_out_snowy_street(site: Site, rng: np.random.Generator) -> None:
    """A cleared lane between banks of snow, chalets, snowed-in cars and trees."""
    half = rng.uniform(2.4, 3.4)
    site.build_ground(m.SNOW.draw(rng))
    build_wheel_tracks(site, rng)
    put_vehicle_ahead(site, rng)
    for part in site.stretches():
        if rng.random() < 0.5:
            x, lane = rng.uniform(8.0, 24.0) + 0.5 * part.travel_m, rng.uniform(0.5, 0.9) * half
            draw = snow_plough if rng.random() < 0.6 else vehicles.traffic
            put_approaching(part, rng, Pose((x, lane, 0.0), np.pi), rng.uniform(2.0, 8.0), draw)
        put_crossers(part, rng, (-half, half))
        for _ in range(rng.integers(0, 3)):
            put_sledge(part, rng, half)
        put_walkers(part, rng, (0, 3), (-half + 0.3, half - 0.3))
    if rng.random() < 0.4:
        x = site.travel_m + 1.0 + 6.0 * rng.uniform() ** 1.5
        blocking = draw_one(rng, (snow_bank, snowman))
        # Half its length further off: its near side is to be at x, and not its middle.
        site.put(blocking, x - float(blocking.corners[..., 0].min()), rng.uniform(-0.8, 0.8), np.pi)
    put_street_lamps(site, rng, -half - 0.6, rng.uniform(14, 24))
    for side in (-1, 1):
        put_row(
            site, rng, snowy_roadside_thing, side * (half + 0.9), 2.6, -side * np.pi / 2, share=0.9
        )
        put_row(site, rng, vehicles.parked_car, side * (half + 2.9), 6.0, np.pi, share=0.4)
        put_row(
            site, rng, chalet, side * (half + 6.5), 9.5, -side * np.pi / 2, share=0.7, spread=0.8
        )
        put_row(site, rng, plants.conifer, side * (half + 4.6), 4.0, 0.0, share=0.6, spread=1.0)


def build_wheel_tracks(site: Site, rng: np.random.Generator) -> None:
    """Two strips where wheels have worn the snow down to the asphalt, of both lanes or one."""
    asphalt, far = m.ASPHALT.draw(rng), site.travel_m + REACH_M
    # Neither dry asphalt nor snow: dark where it is worn through, bright where slush is left.
    worn = Material(asphalt.albedo_low, rng.uniform(0.2, 0.8), 2.0, mirror=0.03)
    # The first two are the ego's own lane.
    for y in (-0.75, 0.75, 2.0, 3.2)[: 2 * rng.integers(1, 3)]:
        site.build(
            meshes.patch((-BEHIND_M, far), (y - 0.18, y + 0.18), 0.004, worn), sheltered=True
        )


def put_sledge(site: Site, rng: np.random.Generator, half: float) -> None:
    """Somebody who pulls a sledge along the street."""
    mover, speed = sledge(rng), rng.uniform(0.7, 1.4)
    for _ in range(TRIES):
        place = (site.travel_m + rng.uniform(1.5, 12.0), rng.uniform(-half, half), 0.0)
        yaw = rng.integers(2) * np.pi + rng.uniform(-0.2, 0.2)
        if site.put_moving(mover, Arc(Pose(place, yaw), speed)):
            return


def snowy_roadside_thing(rng: np.random.Generator) -> Mesh:
    """What stands at the edge of a cleared street."""
    return draw_one(rng, (snow_bank, snow_bank, snow_bank, snow_bank, snowman, marker_stake))


@meshes.thing
def snow_bank(rng: np.random.Generator) -> Mesh:
    """Snow thrown up by a plough, in lumps along y."""
    snow, high = m.SNOW.draw(rng), rng.uniform(0.3, 0.9)
    lumps = [
        meshes.blob(rng, 0.65, snow, (rng.uniform(-0.1, 0.1), y, 0.0)) for y in (-0.6, 0.0, 0.6)
    ]
    # Balls with their middle on the ground, pressed to the height of the bank.
    return meshes.scaled(meshes.join(lumps), (1.0, 1.0, high / 0.65))


@meshes.thing
def snowman(rng: np.random.Generator) -> Mesh:
    """Three balls of snow with a hat."""
    snow, coal, size = m.SNOW.draw(rng), m.RUBBER.draw(rng), rng.uniform(0.7, 1.2)
    balls = [(0.42, 0.36), (0.30, 0.92), (0.20, 1.34)]
    parts = [meshes.ball(radius, snow, (0.0, 0.0, z), detail=1) for radius, z in balls]
    hat = meshes.lathe([(0.24, 0.0), (0.24, 0.03), (0.15, 0.03), (0.14, 0.25), (0.0, 0.25)], coal,
                       (0.0, 0.0, 1.48))  # fmt: skip
    arms = [
        meshes.rod((0, 0.2 * s, 1.0), (0.1, 0.75 * s, 1.25), 0.02, m.BARK.draw(rng), sections=4)
        for s in (-1, 1)
    ]
    return meshes.scaled(meshes.join([*parts, hat, *arms]), (size, size, size))


@meshes.thing
def marker_stake(rng: np.random.Generator) -> Mesh:
    """A stake that shows ploughs where the road ends, with a retro-reflecting band."""
    high = rng.uniform(1.6, 2.4)
    band = [(0.033, high - 0.4), (0.033, high - 0.2)]
    return meshes.join(
        [
            meshes.rod((0, 0, 0), (0, 0, high), 0.03, m.WOOD.draw(rng), sections=6),
            meshes.lathe(band, m.RETRO_SHEET.draw(rng), sections=6),
        ]
    )


@meshes.thing
def chalet(rng: np.random.Generator) -> Mesh:
    """A wooden house with a steep roof that overhangs, its gable facing +x."""
    wood, roof, glass = m.WOOD.draw(rng), m.DARK_METAL.draw(rng), m.GLASS.draw(rng)
    width, depth, eaves = rng.uniform(5.0, 7.0), rng.uniform(4.0, 6.0), rng.uniform(2.4, 3.2)
    half, ridge = width / 2, eaves + width * rng.uniform(0.35, 0.5)
    gable = [(0.0, -half, eaves), (0.0, half, eaves), (0.0, 0.0, ridge)]
    over, low = 0.6, eaves - 0.25
    slopes = [
        [(over, -half - 0.4, low), (over, 0.0, ridge + 0.1), (-depth, 0.0, ridge + 0.1),
         (-depth, -half - 0.4, low)],
        [(over, 0.0, ridge + 0.1), (over, half + 0.4, low), (-depth, half + 0.4, low),
         (-depth, 0.0, ridge + 0.1)],
    ]  # fmt: skip
    panes = [
        meshes.front((y, y + 0.8), (z, z + 1.0), 0.02, glass)
        for y, z in ((-0.4 * width, 1.0), (0.25 * width, 1.0), (-0.4, eaves + 0.2))
    ]
    return meshes.join(
        [
            meshes.box((depth, width, eaves), wood, (-depth / 2, 0.0, 0.0)),
            meshes.polygon(gable, wood),
            *(meshes.polygon(slope, roof) for slope in slopes),
            *panes,
            meshes.front((-0.45, 0.45), (0.0, 2.05), 0.025, m.DARK_METAL.draw(rng)),
            meshes.box((0.5, 0.5, 1.2), m.BRICK.draw(rng), (-depth / 2, 0.5 * half, ridge - 0.5)),
        ]
    )


@meshes.thing
def snow_plough(rng: np.random.Generator, headlight_radiance: float = 0.0) -> Mover:
    """A lorry that grits the road behind a wide blade."""
    front, width, blade = 2.6, 2.3, m.MACHINE_PAINT.draw(rng)
    tyre, rim, half = m.TYRE.draw(rng), m.METAL.draw(rng), 1.4
    curve = [(0.0, 0.05), (0.12, 0.0), (0.05, 0.5), (0.3, 1.0), (0.2, 1.02), (-0.08, 0.5)]
    plate = meshes.join(
        meshes.polygon(
            [(front + 0.6 + a[0], -half, a[1]), (front + 0.6 + a[0], half, a[1]),
             (front + 0.6 + b[0], half, b[1]), (front + 0.6 + b[0], -half, b[1])], blade
        )
        for a, b in pairwise(curve)
    )  # fmt: skip
    hopper = [(-2.5, 1.0), (0.5, 1.0), (0.7, 2.2), (-2.7, 2.2)]
    edge = meshes.back((-half, half), (0.0, 0.06), front + 0.6, blade)
    body = meshes.join(
        [
            cab(rng, front, width),
            meshes.box((5.0, 0.8, 0.4), m.DARK_METAL.draw(rng), (0.0, 0.0, 0.6)),
            meshes.extrude(hopper, 2.0, m.MACHINE_PAINT.draw(rng)),
            plate,
            edge,
            meshes.box((0.7, 0.8, 0.3), rim, (front + 0.3, 0.0, 0.35)),
            nose_lamps(rng, front + 0.02, width, headlight_radiance),
        ]
    )
    wheels = (axle(x, width / 2, 0.46, tyre, rim) for x in (1.7, -1.6))
    return Mover((Rigid(body), *wheels))


@meshes.thing
def sledge(rng: np.random.Generator) -> Mover:
    """Somebody who pulls a sledge, often with a child on it."""
    wood, rope = m.WOOD.draw(rng), m.LEATHER.draw(rng)
    runners = [meshes.box((1.0, 0.04, 0.14), wood, (-1.7, y, 0.0)) for y in (-0.18, 0.18)]
    seat = meshes.box((0.9, 0.44, 0.04), wood, (-1.7, 0.0, 0.14))
    line = meshes.rod((-1.2, 0.0, 0.1), (-0.1, 0.2, 0.86), 0.01, rope, sections=3)
    parts = [*runners, seat, line]
    if rng.random() < 0.6:
        parts.append(people.torso(rng, (-1.8, 0.0, 0.18)))
        parts.append(people.head(rng, (-1.76, 0.0, 1.02)))
    return people.beside(people.adult(rng), Rigid(meshes.join(parts)))
