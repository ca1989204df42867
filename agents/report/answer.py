"""The answer of an evaluation, in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from agents.report.results import OPTIMUM, in_a_sentence, label

Told = Mapping[str, float]
"""An interval: "low", "high", and the point estimate as "mean" or "difference"."""
LEAST_SHARE: Final = 0.005
"""Shares below are shown as 0 %."""
BLIND: Final = "blind"


def verdict(results: dict[str, Any]) -> str:
    """What adaptive scheduling saves at the depth error of always 8 DCS, one sentence."""
    answer = results["answer"]
    own = answer["measures"][answer["scheduler"]]
    saved = own["energy_saved_at_equal_error"]
    where = f"At the depth error of always 8 DCS ({answer['always_8']['depth_mae_m']:.2f} m)"
    over = f"over {results['drives']} {results['config']['study']['split']} drives"
    saves = (
        f"the scheduler saves {percent(saved['mean'])} of its laser energy "
        f"({percent_interval(results, saved)}) {over}"
    )
    if saved["low"] < LEAST_SHARE:
        return f"No significant difference: {_lower(where)} {saves}."
    return f"{where} {saves}; {heat_and_life(own, 'at_equal_error')}."


def details(results: dict[str, Any]) -> list[str]:
    """What else decides: with some more error, at half the energy, beside the rules."""
    answer = results["answer"]
    every, name = answer["measures"], answer["scheduler"]
    own, at = every[name], "at_10_percent_more"
    saved, half = own[f"energy_saved_{at}"], own["error_at_half_energy"]
    below = own["below_blind_at_half_energy"]
    told = [
        f"Where 10 % more error is allowed, it saves {percent(saved['mean'])} "
        f"({percent_interval(results, saved)}), and the best mixture of fixed choices "
        f"{percent(every[BLIND][f'energy_saved_{at}']['mean'])}; {heat_and_life(own, at)}.",
        f"At half the laser energy of 8 DCS in every frame it errs {half['mean']:.2f} m "
        f"({half['low']:.2f} to {half['high']:.2f}), {_less(below['mean'])} than that mixture "
        f"({percent_interval(results, below)}).",
    ]
    if "gap_closed" in own:
        closed = own["gap_closed"]
        told.append(
            "Of the gap between that mixture and the optimum, which knows all, it closes "
            f"{percent(closed['mean'])} ({percent_interval(results, closed)}), mean over energies."
        )
    rival = best_rule(results)
    if rival:
        told.append(rival_sentence(results, rival))
    if len(answer["prices"]) == 1:
        told.append(
            f"The scheduler was trained at one price, {answer['prices'][0]:g}, and has no knob: "
            "its front is that point mixed with fixed choices."
        )
    if results.get("recorded"):
        told.append("Drives are recordings, scored against the reference that came with them.")
    told += [f"Left out: {sentence}." for sentence in results.get("left_out", ())]
    return told


def best_rule(results: dict[str, Any]) -> str | None:
    """Name of the tuned rule with the least error at half the energy, which favours it."""
    answer = results["answer"]
    rules = set(answer["measures"]) - {answer["scheduler"], BLIND, OPTIMUM}
    return min(
        sorted(rules),
        key=lambda name: answer["measures"][name]["error_at_half_energy"]["mean"],
        default=None,
    )


def rival_sentence(results: dict[str, Any], rival: str) -> str:
    """How the scheduler does against a rule at half the energy, one sentence."""
    apart = results["answer"]["differences"][rival]["error_at_half_energy"]
    rule = f"the best of the tuned rules, {in_a_sentence(rival)}"
    less = -apart["difference"]
    # As an interval of what it is less, or more, whichever the estimate is.
    ends = sorted(apart[end] * (-1.0 if less >= 0 else 1.0) for end in ("low", "high"))
    words = (
        f"at half the energy its error is {abs(less):.2f} m {'less' if less >= 0 else 'more'} "
        f"({_confidence(results)} interval {ends[0]:.2f} to {ends[1]:.2f})"
    )
    if apart["low"] <= 0.0 <= apart["high"]:
        return f"No significant difference to {rule}: {words}."
    return f"Against {rule}, {words}."


def heat_and_life(own: Mapping[str, Told], at: str) -> str:
    """Life and temperature of the laser against always 8 DCS, with their intervals."""
    life, cooler = own[f"life_factor_{at}"], own[f"cooler_k_{at}"]
    return (
        f"its laser lives {life['mean']:.1f} times as long ({life['low']:.1f} to "
        f"{life['high']:.1f}) and is {cooler['mean']:.1f} K cooler on average "
        f"({cooler['low']:.1f} to {cooler['high']:.1f})"
    )


def percent_interval(results: dict[str, Any], told: Told) -> str:
    """The interval of a share.

    Examples
    --------
    >>> percent_interval({"confidence": 0.95}, {"mean": 0.26, "low": 0.17, "high": 0.36})
    '95 % interval 17 to 36 %'
    """
    low, high = (percent(told[end]) for end in ("low", "high"))
    return f"{_confidence(results)} interval {low.removesuffix(' %')} to {high}"


def percent(share: float) -> str:
    """A share in percent.

    Examples
    --------
    >>> percent(0.264), percent(-0.001)
    ('26 %', '0 %')
    """
    return f"{round(100 * share)} %"


def names_in_order(results: dict[str, Any]) -> list[tuple[str, str]]:
    """Fronts and their labels: the scheduler, the rules with the best first, blind, optimum."""
    answer = results["answer"]
    every = answer["measures"]
    rules = sorted(
        set(every) - {answer["scheduler"], BLIND, OPTIMUM},
        key=lambda name: (every[name]["error_at_half_energy"]["mean"], name),
    )
    last = [name for name in (BLIND, OPTIMUM) if name in every]
    return [(name, label(name)) for name in (answer["scheduler"], *rules, *last)]


def _confidence(results: dict[str, Any]) -> str:
    return percent(results["confidence"])


def _less(share: float) -> str:
    return f"{percent(abs(share))} {'less' if share >= 0 else 'more'}"


def _lower(sentence: str) -> str:
    return sentence[0].lower() + sentence[1:]


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
