"""The report: one self-contained HTML page, with its numbers beside it as JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from agents.optimum import STILL_M
from agents.report import charts
from agents.report.answer import (
    best_rule,
    budget_rows,
    details,
    names_in_order,
    percent,
    verdict,
)
from agents.report.choice_charts import choice_map
from agents.report.drive_charts import OFF_COLOR, rows_told, timeline
from agents.report.results import (
    CHOICES,
    FRAMES,
    GRAY_GAMMA,
    OPTIMUM,
    RESULTS,
    TIMELINE,
    Strip,
    label,
    read_json,
    read_strip,
)
from agents.report.template import CANNOT_SHOW, page_of
from unwrap.pictures import CYCLIC, ERROR, GRAY, VIRIDIS, ColorMap, picture
from unwrap.signal import GRAY_FULL_SCALE
from unwrap.support import write_text

REPORT = "report.html"
LARGEST_ERROR_M = 1.0  # assumed: a wrong wrap is six times that, a right one a tenth


def write_report(folder: Path) -> Path:
    """Write `report.html` from the results in `folder` and return its path.

    Raises
    ------
    ValueError
        A file of the results is missing or damaged; the message names it.
    """
    results, played, choices = (read_json(folder / name) for name in (RESULTS, TIMELINE, CHOICES))
    strip = read_strip(folder / FRAMES) if results.get("every", 1) == 1 else None
    try:
        page = render_page(results, played, choices, strip)
    except (*CANNOT_SHOW, ValueError) as error:
        raise ValueError(
            f"{folder} holds results that this version cannot show ({error!r}); "
            "`shotenv evaluate` writes them anew"
        ) from None
    write_text(folder / REPORT, page)
    return folder / REPORT


def render_page(
    results: dict[str, Any], played: dict[str, Any], choices: dict[str, Any], strip: Strip | None
) -> str:
    """The page as text; without frames where there is no strip of them."""
    panels = panels_of(strip, results["config"]["env"]["sensor"]["f1_hz"]) if strip else {}
    scheduler = results["scheduler"]
    # The best rule is what the scheduler has to be better than to be worth its training.
    compared = tuple(name for name in (scheduler, best_rule(results)) if name)
    return page_of(
        "report.html.jinja",
        results=results,
        verdict=verdict(results),
        details=details(results),
        percent=percent,
        answer=results["answer"],
        families_measured=_families(results),
        knob=_knob(results),
        budget=budget_rows(results),
        rows=_rows(results),
        cards=_cards(results),
        panels=[{"key": key, "title": panel.title, **panel.scale} for key, panel in panels.items()],
        frames=json.dumps(_frames(strip, panels, played["trip_k"])) if strip else None,
        families=list(dict.fromkeys(strip.family.tolist())) if strip else [],
        fronts=charts.figure_html(charts.fronts(results)),
        shares=charts.figure_html(charts.shares_by_family(results, compared)),
        choice_maps=[charts.figure_html(choice_map(one)) for one in choices["maps"]],
        timeline=charts.figure_html(timeline(played, scheduler), "timeline"),
        drive=played["drive"],
        drive_price=played["power_price"],
        drive_families=json.dumps(played["family"]),
        drive_rows=json.dumps(rows_told(played, scheduler)),
        frame_rate_hz=played["frame_rate_hz"],
        optimum_known=OPTIMUM in played["policies"],
        split=results["config"]["study"]["split"],
        price=_price(results),
        still_m=STILL_M,
        shot_colors={str(shots): color for shots, color in charts.SHOT_COLORS.items()},
        off_color=OFF_COLOR,
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
            "temporal_error_m": None,  # where it is not known
            **policy,
        }
        for name, policy in ordered
    ]


def _families(results: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table of fronts."""
    answer = results["answer"]
    return [
        {
            "label": text,
            "chosen": name == answer["scheduler"],
            "gap_closed": None,  # where the optimum is not known
            **answer["measures"][name],
        }
        for name, text in names_in_order(results)
    ]


def _knob(results: dict[str, Any]) -> list[dict[str, Any]]:
    """What each price that the scheduler was played at comes to, against always 8 DCS."""
    eight = results["answer"]["always_8"]
    return [
        {
            **row,
            "saved": percent(1.0 - row["laser_energy_share"] / eight["laser_energy_share"]),
            "more_error": percent(row["depth_mae_m"] / eight["depth_mae_m"] - 1.0),
            "life_factor": eight["life_used_per_frame_h"] / row["life_used_per_frame_h"],
            "cooler_k": eight["temperature_k"] - row["temperature_k"],
        }
        for row in results["fronts"][results["scheduler"]]
    ]


def _price(results: dict[str, Any]) -> str:
    """Price of power in the drives of the table of policies."""
    low, high = results["config"]["env"]["reward"]["power"]
    return f"{low:g}" if low == high else f"{low:g} to {high:g}, drawn for each drive"


def _cards(results: dict[str, Any]) -> list[dict[str, str]]:
    """The few numbers to remember, scheduler against always 8 DCS."""
    own = results["answer"]["measures"][results["scheduler"]]
    life, half = own["life_factor_at_10_percent_more"], own["error_at_half_energy"]
    return [
        _saved("Energy saved, same error", own["energy_saved_at_equal_error"]),
        _saved("Energy saved, 10 % more error", own["energy_saved_at_10_percent_more"]),
        {
            "title": "Laser life, 10 % more error",
            "value": f"{life['mean']:.1f} times",
            "note": f"that with always 8 DCS; {life['low']:.1f} to {life['high']:.1f}",
        },
        {
            "title": "Error at half the energy",
            "value": f"{half['mean']:.2f} m",
            "note": f"{half['low']:.2f} to {half['high']:.2f} m; best mixture of fixed choices "
            f"{results['answer']['measures']['blind']['error_at_half_energy']['mean']:.2f} m",
        },
    ]


def _saved(title: str, share: dict[str, float]) -> dict[str, str]:
    return {
        "title": title,
        "value": percent(share["mean"]),
        "note": f"{percent(share['low'])} to {percent(share['high'])}, against always 8 DCS",
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


def _frames(strip: Strip, panels: dict[str, Panel], trip_k: float) -> list[dict[str, Any]]:
    """Pictures and caption of every frame of the strip."""
    known = len(strip.optimum_shots) > 0
    return [
        {
            "family": str(strip.family[i]),
            "drive": int(strip.drive[i]),
            "frame": int(strip.frame[i]),
            "shots": int(strip.shots[i]),
            "mae": None if np.isnan(strip.depth_mae_m[i]) else float(strip.depth_mae_m[i]),
            "valid": float(strip.valid[i].mean()),
            "celsius": float(strip.temperature_k[i] - 273.15),
            "margin": float(trip_k - strip.temperature_k[i]),
            "energy": float(strip.laser_energy_j[i]),
            "best": {
                "shots": int(strip.optimum_shots[i]),
                "energy": float(strip.optimum_energy_j[i]),
            }
            if known
            else None,
            "images": {
                key: picture(panel.values(strip, i), panel.colors) for key, panel in panels.items()
            },
        }
        for i in range(len(strip.frame))
    ]
