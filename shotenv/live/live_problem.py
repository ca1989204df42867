"""The decision problem with a camera in place of a bank: what is seen of each frame as it comes."""

from __future__ import annotations

import torch
from torch import Tensor

from shotenv.bank import Clip, KeptPredictions
from shotenv.config import EnvConfig
from shotenv.decision import (
    SEEN_FEATURES,
    Acquisition,
    Drive,
    Measurement,
    Problem,
    acquire_depths,
    check_settings,
    look_at_scenes,
    told_by,
    unscored,
)
from shotenv.laser import NetworkWork
from shotenv.live.live_bank import FAMILY, LiveBank
from shotenv.sensor import description_of
from unwrap.networks import Unwrapper
from unwrap.signal import Shots

Networks = tuple[Unwrapper, Unwrapper | None]
"""The one that looks at the gray image alone; the one that needs samples, where it is chosen."""


def live_problem(bank: LiveBank, config: EnvConfig, networks: Networks) -> Problem:
    """The problem of a drive that has not begun; `look` fills in what is seen of each frame.

    Raises
    ------
    BankError
        The configuration's laser or sensor cannot be in use as the camera is.
    """
    check_settings(bank, bank.clips, config)
    gray, fusion = networks
    size = bank.height, bank.width
    # One frame's memory stands for all: none but the last is looked at.
    maps = torch.full((2, 1, *size), torch.nan, dtype=torch.float16).expand(-1, len(bank), -1, -1)
    kept = KeptPredictions(*maps)
    return Problem(
        config=config,
        bank=bank,
        clips=bank.clips,
        kept=kept,
        fusion=fusion,
        # Without clips nothing is seen yet.
        scenes=look_at_scenes(bank, (), kept, config.sensor),
        gray_exposure_s=torch.from_numpy(bank.gray_exposure_s),
        network_work=NetworkWork(
            gray=gray.macs(*size), samples=0.0 if fusion is None else fusion.macs(*size)
        ),
        description=description_of(config.sensor),
    )


def look(problem: Problem, bank: LiveBank, gray: Unwrapper) -> None:
    """Predict the frame that is there, and write down what is seen of it."""
    number, kept = bank.number, problem.kept
    assert isinstance(kept, KeptPredictions)  # As `live_problem` has made them.
    predicted = gray.predict(bank.gray(torch.tensor([number])))
    # Rounded as predictions of banks are kept, so that a replay of the recorded drive is the same.
    for maps, found in (
        (kept.distance_m, predicted.distance_m),
        (kept.confidence, predicted.confidence),
    ):
        maps[:1].copy_(found)
    now = Clip(FAMILY, FAMILY, 0, "test", number, 1)
    seen = look_at_scenes(bank, (now,), kept, problem.config.sensor)
    for rows, found in (
        (problem.scenes.features, seen.features),
        (problem.scenes.log_ambient, seen.log_ambient),
    ):
        rows[number] = found[number]


def measure_live(
    problem: Problem, drive: Drive, step: Tensor, shots: Tensor, power_w: Tensor | None = None
) -> tuple[Measurement, Acquisition | None]:
    """Take and correct `shots` [1] samples of the frame that is there; None without laser.

    There is no truth: the error term is 0, whatever is taken, and measures of depth are NaN.
    """
    nothing, count = unscored(1), int(shots)
    if not count:
        return Measurement(nothing, nothing.error, torch.zeros(1, len(SEEN_FEATURES))), None
    counts = [fewer for fewer in Shots if fewer <= count]
    taken = acquire_depths(problem, drive, step, counts, power_w)
    return Measurement(nothing, nothing.error, told_by(problem, taken)), taken[-1]
