"""The report: one self-contained HTML page, with its numbers beside it as JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import numpy as np
from plotly.offline import get_plotlyjs

from agents.report import charts
from agents.report.results import (
    FRAMES,
    RESULTS,
    TIMELINE,
    Strip,
    interval_in_words,
    label,
    read_json,
    read_strip,
    rival_note,
    verdict,
)
from unwrap.pictures import CYCLIC, ERROR, GRAY, VIRIDIS, ColorMap, picture
from unwrap.signal import GRAY_FULL_SCALE
from unwrap.support import write_text

REPORT = "report.html"
LARGEST_ERROR_M = 1.0  # assumed: a wrong wrap is six times that, a right one a tenth
GRAY_GAMMA = 0.5  # assumed: a linear image is too dark to look at
MINUS = "\u2212"
"""As wide as a plus; the cards set their numbers large."""


def write_report(folder: Path) -> Path:
    """Write `report.html` from the results in `folder` and return its path.

    Raises
    ------
    ValueError
        A file of the results is missing or damaged; the message names it.
    """
    results, played = read_json(folder / RESULTS), read_json(folder / TIMELINE)
    strip = read_strip(folder / FRAMES) if results.get("every", 1) == 1 else None
    try:
        page = render_page(results, played, strip)
    except (KeyError, IndexError, TypeError, jinja2.UndefinedError) as error:
        raise ValueError(
            f"{folder} holds results that this version cannot show ({error!r}); "
            "`shotenv evaluate` writes them anew"
        ) from None
    write_text(folder / REPORT, page)
    return folder / REPORT


def render_page(results: dict[str, Any], played: dict[str, Any], strip: Strip | None) -> str:
    """The page as text; without frames where there is no strip of them."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,  # by default a misspelt name would print nothing
    )
    panels = panels_of(strip, results["config"]["env"]["sensor"]["f1_hz"]) if strip else {}
    scheduler, fixed = results["scheduler"], results["best_fixed"]
    # The rule is what the scheduler has to be better than to be worth its training.
    compared = tuple(name for name in (scheduler, "snr_threshold") if name in results["policies"])
    return environment.get_template("report.html.jinja").render(
        results=results,
        verdict=verdict(results),
        rival_note=rival_note(results),
        rows=_rows(results),
        cards=_cards(results),
        panels=[{"key": key, "title": panel.title, **panel.scale} for key, panel in panels.items()],
        frames=json.dumps(_frames(strip, panels)) if strip else None,
        families=list(dict.fromkeys(strip.family.tolist())) if strip else [],
        scatter=charts.figure_html(charts.error_against_energy(results)),
        shares=charts.figure_html(charts.shares_by_family(results, compared)),
        timeline=charts.figure_html(charts.timeline(played, scheduler, fixed)),
        drive=played["drive"],
        split=results["config"]["study"]["split"],
        shot_colors={str(shots): color for shots, color in charts.SHOT_COLORS.items()},
        plotly=get_plotlyjs(),  # all 4 MB of it: the page is read without a network
    )


