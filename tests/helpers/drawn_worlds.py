"""Worlds of every family, drawn once for all tests of them."""

from functools import cache

import numpy as np

from shotenv.config.bank import WorldConfig
from shotenv.config.families import FAMILIES, SHIFT_FAMILIES, TRAINING_FAMILIES
from shotenv.world.draw import draw_world
from shotenv.world.geometry import materials as m, meshes
from shotenv.world.geometry.model import Mesh

CLIP = WorldConfig()
SPARSE = WorldConfig(frames_per_clip=3, frame_rate_hz=1.0)
EVERY = FAMILIES + SHIFT_FAMILIES + TRAINING_FAMILIES


@cache
def drawn_worlds():
    """Worlds of every family for two kinds of clip: (config, world) pairs."""
    return [
        (config, draw_world(family, seed, config))
        for config in (CLIP, SPARSE)
        for family in EVERY
        for seed in range(100, 106 if config is CLIP else 103)
    ]


def arrays_of(mesh):
    """Every array of a mesh."""
    return [value for value in vars(mesh).values() if isinstance(value, np.ndarray)]


def plain_box(size=(1.0, 1.0, 1.0)) -> Mesh:
    """A box of one plain material, standing on the origin."""
    return meshes.box(size, m.Material(0.2, 0.3))


def route_of(motion):
    """What a piece is hinged to in the end: its mover's way along the ground."""
    return route_of(motion.body) if hasattr(motion, "body") else motion


def movers_of(world):
    """The moving pieces of a world, gathered by the thing that they belong to."""
    movers = {}
    for piece in world.moving:
        movers.setdefault(id(route_of(piece.motion)), []).append(piece)
    return list(movers.values())
