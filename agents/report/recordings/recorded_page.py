"""The page, and the lines, of an evaluation on recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from agents.report import CANNOT_SHOW, label, page_of
from unwrap.support import write_text

PAGE = Path(__file__).with_name("recorded.html.jinja")
REPORT = "report.html"
TRUTHS = {
    "external": "Distances are scored against a reference that came with the recordings.",
    "own": "Truth is the recordings' own: the depth of all eight samples where their two "
    "frequencies agree. 8 DCS are not scored against themselves: their error term is what their "
    "noise lets expect, which also adds to that of fewer samples, and depth errors are those of "
    "frames with fewer.",
    "none": "There is no reference, and no error is known. Only energy, duty and heat count, and "
    "the fewest samples always return the most.",
}


def recorded_lines(results: dict[str, Any]) -> list[str]:
    """What an evaluation on recordings says, a line for each policy, the best return first."""
    lines = [TRUTHS[results["truth"]]]
    for row in rows_of(results):
        shares = " / ".join(f"{share:.0%}" for share in row["shots_share"])
        error = row["depth_mae_m"]
        told = "" if error is None else f", errs {error['mean']:.2f} m"
        lines.append(
            f"  {row['label']:22} returns {row['return']['mean']:8.1f} with "
            f"{row['laser_energy_j']['mean']:.3f} J of laser per drive{told}; 2 / 4 / 8 DCS in "
            f"{shares}"
        )
    lines += [f"left out: {sentence}" for sentence in results["left_out"]]
    return lines


def rows_of(results: dict[str, Any]) -> list[dict[str, Any]]:
    """Rows of the table, the best return first."""
    policies = results["policies"].items()
    ordered = sorted(policies, key=lambda item: -item[1]["return"]["mean"])
    return [
        {**one, "label": label(name), "chosen": name == results["scheduler"]}
        for name, one in ordered
    ]


def write_recorded_report(results: dict[str, Any], folder: Path) -> Path:
    """Write `report.html` of the results into `folder` and return its path.

    Raises
    ------
    ValueError
        They are of another version.
    """
    try:
        page = page_of(
            PAGE,
            results=results,
            truth=TRUTHS[results["truth"]],
            rows=rows_of(results),
            split=results["config"]["study"]["split"],
            bank=results["config"]["env"]["bank"],
        )
    except CANNOT_SHOW as error:
        raise ValueError(
            f"{folder} holds results that this version cannot show ({error!r}); "
            "`shotenv evaluate` writes them anew"
        ) from None
    write_text(folder / REPORT, page)
    return folder / REPORT
