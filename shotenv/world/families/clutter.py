"""Rooms, halls and open ground full of solids at random. For training only.

A network that sees five kinds of places learns them: that what is dark and low is a road, that
what is bright and upright is a wall. Here reflectance, place, size and kind are drawn independently
of each other, and the lamps of all of them, so that only optics tells a distance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shotenv.world.families.roads import REACH_M
from shotenv.world.families.traffic import draw_one
from shotenv.world.geometry import (
    MAX_LAMPS,
    Arc,
    Indoor,
    Lamp,
    Material,
    Mesh,
    Mover,
    Pose,
    Rigid,
    Site,
    lights,
    materials as m,
    meshes,
    rotation,
)
from shotenv.world.things import cycles, furniture, plants
from unwrap.support import Range

REFLECTANCE: Range = (0.02, 0.95)
"""Of everything in this family: from soot to fresh snow."""
SIDE_M = 1.3
"""Least distance of a wall from the ego's way: half a vehicle's width and some clearance."""
OVERHEAD_M = 2.05
"""What floats higher than this may do so above the ego."""
WALL_M = 0.3
VIEW_RAD = np.radians(40.0)
"""Things are put within this angle of the ego's heading: what the camera sees, and a little more
that lights and shades it."""
NEAREST_M = 0.9
FEWEST_THINGS, MOST_THINGS = 12, 160
"""Things that are drawn; many find no room, above all in small rooms."""
MOST_OVERHEAD = 8
MOVER_TRIES = 12
"""Ways that are tried for something that moves, before it is left out."""
LAMP_IRRADIANCE: Range = (1e-2, 0.5)
"""Irradiance in band that one lamp gives what it is for, W m-2; an assumed range, of lamps of no
kind: what networks learn here is to hold for any light."""
LIT_SHARE = 0.4
"""What a lamp is for is this share of the place's height and reach away; assumed."""
LAMP_SIDE_M = 0.2
"""Side of a lamp's square face."""


def lay_out_room(site: Site, rng: np.random.Generator) -> None:
    """A small room or yard."""
    lay_out_between_walls(site, rng, reach=(2.0, 9.0), height=(2.2, 3.6))


def lay_out_hall(site: Site, rng: np.random.Generator) -> None:
    """A hall or a large yard."""
    lay_out_between_walls(site, rng, reach=(9.0, 60.0), height=(3.0, 14.0))


def lay_out_open_ground(site: Site, rng: np.random.Generator) -> None:
    """Ground without walls."""
    everywhere = (-REACH_M, site.travel_m + REACH_M), (-REACH_M, REACH_M)
    site.build(meshes.patch(*everywhere, 0.0, any_surface(rng)))
    fill(site, rng, m.log_uniform(rng, (5.0, 60.0)), m.log_uniform(rng, (2.5, 12.0)))


def lay_out_between_walls(
    site: Site, rng: np.random.Generator, reach: Range, height: Range
) -> None:
    """Four walls about the ego's way, mostly under a roof, and things between them.

    Parameters
    ----------
    reach : (low, high)
        From the end of the ego's way to the wall ahead, metres; drawn log-uniformly.
    height : (low, high)
        Of the walls, metres; drawn log-uniformly.
    """
    way = np.array([site.ego.at(time).position_m[:2] for time in site.times])
    ahead_m, height_m = m.log_uniform(rng, reach), m.log_uniform(rng, height)
    behind_m = m.log_uniform(rng, (1.0, max(1.5, ahead_m / 2)))
    right_m, left_m = (m.log_uniform(rng, (SIDE_M, max(2.0, ahead_m))) for _ in range(2))
    low = way.min(axis=0) - np.array([behind_m, right_m])
    high = way.max(axis=0) + np.array([ahead_m, left_m])
    site.enclose((low[0], high[0]), (low[1], high[1]), height_m)
    build_walls(site, rng, low, high, height_m)
    fill(site, rng, ahead_m, height_m)


