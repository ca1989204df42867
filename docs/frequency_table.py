"""How far the distance of a gray network, trained at 24 MHz, unwraps samples at other frequencies.

python docs/frequency_table.py

A network of the gray image alone does not know the modulation frequency. Its stored distances on a
thinned bank are merged with samples that are simulated at each frequency, of the bank's own light,
distances and sunlight: four, with noise, without overtones and multipath. Intervals are over clips.
What was measured goes to a JSON file (`--json`), the table into docs/correct_and_export.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from marked_tables import marked, said
from torch import Tensor

from agents.config import StudyConfig
from agents.evaluation import ratio, study_interval
from shotenv.bank import StoredNetwork, ThinnedBank, open_bank
from shotenv.config import LaserConfig, SensorConfig, find_config, read_config
from shotenv.sensor import Exposure, description_of, expose, sample_noise_lsb
from unwrap.depth import correct
from unwrap.signal import TWO_PI, Shots, demodulation_phase_rad, unambiguous_range_m
from unwrap.support import write_json, write_text

PAGE: Final = Path(__file__).with_name("correct_and_export.md")
KEPT: Final = Path(__file__).with_name("frequency_table.json")
FREQUENCIES_HZ: Final = (12e6, 20e6, 24e6, 40e6, 60e6, 80e6, 100e6)
BANK, SPLIT, SENSOR, LASER = "pocket", "test", "epc660", "vcsel"
FARTHEST_M: Final = 25.0
"""Scored range, that of the environment."""
Row = dict[str, Any]


def sensor_at(frequency_hz: float) -> SensorConfig:
    """The sensor with another first frequency, without overtones; all wrapped distances count."""
    sensor = read_config(SensorConfig, find_config("sensor", SENSOR))
    range_m = unambiguous_range_m(frequency_hz)
    changed = {
        "f1_hz": frequency_hz,
        "f2_hz": frequency_hz / 2,  # Is not used: four samples are taken.
        "harmonic_strength": 0.0,
        "saturation_range_m": range_m,
        "max_range_m": range_m,
    }
    return SensorConfig.model_validate({**sensor.model_dump(), **changed})


def at_frequency(exposure: Exposure, frequency_hz: float) -> Exposure:
    """The light of a bank as the samples at another frequency would see it: the direct path."""
    phase_rad = exposure.distance_m.nan_to_num(posinf=0.0).double()
    phase_rad *= TWO_PI / unambiguous_range_m(frequency_hz)
    angles = [phase_rad - demodulation_phase_rad(k) for k in range(Shots.FOUR)]
    correlation = exposure.active.unsqueeze(1) * torch.stack(angles, 1).cos().float()
    return Exposure(correlation, exposure.active, exposure.ambient, exposure.distance_m)


def measured(frequencies_hz: Sequence[float]) -> dict[str, Any]:
    """A row for each network and frequency."""
    bank = open_bank(BANK)
    assert isinstance(bank, ThinnedBank)
    frames = bank.frames(SPLIT)
    rows = [
        row(bank, frames, stored, frequency_hz)
        for stored in bank.manifest.networks
        for frequency_hz in frequencies_hz
    ]
    clips = {bank.clips[number].name for number in clips_of(bank, frames)}
    told = {"bank": BANK, "split": SPLIT, "sensor": SENSOR, "laser": LASER}
    return {**told, "frames": len(frames), "clips": len(clips), "rows": rows}


def clips_of(bank: ThinnedBank, frames: Tensor) -> np.ndarray:
    """Number of the clip of each frame."""
    return np.searchsorted([clip.start for clip in bank.clips], frames.numpy(), side="right") - 1


def row(bank: ThinnedBank, frames: Tensor, stored: StoredNetwork, frequency_hz: float) -> Row:
    """What merging brings at one frequency, over the valid pixels of known distance."""
    sensor = sensor_at(frequency_hz)
    exposure, range_m = bank.exposure(frames), unambiguous_range_m(frequency_hz)
    truth_m, predicted_m = exposure.distance_m, bank.predictions(stored).distance_of(frames)
    # The same laser and noise for every row: they differ by what they are about.
    generator = torch.Generator().manual_seed(0)
    settings = torch.rand(2, len(frames), generator=generator, dtype=torch.float64)
    laser = read_config(LaserConfig, find_config("laser", LASER))
    power_w = between(laser.optical_power_w, settings[0])
    integration_s = between(sensor.integration_s, settings[1])
    noise = torch.randn(len(frames), Shots.FOUR, 2, *truth_m.shape[1:], generator=generator)
    raw = expose(
        at_frequency(exposure, frequency_hz),
        sensor,
        shots=Shots.FOUR,
        laser_power_w=power_w,
        integration_s=integration_s,
        noise=noise,
        offsets=None,
    )
    exposure_s = torch.as_tensor(bank.gray_exposure_s)[frames]
    noise_lsb = sample_noise_lsb(bank.gray(frames), exposure_s, integration_s, sensor)
    found = correct(raw, predicted_m, description_of(sensor), noise_lsb=noise_lsb)
    scored = found.valid & (truth_m <= FARTHEST_M)
    off_m = (found.distance_m - truth_m).abs()
    alone_m = predicted_m - truth_m
    # Half an unambiguous range off, it is the next wrap; below the first there is none.
    first = truth_m < range_m
    expected = (alone_m < range_m / 2) & ((alone_m > -range_m / 2) | first)
    clips, study = clips_of(bank, frames), StudyConfig()

    def over_clips(values: Tensor) -> dict[str, float]:
        sums = [
            np.bincount(clips, (maps * scored).flatten(1).double().sum(1).numpy())
            for maps in (values.nan_to_num(posinf=0.0), torch.ones_like(truth_m))
        ]
        seen = sums[1] > 0
        return study_interval(ratio, study, sums[0][seen], sums[1][seen]).named("mean")

    return {
        "network": stored.name,
        "frequency_hz": frequency_hz,
        "pixels": int(scored.sum()),
        "right": over_clips((off_m < range_m / 2).float()),
        "expected": over_clips(expected.float()),
        "mae_m": over_clips(off_m),
        "alone_mae_m": over_clips(alone_m.abs()),
    }


def between(ends: tuple[float, float], share: Tensor) -> Tensor:
    """Values between the ends of a range."""
    return ends[0] + (ends[1] - ends[0]) * share


def table(found: Mapping[str, Any]) -> str:
    """The table, and what it was measured on."""
    rows = found["rows"]
    networks = list(dict.fromkeys(one["network"] for one in rows))
    alone = " and ".join(
        f"{name} {said(rows_of(rows, name)[0]['alone_mae_m'], 1, 2, ' m')}" for name in networks
    )
    heads = [f"{name}: {what}" for name in networks for what in ("right wrap", "expected", "error")]
    lines = [
        f"{found['frames']} frames of {found['clips']} clips, split `{found['split']}`, bank "
        f"`{found['bank']}`, sensor `{found['sensor']}`; in brackets 95 % intervals over clips. "
        f"Mean error of the distances before merging: {alone}.",
        "",
        f"| frequency | unambiguous range | {' | '.join(heads)} |",
        f"|---|---|{'---|' * len(heads)}",
    ]
    for hz in dict.fromkeys(one["frequency_hz"] for one in rows):
        cells = [f"{hz / 1e6:g} MHz", f"{unambiguous_range_m(hz):.2f} m"]
        for one in rows:
            if one["frequency_hz"] == hz:
                cells += [
                    said(one["right"], 100, 1, " %"),
                    f"{100 * one['expected']['mean']:.1f} %",
                    said(one["mae_m"], 1, 2, " m"),
                ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def rows_of(rows: Sequence[Row], network: str) -> list[Row]:
    """Rows of one network."""
    return [one for one in rows if one["network"] == network]


def filled(page: str, found: Mapping[str, Any]) -> str:
    """`page` with the table between its marks."""
    return marked(page, "frequencies", table(found), PAGE)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and write what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, default=KEPT)
    kept = parser.parse_args(arguments).json
    torch.set_num_threads(1)
    write_json(kept, measured(FREQUENCIES_HZ))
    # From the file, as a test reads it: numbers of JSON are those of the page.
    found = json.loads(kept.read_text(encoding="utf-8"))
    write_text(PAGE, filled(PAGE.read_text(encoding="utf-8"), found))


if __name__ == "__main__":
    main()
