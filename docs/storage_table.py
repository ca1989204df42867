"""The tables of `docs/scale.md`, section Storage: what packing a bank saves, and what it costs.

python docs/storage_table.py --measure --bank wide    # measures first, some five minutes
python docs/storage_table.py

One clip of each family is written both ways into a temporary folder, packed and mapped, and read,
sensed and played from there. What was measured is kept in `docs/scale/storage.json`.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import torch
from marked_tables import marked
from torch import Tensor

DOCS = Path(__file__).parent
PAGE, NUMBERS = DOCS / "scale.md", DOCS / "scale" / "storage.json"
sys.path.insert(0, str(DOCS.parent))  # for the benchmarks, which are not installed

from benchmarks.stepping import NEVER_TRIPS  # noqa: E402
from shotenv.bank import Bank, Clip, open_bank  # noqa: E402
from shotenv.bank.files import ARRAYS, write_clip, write_manifest  # noqa: E402
from shotenv.bank.files.packed import LIGHT, _planes, _zstd  # noqa: E402
from shotenv.config import merged  # noqa: E402
from shotenv.env import ShotScheduleVectorEnv  # noqa: E402
from shotenv.sensor import (  # noqa: E402
    Exposure,
    Purpose,
    acquire,
    description_of,
    draw_offsets,
    incident_light,
    noise_samples,
    scored_pixels,
    sensitivity,
    stream,
)
from unwrap.depth import correct  # noqa: E402
from unwrap.signal import Shots  # noqa: E402
from unwrap.support import progress, write_json  # noqa: E402

LEVELS = {"dim": (1.0, 1e-4), "usual": (6.3, 6.4e-4), "bright": (10.0, 2e-3)}
"""Laser power while on, W, and integration time of a sample, s."""
FRAMES_LOOKED_AT = 4
"""Of each clip, where errors and sizes are measured."""
JUMP_M = 1.0
"""A depth that differs by more has another wrap."""
DRIVES, STEPS, TURNS, READS = 16, 40, 5, 200


def two_banks(source: Bank, folder: Path) -> tuple[Bank, Bank]:
    """One test or shift clip of each family, mapped and packed."""
    chosen = {
        clip.family: record
        for clip, record in zip(source.clips, source.manifest.clips, strict=True)
        if clip.split in ("test", "shift")
    }
    banks = []
    for storage in ("float32", "float16"):
        records, where = [], folder / storage
        for about in chosen.values():
            arrays = {
                name: np.load(source.folder / about.folder / f"{name}.npy") for name in ARRAYS
            }
            facts = about.model_dump(exclude={"sha256", "folder", "frames"}) | {"split": "test"}
            records.append(write_clip(where / about.folder, arrays, facts, storage=storage))
        config = merged(source.config, {"storage": storage})
        write_manifest(where, source.name, records, (source.height, source.width), config)
        banks.append(open_bank(where))
    return banks[0], banks[1]


def sizes(bank: Bank, tick: Callable[[], object]) -> list[dict[str, Any]]:
    """Bytes of a frame, and time to make it, in each of several ways."""
    ways: dict[str, tuple[bool, int | None]] = {
        "float32, as in memory": (False, None),
        "float32, compressed": (False, 3),
        "float16, as in memory": (True, None),
        "float16, compressed at level 1": (True, 1),
        "float16, compressed at level 3": (True, 3),
        "float16, compressed at level 9": (True, 9),
    }
    rows = []
    for way, (half, level) in ways.items():
        total, write_s, frames = 0, 0.0, 0
        for index in frames_of(bank):
            frames += 1
            for name, array in arrays_of(bank, index).items():
                start = thread_time()
                values = array.astype(np.float16) if half and name in LIGHT else array
                content = values.tobytes()
                if level is not None:
                    content = _zstd().compress(_planes(values), level)
                write_s += thread_time() - start
                total += len(content)
        rows.append({"way": way, "bytes": total / frames, "make_ms": 1e3 * write_s / frames})
        tick()
    return rows


def frames_of(bank: Bank) -> Iterator[int]:
    """Some frames of each clip."""
    for clip in bank.clips:
        yield from looked_at(clip)


def looked_at(clip: Clip) -> range:
    """Bank indices of some frames of a clip."""
    return range(clip.start, clip.start + clip.frames, clip.frames // FRAMES_LOOKED_AT)


def arrays_of(bank: Bank, index: int) -> dict[str, np.ndarray]:
    """Arrays of a frame, as they are written; light by the power of two that its clip has."""
    exposure, one = bank.exposure(torch.tensor([index])), torch.tensor([index])
    arrays = {
        name: np.ascontiguousarray(getattr(exposure, name)[0].numpy())
        for name in ARRAYS
        if name != "gray"
    }
    scale = {name: 2.0**15 / np.abs(arrays[name]).max(initial=1e-30) for name in LIGHT}
    for name in LIGHT:
        arrays[name] = arrays[name] * np.float32(2.0 ** np.floor(np.log2(scale[name])))
    return arrays | {"gray": np.ascontiguousarray(bank.gray(one)[0].numpy())}


def reading(mapped: Bank, packed_bank: Bank) -> dict[str, float]:
    """Milliseconds to read a frame, in order and at random, once its file is in memory."""
    random = np.random.default_rng(0).integers(0, len(mapped), READS).tolist()
    orders = {"order": list(range(min(READS, len(mapped)))), "random": random}
    found = {}
    for order, indices in orders.items():
        for name, bank in (("mapped", mapped), ("packed", packed_bank)):
            times = []
            for _ in range(3):
                start = thread_time()
                for index in indices:
                    frame = bank.frame(index)
                    # A mapped array is a view: what is not touched is not read.
                    float(frame.exposure.correlation.sum() + frame.exposure.active.sum())
                    float(frame.exposure.ambient.sum())
                times.append(1e3 * (thread_time() - start) / len(indices))
            found[f"{name}_{order}_ms"] = min(times)
    return found


def depth_of(exposure: Exposure, sensor: Any, level: str, seed: int) -> tuple[Tensor, Tensor]:
    """Depth of eight samples, and where it is valid and counts, both [1, H, W]."""
    height, width = exposure.distance_m.shape[-2:]
    power_w, integration_s = (torch.tensor([value]) for value in LEVELS[level])
    light = incident_light(exposure, sensitivity(sensor, power_w, integration_s))
    offsets = draw_offsets(sensor, height, width, generator=stream(Purpose.OFFSETS, 0))
    noise = noise_samples([seed], [0], height, width)
    raw = acquire(light, sensor, shots=Shots.EIGHT, noise=noise, offsets=offsets)
    depth = correct(raw, None, description_of(sensor))
    return depth.distance_m, depth.valid & scored_pixels(light, exposure.distance_m, sensor)


def errors(mapped: Bank, packed_bank: Bank, tick: Callable[[], object]) -> list[dict[str, Any]]:
    """What rounding the light does to depth, beside the sensor's noise, by family and level."""
    assert mapped.config is not None
    sensor, rows = mapped.config.sensor, []
    for clip in mapped.clips:
        for level in LEVELS:
            changes, noises, jumps, pixels = [], [], 0, 0
            for one in torch.tensor(list(looked_at(clip))).split(1):
                exact, rounded = mapped.exposure(one), packed_bank.exposure(one)
                # Of the same noise, and of other noise.
                depth, counts = depth_of(exact, sensor, level, 1)
                changed, also = depth_of(rounded, sensor, level, 1)
                other, too = depth_of(exact, sensor, level, 2)
                both, pair = counts & also, counts & too
                change, noise = (changed - depth)[both], (other - depth)[pair]
                pixels += int(both.sum())
                jumps += int((change.abs() > JUMP_M).sum()) + int((counts != also).sum())
                changes.append(change[change.abs() <= JUMP_M])
                noises.append(noise[noise.abs() <= JUMP_M])
            change, noise = torch.cat(changes), torch.cat(noises) / 2**0.5
            rows.append(
                {
                    **{"family": clip.family, "level": level, "pixels": pixels},
                    "rounding_mm": 1e3 * rms(change),
                    "noise_mm": 1e3 * rms(noise),
                    "largest_mm": 1e3 * float(change.abs().max()) if len(change) else 0.0,
                    "jumps": jumps,
                }
            )
            tick()
    return rows


