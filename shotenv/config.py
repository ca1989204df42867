"""Typed configuration: one frozen pydantic model per section, read from YAML by jsonargparse.

A section is given as a *name* (`"epc660"`, a file in `configs/sensor/`), a *path* to a YAML
file, or a *mapping* of plain values that overrides the section's default file. Each number's
unit is in its name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import Field, ValidationError, model_validator

from shotenv.section import Fraction, NonNegative, Positive, Range, Section, check_range
from shotenv.sensor_config import SensorConfig

Split = Literal["train", "validation", "test", "shift"]
Family = Literal[
    "sunny_road",
    "overcast_street",
    "garage",
    "tunnel",
    "night_road",
    "warehouse",
    "construction_site",
    "forest_path",
    "snowy_street",
]
FAMILIES: tuple[Family, ...] = ("sunny_road", "overcast_street", "garage", "tunnel", "night_road")
SHIFT_FAMILIES: tuple[Family, ...] = (
    "warehouse",
    "construction_site",
    "forest_path",
    "snowy_street",
)
"""Held out: other geometry, materials and light, and kinds of things that FAMILIES never show."""


ROOM_K = 298.15
"""25 C, at which data sheets state the efficiency of a light source."""


class ConfigError(ValueError):
    """A configuration that cannot be used; the message names field, value and expectation."""


class LaserConfig(Section):
    """The light source: power, efficiency, electronics, heat, trip, ageing and eye safety.

    Derating, efficiency slope, junction stage, ageing and the cap for eyes are off at zero.
    """

    name: str = Field(description="name of the light source")
    optical_power_w: Range = Field((4.0, 10.0), description="mean optical power while on, W")
    efficiency: float = Field(
        0.42, gt=0.0, lt=1.0, description="optical over electrical power at 25 C"
    )
    efficiency_slope_per_k: Fraction = Field(
        0.0, description="share of 1 by which the efficiency falls per kelvin above 25 C"
    )
    derate_k: Positive = Field(325.0, description="optical power falls above this temperature, K")
    derate_per_k: Fraction = Field(0.0, description="share of the power lost per kelvin above")
    derate_floor: Fraction = Field(0.2, gt=0.0, description="least share of the power that stays")
    driver_power_w: NonNegative = Field(2.1, description="modulation driver while integrating, W")
    readout_energy_j: NonNegative = Field(0.26e-3, description="energy of one readout, J")
    static_power_w: NonNegative = Field(62e-3, description="static power of the imager, W")
    energy_per_mac_j: NonNegative = Field(1e-12, description="network energy per MAC, J")
    thermal_resistance_k_per_w: Positive = Field(20.0, description="case to ambient, K/W")
    thermal_time_constant_s: Positive = Field(10.0, description="R times C of the case, s")
    junction_resistance_k_per_w: NonNegative = Field(0.0, description="junction to case, K/W")
    junction_time_constant_s: Positive = Field(1.0, description="R times C of the junction, s")
    ambient_k: Range = Field((293.15, 313.15), description="ambient temperature per drive, K")
    trip_k: Positive = Field(330.0, description="laser switches off at this temperature, K")
    release_k: Positive = Field(325.0, description="laser comes back below this temperature, K")
    ageing_exponent: float = Field(
        0.0, ge=0.0, le=10.0, description="exponent of the current in the rate of ageing"
    )
    activation_energy_ev: float = Field(
        0.0, ge=0.0, le=3.0, description="activation energy of ageing (Arrhenius), eV"
    )
    rated_power_w: Positive = Field(7.0, description="optical power that the life is rated at, W")
    rated_k: Positive = Field(333.15, description="junction temperature of the rated life, K")
    eye_limit_w: NonNegative = Field(0.0, description="cap of the average optical power, W")
    eye_window_s: NonNegative = Field(0.0, description="averaging time of that cap, s")

    @model_validator(mode="after")
    def _consistent(self) -> LaserConfig:
        check_range("optical_power_w", self.optical_power_w)
        check_range("ambient_k", self.ambient_k)
        if self.optical_power_w[0] <= 0:
            raise ValueError(f"optical_power_w is {self.optical_power_w}; expected above 0 W")
        if not self.ambient_k[1] < self.release_k < self.trip_k:
            raise ValueError(
                f"release_k is {self.release_k:g}; expected above the hottest ambient_k "
                f"{self.ambient_k[1]:g} and below trip_k {self.trip_k:g}"
            )
        return self

    @model_validator(mode="after")
    def _effects_possible(self) -> LaserConfig:
        lost = self.efficiency_slope_per_k * max(self.trip_k - ROOM_K, 0.0)
        if lost >= self.efficiency:
            raise ValueError(
                f"efficiency_slope_per_k is {self.efficiency_slope_per_k:g}, which takes {lost:g} "
                f"off the efficiency of {self.efficiency:g} up to trip_k {self.trip_k:g}; "
                "expected something to be left"
            )
        if self.derate_per_k and self.derate_k >= self.trip_k:
            raise ValueError(
                f"derate_k is {self.derate_k:g}; expected below trip_k {self.trip_k:g}, "
                "where the laser is off"
            )
        slowest_s = self.thermal_time_constant_s
        if self.junction_resistance_k_per_w and self.junction_time_constant_s >= slowest_s:
            raise ValueError(
                f"junction_time_constant_s is {self.junction_time_constant_s:g}; expected less "
                f"than that of the case, thermal_time_constant_s {slowest_s:g}"
            )
        if self.eye_limit_w and not self.eye_window_s:
            raise ValueError(
                f"eye_window_s is 0; expected the averaging time of eye_limit_w "
                f"{self.eye_limit_w:g} W, in s"
            )
        return self


class CameraConfig(Section):
    """Image geometry and the instants that are rendered."""

    width: int = Field(160, ge=16, le=1280, description="pixels across")
    height: int = Field(120, ge=16, le=960, description="pixels down")
    horizontal_fov_deg: float = Field(60.0, gt=5, lt=150, description="horizontal field of view")
    samples_per_pixel: int = Field(4, ge=1, description="camera rays per pixel and instant")
    gray_instants: int = Field(4, ge=1, le=16, description="instants that make the gray image")
    bounces: int = Field(2, ge=1, le=8, description="surface hits of a light path")


class WorldConfig(Section):
    """Which worlds are drawn and how a clip moves through them."""

    families: tuple[Family, ...] = Field(FAMILIES, min_length=1, description="scene families")
    speed_m_s: Range = Field((0.0, 15.0), description="ego speed, m/s")
    frame_rate_hz: Positive = Field(10.0, description="frames per second of a clip")
    frames_per_clip: int = Field(16, ge=1, le=4096, description="frames of one clip")

    @model_validator(mode="after")
    def _consistent(self) -> WorldConfig:
        check_range("speed_m_s", self.speed_m_s)
        return self


class BankConfig(Section):
    """A bank of rendered clips: which worlds, how many of each family per split."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_-]{1,80}$", description="name of the bank and of its folder"
    )
    sensor: SensorConfig
    camera: CameraConfig = CameraConfig()
    world: WorldConfig = WorldConfig()
    seed: int = Field(0, ge=0, description="first world seed; clip i has seed + i")
    train_clips: int = Field(8, ge=0, description="training clips of each family")
    validation_clips: int = Field(3, ge=0, description="validation clips of each family")
    test_clips: int = Field(3, ge=0, description="test clips of each family")
    shift_clips: int = Field(0, ge=0, description="clips of each held-out family")

    @property
    def clips(self) -> dict[Split, tuple[int, tuple[Family, ...]]]:
        """Split to the number of clips of each of its families, and those families."""
        seen = self.world.families
        return {
            "train": (self.train_clips, seen),
            "validation": (self.validation_clips, seen),
            "test": (self.test_clips, seen),
            "shift": (self.shift_clips, SHIFT_FAMILIES),
        }

    @model_validator(mode="after")
    def _consistent(self) -> BankConfig:
        if not any(count for count, _ in self.clips.values()):
            raise ValueError(
                "train_clips, validation_clips, test_clips and shift_clips are all 0; expected "
                "at least one clip"
            )
        held_out = sorted(set(self.world.families) & set(SHIFT_FAMILIES))
        if self.shift_clips and held_out:
            raise ValueError(
                f"world.families has {', '.join(held_out)}, which shift_clips = "
                f"{self.shift_clips} holds out; expected other families, or shift_clips = 0"
            )
        return self


