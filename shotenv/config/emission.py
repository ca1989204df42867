"""How the laser's light is spread over directions."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Literal

from pydantic import Field, model_validator

from unwrap.support import Section


class EmissionConfig(Section):
    """Emission profile of the laser module: how much light it sends into each direction.

    `flat` is even over the camera's field of view and falls across soft edges, `gaussian` and
    `table` are round about the camera's axis. Whatever the profile, one watt is emitted per watt.

    Examples
    --------
    >>> EmissionConfig(profile="table", angle_deg=(0, 40, 60), intensity=(1.0, 0.8, 0.0)).profile
    'table'
    """

    profile: Literal["flat", "gaussian", "table"] = Field("flat", description="kind of profile")
    # [assumed] Data sheets of VCSELs with a diffuser state the field of illumination at half
    # maximum and draw edges a few degrees wide.
    edge_softness_deg: float = Field(
        6.0,
        ge=0.0,
        le=60.0,
        description="angle over which a flat profile falls from all to nothing, half of it outside "
        "the field of view; 0 = a knife's edge",
    )
    fwhm_deg: float = Field(
        75.0, gt=1.0, le=170.0, description="full width at half maximum of a Gaussian profile"
    )
    angle_deg: tuple[float, ...] = Field(
        (),
        description="angles from the axis of a table, from 0 up; beyond the last is no light",
    )
    intensity: tuple[float, ...] = Field(
        (), description="relative radiant intensity at each of `angle_deg`, linear in between"
    )

    @model_validator(mode="after")
    def _table_is_whole(self) -> EmissionConfig:
        angles, values = self.angle_deg, self.intensity
        if self.profile != "table":
            if angles or values:
                raise ValueError(
                    f"angle_deg and intensity are given, but profile is {self.profile!r}; expected "
                    "profile 'table', or no table"
                )
            return self
        if len(angles) < 2 or len(angles) != len(values):
            raise ValueError(
                f"angle_deg has {len(angles)} and intensity {len(values)} numbers; expected as "
                "many of both, at least 2"
            )
        # Comparisons with NaN are false, so that these refuse it as well.
        rises = all(low < high for low, high in pairwise(angles))
        if not (angles[0] == 0 and rises and angles[-1] <= 90):
            raise ValueError(f"angle_deg is {angles}; expected angles that rise from 0 to <= 90")
        if not (all(0 <= value < math.inf for value in values) and max(values) > 0):
            raise ValueError(
                f"intensity is {values}; expected finite numbers, none negative and one above 0"
            )
        return self

    def check_covers(self, half_width_deg: float, half_diagonal_deg: float) -> None:
        """Raise ValueError unless the profile is defined over a field of view of this size."""
        if self.profile == "table" and self.angle_deg[-1] < half_diagonal_deg:
            raise ValueError(
                f"emission.angle_deg ends at {self.angle_deg[-1]:g}; expected at least "
                f"{half_diagonal_deg:.4g}, the corner of the camera's field of view"
            )
        if self.profile == "flat" and half_width_deg + self.edge_softness_deg / 2 >= 90:
            raise ValueError(
                f"emission.edge_softness_deg is {self.edge_softness_deg:g}; expected less than "
                f"{180 - 2 * half_width_deg:.4g}, so that no light leaves backwards"
            )
