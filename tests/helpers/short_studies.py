"""Studies of a second or two on the tiny bank."""

from agents.config.study_plan import StudyPlan

FAST = {
    "algorithm": "regression",
    "power_price": [0.01, 0.2],
    "hidden": [4],
    "regression": {
        **{"rounds": 1, "drives": 2, "validation_drives": 2, "horizon": 1},
        **{"members": 1, "passes": 1},
    },
}


def plan_of(files, **changes):
    fields = {
        "policies": [str(files / "fast.yaml"), str(files / "linear.yaml"), "random", "fixed"],
        "presets": [str(files / "short.yaml")],
        "seeds": [0, 1],
        "ablations": {
            "no_heat": {
                "policy": str(files / "fast.yaml"),
                "unseen": ["temperature", "heat_margin"],
                "presets": [str(files / "short.yaml")],
            }
        },
        "study": {"drives": 2, "tuning_drives": 2, "prices": [0.02, 0.1], "bootstrap_draws": 100},
    }
    return StudyPlan.model_validate(fields | changes)
