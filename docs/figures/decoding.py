"""Figures of what decoding and unwrapping make of the samples."""

from __future__ import annotations

import math

import numpy as np
import torch

from figures.stage import (
    BLUE,
    GRAY,
    GREEN,
    PER_RADIAN_M,
    RED,
    SENSOR,
    Made,
    Row,
    axes,
    label,
    phase_of,
)
from unwrap.depth import unwrap_dual
from unwrap.signal import (
    TWO_PI,
    candidate_spacing_m,
    correlation_samples,
    decode,
    harmonic_weights,
    unambiguous_range_m,
    wiggle_of,
)


def wiggle() -> Made:
    """Phase error of overtones, and what the table leaves."""
    figure, panels = axes("Correlation", "Error at 24 MHz", widths=(1, 1.5))
    true_rad = torch.linspace(0, TWO_PI, 2001, dtype=torch.float64)[:-1]
    along = true_rad.numpy() * PER_RADIAN_M
    shipped = harmonic_weights(SENSOR.harmonic_strength, SENSOR.highest_harmonic)
    ideal = harmonic_weights(1.0, 501)  # so many that their sum is a triangle to 0.1 %
    for name, weights, colour in (
        ("sine", harmonic_weights(0.0, 1), GREEN),
        (f"strength {SENSOR.harmonic_strength:g}", shipped, BLUE),
        ("ideal squares", ideal, RED),
    ):
        one = correlation_samples(true_rad, weights)[0]
        panels[0].plot(along, one, color=colour, label=name)
    label(panels[0], "distance, m", "D0 over m S", loc="upper center")
    curves = {"ideal squares": (ideal, None, RED), "epc660": (shipped, None, BLUE)}
    share = SENSOR.wiggle_calibrated_share
    curves[f"epc660, {share:.0%} calibrated"] = (shipped, wiggle_of(shipped).scaled(share), GREEN)
    worst = {}
    for name, (weights, table, colour) in curves.items():
        frame = decode(correlation_samples(true_rad, weights).unsqueeze(-2))
        frame = frame if table is None else table.corrected(frame)
        error = torch.remainder(frame.phase_rad[0] - true_rad + math.pi, TWO_PI) - math.pi
        panels[1].plot(along, 1e3 * PER_RADIAN_M * error, color=colour, label=name)
        worst[name] = error.abs().max().item(), error.square().mean().sqrt().item()
    panels[1].set_ylim(-80, 125)
    label(panels[1], "distance, m", "measured minus true, mm", loc="upper center")
    # atan(x / (1 - x)) - pi x / 2 is steepest at its ends and extreme at this x.
    x = (1 - math.sqrt(4 / math.pi - 1)) / 2
    extreme = abs(math.atan2(x, 1 - x) - math.pi * x / 2)
    plain, left = worst["epc660"][0], worst[f"epc660, {share:.0%} calibrated"][0]
    return figure, [
        Row(
            "wiggle of ideal squares, largest",
            f"{extreme:.4f} rad",
            f"{worst['ideal squares'][0]:.4f} rad",
        ),
        Row(
            "wiggle of the epc660 that its table leaves, over that without",
            f"{1 - share:.3f}",
            f"{left / plain:.3f}",
        ),
        Row(
            "wiggle of the epc660 at 24 MHz, largest, without table",
            f"{1e3 * PER_RADIAN_M * largest_wiggle_rad(shipped):.1f} mm",
            f"{1e3 * PER_RADIAN_M * plain:.1f} mm",
        ),
    ]


