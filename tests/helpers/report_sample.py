"""Made-up results in the shape that an evaluation writes."""

import numpy as np

from agents.report.results import Strip
from shotenv.config.families import FAMILIES

NAMES = ("ppo", "snr_threshold", "cycle", "random", "always_2", "always_4", "always_8")


def made_up_interval(mean, width):
    return {"mean": mean, "low": mean - width, "high": mean + width}


def made_up_results(difference=(6.0, 2.0, 9.0), f1_hz=24e6, split="test"):
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
            "tripped_share": made_up_interval(0.01 * shots, 0.005),
            "shots_share": shares[name],
        }
    # The rules that say what they do have one; that it has a "<" tells whether the page escapes it.
    policies["snr_threshold"]["rule"] = "8 DCS where signal_to_noise < -0.30, else 2"
    pair = dict(zip(("difference", "low", "high"), difference, strict=True))
    zero = {"difference": 0.0, "low": 0.0, "high": 0.0}
    return {
        "policies": policies,
        "paired_to_best_fixed": dict.fromkeys(NAMES, zero) | {"ppo": pair},
        "paired_to_best_rival": {"difference": 0.4, "low": -0.2, "high": 1.1},
        "best_rival": "cycle",
        "every": 1,
        "drives": 24,
        "seeds": list(range(1000, 1024)),
        "versions": {"shotenv": "0.1.0", "torch": "2.13.0"},
        "scheduler": "ppo",
        "best_fixed": "always_4",
        "confidence": 0.95,
        "families": {
            name: {family: rng.dirichlet((1, 1, 1)).tolist() for family in FAMILIES}
            for name in NAMES
        },
        "config": {"env": {"sensor": {"f1_hz": f1_hz}}, "study": {"split": split}},
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
        }

    return {
        "drive": 1003,
        "frame_rate_hz": 10.0,
        "trip_k": 330.0,
        "release_k": 325.0,
        "family": family.tolist(),
        "policies": {
            "ppo": played(rng.choice((2, 4, 8), frames), 0),
            "always_4": played(np.full(frames, 4), 1),
        },
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
        family=np.repeat(FAMILIES, 2),
        drive=np.full(count, 1003),
        unambiguous_m=np.float64(6.2457),
        max_range_m=np.float64(25.0),
    )