def rms(values: Tensor) -> float:
    """Root mean square; 0 of none."""
    return float(values.double().square().mean().sqrt()) if len(values) else 0.0


def playing(mapped: Bank, packed_bank: Bank, tick: Callable[[], object]) -> list[dict[str, Any]]:
    """Steps a second of one drive and of many, random actions, turn by turn."""
    rows = []
    for drives in (1, DRIVES):
        steps = STEPS * 4 if drives == 1 else STEPS
        players = [player(bank, drives) for bank in (mapped, packed_bank)]
        for play in players:
            play(4)
        rates: list[list[float]] = [[], []]
        for _ in range(TURNS):
            for kept, play in zip(rates, players, strict=True):
                start = thread_time()
                play(steps)
                kept.append(drives * steps / (thread_time() - start))
        rows.append(
            {
                "drives": drives,
                "mapped": float(np.median(rates[0])),
                "packed": float(np.median(rates[1])),
            }
        )
        tick()
    return rows


def player(bank: Bank, drives: int) -> Callable[[int], None]:
    """Plays random actions on every pixel."""
    envs = ShotScheduleVectorEnv(drives, bank=str(bank.folder), split="test", **NEVER_TRIPS)
    random = np.random.default_rng(0)
    envs.reset(seed=0)

    def play(steps: int) -> None:
        for _ in range(steps):
            envs.step(random.integers(0, 3, drives))

    return play