class RewardConfig(Section):
    """Weights of the bounded reward terms: r = -(sum of weight times term)."""

    error: NonNegative = Field(1.0, description="weight of the depth error term")
    duty: NonNegative = Field(0.005, description="weight of laser duty relative to always-8")
    power: NonNegative = Field(0.005, description="weight of power relative to always-8")
    trip: NonNegative = Field(0.5, description="weight of a frame without laser")
    error_scale_m: Positive = Field(
        4.0, description="error at which a pixel's term |e| / (|e| + scale) is one half, m"
    )


class EnvConfig(Section):
    """The decision problem."""

    sensor: SensorConfig
    laser: LaserConfig
    bank: str = Field("starter", description="name or path of a bank")
    split: Literal[Split, "all"] = Field(
        "train", description="clips that drives are made of; all: those of no held-out family"
    )
    unwrapper: str = Field("tofregnet", description="name or path of an unwrapping network")
    merge: Literal["nearest", "floor", "none"] = Field(
        "nearest",
        description="how prediction and wrapped map merge: ours, eq. 6, or the prediction alone",
    )
    observation: Literal["features"] = Field("features", description="what is observed")
    frames_per_drive: int = Field(256, ge=2, description="frames of one episode")
    frame_rate_hz: Positive = Field(10.0, description="frames per second")
    reward: RewardConfig = RewardConfig()

    @model_validator(mode="after")
    def _fits_the_frame(self) -> EnvConfig:
        frame_s = 1.0 / self.frame_rate_hz
        acquisition_s = 8 * self.sensor.sample_period_s
        if acquisition_s > frame_s:
            raise ValueError(
                f"frame_rate_hz is {self.frame_rate_hz:g}: eight samples take {acquisition_s:g} s, "
                f"more than the frame period of {frame_s:g} s"
            )
        return self


