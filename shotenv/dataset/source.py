"""The splits of a bank as the sources that a network is trained and judged on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from shotenv.bank import open_bank
from shotenv.config import EnvConfig, env_config, merged
from shotenv.dataset.sensed_frames import SensedFrames
from unwrap.training import TrainConfig


def bench_config(sensor: str = "epc660", **fields: Any) -> EnvConfig:
    """Configuration at which networks are trained and measured, whatever drives are like.

    `fields` as for `env_config`.
    """
    config = env_config(sensor=sensor, laser="vcsel_bench", **fields)
    return merged(config, {"sensor": {"integration_s": (5.5e-4, 7.5e-4)}})


def sources(config: TrainConfig) -> Callable[[str], SensedFrames]:
    """Frames of each split of the bank that a network is trained on; the bank is rendered first."""
    bank, bench = open_bank(config.bank), bench_config(config.sensor)

    def frames(split: str) -> SensedFrames:
        return SensedFrames(
            bank,
            bank.frames(split, by=config.split_by),
            bench,
            range_m=config.clamp_m,
            truth=config.truth,
            stride=config.stride,
            remembers=config.memory,
        )

    return frames
