"""Made-up results in the shape that an evaluation writes."""

import numpy as np

from agents.report.results import Strip
from shotenv.config.families import FAMILIES

RULES = ("look_and_hold", "snr_threshold")
NAMES = ("scheduler", *RULES, "cycle", "random", "always_2", "always_4", "always_8")


def made_up_interval(mean, width):
    return {"mean": mean, "low": mean - width, "high": mean + width}


ALLOWED = ("at_equal_error", "at_10_percent_more", "at_25_percent_more")


def made_up_measures(better):
    """As those of a front: the better, the more is saved."""
    found = {f"energy_saved_{at}": made_up_interval(better / 4, 0.05) for at in ALLOWED}
    found |= {f"life_factor_{at}": made_up_interval(1 + better, 0.1) for at in ALLOWED}
    found |= {f"cooler_k_{at}": made_up_interval(5 * better, 1.0) for at in ALLOWED}
    return found | {
        "error_at_half_energy": made_up_interval(1 - better / 2, 0.1),
        "below_blind_at_half_energy": made_up_interval(better / 2, 0.1),
        "gap_closed": made_up_interval(better, 0.1),
        "hypervolume": made_up_interval(0.3 + better / 3, 0.1),
    }


def made_up_point(price, policy, energy):
    return {
        "price": price,
        "policy": policy,
        "laser_energy_share": energy,
        "depth_mae_m": 0.3 / energy,
        "return": 50.0,
        "life_used_per_frame_h": 1e-5 * energy,
        "temperature_k": 310.0 + 15.0 * energy,
    }


def made_up_fronts(prices):
    fixed = {f"always_{shots}": shots / 8 for shots in (2, 4, 8)}
    blind = [made_up_point(None, name, 0.95 * share) for name, share in fixed.items()]
    fronts = {name: [made_up_point(0.1, "<rule>", 0.5)] for name in RULES}
    own = [made_up_point(price, "scheduler", 0.9 - i / 10) for i, price in enumerate(prices)]
    best = [made_up_point(price, "dynamic programming", 0.4) for price in prices]
    return {"scheduler": own, **fronts, "blind": blind, "optimum": best}


def made_up_answer(prices, better):
    rank = {
        "scheduler": better,
        "look_and_hold": 0.5,
        "snr_threshold": 0.1,
        "blind": 0.0,
        "optimum": 1.0,
    }
    eight = made_up_point(None, "always_8", 0.95)
    return {
        "scheduler": "scheduler",
        "prices": list(prices),
        "measures": {name: made_up_measures(one) for name, one in rank.items()},
        "differences": {
            name: {
                "error_at_half_energy": {
                    "difference": (one - better) / 2,
                    "low": (one - better) / 2 - 0.05,
                    "high": (one - better) / 2 + 0.05,
                }
            }
            for name, one in rank.items()
            if name != "scheduler"
        },
        "always_8": eight,
        "cool_8": {"laser_energy_share": 1.0, "depth_mae_m": 0.25},
    }


def made_up_results(
    difference=(6.0, 2.0, 9.0), f1_hz=24e6, split="test", better=0.7, prices=(0.01, 0.1)
):
    rng = np.random.default_rng(0)
    shares = {name: rng.dirichlet((1, 1, 1)).tolist() for name in NAMES}
    shares |= {"always_2": [1.0, 0.0, 0.0], "always_4": [0.0, 1.0, 0.0]}
    shares |= {"always_8": [0.0, 0.0, 1.0]}
    policies = {}
    for name in NAMES:
        shots = float(np.dot(shares[name], (2, 4, 8)))
        policies[name] = {
            "return": made_up_interval(-60.0 - rng.random() * 20, 4.0),
            "laser_energy_j": made_up_interval(30.0 * shots, 4.0),
            "energy_j": made_up_interval(35.0 * shots, 5.0),
            "life_used_h": made_up_interval(2e-3 * shots, 2e-4),
            "depth_mae_m": made_up_interval(1.2 / shots + 0.1, 0.02),
            "wrap_accuracy": made_up_interval(0.93, 0.01),
            "within_0p1m": made_up_interval(0.5, 0.02),
            "temporal_error_m": made_up_interval(0.8 / shots, 0.02),
            "tripped_share": made_up_interval(0.01 * shots, 0.005),
            "shots_share": shares[name],
            "life_factor": made_up_interval(8.0 / shots, 0.1),
            "depth_mae_p95_m": 3.0,
            "worst_clip": {"clip": 3, "family": "night_road", "depth_mae_m": 5.0},
            "highest_temperature_k": 330.0,
            "laser_wh_per_h": 0.2,
            "tripped_drives_share": 0.25,
            "median": {"return": -60.0, "depth_mae_m": 0.5},
        }
    # The rules that say what they do have one; that it has a "<" tells whether the page escapes it.
    policies["snr_threshold"]["rule"] = "8 DCS where signal_to_noise < -0.30, else 2"
    pair = dict(zip(("difference", "low", "high"), difference, strict=True))
    zero = {"difference": 0.0, "low": 0.0, "high": 0.0}
    return {
        "policies": policies,
        "answer": made_up_answer(prices, better),
        "fronts": made_up_fronts(prices),
        "paired_to_best_fixed": dict.fromkeys(NAMES, zero) | {"scheduler": pair},
        "paired_to_best_rival": {"difference": 0.4, "low": -0.2, "high": 1.1},
        "best_rival": "cycle",
        "algorithm": "ppo",
        "every": 1,
        "drives": 24,
        "seeds": list(range(1000, 1024)),
        "versions": {"shotenv": "0.1.0", "torch": "2.13.0"},
        "scheduler": "scheduler",
        "best_fixed": "always_4",
        "confidence": 0.95,
        "families": {
            name: {family: rng.dirichlet((1, 1, 1)).tolist() for family in FAMILIES}
            for name in NAMES
        },
        "config": {
            "env": {
                "bank": "pocket",
                "families": [],
                "frames_per_drive": 256,
                "sensor": {"f1_hz": f1_hz},
                "reward": {"power": [0.09, 0.09]},
            },
            "study": {"split": split},
        },
    }


