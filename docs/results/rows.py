"""The answer, and the rows of a preset."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

AT_HALF: Final = "error_at_half_energy"
LEARNED: Final = ("learned", "saved")
FORMS: Final = {"%": (100, 0, " %"), "m": (1, 2, " m"), "": (1, 0, "")}
"""Factor, digits and unit."""


def interval(row: dict[str, Any], measure: str, form: str) -> str:
    """Interquartile mean and interval; a dash where there is none."""
    if measure not in row:
        return "-"
    scale, digits, unit = FORMS[form]
    mean, low, high = (number(scale * row[measure][key], digits) for key in ("iqm", "low", "high"))
    return f"{mean}{unit} ({low} to {high})"


def number(value: float, digits: int) -> str:
    """Rounded, and without the sign of a zero."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def named(row: str) -> str:
    """A row as it is written."""
    return row.replace("_", " ")


def rows_of(table: dict[str, Any]) -> list[str]:
    """Names of the rows, the least error at half the energy first."""
    rows = table["rows"]
    return sorted(rows, key=lambda name: rows[name][AT_HALF]["iqm"])


def best_of(table: dict[str, Any], kinds: Iterable[str]) -> list[str]:
    """The best row of these kinds, if there is one; ablations do not count."""
    rows = [name for name in rows_of(table) if name not in table["ablations"]]
    return [name for name in rows if table["kinds"][name] in kinds][:1]


def rivals(table: dict[str, Any]) -> list[str]:
    """The best that learns, the best tuned rule, the linear ridge and random choices."""
    always = [name for name in ("ridge", "random") if name in table["rows"]]
    return list(dict.fromkeys([*best_of(table, LEARNED), *best_of(table, ["rule"]), *always]))


def answer(preset: str, table: dict[str, Any]) -> str:
    """What errs least at half the energy, and by how much less than what it must beat."""
    best = table["best"]
    row, kind = table["rows"][best], table["kinds"][best]
    what = {"rule": "a tuned rule", "random": "random choices"}.get(kind, "a learned scheduler")
    gap = f", and closes {interval(row, 'gap_closed', '%')} of the gap to the optimum"
    beside = [_less(table, name) for name in rivals(table) if name != best]
    return (
        f"On `{preset}`, **{named(best)}**, {what}, errs least at half the laser energy of 8 DCS: "
        f"{interval(row, AT_HALF, 'm')}{gap if 'gap_closed' in row else ''}. "
        + (f"It errs {'; '.join(beside)}." if beside else "")
    ).rstrip()


def _less(table: dict[str, Any], name: str) -> str:
    """By how much less the best row errs than another."""
    one = table["differences"][name][AT_HALF]
    less, low, high = (number(-one[key], 2) for key in ("difference", "high", "low"))
    kind = table["kinds"][name]
    best = {"rule": ", the best rule", "learned": ", the best that learns"}.get(kind, "")
    told = f"{less} m less ({low} to {high}) than {named(name)}{'' if name == 'ridge' else best}"
    return told if one["significant"] else f"{told}: no significant difference"


def improvement(table: dict[str, Any], name: str) -> str:
    """Probability that the first row does better than this one."""
    if name == table["best"]:
        return ""
    one = table["improvement"][table["best"]][name]
    told = f"{100 * one['probability']:.0f} % ({100 * one['low']:.0f} to {100 * one['high']:.0f})"
    return told if one["significant"] else f"{told}, no significant difference"


def leaderboard(preset: str, table: dict[str, Any]) -> str:
    """A preset and its table."""
    lines = [
        "| policy | seeds | gap closed | error at half the energy | of its seeds | "
        "energy saved, same error | with 10 % more | return | "
        f"*{named(table['best'])}* does better |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in rows_of(table):
        row = table["rows"][name]
        seeds = row[AT_HALF]["seeds"]
        spread = f"{min(seeds):.2f} to {max(seeds):.2f} m" if len(seeds) > 1 else ""
        lines.append(
            f"| {named(name)} | {len(seeds)} | {interval(row, 'gap_closed', '%')} | "
            f"{interval(row, AT_HALF, 'm')} | {spread} | "
            f"{interval(row, 'energy_saved_at_equal_error', '%')} | "
            f"{interval(row, 'energy_saved_at_10_percent_more', '%')} | "
            f"{interval(row, 'return', '')} | "
            f"{improvement(table, name)} |"
        )
    env = table["env"]
    return "\n\n".join(
        [
            f"## `{preset}`",
            "\n".join(lines),
            f"{table['drives']} drives of {table['clips']} clips of the bank "
            f"`{env['bank']}` (digest `{table['bank']}`), {env['frames_per_drive']} frames each. "
            f"Returns are at a price of power of {table['price']:.2g}.",
        ]
    )


def ablations(plan: dict[str, Any]) -> str:
    """What each learner is not shown, or trained with."""
    told = []
    for row, one in plan["ablations"].items():
        parts = [f"that is not shown {', '.join(one['unseen'])}"] if one["unseen"] else []
        parts += [f"with {settings(one['agent'])}"] if one["agent"] else []
        told.append(f"*{named(row)}*: {one['policy']} {' and '.join(parts)}")
    return f"Ablations: {'; '.join(told)}."


def settings(changes: dict[str, Any], above: str = "") -> str:
    """Nested settings as words: `regression.horizon 1`."""
    return ", ".join(
        settings(value, f"{above}{key}.")
        if isinstance(value, dict)
        else f"`{above}{key}` {_value(value)}"
        for key, value in changes.items()
    )


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        numbers = list(dict.fromkeys(f"{one:g}" for one in value))
        return " to ".join(numbers)
    return str(value)
