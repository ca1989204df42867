"""A real camera: what must be known of it to read its recordings and to correct them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from torch import Tensor

from unwrap.depth import Eight, Merge
from unwrap.signal import SensorDescription, WiggleTable, read_wiggle


@dataclass(frozen=True)
class Camera:
    """How recordings are read and corrected.

    Attributes
    ----------
    description : SensorDescription
        With the stored wiggle tables.
    bits : int
        Of the converter.
    unwrapper : str or None
        Name or path of a network, which is asked where a recording has gray images; None leaves
        two and four samples wrapped.
    merge : "nearest", "floor" or "none"
    eight : "two_frequency", "kernel_density" or "network"
        Who tells the wraps of eight samples, see `unwrap.correct`.
    horizontal_fov_deg : float
        Horizontal field of view.
    noise_lsb : float or None
        Standard deviation of one sample where it is told; None leaves it to each recording's own
        samples, see `unwrap.recordings.sample_noise`.
    rays : float64 [3, H, W] or None
        Unit vectors ahead, left and up of the pixels, in place of the field of view.
    """

    description: SensorDescription
    bits: int
    unwrapper: str | None
    merge: Merge
    horizontal_fov_deg: float
    noise_lsb: float | None = None
    eight: Eight = "two_frequency"
    rays: Tensor | None = None


def camera_of(
    description: SensorDescription,
    *,
    bits: int,
    unwrapper: str | None,
    merge: Merge,
    horizontal_fov_deg: float,
    wiggle: Path | None = None,
    noise_lsb: float | None = None,
    eight: Eight = "two_frequency",
    rays: Tensor | None = None,
) -> Camera:
    """Camera with a sensor like `description`, but maybe with tables and noise of its own.

    Parameters
    ----------
    description : SensorDescription
        Of the kind of sensor.
    bits, unwrapper, merge, horizontal_fov_deg, eight, rays
        See `Camera`.
    wiggle : Path, optional
        Tables measured with this camera, at both frequencies, in place of those of its kind.
    noise_lsb : float, optional
        Standard deviation of one sample, in place of what recordings tell and of its kind's.

    Raises
    ------
    ValueError
        A table that is missing, a field of view or a noise out of range.
    """
    if not 1 <= horizontal_fov_deg <= 179:
        raise ValueError(f"fov_deg is {horizontal_fov_deg:g}; expected 1 to 179 degrees")
    if wiggle is not None:
        description = replace(description, wiggle=_tables_at_both(wiggle, description))
    if noise_lsb is not None:
        # More noise than the converter's whole range can only be a mistaken unit.
        if not 0 <= noise_lsb <= 2**bits:
            raise ValueError(f"noise_lsb is {noise_lsb:g}; expected 0 to {2**bits}")
        description = replace(description, noise_lsb=noise_lsb)
    return Camera(description, bits, unwrapper, merge, horizontal_fov_deg, noise_lsb, eight, rays)


def _tables_at_both(path: Path, sensor: SensorDescription) -> tuple[WiggleTable, WiggleTable]:
    """Tables of a file at f1 and f2 of `sensor`."""
    tables = read_wiggle(path)
    missing = [f"{hz:g}" for hz in (sensor.f1_hz, sensor.f2_hz) if hz not in tables]
    if missing:
        known = ", ".join(f"{hz:g}" for hz in tables) or "none"
        raise ValueError(f"{path}: no table at {', '.join(missing)} Hz; it has {known}")
    return tables[sensor.f1_hz], tables[sensor.f2_hz]