def build_walls(
    site: Site, rng: np.random.Generator, low: np.ndarray, high: np.ndarray, height: float
) -> None:
    """Floor and walls of a rectangle; a roof over most, and daylight through a gap ahead of some.

    `low` and `high` are the corners (x, y) between the walls.
    """
    (x0, y0), (x1, y1) = low, high
    middle, size = (low + high) / 2, high - low + 2 * WALL_M
    roofed, has_gap = rng.random() < 0.75, rng.random() < 0.4
    site.build(meshes.patch((x0, x1 + WALL_M), (y0, y1), 0.0, any_surface(rng)))
    for y in (y0 - WALL_M / 2, y1 + WALL_M / 2):
        side = meshes.box((size[0], WALL_M, height), any_surface(rng), (middle[0], y, 0.0))
        site.build(side)
    rear = meshes.box((WALL_M, y1 - y0, height), any_surface(rng), (x0 - WALL_M / 2, middle[1], 0))
    site.build(rear)
    # Whether there is a gap or not, its edges are drawn: what follows does not depend on it.
    gap_y0, gap_y1 = np.sort(rng.uniform(y0, y1, 2))
    gap_z0, gap_z1 = np.sort(rng.uniform(0.0, height, 2))
    if has_gap:
        ahead = [(y0, gap_y0, 0.0, height), (gap_y1, y1, 0.0, height),
                 (gap_y0, gap_y1, 0.0, gap_z0), (gap_y0, gap_y1, gap_z1, height)]  # fmt: skip
        outside = (x1 + WALL_M, x1 + REACH_M), (-REACH_M, REACH_M)
        # A little lower, so that it does not lie in one plane with the floor.
        site.build(meshes.patch(*outside, -0.01, any_surface(rng)))
    else:
        ahead = [(y0, y1, 0.0, height)]
    surface = any_surface(rng)
    for left, right, bottom, top in ahead:
        box = (WALL_M, right - left, top - bottom)
        site.build(meshes.box(box, surface, (x1 + WALL_M / 2, (left + right) / 2, bottom)))
    if roofed:
        roof = meshes.box((*size, WALL_M), any_surface(rng), (*middle, height))
        site.build(roof)
        opening = ((gap_y0, gap_z0), (gap_y1, gap_z1)) if has_gap else None
        corners = (x0 - 1.0, y0 - 1.0, -1.0), (x1, y1 + 1.0, height + WALL_M)
        site.indoor = Indoor(*corners, opening)


def fill(site: Site, rng: np.random.Generator, reach_m: float, ceiling_m: float) -> None:
    """Lamps, then things on the floor, in the air and on the move, few or very many."""
    # Few scenes without any light but the laser's: their gray images tell nothing.
    lit_share = 0.92 if site.night or site.indoor else 0.4
    for _ in range(rng.integers(1, MAX_LAMPS + 1) if rng.random() < lit_share else 0):
        put_lamp(site, rng, reach_m, ceiling_m)
    for _ in range(rng.integers(1, 4) if rng.random() < 0.7 else 0):
        put_mover(site, rng, reach_m)
    for _ in range(rng.integers(MOST_OVERHEAD + 1)):
        hang(site, rng, reach_m, ceiling_m)
    for _ in range(int(m.log_uniform(rng, (FEWEST_THINGS, MOST_THINGS)))):
        thing, place = any_thing(rng, reach_m), any_place(site, rng, reach_m)
        floats, share = rng.random(2)
        # It may float, wherever there is room; its ground is taken all the same.
        room_m = max(ceiling_m - float(thing.corners[..., 2].max()), 0.0)
        site.put(thing, *place, z=share * room_m if floats < 0.3 else 0.0)


def hang(site: Site, rng: np.random.Generator, reach_m: float, ceiling_m: float) -> None:
    """Something in the air, above the ego's head too, or nothing where the ceiling is low."""
    thing, place = any_thing(rng, reach_m), any_place(site, rng, reach_m)
    highest_m = ceiling_m - float(thing.corners[..., 2].max())
    if highest_m > OVERHEAD_M:
        site.build(meshes.at(thing, *place, rng.uniform(OVERHEAD_M, highest_m)))


def put_mover(site: Site, rng: np.random.Generator, reach_m: float) -> None:
    """Something that goes anywhere at any speed, or nothing where no way is free."""
    thing = Mover((Rigid(any_thing(rng, reach_m)),))
    for _ in range(MOVER_TRIES):
        start = Pose((*any_place(site, rng, reach_m), 0.0), rng.uniform(-np.pi, np.pi))
        # Slower where there is less room to go.
        speed_m_s = m.log_uniform(rng, (0.1, 0.2 + 0.1 * reach_m))
        if site.put_moving(thing, Arc(start, speed_m_s, rng.normal(0.0, 0.3))):
            return


def any_place(site: Site, rng: np.random.Generator, reach_m: float) -> tuple[float, float]:
    """A place (x, y) ahead of where the ego is at some time; its distance is log-uniform."""
    pose = site.ego.at(float(rng.choice(site.times)))
    away = m.log_uniform(rng, (NEAREST_M, reach_m + NEAREST_M))
    angle = pose.yaw_rad + rng.uniform(-VIEW_RAD, VIEW_RAD)
    x, y, _ = pose.position_m
    return x + away * float(np.cos(angle)), y + away * float(np.sin(angle))


