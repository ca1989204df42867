"""Bodies with limbs: who walks on two legs or four, and who pedals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from shotenv.world.geometry import (
    LEAN,
    Leg,
    Mesh,
    MovingObject,
    Posture,
    Route,
    Segment,
    meshes,
    pedalling_posture,
    walking_posture,
)


@dataclass(frozen=True)
class Limb:
    """Meshes of a leg, each hanging from the joint at its origin: hip, knee and ankle."""

    thigh: Mesh
    shank: Mesh
    foot: Mesh | None = None


@dataclass(frozen=True)
class Walking:
    """A body on legs that step along the route of its mover.

    Attributes
    ----------
    trunk : Mesh
        What the hips carry, their middle at its origin.
    legs : tuple of Leg
    limbs : tuple of Limb
        Meshes of each leg.
    height_m : float
        It steps like a person as tall.
    phase : float
        Steps made at the start of the clip.
    arms : tuple of Mesh
        One for each leg or none, hanging from the shoulder at their origin.
    shoulder_m : (y, z)
        Where the shoulders are to either side of the middle, and above the hips.
    place_m : (x, y)
        Where the hips' middle is on the mover.
    """

    trunk: Mesh
    legs: tuple[Leg, ...]
    limbs: tuple[Limb, ...]
    height_m: float
    phase: float
    arms: tuple[Mesh, ...] = ()
    shoulder_m: tuple[float, float] = (0.0, 0.0)
    place_m: tuple[float, float] = (0.0, 0.0)

    def on(self, route: Route, span_s: tuple[float, float]) -> Iterable[MovingObject]:
        """Trunk, arms and legs on a route."""
        posture = walking_posture(route, span_s, self.legs, self.height_m, self.phase)
        (x, y), hip_z = self.place_m, self.legs[0].hip_z_m
        beside, up = self.shoulder_m
        yield MovingObject(self.trunk, Segment(route, posture, (x, y, hip_z), (), LEAN))
        for i, arm in enumerate(self.arms):
            # Up from the hips to the shoulders is a segment that hangs down by less than nothing.
            shoulder = (x, y + (beside if i == 0 else -beside), hip_z)
            motion = Segment(route, posture, shoulder, ((-up, LEAN),), LEAN + 1 + i)
            yield MovingObject(arm, motion)
        yield from leg_pieces(route, posture, self.legs, self.limbs, hip_z)


@dataclass(frozen=True)
class Pedalling:
    """Legs of somebody on a bicycle; the attributes are those of `pedalling_posture`."""

    legs: tuple[Leg, ...]
    limbs: tuple[Limb, ...]
    hip_z_m: float
    bottom_m: meshes.Point
    crank_m: float
    turn_m: float

    def on(self, route: Route, span_s: tuple[float, float]) -> Iterable[MovingObject]:
        """The legs on a route."""
        posture = pedalling_posture(
            route, span_s, self.legs, self.hip_z_m, self.bottom_m, self.crank_m, self.turn_m
        )
        return leg_pieces(route, posture, self.legs, self.limbs, self.hip_z_m)


def leg_pieces(
    route: Route,
    posture: Posture,
    legs: tuple[Leg, ...],
    limbs: tuple[Limb, ...],
    hip_z_m: float,
) -> Iterable[MovingObject]:
    """Thighs, shanks and feet of legs whose hips are at a height on their mover."""
    # After the shifts, the lean and an arm for each leg.
    column = LEAN + 1 + len(legs)
    for leg, limb in zip(legs, limbs, strict=True):
        hip = (leg.hip_x_m, leg.hip_y_m, hip_z_m)
        to_knee, to_ankle = (leg.thigh_m, column), (leg.shank_m, column + 1)
        yield MovingObject(limb.thigh, Segment(route, posture, hip, (), column))
        yield MovingObject(limb.shank, Segment(route, posture, hip, (to_knee,), column + 1))
        if limb.foot is not None:
            above = (to_knee, to_ankle)
            yield MovingObject(limb.foot, Segment(route, posture, hip, above, column + 2))
        column += 3