class AgentConfig(Section):
    """Training of a scheduler with PPO."""

    algorithm: Literal["ppo"] = Field("ppo", description="stable-baselines3 algorithm")
    total_steps: int = Field(100_000, ge=1, description="environment steps in all")
    num_envs: int = Field(16, ge=1, description="environments in the batch")
    drives: int = Field(32, ge=1, description="different drives to train on, again and again")
    rollout_steps: int = Field(128, ge=2, description="steps of each environment per update")
    batch_size: int = Field(512, ge=2, description="steps per gradient batch")
    epochs: int = Field(10, ge=1, description="passes over a rollout")
    learning_rate: Positive = Field(1e-3, description="Adam learning rate")
    gamma: Fraction = Field(0.98, description="discount per frame")
    gae_lambda: Fraction = Field(0.95, description="lambda of the advantage estimate")
    entropy_coefficient: NonNegative = Field(0.005, description="weight of the policy's entropy")
    hidden: tuple[int, ...] = Field((64, 64), description="hidden layers of policy and value")
    guard: NonNegative = Field(
        1.0,
        description="margin to the trip that shots need, in the most that they can warm the laser "
        "by in a frame; 0 = no guard",
    )
    warm_start: bool = Field(
        True, description="whether to start from the known costs of all actions in the drives"
    )
    seed: int = Field(0, ge=0, description="seed of weights and drives")


class StudyConfig(Section):
    """Evaluation: which drives and how many bootstrap draws."""

    split: Literal["test", "shift"] = Field(
        "test", description="clips that the drives are made of; shift: families never trained on"
    )
    drives: int = Field(24, ge=2, description="test drives, the same for every policy")
    tuning_drives: int = Field(12, ge=2, description="validation drives that tune the rule")
    seed: int = Field(1000, ge=0, description="seed of the first drive")
    bootstrap_draws: int = Field(10_000, ge=100, description="resamples of each interval")
    confidence: float = Field(0.95, gt=0.5, lt=1.0, description="coverage of each interval")


class DemoConfig(Section):
    """The main job, small."""

    env: EnvConfig
    agent: AgentConfig
    study: StudyConfig


Model = TypeVar("Model", bound=Section)


def configs_dir() -> Path:
    """Folder of the shipped YAML files: beside the package in a checkout, inside it in a wheel."""
    inside = Path(__file__).parent / "configs"
    return inside if inside.is_dir() else Path(__file__).parents[1] / "configs"


def find_config(section: str, name: str) -> Path:
    """File of configuration `name` (a name in `configs/<section>/`, or a path).

    Raises
    ------
    ConfigError
        There is no such name and no such file.
    """
    shipped = configs_dir() / section
    for candidate in (shipped / f"{name}.yaml", Path(name)):
        if candidate.is_file():
            return candidate
    known = ", ".join(sorted(path.stem for path in shipped.glob("*.yaml"))) or "none"
    raise ConfigError(f"{section} is {name!r}; expected one of {known}, or the path of a YAML file")


def read_config(model: type[Model], path: Path, overrides: Sequence[str] = ()) -> Model:
    """Read `path` into `model`; `overrides` are command-line words such as `--reward.power 0.3`.

    Raises
    ------
    ConfigError
        An unknown key, a wrong type or a value out of range; the message names the key.
    """
    import jsonargparse

    parser = jsonargparse.ArgumentParser(exit_on_error=False)
    parser.add_class_arguments(model, "config", sub_configs=True)
    words = [_under(word, "config") for word in overrides]
    try:
        return parser.instantiate(parser.parse_args(["--config", str(path), *words])).config
    except (jsonargparse.ArgumentError, ValueError, TypeError, OSError) as error:
        raise ConfigError(f"{path.name}: {one_sentence(error)}") from None


def _under(word: str, group: str) -> str:
    return f"--{group}.{word[2:]}" if word.startswith("--") else word


def one_sentence(error: Exception) -> str:
    """What a validation error says, on one line, without the library's own advertising."""
    if isinstance(error, ValidationError):
        return "; ".join(_describe(detail) for detail in error.errors())
    kept = [line.strip() for line in str(error).splitlines() if "errors.pydantic.dev" not in line]
    return " ".join(" ".join(kept).replace("config.", "").split())


def _describe(detail: Any) -> str:
    where = ".".join(str(part) for part in detail["loc"]) or "configuration"
    message = detail["msg"].removeprefix("Value error, ")
    if detail["type"] == "extra_forbidden":
        return f"unknown key {where}"
    return f"{where}: {message}, got {detail['input']!r}" if detail["loc"] else message


def merged(base: Model, changes: Mapping[str, Any]) -> Model:
    """`base` with the (possibly nested) plain values of `changes`, validated again.

    Raises
    ------
    ConfigError
        An unknown key, a wrong type or a value out of range; the message names the key.
    """
    try:
        return type(base).model_validate(_overlay(base.model_dump(), changes))
    except ValidationError as error:
        raise ConfigError(one_sentence(error)) from None


def _overlay(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in changes.items():
        nested = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = _overlay(result[key], value) if nested else value
    return result
