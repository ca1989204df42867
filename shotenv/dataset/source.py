"""The splits of a bank as the sources that a network is trained and judged on."""

from __future__ import annotations

from collections.abc import Callable

from shotenv.bank import open_bank
from shotenv.config import env_config
from shotenv.dataset.sensed_frames import SensedFrames
from unwrap.training import TrainConfig


def sources(config: TrainConfig) -> Callable[[str], SensedFrames]:
    """Frames of each split of the bank that a network is trained on; the bank is rendered first."""
    bank, sensor = open_bank(config.bank), env_config(sensor=config.sensor)

    def frames(split: str) -> SensedFrames:
        return SensedFrames(
            bank,
            bank.frames(split, by=config.split_by),
            sensor,
            range_m=config.clamp_m,
            truth=config.truth,
            stride=config.stride,
            remembers=config.memory,
        )

    return frames
