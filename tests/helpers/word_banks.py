"""Banks of words in memory, and simulated drives recorded into them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import yaml
from torch import Tensor

from shotenv.bank.bank import Clip
from shotenv.bank.files.layout import ClipFacts, TableOfContents
from shotenv.bank.word_bank import ClipSettings, TruthLevel, WordBank
from shotenv.decision.acquire import acquire_depths
from shotenv.decision.problem import Problem, problem_of
from shotenv.decision.transition import drive_of_seed
from unwrap.signal.frames import RawFrame
from unwrap.signal.shots import Shots


@dataclass(frozen=True)
class Recorded:
    """A drive as a camera that knows everything would have recorded it; F frames."""

    raws: dict[Shots, RawFrame]
    gray: Tensor
    truth_m: Tensor
    settings: ClipSettings
    facts: ClipFacts


class Contents(TableOfContents):
    key: str

    @property
    def fingerprint(self) -> str:
        return self.key


class HeldWords(WordBank):
    """A bank of recorded drives, in memory."""

    def __init__(
        self,
        recorded: Sequence[Recorded],
        *,
        key: str,
        truth_level: TruthLevel = "external",
        answers: tuple[Shots, ...] = tuple(Shots),
    ) -> None:
        height, width = recorded[0].gray.shape[-2:]
        contents = Contents(
            name="held",
            height=height,
            width=width,
            config=None,
            clips=tuple(one.facts for one in recorded),
            key=key,
        )
        super().__init__(Path("held"), contents)
        self._level, self._answers, self.asked = truth_level, answers, []
        self._settings = {one.facts.name: one.settings for one in recorded}
        self._raws = {
            shots: RawFrame(
                torch.cat([one.raws[shots].dcs_lsb for one in recorded]),
                torch.cat([one.raws[shots].saturated for one in recorded]),
            )
            for shots in answers
        }
        self._gray = torch.cat([one.gray for one in recorded])
        self._truth_m = torch.cat([one.truth_m for one in recorded])

    @property
    def truth_level(self) -> TruthLevel:
        return self._level

    @property
    def answers(self) -> tuple[Shots, ...]:
        return self._answers

    def words(self, frames: Tensor, shots: Shots) -> RawFrame:
        self.asked.append(shots)
        raw = self._raws[shots]
        return RawFrame(raw.dcs_lsb[frames], raw.saturated[frames])

    def settings(self, clip: Clip) -> ClipSettings:
        return self._settings[clip.name]

    def distance_m(self, indices: Tensor) -> Tensor:
        return self._truth_m[indices]

    def gray(self, indices: Tensor) -> Tensor:
        return self._gray[indices]


def record(problem: Problem, seed: int, *, name: str = "recorded") -> Recorded:
    """All frames of the drive `seed`, the one that is seen after the last as well."""
    bank, drive = problem.bank, drive_of_seed(problem, seed)
    frames = drive.frames[0]
    steps = torch.arange(len(frames))
    whole = replace(
        drive,
        **{
            field: getattr(drive, field).expand(len(steps), *getattr(drive, field).shape[1:])
            for field in ("seed", "frames", "laser_power_w", "integration_s", "drift_m")
        },
        offset_left_lsb=drive.offset_left_lsb.expand(len(steps)),
        sensitivity=type(drive.sensitivity)(
            drive.sensitivity.ambient_e.expand(len(steps)),
            drive.sensitivity.active_e.expand(len(steps)),
        ),
    )
    taken = acquire_depths(problem, whole, steps, tuple(Shots))
    rows = frames.numpy()
    facts = ClipFacts(
        name=name,
        family="street",
        seed=seed,
        split="test",
        frames=len(frames),
        time_s=tuple(range(len(frames))),
        ego_speed_m_s=tuple(bank.ego_speed_m_s[rows].tolist()),
        yaw_rate_rad_s=tuple(bank.yaw_rate_rad_s[rows].tolist()),
        gray_exposure_s=tuple(bank.gray_exposure_s[rows].tolist()),
    )
    scored = taken[0].scored
    return Recorded(
        raws={shots: one.raw for shots, one in zip(Shots, taken, strict=True)},
        gray=bank.gray(frames),
        truth_m=taken[0].truth_m.where(scored, torch.nan),
        settings=ClipSettings(
            float(drive.laser_power_w),
            float(drive.integration_s),
            float(drive.ambient_k),
            float(drive.drift_m),
            drive.offsets.calibrated_lsb[0],
        ),
        facts=facts,
    )


def flags_of(raws: dict[Shots, RawFrame]) -> np.ndarray:
    """A flag of each of eight samples [F, 8, H, W] by which prefixes are flagged as they are."""
    eight = raws[Shots.EIGHT].saturated.numpy()
    flags = np.zeros((len(eight), 8, *eight.shape[1:]), bool)
    for shots, raw in raws.items():
        # That it came with the last of them does not show in a prefix.
        flags[:, shots - 1] = raw.saturated.numpy()
    return flags


CAMERA = """name: bench
container: arrays
layout: {axes: FPHW}
words: {bits: 12, signed: true}
samples: {phase_deg: [0, 90, 180, 270]}
passive: {where: recording, highest: 4095}
lens: {horizontal_fov_deg: 60}
"""
"""A camera that stores what is recorded of a drive, in plain arrays."""


def write_folder(
    folder: Path, recorded: Sequence[Recorded], *, samples: int = 8, truth: bool = True, **common
) -> Path:
    """Recordings as `bank import` takes them, and all that is told beside them: `folder`."""
    hertz = "[24.0e+6, 10.0e+6]" if samples == 8 else "[24.0e+6]"
    folder.mkdir(parents=True)
    (folder / "camera").mkdir()
    (folder / "camera" / "bench.yaml").write_text(f"{CAMERA}frequencies_hz: {hertz}\n")
    rows = []
    for number, one in enumerate(recorded):
        name, facts = f"drive_{number}", one.facts
        eight = one.raws[Shots.EIGHT]
        np.savez(
            folder / f"{name}.npz",
            dcs=eight.dcs_lsb[:, :samples].numpy().astype(np.int16),
            gray=one.gray.numpy(),
            saturated=flags_of(one.raws)[:, :samples],
            timestamp_s=100.0 + 0.1 * np.arange(len(one.gray)),
        )
        np.save(folder / f"{name}_truth.npy", one.truth_m.numpy())
        np.save(folder / f"{name}_offset.npy", one.settings.offset_lsb.numpy())
        columns = ("ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
        table = [",".join(columns)]
        for row in zip(*(getattr(facts, column) for column in columns), strict=True):
            table.append(",".join(map(repr, row)))
        (folder / f"{name}_ego.csv").write_text("\n".join(table) + "\n")
        rows.append(
            {
                "file": f"{name}.npz",
                **({"truth": f"{name}_truth.npy"} if truth else {}),
                "ego": f"{name}_ego.csv",
                "offset": f"{name}_offset.npy",
                "family": facts.family,
                "seed": facts.seed,
                **{
                    field: getattr(one.settings, field)
                    for field in ("laser_power_w", "integration_s", "ambient_k", "shift_m")
                },
            }
        )
    told = {"name": "bench", "recordings": rows, **common}
    (folder / "recordings.yaml").write_text(yaml.safe_dump(told))
    return folder


def replayed_problem(simulated: Problem, recorded: Sequence[Recorded], **kind) -> Problem:
    """The problem of `simulated` with these recordings in place of its bank; `kind` of the bank."""
    key = "".join(f"{one.facts.name}{one.facts.frames}" for one in recorded)
    return problem_of(HeldWords(recorded, key=key, **kind), simulated.config)