def measure(name: str) -> dict[str, Any]:
    """All of it, on one thread."""
    torch.set_num_threads(1)
    source = open_bank(name, render=False)
    assert source.config is not None
    with tempfile.TemporaryDirectory() as scratch:
        # Predictions for the banks made here are of no use to anyone else.
        os.environ["SHOTENV_CACHE"] = scratch
        mapped, packed_bank = two_banks(source, Path(scratch))
        total = 6 + len(mapped.clips) * len(LEVELS) + 2
        with progress(total, "measuring", "part") as bar:
            found = {
                "bank": {
                    "name": source.name,
                    "fingerprint": source.fingerprint,
                    "clips": len(mapped.clips),
                    "pixels": [source.width, source.height],
                    "mapped_bytes": bytes_of(mapped) / len(mapped),
                    "packed_bytes": bytes_of(packed_bank) / len(packed_bank),
                },
                "sizes": sizes(mapped, bar.update),
                "reading": reading(mapped, packed_bank),
                "errors": errors(mapped, packed_bank, bar.update),
                "playing": playing(mapped, packed_bank, bar.update),
            }
    return found


def bytes_of(bank: Bank) -> int:
    """Bytes of a bank's arrays on disk."""
    return sum(path.stat().st_size for path in bank.folder.rglob("clips/*/*"))


def size_table(found: dict[str, Any]) -> str:
    """Ways to store a frame."""
    whole = found["sizes"][0]["bytes"]
    lines = ["| a frame as | kB | of float32 | ms to make it |", "|---|---|---|---|"]
    for one in found["sizes"]:
        lines.append(
            f"| {one['way']} | {one['bytes'] / 1e3:.0f} | {one['bytes'] / whole:.2f} | "
            f"{one['make_ms']:.1f} |"
        )
    return "\n".join(lines)


def error_table(found: dict[str, Any]) -> str:
    """Rounding beside noise: root mean squares, over the families' pixels and the worst family."""
    lines = [
        "| laser, integration | noise of 8 samples | rounding adds | of the noise, worst family | "
        "other wrap or validity |",
        "|---|---|---|---|---|",
    ]
    for level, (power_w, integration_s) in LEVELS.items():
        rows = [one for one in found["errors"] if one["level"] == level and one["pixels"]]
        pixels = sum(one["pixels"] for one in rows)
        noise, added = (
            (sum(one[key] ** 2 * one["pixels"] for one in rows) / pixels) ** 0.5
            for key in ("noise_mm", "rounding_mm")
        )
        worst = max(rows, key=lambda one: one["rounding_mm"] / one["noise_mm"])
        jumps = sum(one["jumps"] for one in rows) / pixels
        lines.append(
            f"| {power_w:g} W, {1e3 * integration_s:g} ms | {noise:.1f} mm | {added:.2f} mm | "
            f"{worst['rounding_mm'] / worst['noise_mm']:.3f} ({worst['family']}) | "
            f"{100 * jumps:.3f} % |"
        )
    return "\n".join(lines)


def pace_table(found: dict[str, Any]) -> str:
    """Reading and playing."""
    read = found["reading"]
    lines = ["| | float32, mapped | float16, packed |", "|---|---|---|"]
    for order, words in (("order", "in order"), ("random", "at random")):
        mapped, other = read[f"mapped_{order}_ms"], read[f"packed_{order}_ms"]
        lines.append(f"| reading a frame {words} | {mapped:.2f} ms | {other:.2f} ms |")
    for one in found["playing"]:
        words = "one drive" if one["drives"] == 1 else f"a vector of {one['drives']}"
        lines.append(
            f"| playing {words} | {one['mapped']:.0f} steps/s | {one['packed']:.0f} steps/s |"
        )
    return "\n".join(lines)


def filled(page: str, found: dict[str, Any]) -> str:
    """`page` with the tables between their marks."""
    for name, table in (("sizes", size_table), ("rounding", error_table), ("pace", pace_table)):
        page = marked(page, name, table(found), PAGE)
    return page


def main() -> None:
    """Measure where asked to, then write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--measure", action="store_true", help="measure anew")
    parser.add_argument("--bank", default="wide", help="a rendered bank, mapped")
    arguments = parser.parse_args()
    if arguments.measure:
        write_json(NUMBERS, measure(arguments.bank))
    found = json.loads(NUMBERS.read_text(encoding="utf-8"))
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")


if __name__ == "__main__":
    main()
