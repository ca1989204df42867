"""Correlation samples to phase, and phase to distance.

The samples are D_k ~ m S cos(phi - k pi / 2), see `unwrap.signal.shots`; phase and distance are
tied by phi = 4 pi f d / c (mod 2 pi).

On the way from samples to phase stand the *quadratures* m S cos(phi) and m S sin(phi), and *turns*,
phi / (2 pi): steps that corrections of the phase reach into (`unwrap.signal.calibrated`).
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from unwrap.signal.frames import PhaseFrame
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.support import array, array_of, can_loop, long_rows, loop, require_floats

Array = np.ndarray
# float32, since a Python float would make the arithmetic of a loop float64.
HALF, ZERO = np.float32(0.5), np.float32(0.0)
PI, HALF_PI, TINY = np.float32(np.pi), np.float32(np.pi / 2), np.float32(1e-30)
ARC_TANGENT = tuple(
    map(
        np.float32,
        (
            *(0.00282363896258175373, -0.0159569028764963150, 0.0425049886107444763),
            *(-0.0748900920152664185, 0.106347933411598206, -0.142027363181114197),
            *(0.199926957488059998, -0.333331018686294556),
        ),
    )
)
"""Polynomial of `angle_pixels`, highest power first."""
TWO_PI = 2 * math.pi
BELOW_TWO_PI = float(np.nextafter(np.float32(TWO_PI), np.float32(0)))
"""Largest float32 phase of a period."""


def distance_m(phase_rad: Tensor, frequency_hz: float) -> Tensor:
    """Wrapped distance of a phase: d = c phi / (4 pi f).

    Examples
    --------
    >>> distance_m(torch.tensor([0.0, torch.pi]), 24e6)
    tensor([0.0000, 3.1228])
    """
    require_floats(phase_rad=phase_rad)
    return phase_rad * (unambiguous_range_m(frequency_hz) / TWO_PI)


def decode(dcs: Tensor, *, offset_lsb: Tensor | None = None) -> PhaseFrame:
    """Phase and amplitude of two or four samples of one modulation frequency.

    Four samples: phi = atan2(D1 - D3, D0 - D2), A = hypot(D1 - D3, D0 - D2) / 2; offsets cancel.
    Two samples: phi = atan2(D1, D0), A = hypot(D1, D0); nothing cancels.

    Parameters
    ----------
    dcs : float [..., n, H, W]
        Samples in any one unit, n = 2 or 4.
    offset_lsb : float [..., H, W], optional
        Calibrated offset of each pixel, common to its samples, in the unit of the samples.

    Raises
    ------
    ValueError
        Another number of samples, another dtype, or a NaN or infinity; the message says where.

    Examples
    --------
    Four samples of one pixel at 90 degrees, with an offset of 5 that cancels:

    >>> frame = decode(torch.tensor([5.0, 105.0, 5.0, -95.0]).view(4, 1, 1))
    >>> frame.phase_rad, frame.amplitude
    (tensor([[1.5708]]), tensor([[100.]]))
    """
    cosine, sine, amplitude, residual = quadratures(dcs, offset_lsb)
    phase_rad = to_phase_(to_turns_(angle_rad(sine, cosine)))
    return PhaseFrame(phase_rad, amplitude, residual)


def angle_rad(sine: Tensor, cosine: Tensor, *, out: Tensor | None = None) -> Tensor:
    """The angle in [-pi, pi] whose sine and cosine have this ratio.

    Written twice: a compiled loop for maps on the processor, which has the same bits on every
    machine and whatever else is in the batch, and `torch.atan2`, which has not, for the rest.
    """
    if not can_loop(sine, cosine) or sine.shape != cosine.shape:
        return torch.atan2(sine, cosine, out=out)
    found = torch.empty_like(sine, memory_format=torch.contiguous_format) if out is None else out
    angles = found if found.is_contiguous() else torch.empty(found.shape)
    angle_pixels(array(sine).reshape(-1), array(cosine).reshape(-1), array(angles).reshape(-1))
    return found if angles is found else found.copy_(angles)


@loop
def angle_pixels(sine: Array, cosine: Array, angle: Array) -> None:
    """atan2 of N numbers, float32, within 3e-7; of two zeros 0. `angle` may be one of the others.

    The arc tangent is a polynomial from 0 to 1 (N. Shibata, SLEEF), and symmetric beyond.
    """
    for i in range(len(angle)):
        x, y = abs(cosine[i]), abs(sine[i])
        # Never 0 / 0, which is no number; smaller numbers than these are no samples.
        ratio = min(x, y) / max(max(x, y), TINY)
        squared = ratio * ratio
        series = ARC_TANGENT[0]
        series = series * squared + ARC_TANGENT[1]
        series = series * squared + ARC_TANGENT[2]
        series = series * squared + ARC_TANGENT[3]
        series = series * squared + ARC_TANGENT[4]
        series = series * squared + ARC_TANGENT[5]
        series = series * squared + ARC_TANGENT[6]
        series = series * squared + ARC_TANGENT[7]
        found = ratio + ratio * squared * series
        found = HALF_PI - found if y > x else found
        found = PI - found if cosine[i] < ZERO else found
        angle[i] = np.copysign(found, sine[i])


def quadratures(
    dcs: Tensor, offset_lsb: Tensor | None = None
) -> tuple[Tensor, Tensor, Tensor, Tensor | None]:
    """Cosine, sine, amplitude and residual, see `decode`, which says what is refused.

    Written twice: a compiled loop for samples on the processor, a chain of torch operations for
    other devices, gradients and exported files. A test holds them together.
    """
    require_floats(dcs=dcs)
    if dcs.ndim < 3 or dcs.shape[-3] not in (2, 4):
        raise ValueError(f"dcs has shape {tuple(dcs.shape)}; expected [..., 2 or 4, H, W]")
    if offset_lsb is not None:
        require_floats(offset_lsb=offset_lsb)
        size = (*dcs.shape[:-3], *dcs.shape[-2:])
        shape = tuple(offset_lsb.shape)
        # An axis of one is common to all frames, as is one that is not there.
        pairs = zip(reversed(shape), reversed(size), strict=False)
        if len(shape) > len(size) or any(one not in (1, whole) for one, whole in pairs):
            raise ValueError(f"offset_lsb has shape {shape}; expected {size}, or its last axes")
    return _by_loop(dcs, offset_lsb) if can_loop(dcs) else _by_torch(dcs, offset_lsb)


def _by_torch(
    dcs: Tensor, offset_lsb: Tensor | None
) -> tuple[Tensor, Tensor, Tensor, Tensor | None]:
    _check_values(dcs)
    samples = dcs if offset_lsb is None else dcs - offset_lsb.unsqueeze(-3)
    if samples.shape[-3] == 2:
        cosine, sine = samples.unbind(-3)
        return cosine, sine, _length(cosine, sine), None
    first, second, third, fourth = samples.unbind(-3)
    # Opposite samples have opposite signs: their difference is twice the quadrature, so that the
    # amplitude is halved below; their sum is what is not light.
    cosine, sine = first - third, second - fourth
    residual = torch.maximum((first + third).abs(), (second + fourth).abs())
    return cosine, sine, _length(cosine, sine) / 2, residual


def _length(cosine: Tensor, sine: Tensor) -> Tensor:
    """As `torch.hypot`, which ONNX has no operation for."""
    return (cosine * cosine).addcmul(sine, sine).sqrt()


def _by_loop(
    dcs: Tensor, offset_lsb: Tensor | None
) -> tuple[Tensor, Tensor, Tensor, Tensor | None]:
    *leading, count, height, width = dcs.shape
    samples, shape = dcs.reshape(-1, count, height, width), (*leading, height, width)
    offset = array_of(0.0 if offset_lsb is None else offset_lsb, shape)
    # One block for all four maps. Two samples leave that of the residual unwritten; it is not
    # handed out then.
    maps = np.empty((4, len(samples), height, width), np.float32)
    offset = offset.reshape(maps[0].shape)
    if not decode_pixels(*map(long_rows, (array(samples), offset, *maps))):
        # The loop only tells that some sample is not finite; the error says which.
        _check_values(dcs)
    cosine, sine, amplitude, residual = torch.from_numpy(maps).view(4, *shape).unbind()
    return cosine, sine, amplitude, residual if count == 4 else None


@loop
def decode_pixels(
    dcs: Array, offset: Array, cosine: Array, sine: Array, amplitude: Array, residual: Array
) -> bool:
    """Quadratures and strength of samples [B, n, H, W] less their offset [B, H, W]; all float32.

    The maps [B, H, W] are written, `residual` only for four samples. False if a sample is NaN or
    infinite.
    """
    four, finite = dcs.shape[1] == 4, True
    frames, rows, columns = amplitude.shape
    for b in range(frames):
        for i in range(rows):
            for j in range(columns):
                common = offset[b, i, j]
                x, y = dcs[b, 0, i, j] - common, dcs[b, 1, i, j] - common
                scale = np.float32(1.0)
                if four:
                    third, fourth = dcs[b, 2, i, j] - common, dcs[b, 3, i, j] - common
                    residual[b, i, j] = max(abs(x + third), abs(y + fourth))
                    x, y, scale = x - third, y - fourth, HALF
                squared = x * x + y * y
                cosine[b, i, j], sine[b, i, j] = x, y
                amplitude[b, i, j] = np.sqrt(squared) * scale
                # x - x is 0 but for NaN and infinity; a branch would keep the loop from vector
                # instructions.
                finite = finite & (squared - squared == ZERO)
    return finite


def to_turns_(phase_rad: Tensor) -> Tensor:
    """Phases in [-pi, 2 pi) become phi / (2 pi) + 1, in place.

    The added turn keeps them from being negative; `to_phase_` takes whole turns away.
    """
    return phase_rad.mul_(1 / TWO_PI).add_(1)


def to_phase_(turns: Tensor) -> Tensor:
    """Turns that are not negative become their phase in [0, 2 pi), in place."""
    # The largest float below 1, times 2 pi, rounds to a float below 2 pi: the interval stays open.
    return turns.frac_().mul_(TWO_PI)


def _check_values(dcs: Tensor) -> None:
    if torch.compiler.is_compiling():
        return  # A graph, such as an exported one, is made before there are values.
    # A sum is one pass, and finite unless a sample is not; or samples are so large that it
    # overflows, and then the search below finds none.
    if not math.isfinite(dcs.sum()):
        for name, wrong in (("NaN", dcs.isnan()), ("an infinity", dcs.isinf())):
            if wrong.any():
                raise ValueError(f"dcs holds {name} at {wrong.nonzero()[0].tolist()}")