def largest_wiggle_rad(weights: tuple[tuple[int, float], ...]) -> float:
    """Of the series: atan2(sum of w (-1)^((h - 1) / 2) sin h phi, sum of w cos h phi) - phi."""
    phase = np.linspace(0, math.pi / 2, 100_001)
    sine = sum(w * (-1) ** (h // 2) * np.sin(h * phase) for h, w in weights)
    cosine = sum(w * np.cos(h * phase) for h, w in weights)
    return float(np.abs(np.arctan2(sine, cosine) - phase).max())


def dual() -> Made:
    """Spacing of wrap candidates over the range, and wrong wraps over noise."""
    figure, panels = axes("Margin of the candidates", "Wrong wraps, range 25 m")
    f1, f2 = SENSOR.f1_hz, SENSOR.f2_hz
    ranges = np.linspace(7.0, 74.9, 400)
    half = [candidate_spacing_m(f1, f2, r) / 2 for r in ranges]
    panels[0].step(ranges, half, color=BLUE)
    panels[0].axvline(SENSOR.max_range_m, color=GRAY, ls="--", label="range unwrapped")
    panels[0].set_ylim(0)
    label(panels[0], "largest distance, m", r"largest $|d_{10} - d_{24}|$ allowed, m")
    sigmas = np.linspace(0.35, 1.6, 9)
    found = [_wrong_share(sigma) for sigma in sigmas]
    fine = np.linspace(0.3, 1.65, 100)
    panels[1].plot(fine, [wrong_share(s) for s in fine], color=GRAY, lw=1, label="formula")
    panels[1].plot(sigmas, found, "o", color=RED, label="Monte Carlo")
    panels[1].set(yscale="log", ylim=(1e-5, 1))
    label(panels[1], r"standard deviation of $d_{10} - d_{24}$, m", "share of wrong wraps")
    return figure, [
        Row(
            "half the spacing of candidates within 25 m: d₁₀ / 12",
            f"{unambiguous_range_m(f2) / 12:.3f} m",
            f"{candidate_spacing_m(f1, f2, 25.0) / 2:.3f} m",
        ),
        Row(
            f"wrong wraps at 9.4 m, standard deviation {sigmas[4]:.2f} m",
            f"{wrong_share(sigmas[4]):.4f}",
            f"{found[4]:.4f}",
        ),
    ]


TRUE_M = 9.4


def _wrong_share(sigma_m: float) -> float:
    """Share of wrong wraps of a wall with noise in the distance at f2."""
    generator = torch.Generator().manual_seed(5)
    noise_m = sigma_m * torch.randn(1000, 1000, generator=generator)
    first = torch.full_like(noise_m, phase_of(TRUE_M, SENSOR.f1_hz) % TWO_PI)
    second = torch.remainder(phase_of(TRUE_M + noise_m, SENSOR.f2_hz), TWO_PI)
    found_m, _ = unwrap_dual(
        first, second, SENSOR.f1_hz, SENSOR.f2_hz, max_range_m=SENSOR.max_range_m
    )
    # The distances of both frequencies are averaged, weighted by f1^2 and f2^2, their inverse
    # variances: a right wrap moves by the share of the noise that this lets through.
    share2 = SENSOR.f2_hz**2 / (SENSOR.f1_hz**2 + SENSOR.f2_hz**2)
    apart_m = found_m - TRUE_M
    wraps = torch.round((apart_m - share2 * noise_m) / unambiguous_range_m(SENSOR.f1_hz))
    return float((wraps != 0).float().mean())


def wrong_share(sigma_m: float) -> float:
    """Probability that the disagreement passes half way to a neighbouring candidate.

    The candidates of f1 within the range lie at n d1 mod d2 on the circle of f2.
    """
    range1_m, range2_m = (unambiguous_range_m(f) for f in (SENSOR.f1_hz, SENSOR.f2_hz))
    true_wrap, start_m = divmod(TRUE_M, range1_m)
    count = math.floor((SENSOR.max_range_m - start_m) / range1_m) + 1
    others = [(n - true_wrap) * range1_m % range2_m for n in range(count) if n != true_wrap]
    above, below = min(others), range2_m - max(others)
    tails = (0.5 * math.erfc(gap / 2 / sigma_m / math.sqrt(2)) for gap in (above, below))
    return sum(tails)


def valid() -> Made:
    """How often noise alone is called valid, by the threshold on the decoded amplitude."""
    figure, (panel,) = axes("Noise alone called valid")
    thresholds = np.linspace(0.0, 4.0, 17)
    generator = torch.Generator().manual_seed(0)
    rows = []
    for samples, colour in ((2, RED), (4, BLUE)):
        noise = torch.randn(1, samples, 1000, 1000, generator=generator)
        amplitude = decode(noise).amplitude
        found = [float((amplitude >= k).double().mean()) for k in thresholds]
        # The amplitude of two normals is Rayleigh's; four samples halve its variance.
        expected = np.exp(-(thresholds**2) / (2 if samples == 2 else 1))
        panel.plot(thresholds, expected, color=colour, label=f"{samples} DCS")
        panel.plot(thresholds, found, "o", color=colour, markersize=3)
        at = int(np.flatnonzero(thresholds == 2.0)[0])
        rows.append(
            Row(
                f"noise alone at 2 times the noise of a sample, {samples} DCS",
                f"{expected[at]:.4f}",
                f"{found[at]:.4f}",
            )
        )
    panel.axvline(SENSOR.min_snr, color=GRAY, linewidth=1, label="default")
    panel.set(yscale="log", ylim=(1e-6, 1.3))
    label(panel, "amplitude over the noise of one sample", "share of pixels", loc="lower left")
    return figure, rows