def made_up_timeline(frames=256):
    rng = np.random.default_rng(1)
    family = np.repeat([FAMILIES[i % 5] for i in range(frames // 16 + 1)], 16)[:frames]
    warm = 300 + 28 * (1 - np.exp(-np.arange(frames) / 100))

    def played(shots, warmer):
        off = np.zeros(frames, bool)
        off[200:220] = warmer
        return {
            "shots": np.where(off, 0, shots).tolist(),
            "depth_mae_m": [None if o else float(rng.random() * 0.4) for o in off],
            "temperature_k": (warm + warmer * 3).tolist(),
            "laser_energy_j": (0.002 * np.where(off, 0, shots)).tolist(),
        }

    return {
        "drive": 1003,
        "power_price": 0.09,
        "frame_rate_hz": 10.0,
        "trip_k": 330.0,
        "release_k": 325.0,
        "family": family.tolist(),
        "policies": {
            "scheduler": played(rng.choice((2, 4, 8), frames), 0),
            "always_8": played(np.full(frames, 8), 1),
            "optimum": played(np.resize((2, 8), frames), 0),
        },
    }


def made_up_choices():
    counts = np.zeros((2, 3, 3), int)
    counts[1, 0] = 6, 2, 2
    counts[0, 2] = 0, 0, 40
    signal = {"title": "signal-to-noise", "unit": "", "edges": [0.1, 0.2, 0.3, 0.4]}
    distance = {"title": "mean predicted distance", "unit": "m", "edges": [4.0, 6.0, 8.0]}
    margin = {"title": "below the laser's trip", "unit": "K", "edges": [32.0, 48.0, 64.0, None]}
    price = {"title": "price of power", "unit": "", "marks": [0.01, 0.1]}
    return {
        "maps": [
            {"x": signal, "y": distance, "counts": counts.tolist()},
            {"x": margin, "y": price, "counts": counts.tolist()},
        ]
    }


def made_up_strip(height=24, width=32):
    count = 2 * len(FAMILIES)
    shape = (count, height, width)
    rng = np.random.default_rng(2)
    truth = np.broadcast_to(np.geomspace(1, 40, height)[None, ::-1, None], shape).astype("float32")
    corrected = truth + rng.normal(0, 0.1, shape).astype("float32")
    return Strip(
        gray_lsb=(rng.random(shape) * 4095).astype(np.uint16),
        wrapped_m=np.mod(corrected, 6.2457).astype("float32"),
        corrected_m=corrected,
        truth_m=truth,
        valid=truth < 30,
        shots=np.resize((2, 4, 8, 0), count),
        frame=np.arange(count),
        depth_mae_m=np.where(np.resize((0, 0, 0, 1), count), np.nan, 0.1),
        temperature_k=np.full(count, 320.0),
        laser_energy_j=np.linspace(0.5, 1.5, count),
        optimum_shots=np.full(count, 4),
        optimum_energy_j=np.linspace(0.25, 0.75, count),
        family=np.repeat(FAMILIES, 2),
        drive=np.full(count, 1003),
        unambiguous_m=np.float64(6.2457),
        max_range_m=np.float64(25.0),
    )
