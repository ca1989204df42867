"""What readers of scene files find."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from shotenv.config import SurfaceConfig
from shotenv.world.geometry import Lamp

NO_MATERIAL = "default"
"""Name of the material of faces to which their file gives none."""


@dataclass(frozen=True)
class Body:
    """Triangles of one material.

    Attributes
    ----------
    name : str
        What the file calls it, for messages.
    material : str
        Its name in the table of materials.
    corners : float64 [F, 3, 3]
        In the file's units and axes; counter-clockwise seen from outside.
    surface : SurfaceConfig or None
        What the file itself tells of the surface, for materials that the table leaves out.
    radiance : float
        Of faces that the file lets glow, W m-2 sr-1.
    reason : str
        Why there is no `surface`.
    """

    name: str
    material: str
    corners: np.ndarray
    surface: SurfaceConfig | None = None
    radiance: float = 0.0
    reason: str = "the file tells no albedo at the sensor's wavelength"


@dataclass(frozen=True)
class FoundLights:
    """Lights that a file holds, in its units and axes.

    Attributes
    ----------
    suns : list of (irradiance, direction)
        W m-2, and the way that the light goes.
    skies : list of float
        Radiances, W m-2 sr-1.
    lamps : list of Lamp
    """

    suns: list[tuple[float, tuple[float, float, float]]] = field(default_factory=list)
    skies: list[float] = field(default_factory=list)
    lamps: list[Lamp] = field(default_factory=list)
