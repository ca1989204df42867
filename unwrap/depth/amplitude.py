"""Single-frequency unwrapping by amplitude and smoothness, after Crabb and Manduchi (2014, 2015).

R. Crabb, R. Manduchi, Probabilistic Phase Unwrapping for Single-Frequency Time-of-Flight Range
Cameras, 3DV 2014, and Fast Single-Frequency Time-of-Flight Range Imaging, CVPR Workshops 2015.

The amplitude is reflectance / distance^2 times a constant, so that each wrap of a pixel implies a
reflectance: with an amplitude of 100 LSB at 1 m for a white surface, 4 LSB at a phase of 2 m mean a
reflectance of 0.16 in the first wrap and an impossible 2.7 in the second, at 8.2 m. A Markov random
field weighs how likely the implied reflectances are against how well neighbours agree.

Adapted: the prior on the reflectance, which here includes the tilt of the surface, and that on the
wrap are histograms measured on training frames; the energy is minimised by min-sum belief
propagation in sweeps over rows and columns, which is one vector operation per step.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from unwrap.depth.candidates import (
    DepthWithConfidence,
    candidates_m,
    chosen,
    depth_with_confidence,
    require_shots,
)
from unwrap.depth.reflectance import ReflectancePrior
from unwrap.signal import PhaseFrame, RawFrame, SensorDescription, Shots, decode_at

BEYOND = 1e3
"""Cost of a candidate beyond the range: more than any -ln p, and finite, so that sums stay so."""


@dataclass(frozen=True)
class Smoothness:
    """Parameters of the energy; the defaults did best on training frames of rendered worlds.

    Attributes
    ----------
    per_m : float
        Cost of neighbours one metre apart; 0 leaves every pixel to itself.
    largest_m : float
        Difference from which on neighbours cost no more, so that edges stay.
    edge : float
        Difference of the logarithms of two amplitudes that lowers the cost to exp(-1) of it.
    rounds : int
        Sweeps over rows and columns.
    min_confidence : float
        Confidence from which on a pixel is valid.
    """

    per_m: float = 8.0
    largest_m: float = 6.0
    edge: float = 2.0
    rounds: int = 3
    min_confidence: float = 0.5


def unwrap_amplitude(
    raw: RawFrame,
    sensor: SensorDescription,
    *,
    prior: ReflectancePrior,
    offset_lsb: Tensor | None = None,
    noise_lsb: Tensor | float | None = None,
    shift_m: Tensor | None = None,
    smoothness: Smoothness | None = None,
) -> DepthWithConfidence:
    """Depth of two or four samples; the confidence estimates the probability of the wrap.

    It is the softmax of minus the beliefs, and too high where messages went round in loops of the
    grid and were counted more than once.

    Parameters
    ----------
    raw : RawFrame
        Two or four samples.
    prior : ReflectancePrior
        From `unwrap.depth.reflectance.calibrate`.
    offset_lsb, noise_lsb, shift_m
        See `unwrap.depth.correction.correct`.

    Raises
    ------
    ValueError
        Another number of samples.
    """
    require_shots(raw, (Shots.TWO, Shots.FOUR))
    smoothness = smoothness or Smoothness()
    noise = sensor.noise_lsb if noise_lsb is None else noise_lsb
    first = decode_at(0, raw, sensor, offset_lsb=offset_lsb, shift_m=shift_m)
    depth_m = candidates_m(first.phase_rad, sensor.f1_hz, sensor.max_range_m)
    cost = wrap_costs(depth_m, first, raw.saturated, sensor, prior, noise)
    # Noise is added, or the logarithm would see an edge between any two dark pixels.
    log_amplitude = first.amplitude.add(noise).log()
    beliefs = min_sum(cost, depth_m, log_amplitude, smoothness)
    confidence, wraps = beliefs.neg().softmax(1).max(1)
    return depth_with_confidence(
        chosen(depth_m, wraps),
        confidence,
        first,
        raw,
        sensor,
        noise_lsb=noise,
        min_confidence=smoothness.min_confidence,
    )


def wrap_costs(
    depth_m: Tensor,
    first: PhaseFrame,
    saturated: Tensor,
    sensor: SensorDescription,
    prior: ReflectancePrior,
    noise: Tensor | float,
) -> Tensor:
    """-ln p(amplitude | wrap) - ln p(wrap), float32 [B, N, H, W].

    The first term fades where the amplitude drowns in noise, and is 0 where it is clipped.
    """
    amplitude = first.amplitude.unsqueeze(1)
    # 0 in the dark, near 1 for strong signals: a Wiener filter's share of power that is signal.
    power = first.amplitude.square()
    trust = (power / (power + torch.as_tensor(noise).square())).where(~saturated, 0.0)
    likely = prior.log_density(amplitude * depth_m.square())
    cost = -trust.unsqueeze(1) * likely - prior.log_wraps(depth_m.shape[1]).to(depth_m)
    return cost.masked_fill(depth_m > sensor.max_range_m, BEYOND)


def min_sum(cost: Tensor, depth_m: Tensor, log_amplitude: Tensor, smoothness: Smoothness) -> Tensor:
    """Beliefs [B, N, H, W]: cost of each wrap with the best of its neighbours', theirs included.

    Loopy min-sum belief propagation on the 4-connected grid, sequentially along rows, then along
    columns; exact for an image of one row or column.

    Parameters
    ----------
    cost, depth_m : float [B, N, H, W]
        Cost and distance of each wrap.
    log_amplitude : float [B, H, W]
        Its steps tell edges, across which neighbours may differ at less cost.
    """
    # Axis of the sweep first: one step goes from a line to the next, for all K pixels of a line at
    # once, [L, B, N, K].
    columns, rows = (3, 0, 1, 2), (2, 0, 1, 3)
    edges = {
        order: _edges(depth_m.permute(order), log_amplitude.unsqueeze(1).permute(order), smoothness)
        for order in (columns, rows)
    }
    incoming = {order: torch.zeros_like(cost) for order in (columns, rows)}
    for _ in range(smoothness.rounds):
        for order, other in ((columns, rows), (rows, columns)):
            # Of what was said before only the other axis: messages along this one would hear
            # their own echo.
            lines, edge = (cost + incoming[other]).permute(order), edges[order]
            forth = _messages(lines, edge)
            # The way back is the way forth through everything reversed.
            back = _messages(lines.flip(0), edge.flip(0).transpose(2, 3)).flip(0)
            incoming[order] = (forth + back).permute([order.index(axis) for axis in range(4)])
    return cost + incoming[columns] + incoming[rows]


def _edges(depth_m: Tensor, log_amplitude: Tensor, smoothness: Smoothness) -> Tensor:
    """Costs of the wraps of neighbouring lines, [L - 1, B, N of the first, N of the second, K]."""
    apart = (depth_m[:-1].unsqueeze(3) - depth_m[1:].unsqueeze(2)).abs_()
    alike = torch.exp(-log_amplitude.diff(dim=0).abs() / smoothness.edge).unsqueeze(2)
    return apart.clamp_(max=smoothness.largest_m).mul_(smoothness.per_m * alike)


def _messages(lines: Tensor, edges: Tensor) -> Tensor:
    """Messages [L, B, N, K] from each line to the next; the least of each pixel is 0."""
    sent = torch.zeros_like(lines)
    for i, edge in enumerate(edges):
        best = (lines[i] + sent[i]).unsqueeze(2).add(edge).amin(1)
        # Only differences count; without this they would grow with every line.
        sent[i + 1] = best - best.amin(1, keepdim=True)
    return sent
