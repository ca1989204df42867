"""What the decision problem must be like for fewer shots to pay: goals, judgement and text."""

from __future__ import annotations

from typing import Any, Final

from agents.config import DemoConfig

LEAST_SHARE: Final = 0.12
"""Of the optimum's frames, for each action."""
LEAST_EXCESS: Final = {"best_fixed": 0.18, "best_blind": 0.15, "threshold_rule": 0.15}
"""Over the optimum's cost, of each kind of policy that does not look ahead or around."""
LEAST_EXCESS_IN_HEAT: Final = 0.05
"""Over the optimum's cost, of a clairvoyant that does not look ahead, where heat binds."""
LEAST_ENERGY_SHARE: Final = 0.25
"""Of the optimum's cost that duty and power make."""
LEAST_BELOW_BLIND: Final = 0.35
"""By which the clairvoyant's error at half energy lies below that of blind choices."""
LEAST_WORTH_OF_LOOKING: Final = 0.10
"""Of the error at half energy, to what foresees errors."""
HELD_BACK: Final = (0.2, 0.4)
"""Share of the drives in which heat holds back always-8."""
MOST_EXPLAINED: Final = 0.90
"""Share of the variance of what 8 DCS gain that the bank frame may explain."""


def judged(found: dict[str, Any], *, heat_binds: bool = False) -> dict[str, Any]:
    """What `measure_problem` found, with each goal: whether it holds, and whether all do.

    With `heat_binds` the goals are those of a problem that is about heat.
    """
    shares = found["optimum"]["shots_share"]
    greedy = found["excess"]["greedy"]["excess"]
    explained = max(found["frame_explains"].values())
    low, high = HELD_BACK
    points = {
        "every_action_is_used": (min(one["mean"] for one in shares.values()), LEAST_SHARE),
        **{
            f"excess_of_{name}": (found["excess"][name]["excess"], least)
            for name, least in LEAST_EXCESS.items()
        },
        "cost_share_of_energy": (found["cost_share_of_energy"], LEAST_ENERGY_SHARE),
        "clairvoyant_below_blind": (found["clairvoyant_below_blind"]["mean"], LEAST_BELOW_BLIND),
        "worth_of_looking": (found["worth_of_looking"]["mean"], LEAST_WORTH_OF_LOOKING),
        "left_by_the_frame": (1.0 - explained, 1.0 - MOST_EXPLAINED),
    }
    if heat_binds:
        points = {"excess_of_greedy": (greedy, LEAST_EXCESS_IN_HEAT)}
    goals = {
        name: {"value": value, "least": least, "holds": value >= least}
        for name, (value, least) in points.items()
    }
    if not heat_binds:
        held = found["held_back_drives_share"]
        goals["held_back_drives_share"] = {
            "value": held,
            "least": low,
            "most": high,
            "holds": low <= held <= high,
        }
    return {**found, "goals": goals, "holds": all(goal["holds"] for goal in goals.values())}


def print_problem(found: dict[str, Any], config: DemoConfig) -> None:
    """What `judged` found for `config`, as text."""
    optimum, env = found["optimum"], config.env
    measured = f"bank {env.bank}, unwrapper {env.unwrapper}, laser {env.laser.name}"
    weights = ", ".join(f"{name} {value}" for name, value in env.reward.model_dump().items())
    print(f"{measured}; reward: {weights}")
    print(
        f"Clairvoyant optimum over {found['drives']} {config.study.split} drives of "
        f"{found['clips']} clips ({config.study.confidence:.0%} intervals over clips)"
    )
    for shots, share in optimum["shots_share"].items():
        print(
            f"  {shots} DCS in {share['mean']:6.1%} of frames  "
            f"({share['low']:.1%} to {share['high']:.1%})"
        )
    print(
        f"  laser energy {optimum['laser_energy_share']:.0%} of always-8, "
        f"mean depth error {optimum['depth_mae_m']['mean']:.2f} m, "
        f"laser off in {optimum['tripped_share']:.1%} of frames"
    )
    print("\nWhat others cost more than the optimum")
    for name, one in found["excess"].items():
        print(
            f"  {name.replace('_', ' '):15}{one['excess']:6.1%}  "
            f"({one['low']:.1%} to {one['high']:.1%})  {one['choice']}"
        )
    print("\nMean depth error at half of always-8's laser energy, and the energy at which")
    print("it is that of the best blind choice there")
    for name, one in found["error_at_half_energy"].items():
        energy = found["energy_at_equal_error"][name]
        print(
            f"  {name.replace('_', ' '):28}{one['mean']:5.2f} m  "
            f"({one['low']:.2f} to {one['high']:.2f})   {energy['mean']:4.0%}  "
            f"({energy['low']:.0%} to {energy['high']:.0%})"
        )
    print("\nBest action by family: shares of 2 / 4 / 8 in the optimum")
    for family, shares in found["families"].items():
        print(f"  {family:20}{_shares(shares)}")
    print("\nWeight of power   shares of 2 / 4 / 8 in the optimum   best fixed choice, its excess")
    for row in found["sweep"]:
        shares = _shares(row["shots_share"])
        print(
            f"  {row['power']:<16g}{shares:37}{row['best_fixed']}, {row['best_fixed_excess']:.1%}"
        )
    print("\nGoals")
    for name, goal in found["goals"].items():
        most = f", at most {goal['most']:.0%}" if "most" in goal else ""
        word = "holds" if goal["holds"] else "MISSED"
        print(
            f"  {word:7}{name.replace('_', ' '):30}{goal['value']:6.1%}  "
            f"(at least {goal['least']:.0%}{most})"
        )
    held = "holds" if found["holds"] else "DOES NOT hold"
    print(f"\nThis problem ({measured}) {held} every goal.")


def _shares(shares: list[float]) -> str:
    return " / ".join(f"{share:4.0%}" for share in shares)
