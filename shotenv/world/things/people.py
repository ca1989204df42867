"""People in many poses, standing on z = 0 and facing +x, and what they lead, push and carry."""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import Material, Mesh, materials as m, meshes
from shotenv.world.things.wheels import hoop

HAIR_PROFILE = [(0.1, 0.0), (0.11, 0.04), (0.085, 0.11), (0.0, 0.135)]
HELMET_PROFILE = [(0.10, -0.10), (0.14, 0.0), (0.13, 0.08), (0.08, 0.15), (0.0, 0.17)]
STRIDE_S = 0.4
"""A stride at walking speed v is about v times this long."""


def clothes(rng: np.random.Generator) -> Material:
    """One garment, more often bright than dark in the near infrared."""
    return (m.CLOTHES if rng.random() < 0.7 else m.DARK_CLOTHES).draw(rng)


def somebody(rng: np.random.Generator, speed_m_s: float, wetness: float = 0.0) -> Mesh:
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
        return umbrella(rng, speed_m_s)
    # `and` draws for those who stand only: taken out of it, the draw would change every world.
    if speed_m_s == 0.0 and rng.random() < 0.2:
        return crouching(rng)
    draw = (adult, child, pushchair, dog_walker, suitcase)[
        rng.choice(5, p=(0.62, 0.14, 0.08, 0.08, 0.08))
    ]
    return draw(rng, STRIDE_S * speed_m_s)


@meshes.thing
def adult(rng: np.random.Generator, stride_m: float = 0.0, reach_m: float = 0.0) -> Mesh:
    """Somebody standing (`stride_m` 0) or caught at any moment of a stride of that length.

    Sometimes with a bag or a retro-reflecting vest stripe; hands `reach_m` ahead, 0 for none.
    """
    return figure(rng, rng.uniform(1.52, 1.92), stride_m, reach_m)


@meshes.thing
def child(rng: np.random.Generator, stride_m: float = 0.0) -> Mesh:
    """A child of about three to ten years."""
    return figure(rng, rng.uniform(0.95, 1.38), 0.7 * stride_m)


def figure(
    rng: np.random.Generator, height_m: float, stride_m: float = 0.0, reach_m: float = 0.0
) -> Mesh:
    """A person of this height; children have larger heads."""
    # Limbs are drawn for 1.75 m; a stride stays as long as asked for.
    scale = height_m / 1.75
    phase, stride = rng.uniform(-np.pi, np.pi), stride_m / scale
    parts = [
        legs(rng, stride, phase),
        torso(rng, base=(0.0, 0.0, 0.80)),
        arms(rng, stride * np.cos(phase), reach_m / scale),
        head(rng, (0.02, 0.0, 1.62)),
    ]
    if rng.random() < 0.25:
        # A rucksack.
        parts.append(meshes.box((0.12, 0.34, 0.4), clothes(rng), (-0.2, 0.0, 1.0)))
    return meshes.scaled(meshes.join(parts), (scale, scale * rng.uniform(0.95, 1.12), scale))


def legs(rng: np.random.Generator, stride_m: float, phase_rad: float) -> Mesh:
    """Two legs in trousers, one shoe on the ground, the other one swinging forward."""
    trousers, shoe = clothes(rng), m.LEATHER.draw(rng)
    parts = []
    for side in (-1, 1):
        foot, y = side * stride_m / 2 * np.cos(phase_rad), side * 0.10
        # Feet are farthest apart at phase 0; where they pass each other, one of them is up.
        lift = 0.25 * stride_m * max(0.0, side * np.sin(phase_rad))
        # A lifted foot bends the knee forwards.
        knee = foot / 2 + 0.03 + 0.8 * lift
        parts += [
            meshes.rod((knee, y, 0.44 + lift), (0.0, y, 0.86), 0.085, trousers, sections=6),
            meshes.rod((foot, y, 0.06 + lift), (knee, y, 0.47 + lift), 0.065, trousers, sections=6),
            meshes.box((0.26, 0.10, 0.08), shoe, (foot + 0.05, y, lift)),
        ]
    return meshes.join(parts)


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


def arms(rng: np.random.Generator, stride_m: float, reach_m: float = 0.0) -> Mesh:
    """Two arms that swing against the legs or reach ahead, and hands."""
    sleeve, skin = clothes(rng), m.SKIN.draw(rng)
    parts = []
    for side in (-1, 1):
        # Each arm swings with the leg of the other side, less far.
        swing, y = -side * stride_m / 3, side * 0.28
        elbow, hand = (swing / 2 - 0.03, y, 1.12), (swing + 0.04, y, 0.86)
        if reach_m:
            elbow, hand = (0.3 * reach_m, y, 1.14), (reach_m, 0.8 * y, 1.0)
        parts += [
            meshes.rod((0.0, y - side * 0.06, 1.42), elbow, 0.052, sleeve, sections=5),
            meshes.rod(elbow, hand, 0.043, sleeve, sections=5),
            meshes.ball(0.055, skin, hand, detail=0),
        ]
    return meshes.join(parts)


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
def crouching(rng: np.random.Generator) -> Mesh:
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
    return meshes.join([*parts, head(rng, (0.24, 0.0, 1.0))])


