"""Animals on four legs, standing on z = 0 and facing +x."""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import Leg, Material, Mesh, materials as m, meshes
from shotenv.world.things.limbs import Limb, Walking

HIP_SHARE = 0.53
"""Hip over height of a person (Winter, 2009): animals step like a person with as high hips."""


def four_legged(
    rng: np.random.Generator,
    trunk: Mesh,
    hips: tuple[tuple[float, float], tuple[float, float]],
    lengths: tuple[float, float, float],
    radius: float,
    coat: Material,
    scale: float,
    place_m: tuple[float, float] = (0.0, 0.0),
) -> Walking:
    """An animal that trots: each fore leg goes with the hind leg of the other side.

    Parameters
    ----------
    trunk : Mesh
        Head, body and tail, over the ground below its middle.
    hips : ((x, x), (y, y))
        Of hind and fore legs, and of right and left ones.
    lengths : tuple of float
        Of thigh, shank and paw.
    radius : float
        Of the thighs; shanks are thinner.
    scale : float
        All lengths above are stretched by this.
    place_m : (x, y)
        Where the animal's middle is on its mover.
    """
    thigh, shank, paw = lengths
    upper = meshes.rod((0.0, 0.0, -thigh), (0.0, 0.0, 0.02), radius, coat, sections=4)
    foot = (0.0, 0.0, -shank - 0.98 * paw)
    lower = meshes.rod(foot, (0.0, 0.0, 0.0), 0.4 * radius, coat, sections=4)
    limb = Limb(*(meshes.scaled(mesh, (scale,) * 3) for mesh in (upper, lower)))
    legs = tuple(
        Leg(
            thigh_m=scale * thigh,
            shank_m=scale * shank,
            ankle_m=scale * paw,
            heel_m=0.0,
            toe_m=0.0,
            hip_x_m=scale * x + place_m[0],
            hip_y_m=scale * y + place_m[1],
            turn=float(fore ^ left),
            knee=1 if fore else -1,
        )
        for fore, x in enumerate(hips[0])
        for left, y in enumerate(hips[1])
    )
    hip_z_m = legs[0].hip_z_m
    trunk = meshes.at(meshes.scaled(trunk, (scale,) * 3), 0.0, 0.0, -hip_z_m)
    phase = rng.uniform(0.0, 2.0)
    return Walking(trunk, legs, (limb,) * 4, hip_z_m / HIP_SHARE, phase, place_m=place_m)


def dog(rng: np.random.Generator, x: float = 0.0, y: float = 0.0) -> Walking:
    """A dog of any size, beside its walker at (x, y)."""
    coat = m.Finish((0.10, 0.60), 0.3, 0.3).draw(rng)
    # Trunk, neck, head with muzzle, tail.
    trunk = meshes.join(
        [
            meshes.rod((-0.28, 0.0, 0.48), (0.26, 0.0, 0.50), 0.12, coat, sections=7),
            meshes.rod((0.22, 0.0, 0.52), (0.36, 0.0, 0.70), 0.07, coat, sections=6),
            meshes.rod((0.30, 0.0, 0.70), (0.52, 0.0, 0.66), 0.06, coat, sections=6),
            meshes.rod((-0.28, 0.0, 0.52), (-0.50, 0.0, 0.70), 0.02, coat, sections=4),
        ]
    )
    hips, lengths = ((-0.22, 0.2), (-0.07, 0.07)), (0.22, 0.21, 0.02)
    scale = rng.uniform(0.5, 1.1)
    return four_legged(rng, trunk, hips, lengths, 0.045, coat, scale, (x, y))
