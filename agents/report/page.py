"""The report: one self-contained HTML page, with its numbers beside it as JSON and CSV."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from plotly.offline import get_plotlyjs

from agents.report import charts
from agents.report.results import (
    FRAMES,
    RESULTS,
    TIMELINE,
    Strip,
    label,
    read_json,
    read_strip,
    rival_note,
    verdict,
)
from unwrap.pictures import CYCLIC, ERROR, GRAY, VIRIDIS, ColorMap, picture
from unwrap.support import write_text

REPORT = "report.html"
LARGEST_ERROR_M = 1.0
GRAY_GAMMA = 0.5  # a 12-bit linear image is too dark to look at


def write_report(folder: Path) -> Path:
    """Write `report.html` from the results in `folder` and return its path.

    Raises
    ------
    ValueError
        A file of the results is missing or damaged; the message names it.
    """
    results, played = read_json(folder / RESULTS), read_json(folder / TIMELINE)
    strip = read_strip(folder / FRAMES)
    try:
        page = render_page(results, played, strip)
    except (KeyError, IndexError, TypeError, jinja2.UndefinedError) as error:
        raise ValueError(
            f"{folder} holds results that this version cannot show ({error!r}); "
            "`shotenv evaluate` writes them anew"
        ) from None
    write_text(folder / REPORT, page)
    return folder / REPORT


def render_page(results: dict[str, Any], played: dict[str, Any], strip: Strip) -> str:
    """The page as text."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    scheduler, fixed = results["scheduler"], results["best_fixed"]
    compared = tuple(name for name in (scheduler, "snr_threshold") if name in results["policies"])
    return environment.get_template("report.html.jinja").render(
        results=results,
        verdict=verdict(results),
        rival_note=rival_note(results),
        label=label,
        rows=_rows(results),
        cards=_cards(results),
        panels=_panels(strip),
        frames=json.dumps(_frames(strip)),
        families=list(dict.fromkeys(strip.family.tolist())),
        scatter=charts.figure_html(charts.error_against_energy(results)),
        shares=charts.figure_html(charts.shares_by_family(results, compared)),
        timeline=charts.figure_html(charts.timeline(played, scheduler, fixed)),
        drive=played["drive"],
        plotly=get_plotlyjs(),
    )


def _rows(results: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table, best return first."""
    ordered = sorted(results["policies"].items(), key=lambda item: -item[1]["return"]["mean"])
    return [
        {
            "name": name,
            "label": label(name),
            "chosen": name == results["scheduler"],
            "fixed": name == results["best_fixed"],
            "paired": results["paired_to_best_fixed"].get(name),
            "rule": None,
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
            "value": f"{pair['difference']:+.1f}".replace("-", "\u2212"),
            "note": f"{results['confidence']:.0%} interval {pair['low']:+.1f} to "
            f"{pair['high']:+.1f}".replace("-", "\u2212"),
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
    change = ours["mean"] / theirs["mean"] - 1.0
    return {
        "title": title,
        "value": f"{ours['mean']:.3g} {unit}",
        "note": f"{change:+.0%} against {against} ({theirs['mean']:.3g} {unit})".replace(
            "-", "\u2212"
        ),
    }


def _color_maps(strip: Strip) -> dict[str, ColorMap]:
    range_m, unambiguous_m = float(strip.max_range_m), float(strip.unambiguous_m)
    return {
        "gray": ColorMap(0.0, 1.0, "share of full scale, gamma 0.5", GRAY),
        "wrapped": ColorMap(0.0, unambiguous_m, "m, wraps around", CYCLIC),
        "corrected": ColorMap(0.0, range_m, "m", VIRIDIS),
        "truth": ColorMap(0.0, range_m, "m", VIRIDIS),
        "error": ColorMap(0.0, LARGEST_ERROR_M, "m, clipped above", ERROR),
    }


TITLES = {
    "gray": "Gray image",
    "wrapped": "Wrapped map, 24 MHz",
    "corrected": "Corrected depth",
    "truth": "True depth",
    "error": "Absolute error",
}


def _panels(strip: Strip) -> list[dict[str, Any]]:
    return [
        {
            "key": key,
            "title": TITLES[key],
            "css": colors.css,
            "ticks": colors.ticks,
            "unit": colors.unit,
        }
        for key, colors in _color_maps(strip).items()
    ]


def _frames(strip: Strip) -> list[dict[str, Any]]:
    """Pictures and caption of every frame of the strip."""
    maps = _color_maps(strip)
    return [
        {
            "family": str(strip.family[i]),
            "drive": int(strip.drive[i]),
            "frame": int(strip.frame[i]),
            "shots": int(strip.shots[i]),
            "mae": None if np.isnan(strip.depth_mae_m[i]) else float(strip.depth_mae_m[i]),
            "valid": float(strip.valid[i].mean()),
            "images": {
                key: picture(values, maps[key]) for key, values in _quantities(strip, i).items()
            },
        }
        for i in range(len(strip.frame))
    ]


def _quantities(strip: Strip, i: int) -> dict[str, np.ndarray]:
    """Quantities of frame `i` as they are shown: only valid depth, only scored truth."""
    truth_m = np.where(strip.truth_m[i] <= strip.max_range_m, strip.truth_m[i], np.nan)
    corrected_m = np.where(strip.valid[i], strip.corrected_m[i], np.nan)
    return {
        "gray": (strip.gray_lsb[i] / 4095.0) ** GRAY_GAMMA,
        "wrapped": np.where(strip.valid[i], strip.wrapped_m[i], np.nan),
        "corrected": corrected_m,
        "truth": truth_m,
        "error": np.abs(corrected_m - truth_m),
    }