@meshes.thing
def umbrella(rng: np.random.Generator, speed_m_s: float = 0.0) -> Mesh:
    """Somebody under an open umbrella."""
    canopy = [(0.02, 0.22), (0.30, 0.16), (0.55, 0.0)]
    cloth, metal = clothes(rng), m.METAL.draw(rng)
    # The profile runs from the rim up to the tip, as `lathe` wants it.
    cover = meshes.lathe(canopy[::-1], cloth, (0.12, 0.1, 1.86))
    stick = meshes.rod((0.2, 0.15, 1.05), (0.12, 0.1, 2.05), 0.012, metal, sections=4)
    return meshes.join([adult(rng, STRIDE_S * speed_m_s, reach_m=0.2), cover, stick])


@meshes.thing
def pushchair(rng: np.random.Generator, stride_m: float = 0.0) -> Mesh:
    """Somebody behind a pushchair."""
    cloth, metal, tyre = clothes(rng), m.METAL.draw(rng), m.TYRE.draw(rng)
    hood = [(0.62, 0.55), (0.98, 0.42), (1.02, 0.52), (0.78, 1.02), (0.62, 0.95)]
    frame = [
        meshes.rod((0.45, y, 1.0), (1.05, y, 0.25), 0.02, metal, sections=4) for y in (-0.22, 0.22)
    ]
    wheels = [
        hoop((x, y, 0.125), 0.1, tyre, thickness=0.025) for x in (0.62, 1.1) for y in (-0.26, 0.26)
    ]
    basket = meshes.box((0.5, 0.4, 0.2), m.DARK_CLOTHES.draw(rng), (0.85, 0.0, 0.25))
    chair = meshes.join([meshes.extrude(hood, 0.4, cloth), *frame, *wheels, basket])
    return meshes.join([adult(rng, stride_m, reach_m=0.42), meshes.grounded(chair)])


@meshes.thing
def dog_walker(rng: np.random.Generator, stride_m: float = 0.0) -> Mesh:
    """Somebody with a dog on a lead."""
    x, y = rng.uniform(0.4, 1.0), rng.choice([-0.45, 0.45])
    lead = meshes.rod((0.1, 0.6 * y, 0.86), (x + 0.2, y, 0.45), 0.008, m.LEATHER.draw(rng), 3)
    return meshes.join([adult(rng, stride_m), meshes.at(dog(rng), x, y), lead])


@meshes.thing
def dog(rng: np.random.Generator) -> Mesh:
    """A dog of any size."""
    coat = m.Finish((0.10, 0.60), 0.3, 0.3).draw(rng)
    legs_at = [(x, y) for x in (-0.22, 0.2) for y in (-0.07, 0.07)]
    # Trunk, legs, neck, head with muzzle, tail.
    body = meshes.join(
        [
            meshes.rod((-0.28, 0.0, 0.48), (0.26, 0.0, 0.50), 0.12, coat, sections=7),
            *(meshes.rod((x, y, 0.0), (x, y, 0.45), 0.035, coat, sections=4) for x, y in legs_at),
            meshes.rod((0.22, 0.0, 0.52), (0.36, 0.0, 0.70), 0.07, coat, sections=6),
            meshes.rod((0.30, 0.0, 0.70), (0.52, 0.0, 0.66), 0.06, coat, sections=6),
            meshes.rod((-0.28, 0.0, 0.52), (-0.50, 0.0, 0.70), 0.02, coat, sections=4),
        ]
    )
    return meshes.scaled(body, (rng.uniform(0.5, 1.1),) * 3)


@meshes.thing
def suitcase(rng: np.random.Generator, stride_m: float = 0.0) -> Mesh:
    """Somebody who pulls a suitcase on wheels."""
    shell = meshes.box((0.28, 0.42, 0.6), m.PLASTIC.draw(rng), (-0.62, -0.3, 0.06))
    wheels = meshes.box((0.2, 0.36, 0.06), m.RUBBER.draw(rng), (-0.62, -0.3, 0.0))
    handle = meshes.rod((-0.6, -0.3, 0.66), (0.0, -0.28, 0.86), 0.012, m.METAL.draw(rng), 4)
    return meshes.join([adult(rng, stride_m), shell, wheels, handle])


def seated_rider(rng: np.random.Generator, turn_rad: float = 0.5 * np.pi) -> Mesh:
    """Somebody on a bicycle's saddle, leaning to the handle bar; the pedals turned by an angle."""
    trousers, jacket, shoe = clothes(rng), clothes(rng), m.LEATHER.draw(rng)
    parts = [meshes.rod((-0.2, 0.0, 0.95), (0.08, 0.0, 1.42), 0.16, jacket, sections=8)]
    for side in (-1, 1):
        # Cranks of 16 cm about the bottom bracket; the pedals are half a turn apart.
        pedal_x = -0.05 + 0.16 * side * np.cos(turn_rad)
        pedal_z = 0.30 + 0.16 * side * np.sin(turn_rad)
        hip, knee = (-0.17, side * 0.1, 0.95), (0.2, side * 0.12, pedal_z + 0.45)
        hand = (0.38, side * 0.2, 1.02)
        parts += [
            meshes.rod(hip, knee, 0.075, trousers, sections=6),
            meshes.rod(knee, (pedal_x, side * 0.12, pedal_z + 0.05), 0.055, trousers, sections=6),
            meshes.box((0.25, 0.09, 0.07), shoe, (pedal_x + 0.05, side * 0.12, pedal_z)),
            meshes.rod((0.06, side * 0.17, 1.38), hand, 0.045, jacket, sections=6),
        ]
    return meshes.join([*parts, head(rng, (0.16, 0.0, 1.62), helmet=rng.random() < 0.5)])


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
