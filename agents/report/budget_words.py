"""What a budget of laser energy allows, in words and as rows of a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from agents.report.answer import OPTIMUM, percent
from agents.report.results import label


def budget_rows(results: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table: the optimum, then the policies, the least error first; none without it."""
    if "budget" not in results:
        return []
    told = results["budget"]
    ordered = sorted(told["policies"].items(), key=lambda item: item[1]["depth_mae_m"]["mean"])
    rows = [
        {
            "label": label(name),
            "chosen": name == results["scheduler"],
            "knob": "; ".join(_setting(part) for part in one["setting"]),
            "above_optimum_m": None,  # where the optimum is not known
            **one,
        }
        for name, one in ordered
    ]
    if OPTIMUM in told:
        low, high = told[OPTIMUM]["prices_per_j"]
        knob = f"price of a joule {low:.2g}" + (f" and {high:.2g}" if low < high else "")
        best = {"label": label(OPTIMUM), "chosen": False, "knob": knob, **told[OPTIMUM]}
        rows = [best | {"above_optimum_m": None}, *rows]
    return rows


def budget_lines(results: dict[str, Any]) -> list[str]:
    """The same as sentences; none without a budget."""
    rows = budget_rows(results)
    if not rows:
        return []
    budget_j = results["budget"]["budget_j"]
    return [
        f"With a budget of {budget_j:g} J of laser energy per drive on average:",
        *(f"  {_sentence(row)}" for row in rows),
    ]


def _sentence(row: Mapping[str, Any]) -> str:
    spent, error_m, above = row["laser_energy_j"], row["depth_mae_m"], row["above_optimum_m"]
    told = (
        f"{row['label']} ({row['knob']}) spends {spent['mean']:.4g} J, at most "
        f"{row['worst_drive_j']:.4g} J in a drive, in "
        f"{percent(row['drives_over_share'])} of the drives more than the budget, and errs "
        f"{error_m['mean']:.2f} m ({error_m['low']:.2f} to {error_m['high']:.2f})"
    )
    if above is None:
        return f"{told}."
    return (
        f"{told}, {above['difference']:.2f} m above the optimum "
        f"({above['low']:.2f} to {above['high']:.2f})."
    )


def _setting(part: Mapping[str, Any]) -> str:
    """A policy, its price and its share of the drives.

    Examples
    --------
    >>> _setting({"share": 0.25, "price": 0.1, "policy": "always_2"})
    '25 % of drives: Always 2 DCS, price 0.1'
    """
    whole = "" if part["share"] >= 1.0 else f"{percent(part['share'])} of drives: "
    price = "" if part["price"] is None else f", price {part['price']:.3g}"
    return f"{whole}{label(part['policy'])}{price}"
