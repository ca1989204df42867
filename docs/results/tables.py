"""Where a study's policies do well: by family of scenes, by ego speed, and elsewhere."""

from __future__ import annotations

from typing import Any, Final

from results.rows import AT_HALF, interval, named, number, rivals, rows_of, settings

BY: Final = {"family": "family of scenes", "ego_speed": "mean speed of the clip"}


def by_groups(preset: str, table: dict[str, Any]) -> str:
    """Tables by family and by speed, of the best and of what it must beat."""
    shown = rivals(table)
    # What the knob at one price makes of each group; the best that learns comes first.
    at, price = shown[0], f"{table['price']:.2g}"
    parts = [
        f"## `{preset}` by family of scenes and by ego speed",
        "Error at half the energy within the group, and the share of its gap that is closed; then "
        f"what *{named(at)}* does there with its knob at one price, {price}.",
    ]
    for by, groups in table["groups"].items():
        lines = [
            f"| {BY[by]} | clips | {' | '.join(named(name) for name in shown)} | "
            f"energy at {price} | error | return |",
            "|---|---|" + "---|" * (len(shown) + 3),
        ]
        for group, one in groups.items():
            cells = [_error_and_gap(one["rows"][name]) for name in shown]
            row = one["rows"][at]
            lines.append(
                f"| {named(group)} | {one['clips']} | {' | '.join(cells)} | "
                f"{interval(row, 'laser_energy_share', '%')} | "
                f"{interval(row, 'depth_mae_m', 'm')} | {interval(row, 'return', '')} |"
            )
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _error_and_gap(row: dict[str, Any]) -> str:
    gap = f", {number(100 * row['gap_closed']['iqm'], 0)} %" if "gap_closed" in row else ""
    return f"{interval(row, AT_HALF, 'm')}{gap}"


def elsewhere(plan: dict[str, Any], tables: dict[str, Any]) -> str:
    """What was trained and tuned on one preset, on other drives."""
    transfer = plan["transfer"]
    rows = list(dict.fromkeys(name for table in tables.values() for name in table["rows"]))
    parts = [
        "## Elsewhere, without training anew",
        f"Schedulers trained, and rules tuned, on `{transfer['source']}`, as they are. Bold: the "
        "least error at half the energy, and what does not differ from it significantly.",
        "\n".join(
            f"- `{name}`: {_place(transfer['tables'][name], table)}"
            for name, table in tables.items()
        ),
    ]
    for title, measure, form in (
        ("error at half the energy", AT_HALF, "m"),
        ("gap closed", "gap_closed", "%"),
        ("return", "return", ""),
    ):
        lines = [
            f"| {title} | {' | '.join(named(name) for name in rows)} |",
            "|---|" + "---|" * len(rows),
        ]
        for name, table in tables.items():
            cells = [_cell(table, row, measure, form) for row in rows]
            lines.append(f"| `{name}` | {' | '.join(cells)} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _cell(table: dict[str, Any], row: str, measure: str, form: str) -> str:
    told = interval(table["rows"][row], measure, form)
    first = rows_of(table)[0]
    alike = row == first or not table["differences"][row][AT_HALF]["significant"]
    return f"**{told}**" if measure == AT_HALF and alike else told


def _place(place: dict[str, Any], table: dict[str, Any]) -> str:
    """Preset, clips and settings in words."""
    parts = [f"preset `{place['preset']}`"]
    if place["split"] is not None:
        families = ", ".join(named(name) for name in table["groups"]["family"])
        parts.append(f"clips of split {place['split']} ({families})")
    if place["env"]:
        parts.append(settings(place["env"]))
    return f"{'; '.join(parts)}; {table['clips']} clips, returns at a price of {table['price']:.2g}"
