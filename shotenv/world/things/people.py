"""People who walk and stand on z = 0 and face +x, and what they lead, push and carry."""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import (
    Leg,
    Material,
    Mesh,
    Mover,
    Part,
    Rigid,
    materials as m,
    meshes,
)
from shotenv.world.things.animals import dog
from shotenv.world.things.limbs import Limb, Pedalling, Walking
from shotenv.world.things.wheels import ring

HAIR_PROFILE = [(0.1, 0.0), (0.11, 0.04), (0.085, 0.11), (0.0, 0.135)]
HELMET_PROFILE = [(0.10, -0.10), (0.14, 0.0), (0.13, 0.08), (0.08, 0.15), (0.0, 0.17)]
HEIGHT_M = 1.75
"""People are drawn this tall and then scaled."""
THIGH_M, SHANK_M, ANKLE_M = 0.43, 0.43, 0.07
"""Segments of a leg of somebody this tall: Winter (2009), as shares of the height."""
SHOULDER_M = 1.42


def clothes(rng: np.random.Generator) -> Material:
    """One garment, more often bright than dark in the near infrared."""
    return (m.CLOTHES if rng.random() < 0.7 else m.DARK_CLOTHES).draw(rng)


def somebody(rng: np.random.Generator, speed_m_s: float, wetness: float = 0.0) -> Mover:
    """Anybody on a pavement: alone, or with an umbrella, a pushchair, a dog or a suitcase.

    Parameters
    ----------
    rng : Generator
    speed_m_s : float
        How fast they walk: who stands may as well crouch.
    wetness : float
        In the wet, more umbrellas are open.
    """
    kind = rng.random()
    if kind < 0.04 + 0.4 * wetness:
        return umbrella(rng)
    # `and` draws for those who stand only: taken out of it, the draw would change every world.
    if speed_m_s == 0.0 and rng.random() < 0.2:
        return crouching(rng)
    draw = (adult, child, pushchair, dog_walker, suitcase)[
        rng.choice(5, p=(0.62, 0.14, 0.08, 0.08, 0.08))
    ]
    return draw(rng)


@meshes.thing
def adult(rng: np.random.Generator, reach_m: float = 0.0, carried: Mesh | None = None) -> Mover:
    """Somebody with swinging arms, or with hands `reach_m` ahead that hold what is `carried`.

    Sometimes with a rucksack or a retro-reflecting vest stripe.
    """
    return Mover((figure(rng, rng.uniform(1.52, 1.92), reach_m, carried),))


@meshes.thing
def child(rng: np.random.Generator) -> Mover:
    """A child of about three to ten years."""
    return Mover((figure(rng, rng.uniform(0.95, 1.38)),))


def figure(
    rng: np.random.Generator, height_m: float, reach_m: float = 0.0, carried: Mesh | None = None
) -> Walking:
    """A person of this height who walks; what is `carried` is drawn for one of `HEIGHT_M`."""
    parts = [torso(rng, base=(0.0, 0.0, 0.80)), head(rng, (0.02, 0.0, 1.62))]
    if carried is not None:
        parts.append(carried)
    elif rng.random() < 0.25:
        # A rucksack.
        parts.append(meshes.box((0.12, 0.34, 0.4), clothes(rng), (-0.2, 0.0, 1.0)))
    return walking(rng, meshes.join(parts), height_m, rng.uniform(0.95, 1.12), reach_m)


def walking(
    rng: np.random.Generator, upright: Mesh, height_m: float, width: float, reach_m: float = 0.0
) -> Walking:
    """An upright body of `HEIGHT_M` with arms and legs, scaled to a height and a width."""
    scale = height_m / HEIGHT_M
    size = (scale, scale * width, scale)
    legs, limbs = two_legs(rng, size)
    arm = arms(rng, reach_m / scale)
    trunk = meshes.at(upright, 0.0, 0.0, -legs[0].hip_z_m / scale)
    beside, up = 0.24 * size[1], SHOULDER_M * scale - legs[0].hip_z_m
    if reach_m:
        # Hands that hold something keep still on the body.
        still = [
            meshes.at(one, 0.0, side * 0.24, up / scale)
            for one, side in zip(arm, (1, -1), strict=True)
        ]
        trunk, arm = meshes.join([trunk, *still]), ()
    return Walking(
        trunk=meshes.scaled(trunk, size),
        legs=legs,
        limbs=limbs,
        height_m=height_m,
        phase=rng.uniform(0.0, 2.0),
        arms=tuple(meshes.scaled(one, size) for one in arm),
        shoulder_m=(beside, up),
    )