def put_lamp(site: Site, rng: np.random.Generator, reach_m: float, ceiling_m: float) -> None:
    """A lamp with a glowing face at any height, aimed down or anywhere, wide or narrow."""
    x, y = any_place(site, rng, reach_m)
    # Mostly high up, as lamps are.
    height = float(rng.uniform(0.3, ceiling_m - 0.2, 2).max())
    aim = rng.normal(0.0, 1.0, 3) - (0.0, 0.0, 1.5)
    aim /= np.linalg.norm(aim)
    away_m = LIT_SHARE * (ceiling_m + reach_m)
    intensity = m.log_uniform(rng, LAMP_IRRADIANCE) * away_m**2
    cutoff = rng.uniform(-0.3, 0.9)
    radiance = lights.face_radiance(intensity, LAMP_SIDE_M**2)
    face = lamp_face(aim, any_surface(rng).glowing(radiance))
    if height > OVERHEAD_M:
        site.build(meshes.at(face, x, y, height))
    elif not site.put(face, x, y, z=height):
        return
    # A little before its face, which would shade it otherwise.
    place = np.array([x, y, height]) + 0.05 * aim
    site.lamps.append(
        Lamp(tuple(place.tolist()), intensity, 0.2, tuple(aim.tolist()), float(cutoff))
    )


def lamp_face(aim: np.ndarray, material: Material) -> Mesh:
    """A square across `aim` about the origin."""
    along = np.cross(aim, np.eye(3)[np.abs(aim).argmin()])
    along *= LAMP_SIDE_M / 2 / np.linalg.norm(along)
    across = np.cross(aim, along)
    return meshes.polygon(np.array([along, across, -along, -across]) * np.sqrt(2), material)


def any_surface(rng: np.random.Generator) -> Material:
    """A surface of any reflectance, plain or patterned; some are glossy, a few retro-reflect."""
    # Uniform in the square root: dark surfaces, which are the hard ones, are then more frequent.
    least, most = np.sqrt(REFLECTANCE)
    albedo = rng.uniform(least, most, 2) ** 2
    contrast = rng.uniform() if rng.random() < 0.5 else 0.0
    low, high = np.sort([albedo[0], albedo[0] + contrast * (albedo[1] - albedo[0])])
    kind, mirror = rng.random(3), m.log_uniform(rng, (0.02, 0.5))
    return Material(
        albedo_low=float(low),
        albedo_high=float(high),
        texture_m=m.log_uniform(rng, (0.15, 4.0)),
        offset=float(rng.uniform()),
        mirror=mirror if kind[0] < 0.2 else 0.0,
        retro=m.log_uniform(rng, (2.0, 500.0)) if kind[1] < 0.03 else 0.0,
    )


def any_thing(rng: np.random.Generator, reach_m: float) -> Mesh:
    """A solid, a panel, a shelf or something from the street, of any size, standing on z = 0."""
    kinds: tuple[Callable[[np.random.Generator, float], Mesh], ...] = (
        solid_box, cylinder, sphere, turned_solid, lump, panel, panel, shelf, street_thing,
    )  # fmt: skip
    size_m = m.log_uniform(rng, (0.1 + 0.01 * reach_m, 0.6 + 0.13 * reach_m))
    return kinds[rng.integers(len(kinds))](rng, size_m)


def tilted(rng: np.random.Generator, mesh: Mesh) -> Mesh:
    """`mesh` turned about z by any angle and, as often as not, about the other axes as well."""
    tilt = rng.uniform(-np.pi, np.pi, 2) * (rng.random() < 0.5)
    turn = rotation(Pose((0.0, 0.0, 0.0), rng.uniform(-np.pi, np.pi), *tilt))
    corners = (mesh.corners.astype(np.float64) @ turn.T).astype(np.float32)
    return meshes.grounded(replace(mesh, corners=corners))


@meshes.thing
def solid_box(rng: np.random.Generator, size_m: float) -> Mesh:
    """A box of any proportions whose longest side may measure `size_m`."""
    width, depth, height = (size_m * rng.uniform(0.1, 1.0, 3)).tolist()
    return tilted(rng, meshes.box((width, depth, height), any_surface(rng)))


@meshes.thing
def cylinder(rng: np.random.Generator, size_m: float) -> Mesh:
    """A disc, a drum or a rod."""
    radius = size_m * m.log_uniform(rng, (0.04, 0.5))
    end = (0.0, 0.0, size_m * m.log_uniform(rng, (0.1, 1.0)))
    return tilted(rng, meshes.rod((0.0, 0.0, 0.0), end, radius, any_surface(rng), sections=16))


