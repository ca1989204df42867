"""Tables of docs/scale.md, from what `growth` measured."""

from __future__ import annotations

from typing import Any, Final

from scale.growth import SUBJECTS, fitted

PASSES: Final = 30
"""Passes of the recipe of TofRegNet, `configs/unwrap/tofregnet.yaml`."""
GPU_NETWORK_S: Final = 1 / 2449
"""A frame of 320 x 240 of a training step at width 64 on one H100 (docs/gpu.md)."""
HOUR_S: Final = 3600.0
COUNTS: Final = (10**6, 10**9)


def each(found: dict[str, Any]) -> str:
    """What one more of each costs, and what it takes before the first."""
    lines = [
        "| | each | processor time of each | before the first | largest process |",
        "|---|---|---|---|---|",
    ]
    for name, subject in SUBJECTS.items():
        points = found["points"][name]
        start_s, each_s = fitted(points)
        held = [f"{point['memory_mb']:.0f}" for point in points if "memory_mb" in point]
        memory = f"{' to '.join(dict.fromkeys((held[0], held[-1])))} MB" if held else ""
        sizes = f"{points[0]['size']:,.0f} to {points[-1]['size']:,.0f}"
        lines.append(
            f"| {subject.what} ({sizes}) | {subject.unit} | {duration(each_s)} "
            f"| {max(start_s, 0):.1f} s | {memory} |"
        )
    return "\n".join(lines)


def millions(found: dict[str, Any]) -> str:
    """Processor hours, GPU hours and disk of a million and of a billion frames."""
    points = found["points"]
    frame_mb = fitted(points["rendering"], "disk_mb")[1]
    network_s = fitted(points["network"])[1]
    rows = {
        "rendering": (fitted(points["rendering"])[1], None),
        f"TofRegNet, its recipe's {PASSES} passes": (PASSES * network_s, PASSES * GPU_NETWORK_S),
        "playing each once, every pixel": (fitted(points["playing_every_pixel"])[1], None),
        "playing each once, `pocket`": (fitted(points["playing"])[1], None),
    }
    lines = [
        "| | 10^6 frames | 10^9 frames | on one H100 |",
        "|---|---|---|---|",
    ]
    for what, (core_s, gpu_s) in rows.items():
        cells = [f"{hours(core_s * count)} of one core" for count in COUNTS]
        gpu = "" if gpu_s is None else " and ".join(hours(gpu_s * count) for count in COUNTS)
        lines.append(f"| {what} | {cells[0]} | {cells[1]} | {gpu} |")
    disk = [f"{frame_mb * count / 1e6:,.2f} TB" for count in COUNTS]
    lines.append(f"| disk, {frame_mb:.3f} MB a frame | {disk[0]} | {disk[1]} | |")
    return "\n".join(lines)


def duration(seconds: float) -> str:
    """In the unit that suits.

    Examples
    --------
    >>> duration(0.0042)
    '4.2 ms'
    """
    for unit, name in ((1.0, "s"), (1e-3, "ms")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds / 1e-6:.3g} µs"


def hours(seconds: float) -> str:
    """Hours, with two digits where they are few.

    Examples
    --------
    >>> hours(7200), hours(3.6e9)
    ('2 h', '1,000,000 h')
    """
    value = seconds / HOUR_S
    return f"{value:,.0f} h" if value >= 10 else f"{value:.2g} h"
