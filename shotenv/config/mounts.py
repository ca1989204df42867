"""Where a sensor module sits on the car."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from unwrap.support import Section

Finite = Annotated[float, Field(allow_inf_nan=False)]
Degrees = Annotated[float, Field(ge=-360.0, le=360.0)]
Point = tuple[Finite, Finite, Finite]


class MountConfig(Section):
    """Place and direction of a sensor module, camera and laser, on the car that carries it.

    Relative to the car's reference, which follows the path: x ahead, y left, z up. Angles turn by
    the right-hand rule, first roll about x, then pitch about y (positive looks down), then yaw
    about z (positive looks left).
    """

    name: str = Field(
        "camera", pattern=r"^[A-Za-z0-9_-]{1,24}$", description="tells the modules of a car apart"
    )
    position_m: Point = Field((0.0, 0.0, 0.0), description="x ahead, y left, z up, m")
    yaw_deg: Degrees = Field(0.0, description="to the left, degrees")
    pitch_deg: Degrees = Field(0.0, description="down, degrees")
    roll_deg: Degrees = Field(0.0, description="right side down, degrees")
