"""People, standing on z = 0 and facing +x."""

from __future__ import annotations

import numpy as np

from shotenv.world import materials as m
from shotenv.world import meshes
from shotenv.world.materials import Material
from shotenv.world.model import Mesh

HAIR_PROFILE = [(0.1, 0.0), (0.11, 0.04), (0.085, 0.11), (0.0, 0.135)]


def clothes(rng: np.random.Generator) -> Material:
    """One garment, more often bright than dark in the near infrared."""
    return (m.CLOTHES if rng.random() < 0.7 else m.DARK_CLOTHES).draw(rng)


def person(rng: np.random.Generator, stride_m: float = 0.0) -> Mesh:
    """Somebody standing (`stride_m` 0) or caught in a stride of that length.

    Child to tall adult; sometimes with a bag or a retro-reflecting vest stripe.
    """
    height = rng.uniform(1.1, 1.35) if rng.random() < 0.12 else rng.uniform(1.52, 1.92)
    scale = height / 1.75
    parts = [
        legs(rng, stride_m / scale),
        torso(rng, base=(0.0, 0.0, 0.80)),
        arms(rng, stride_m / scale),
        head(rng, centre=(0.02, 0.0, 1.62)),
    ]
    if rng.random() < 0.25:
        parts.append(meshes.box((0.12, 0.34, 0.4), clothes(rng), (-0.2, 0.0, 1.0)))
    return meshes.scaled(meshes.join(parts), (scale, scale * rng.uniform(0.95, 1.12), scale))


def legs(rng: np.random.Generator, stride_m: float) -> Mesh:
    """Two legs in trousers, and shoes flat on the ground."""
    trousers, shoe = clothes(rng), m.LEATHER.draw(rng)
    parts = []
    for side in (-1, 1):
        foot = side * stride_m / 2
        knee, y = foot / 2 + 0.03, side * 0.10
        parts += [
            meshes.rod((knee, y, 0.44), (0.0, y, 0.86), 0.085, trousers, sections=6),
            meshes.rod((foot, y, 0.06), (knee, y, 0.47), 0.065, trousers, sections=6),
            meshes.box((0.26, 0.10, 0.08), shoe, (foot + 0.05, y, 0.0)),
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
    parts = [meshes.lathe(profile, cloth, sections=10)]
    if rng.random() < 0.15:
        stripe = [(0.192, 0.30), (0.205, 0.36)]
        parts.append(meshes.lathe(stripe, m.RETRO_SHEET.draw(rng), sections=10))
    return meshes.at(meshes.scaled(meshes.join(parts), (0.62, 1.0, 1.0)), *base)


def arms(rng: np.random.Generator, stride_m: float) -> Mesh:
    """Two arms that swing against the legs, and hands."""
    sleeve, skin = clothes(rng), m.SKIN.draw(rng)
    parts = []
    for side in (-1, 1):
        swing, y = -side * stride_m / 3, side * 0.25
        elbow, hand = (
            (swing / 2 - 0.03, y + side * 0.03, 1.12),
            (swing + 0.04, y + side * 0.03, 0.86),
        )
        parts += [
            meshes.rod((0.0, y - side * 0.03, 1.42), elbow, 0.052, sleeve, sections=5),
            meshes.rod(elbow, hand, 0.043, sleeve, sections=5),
            meshes.ball(0.055, skin, hand, detail=0),
        ]
    return meshes.join(parts)


def head(rng: np.random.Generator, centre: meshes.Point) -> Mesh:
    """Face, neck and hair."""
    x, y, z = centre
    skin = m.SKIN.draw(rng)
    return meshes.join(
        [
            meshes.lathe([(0.0, -0.13), (0.075, -0.11), (0.1, 0.0), (0.07, 0.1)], skin, centre),
            meshes.rod((x - 0.03, y, z - 0.2), (x - 0.01, y, z - 0.05), 0.055, skin, sections=6),
            meshes.lathe(HAIR_PROFILE, m.HAIR.draw(rng), (x - 0.02, y, z)),
        ]
    )


def seated_rider(rng: np.random.Generator) -> Mesh:
    """Somebody on a bicycle's saddle, leaning to the handle bar."""
    trousers, jacket, shoe = clothes(rng), clothes(rng), m.LEATHER.draw(rng)
    parts = [meshes.rod((-0.2, 0.0, 0.95), (0.08, 0.0, 1.42), 0.16, jacket, sections=8)]
    for side, pedal in ((-1, 0.14), (1, 0.46)):
        hip, knee, foot = (
            (-0.17, side * 0.1, 0.95),
            (0.2, side * 0.12, pedal + 0.45),
            (0.0, side * 0.12, pedal + 0.05),
        )
        hand = (0.38, side * 0.2, 1.02)
        parts += [
            meshes.rod(hip, knee, 0.075, trousers, sections=6),
            meshes.rod(knee, foot, 0.055, trousers, sections=6),
            meshes.box((0.25, 0.09, 0.07), shoe, (0.04, side * 0.12, pedal)),
            meshes.rod((0.06, side * 0.17, 1.38), hand, 0.045, jacket, sections=6),
        ]
    return meshes.join([*parts, head(rng, (0.16, 0.0, 1.62))])
