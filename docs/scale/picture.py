"""Growth curves: processor hours against frames, as measured and on to a billion."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from scale.costs import HOUR_S
from scale.growth import fitted

SHOWN: Final = {
    "rendering": ("rendering, 160 x 120", "#c2410c"),
    "network": ("TofRegNet, one pass", "#1d4ed8"),
    "playing_every_pixel": ("playing, every pixel", "#0f766e"),
    "playing": ("playing, pocket", "#65a30d"),
    "opening": ("opening the bank", "#64748b"),
}


def paint(found: dict[str, Any], path: Path) -> None:
    """Points that were measured, and the straight lines through them."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axis = pyplot.subplots(figsize=(7.4, 4.6))
    for name, (label, color) in SHOWN.items():
        points = found["points"][name]
        start_s, each_s = fitted(points)
        sizes = [point["size"] for point in points]
        axis.loglog(sizes, [p["core_s"] / HOUR_S for p in points], "o", color=color, markersize=4)
        further = np.geomspace(sizes[0], 1e9, 200)
        curve = (max(start_s, 0) + each_s * further) / HOUR_S
        axis.loglog(further, curve, "-", color=color, linewidth=1.2, label=label)
    axis.set_xlabel("frames", fontsize=9)
    axis.set_ylabel("hours of one core", fontsize=9)
    axis.grid(alpha=0.25)
    axis.tick_params(labelsize=8)
    axis.legend(fontsize=8, frameon=False)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