def two_legs(
    rng: np.random.Generator, size: meshes.Point, hip_x_m: float = 0.0
) -> tuple[tuple[Leg, ...], tuple[Limb, ...]]:
    """Two legs in trousers and shoes, stretched by `size` along each axis: left, then right."""
    trousers, shoe = clothes(rng), m.LEATHER.draw(rng)
    thigh = meshes.rod((0.0, 0.0, -THIGH_M - 0.03), (0.0, 0.0, 0.02), 0.085, trousers, sections=6)
    shank = meshes.rod((0.0, 0.0, -SHANK_M), (0.0, 0.0, 0.03), 0.062, trousers, sections=6)
    sole = meshes.box((0.26, 0.10, 0.09), shoe, (0.05, 0.0, -ANKLE_M))
    limb = Limb(*(meshes.scaled(mesh, size) for mesh in (thigh, shank, sole)))
    legs = tuple(
        Leg(
            thigh_m=size[0] * THIGH_M,
            shank_m=size[0] * SHANK_M,
            ankle_m=size[0] * ANKLE_M,
            heel_m=-0.08 * size[0],
            toe_m=0.18 * size[0],
            hip_x_m=hip_x_m,
            hip_y_m=side * 0.10 * size[1],
            turn=turn,
        )
        for side, turn in ((1, 0.0), (-1, 1.0))
    )
    return legs, (limb, limb)


def torso(rng: np.random.Generator, base: meshes.Point) -> Mesh:
    """Hip to shoulders, flatter than wide; sometimes with a retro-reflecting stripe."""
    profile = [
        (0.0, 0.0),
        (0.17, 0.0),
        (0.16, 0.15),
        (0.21, 0.5),
        (0.19, 0.62),
        (0.07, 0.70),
        (0.0, 0.70),
    ]
    cloth = clothes(rng)
    # A body of revolution, pressed flat at the end together with its stripe.
    parts = [meshes.lathe(profile, cloth, sections=10)]
    if rng.random() < 0.15:
        stripe = [(0.192, 0.30), (0.205, 0.36)]
        parts.append(meshes.lathe(stripe, m.RETRO_SHEET.draw(rng), sections=10))
    return meshes.at(meshes.scaled(meshes.join(parts), (0.62, 1.0, 1.0)), *base)


def arms(rng: np.random.Generator, reach_m: float = 0.0) -> tuple[Mesh, ...]:
    """Left and right arm that hang from the shoulder or reach ahead, and hands."""
    sleeve, skin = clothes(rng), m.SKIN.draw(rng)
    pair = []
    for side in (1, -1):
        y = side * 0.04
        elbow, hand = (-0.03, y, -0.30), (0.05, y, -0.55)
        if reach_m:
            elbow, hand = (0.3 * reach_m, y, -0.28), (reach_m, -side * 0.02, -0.42)
        parts = [
            meshes.rod((0.0, -side * 0.02, 0.0), elbow, 0.052, sleeve, sections=5),
            meshes.rod(elbow, hand, 0.043, sleeve, sections=5),
            meshes.ball(0.055, skin, hand, detail=0),
        ]
        pair.append(meshes.join(parts))
    return tuple(pair)


def head(rng: np.random.Generator, centre: meshes.Point, helmet: bool = False) -> Mesh:
    """Face, neck and hair, or a helmet."""
    x, y, z = centre
    skin = m.SKIN.draw(rng)
    cover = m.PLASTIC.draw(rng) if helmet else m.HAIR.draw(rng)
    return meshes.join(
        [
            meshes.lathe([(0.0, -0.13), (0.075, -0.11), (0.1, 0.0), (0.07, 0.1)], skin, centre),
            meshes.rod((x - 0.03, y, z - 0.2), (x - 0.01, y, z - 0.05), 0.055, skin, sections=6),
            meshes.lathe(HELMET_PROFILE if helmet else HAIR_PROFILE, cover, (x - 0.02, y, z)),
        ]
    )


@meshes.thing
def crouching(rng: np.random.Generator) -> Mover:
    """Somebody down on their heels, as to tie a shoe or to look under a car."""
    trousers, jacket, shoe = clothes(rng), clothes(rng), m.LEATHER.draw(rng)
    parts = [meshes.rod((-0.12, 0.0, 0.32), (0.14, 0.0, 0.80), 0.17, jacket, sections=8)]
    for side in (-1, 1):
        y = side * 0.12
        parts += [
            meshes.rod((-0.12, y, 0.32), (0.28, y, 0.48), 0.085, trousers, sections=6),
            meshes.rod((0.28, y, 0.48), (0.0, y, 0.08), 0.065, trousers, sections=6),
            meshes.box((0.26, 0.10, 0.08), shoe, (0.06, y, 0.0)),
            meshes.rod((0.12, side * 0.2, 0.76), (0.36, side * 0.1, 0.3), 0.05, jacket, sections=5),
        ]
    return Mover((Rigid(meshes.join([*parts, head(rng, (0.24, 0.0, 1.0))])),))


