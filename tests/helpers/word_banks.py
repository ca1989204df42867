"""Banks of words in memory, and simulated drives recorded into them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor

from shotenv.bank.bank import Clip
from shotenv.bank.layout import ClipFacts, TableOfContents
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


def replayed_problem(simulated: Problem, recorded: Sequence[Recorded], **kind) -> Problem:
    """The problem of `simulated` with these recordings in place of its bank; `kind` of the bank."""
    key = "".join(f"{one.facts.name}{one.facts.frames}" for one in recorded)
    return problem_of(HeldWords(recorded, key=key, **kind), simulated.config)
