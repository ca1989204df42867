"""Arguments of an acquisition as a public call hands them in: refused by name."""

from __future__ import annotations

from typing import Any, Final

from torch import Tensor

from shotenv.config import SensorConfig
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.offsets import OffsetPattern
from unwrap.signal import Shots
from unwrap.support import require_floats

MOST: Final = 1e9
"""Largest radiance, laser power, time and offset: electrons of them stay numbers in float32."""


def check_acquisition(
    exposure: Exposure,
    sensor: SensorConfig,
    shots: Shots,
    laser_power_w: Tensor,
    integration_s: Tensor,
    noise: Tensor | None,
    offsets: OffsetPattern | None,
) -> None:
    """Refuse what cannot be acquired.

    Raises
    ------
    TypeError, ValueError
        As `expose` does, whose arguments these are.
    """
    _require_kind("exposure", exposure, Exposure)
    _require_kind("sensor", sensor, SensorConfig)
    if not isinstance(shots, int) or shots not in tuple(Shots):
        raise ValueError(f"shots is {shots!r}; expected 2, 4 or 8")
    require_floats(correlation=exposure.correlation)
    if exposure.correlation.ndim != 4 or exposure.correlation.shape[1] < shots:
        shape = tuple(exposure.correlation.shape)
        raise ValueError(f"correlation is {shape}; expected [B, {int(shots)} or more, H, W]")
    batch, _, height, width = exposure.correlation.shape
    _require_values("correlation", exposure.correlation[:, :shots], (batch, shots, height, width))
    _require_values("active", exposure.active, (batch, height, width), least=0.0)
    _require_values("ambient", exposure.ambient, (batch, height, width), least=0.0)
    _require_values("laser_power_w", laser_power_w, (batch,), least=0.0)
    _require_values("integration_s", integration_s, (batch,), least=0.0)
    if noise is not None:
        require_floats(noise=noise)
        _require_values("noise", noise[:, :shots], (batch, shots, 2, height, width))
    if offsets is not None:
        _require_kind("offsets", offsets, OffsetPattern)
        require_floats(alike=False, **{"offsets.pattern_lsb": offsets.pattern_lsb})
        # One sensor's pattern serves a whole batch.
        one = 1 if offsets.pattern_lsb.shape[:1] == (1,) else batch
        _require_values("offsets.pattern_lsb", offsets.pattern_lsb, (one, height, width))


def _require_kind(name: str, value: Any, kind: type) -> None:
    if not isinstance(value, kind):
        raise TypeError(f"{name} is {type(value).__name__}; expected {kind.__name__}")


def _require_values(name: str, value: Any, shape: tuple[int, ...], *, least: float = -MOST) -> None:
    """Refuse a tensor of another shape, or with a value outside `least`..`MOST` or NaN."""
    require_floats(alike=False, **{name: value})
    if value.shape != shape:
        raise ValueError(f"{name} is {tuple(value.shape)}; expected {tuple(map(int, shape))}")
    if not bool(((value >= least) & (value <= MOST)).all()):
        raise ValueError(f"{name} holds NaN or a number outside {least:g}..{MOST:g}")