@meshes.thing
def umbrella(rng: np.random.Generator) -> Mover:
    """Somebody under an open umbrella."""
    canopy = [(0.02, 0.22), (0.30, 0.16), (0.55, 0.0)]
    cloth, metal = clothes(rng), m.METAL.draw(rng)
    # The profile runs from the rim up to the tip, as `lathe` wants it.
    cover = meshes.lathe(canopy[::-1], cloth, (0.12, 0.1, 1.86))
    stick = meshes.rod((0.2, 0.15, 1.0), (0.12, 0.1, 2.05), 0.012, metal, sections=4)
    return adult(rng, reach_m=0.2, carried=meshes.join([cover, stick]))


def beside(walker: Mover, *parts: Part) -> Mover:
    """A walker and what goes along with them."""
    return Mover((*walker.parts, *parts), walker.kinds)


@meshes.thing
def pushchair(rng: np.random.Generator) -> Mover:
    """Somebody behind a pushchair."""
    cloth, metal, tyre = clothes(rng), m.METAL.draw(rng), m.TYRE.draw(rng)
    hood = [(0.62, 0.55), (0.98, 0.42), (1.02, 0.52), (0.78, 1.02), (0.62, 0.95)]
    frame = [
        meshes.rod((0.45, y, 1.0), (1.05, y, 0.25), 0.02, metal, sections=4) for y in (-0.22, 0.22)
    ]
    wheels = [ring(x, 0.1, tyre, thickness=0.025, y=(-0.26, 0.26)) for x in (0.62, 1.1)]
    basket = meshes.box((0.5, 0.4, 0.2), m.DARK_CLOTHES.draw(rng), (0.85, 0.0, 0.25))
    chair = meshes.join([meshes.extrude(hood, 0.4, cloth), *frame, basket])
    return beside(adult(rng, reach_m=0.42), Rigid(chair), *wheels)


@meshes.thing
def dog_walker(rng: np.random.Generator) -> Mover:
    """Somebody with a dog on a lead."""
    x, y = rng.uniform(0.4, 1.0), rng.choice([-0.45, 0.45])
    lead = meshes.rod((0.1, 0.6 * y, 0.86), (x + 0.2, y, 0.45), 0.008, m.LEATHER.draw(rng), 3)
    return beside(adult(rng), dog(rng, x, y), Rigid(lead))


@meshes.thing
def suitcase(rng: np.random.Generator) -> Mover:
    """Somebody who pulls a suitcase on wheels."""
    shell = meshes.box((0.28, 0.42, 0.6), m.PLASTIC.draw(rng), (-0.72, -0.3, 0.06))
    wheels = meshes.box((0.2, 0.36, 0.06), m.RUBBER.draw(rng), (-0.72, -0.3, 0.0))
    handle = meshes.rod((-0.7, -0.3, 0.66), (0.0, -0.28, 0.86), 0.012, m.METAL.draw(rng), 4)
    return beside(adult(rng), Rigid(meshes.join([shell, wheels, handle])))


def seated_rider(rng: np.random.Generator) -> tuple[Part, ...]:
    """Somebody on a bicycle's saddle who leans to the handle bar and pedals."""
    jacket = clothes(rng)
    parts = [meshes.rod((-0.2, 0.0, 0.95), (0.08, 0.0, 1.42), 0.16, jacket, sections=8)]
    for side in (-1, 1):
        hand = (0.38, side * 0.2, 1.02)
        parts.append(meshes.rod((0.06, side * 0.17, 1.38), hand, 0.045, jacket, sections=6))
    body = [*parts, head(rng, (0.16, 0.0, 1.62), helmet=rng.random() < 0.5)]
    legs, limbs = two_legs(rng, (1.0, 1.0, 1.0), hip_x_m=-0.17)
    # Cranks of 17 cm; a turn of 4 to 5.5 m of way is 60 to 80 turns a minute at 5.5 m/s.
    bottom, turn_m = (-0.10, 0.0, 0.30), rng.uniform(4.0, 5.5)
    return Rigid(meshes.join(body)), Pedalling(legs, limbs, 0.97, bottom, 0.17, turn_m)


def motorcyclist(rng: np.random.Generator) -> Mesh:
    """The rider of a motorcycle."""
    trousers, jacket, shoe = clothes(rng), clothes(rng), m.LEATHER.draw(rng)
    parts = [meshes.rod((-0.32, 0.0, 0.88), (-0.06, 0.0, 1.36), 0.18, jacket, sections=8)]
    for side in (-1, 1):
        y = side * 0.2
        parts += [
            meshes.rod((-0.3, side * 0.12, 0.92), (0.12, y, 0.72), 0.09, trousers, sections=6),
            meshes.rod((0.12, y, 0.72), (-0.15, y, 0.36), 0.065, trousers, sections=6),
            meshes.box((0.26, 0.1, 0.08), shoe, (-0.08, y, 0.28)),
            meshes.rod((-0.08, side * 0.2, 1.3), (0.4, side * 0.32, 1.02), 0.055, jacket, 6),
        ]
    return meshes.join([*parts, head(rng, (0.02, 0.0, 1.58), helmet=True)])