@meshes.thing
def sphere(rng: np.random.Generator, size_m: float) -> Mesh:
    """A ball of 320 triangles, or an ellipsoid."""
    ball = meshes.ball(size_m / 2, any_surface(rng), (0.0, 0.0, 0.0), detail=2)
    if rng.random() < 0.5:
        return meshes.grounded(ball)
    x, y, z = rng.uniform(0.3, 1.0, 3).tolist()
    return tilted(rng, meshes.scaled(ball, (x, y, z)))


@meshes.thing
def turned_solid(rng: np.random.Generator, size_m: float) -> Mesh:
    """A cone, a vase, a spindle: a solid of revolution with any profile."""
    radii = size_m / 2 * rng.uniform(0.1, 1.0, rng.integers(2, 6))
    heights = np.linspace(0.0, size_m * rng.uniform(0.3, 1.0), len(radii))
    profile = [(0.0, 0.0), *zip(radii.tolist(), heights.tolist(), strict=True), (0.0, heights[-1])]
    return tilted(rng, meshes.lathe(profile, any_surface(rng), sections=14))


@meshes.thing
def lump(rng: np.random.Generator, size_m: float) -> Mesh:
    """A rough stone."""
    stone = meshes.blob(rng, size_m / 2, any_surface(rng), (0.0, 0.0, 0.0), detail=2)
    x, y, z = rng.uniform(0.4, 1.0, 3).tolist()
    return tilted(rng, meshes.scaled(stone, (x, y, z)))


@meshes.thing
def panel(rng: np.random.Generator, size_m: float) -> Mesh:
    """A plane at any angle; one in ten is a pane that light passes."""
    surface, clear = any_surface(rng), rng.uniform(0.1, 0.8)
    if rng.random() < 0.1:
        surface = replace(surface, clear=min(clear, 1.0 - surface.mirror))
    width, height = (size_m * rng.uniform(0.4, 2.0, 2)).tolist()
    return tilted(rng, meshes.front((-width / 2, width / 2), (0.0, height), 0.0, surface))


@meshes.thing
def shelf(rng: np.random.Generator, size_m: float) -> Mesh:
    """Boards between two sides, each with boxes on it and a surface of its own."""
    width, depth = size_m * rng.uniform(0.5, 1.0), size_m * rng.uniform(0.15, 0.4)
    step, boards = size_m * rng.uniform(0.15, 0.4), int(rng.integers(2, 5))
    thick = 0.03 * size_m
    tall = step * (boards - 1) + thick
    parts = [
        meshes.box((depth, thick, tall), any_surface(rng), (0.0, side * (width + thick) / 2, 0.0))
        for side in (-1, 1)
    ]
    for z in step * np.arange(boards):
        parts.append(meshes.box((depth, width, thick), any_surface(rng), (0.0, 0.0, float(z))))
        for y in np.arange(-width / 2, width / 2, 0.25 * width)[: rng.integers(5)]:
            most = np.array([depth, 0.2 * width, 0.95 * (step - thick)])
            deep, wide, high = (most * rng.uniform(0.3, 1.0, 3)).tolist()
            base = (0.0, float(y) + 0.125 * width, float(z) + thick + 1e-3)
            parts.append(meshes.box((deep, wide, high), any_surface(rng), base))
    return meshes.at(meshes.join(parts), 0.0, 0.0, yaw=rng.uniform(-np.pi, np.pi))


@meshes.thing
def street_thing(rng: np.random.Generator, size_m: float) -> Mesh:
    """Something from the street, upright, every part of it with any reflectance."""
    del size_m  # It is as large as it is.
    drawn = draw_one(
        rng,
        (furniture.sign, furniture.bollard, furniture.cone, furniture.crate, furniture.bench,
         furniture.rubbish_bin, furniture.cabinet, furniture.letter_box, furniture.planter,
         plants.tree, plants.shrub, cycles.bicycle),
    )  # fmt: skip
    # Faces of one part have one pair of albedos; the kinds of things would tell reflectances.
    pairs = np.stack([drawn.albedo_low, drawn.albedo_high], axis=1)
    part = np.unique(pairs, axis=0, return_inverse=True)[1].ravel()
    surfaces = [any_surface(rng) for _ in range(part.max() + 1)]

    def of_parts(name: str) -> np.ndarray:
        return np.array([getattr(surface, name) for surface in surfaces], np.float32)[part]

    return replace(
        drawn,
        albedo_low=of_parts("albedo_low"),
        albedo_high=of_parts("albedo_high"),
        retro=of_parts("retro"),
        mirror=of_parts("mirror"),
        clear=np.zeros_like(drawn.clear),
    )