def _rows(results: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table, best return first."""
    ordered = sorted(results["policies"].items(), key=lambda item: -item[1]["return"]["mean"])
    return [
        {
            "label": label(name),
            "chosen": name == results["scheduler"],
            "fixed": name == results["best_fixed"],
            "paired": results["paired_to_best_fixed"].get(name),
            "rule": None,  # where the policy has none of its own
            **policy,
        }
        for name, policy in ordered
    ]


def _cards(results: dict[str, Any]) -> list[dict[str, str]]:
    """The few numbers to remember, scheduler against best fixed choice."""
    scheduler = results["policies"][results["scheduler"]]
    fixed = results["policies"][results["best_fixed"]]
    pair = results["paired_to_best_fixed"][results["scheduler"]]
    against = label(results["best_fixed"])
    return [
        {
            "title": "Return, difference",
            "value": f"{pair['difference']:+.1f}".replace("-", MINUS),
            "note": interval_in_words(results["confidence"], pair).replace("-", MINUS),
        },
        _card("Laser energy", "J", scheduler["laser_energy_j"], fixed["laser_energy_j"], against),
        _card("Depth error", "m", scheduler["depth_mae_m"], fixed["depth_mae_m"], against),
        {
            "title": "Laser off",
            "value": f"{scheduler['tripped_share']['mean']:.1%}",
            "note": f"of frames, tripped; {against}: {fixed['tripped_share']['mean']:.1%}",
        },
    ]


def _card(title: str, unit: str, ours: dict, theirs: dict, against: str) -> dict[str, str]:
    change = f"{ours['mean'] / theirs['mean'] - 1.0:+.0%}".replace("-", MINUS)
    return {
        "title": title,
        "value": f"{ours['mean']:.3g} {unit}",
        "note": f"{change} against {against} ({theirs['mean']:.3g} {unit})",
    }


class Panel(NamedTuple):
    """One picture of a frame.

    Attributes
    ----------
    title : str
    colors : ColorMap
    values : callable
        What is painted of frame i of a strip, [H, W]; NaN where there is nothing to show.
    """

    title: str
    colors: ColorMap
    values: Callable[[Strip, int], np.ndarray]

    @property
    def scale(self) -> dict[str, Any]:
        """The colour bar under the picture."""
        return {"css": self.colors.css, "ticks": self.colors.ticks, "unit": self.colors.unit}


def panels_of(strip: Strip, f1_hz: float) -> dict[str, Panel]:
    """The pictures of each frame, by the name that the page's script knows them by."""
    distance = ColorMap(0.0, float(strip.max_range_m), "m", VIRIDIS)
    around = ColorMap(0.0, float(strip.unambiguous_m), "m, wraps around", CYCLIC)
    gray = ColorMap(0.0, 1.0, f"share of full scale, gamma {GRAY_GAMMA:g}", GRAY)
    error = ColorMap(0.0, LARGEST_ERROR_M, "m, clipped above", ERROR)
    return {
        "gray": Panel("Gray image", gray, gray_shown),
        "wrapped": Panel(
            f"Wrapped map, {f1_hz / 1e6:g} MHz",
            around,
            lambda strip, i: np.where(strip.valid[i], strip.wrapped_m[i], np.nan),
        ),
        "corrected": Panel("Corrected depth", distance, valid_m),
        "truth": Panel("True depth", distance, scored_m),
        "error": Panel(
            "Absolute error", error, lambda strip, i: np.abs(valid_m(strip, i) - scored_m(strip, i))
        ),
    }


def gray_shown(strip: Strip, i: int) -> np.ndarray:
    """Gray image as a share of full scale, brightened."""
    return (strip.gray_lsb[i] / float(GRAY_FULL_SCALE)) ** GRAY_GAMMA


def valid_m(strip: Strip, i: int) -> np.ndarray:
    """Corrected depth where the sensor calls it valid, metres."""
    return np.where(strip.valid[i], strip.corrected_m[i], np.nan)


def scored_m(strip: Strip, i: int) -> np.ndarray:
    """True depth within the scored range, metres."""
    return np.where(strip.truth_m[i] <= strip.max_range_m, strip.truth_m[i], np.nan)


def _frames(strip: Strip, panels: dict[str, Panel]) -> list[dict[str, Any]]:
    """Pictures and caption of every frame of the strip."""
    return [
        {
            "family": str(strip.family[i]),
            "drive": int(strip.drive[i]),
            "frame": int(strip.frame[i]),
            "shots": int(strip.shots[i]),
            "mae": None if np.isnan(strip.depth_mae_m[i]) else float(strip.depth_mae_m[i]),
            "valid": float(strip.valid[i].mean()),
            "images": {
                key: picture(panel.values(strip, i), panel.colors) for key, panel in panels.items()
            },
        }
        for i in range(len(strip.frame))
    ]
