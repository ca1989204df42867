"""The splits of a bank as the sources that a network is trained and judged on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from shotenv.bank import Bank, check_fits, gray_differences, open_bank
from shotenv.config import BankConfig, ConfigError, EnvConfig, env_config, find_config, merged
from shotenv.dataset.sensed_frames import SensedFrames
from shotenv.sensor import description_of
from unwrap.training import TrainConfig


def bench_config(sensor: str = "epc660", **fields: Any) -> EnvConfig:
    """Configuration at which networks are trained and measured, whatever drives are like.

    `fields` as for `env_config`.
    """
    config = env_config(sensor=sensor, laser="vcsel_bench", **fields)
    return merged(config, {"sensor": {"integration_s": (5.5e-4, 7.5e-4)}})


def for_sensor(config: TrainConfig) -> TrainConfig:
    """A training with the frequency, ranges and classes of its sensor, where none is chosen.

    Raises
    ------
    ConfigError
        The sensor's file is of no use.
    ValueError
        See `TrainConfig.at_sensor`.
    """
    return config.at_sensor(description_of(bench_config(config.sensor).sensor))


class Splits:
    """Frames of each split of a bank, for one training; see `sources`.

    Pickled it is its configuration: another process opens the bank anew and shares what the system
    holds of its files.
    """

    def __init__(self, config: TrainConfig, bank: Bank, bench: EnvConfig, gray_only: bool) -> None:
        self._config, self._bank = config, bank
        self._bench, self._gray_only = bench, gray_only

    def __call__(self, split: str) -> SensedFrames:
        """The frames of a split."""
        config = self._config
        return SensedFrames(
            self._bank,
            self._bank.frames(split, by=config.split_by),
            self._bench,
            range_m=config.clamp_m,
            truth=config.truth,
            stride=config.stride,
            remembers=config.memory,
            gray_only=self._gray_only,
        )

    def __reduce__(self) -> tuple[Callable[[TrainConfig], Splits], tuple[TrainConfig]]:
        return sources, (self._config,)


def sources(config: TrainConfig) -> Splits:
    """Frames of each split of the bank that a network is trained on; the bank is rendered first.

    A network that looks at the gray image alone is trained on any bank, whatever sensor that was
    rendered for: `gray_differences` tells what its images do not have of the sensor.

    Raises
    ------
    ValueError
        The network looks at samples, and the bank was rendered for another sensor; the message has
        the command that renders one.
    """
    bank, bench = open_bank(config.bank), bench_config(config.sensor)
    gray_only = not config.shown_shots and config.truth == "rendered"
    if not gray_only:
        try:
            check_fits(bank, bench.sensor)
        except ValueError as error:
            assert bank.config is not None  # A bank without one fits everything.
            raise ValueError(f"{error}: {rendering(bank.config, config.sensor)}") from None

    return Splits(config, bank, bench, gray_only)


def gray_warning(config: TrainConfig) -> str | None:
    """What to know where a network learns from gray images of another sensor than its own."""
    bank = open_bank(config.bank)
    differing = gray_differences(bank, bench_config(config.sensor).sensor)
    if not differing or bank.config is None:
        return None
    return (
        f"gray images of bank {bank.name} are those of sensor {bank.config.sensor.name}, which "
        f"{config.sensor} differs from in {', '.join(differing)}"
    )


def rendering(bank: BankConfig, sensor: str) -> str:
    """The command that renders a bank of the same worlds for another sensor."""
    try:
        like = find_config("bank", bank.name)
    except ConfigError:
        like = Path(f"{bank.name}.yaml")  # Of the user's own, wherever it lies.
    name = f"{bank.name}-{Path(sensor).stem}"
    path = find_config("sensor", sensor)
    return f"shotenv render --config {like} --sensor {path} --name {name} --out {name}"
