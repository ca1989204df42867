"""What `recordings.yaml` tells: which recordings there are, and what they do not store."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from shotenv.config import Split, read_config
from unwrap.support import Positive, Section

RECORDINGS_FILE = "recordings.yaml"
Kelvin = Annotated[float, Field(ge=200.0, le=450.0)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,80}$")]


class ToldSettings(Section):
    """What a recording was made with, where it does not store it."""

    laser_power_w: Positive | None = Field(None, description="optical power while on, W")
    integration_s: Positive | None = Field(None, le=1.0, description="of one sample, s")
    temperature_k: Kelvin | None = Field(None, description="of the imager, K")
    ambient_k: Kelvin | None = Field(
        None, description="around the camera, K; without it the imager's less its own rise"
    )
    shift_m: float | None = Field(
        None,
        ge=-100.0,
        le=100.0,
        description="added to every distance, m; without it minus the share of the imager's drift "
        "that the sensor compensates",
    )
    gray_exposure_s: Positive | None = Field(None, le=10.0, description="of the gray images, s")


class RecordedFile(ToldSettings):
    """One recording, and what lies beside it."""

    file: str = Field(min_length=1, description="recording, as the camera's description has it")
    gray: str | None = Field(None, description="gray images, where the recording has none")
    truth: str | None = Field(
        None, description=".npy float [F, H, W], radial metres, NaN where there is no reference"
    )
    ego: str | None = Field(
        None,
        description=".csv with the columns ego_speed_m_s, yaw_rate_rad_s, gray_exposure_s, a row "
        "for each frame",
    )
    offset: str | None = Field(None, description=".npy [H, W], calibrated dark offset, LSB")
    family: Name = Field("recorded", description="kind of scene")
    split: Split = Field("test", description="what the frames are for")
    seed: int | None = Field(
        None, ge=0, lt=2**63, description="the drive of this seed plays it; its number without"
    )


class RecordingsConfig(ToldSettings):
    """`recordings.yaml`: recordings of one camera, and settings of all that tell none."""

    name: Name = Field("recorded", description="of the bank")
    frame_rate_hz: Positive | None = Field(
        None, description="frames a second, where times are not stored"
    )
    recordings: list[RecordedFile] = Field(
        default_factory=list, description="one entry each; without any, all files of the folder"
    )


def read_recordings(folder: Path) -> RecordingsConfig:
    """What is told of the recordings in `folder`; nothing where there is no `recordings.yaml`.

    Raises
    ------
    ValueError
        There is no such folder, or the file is of no use.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder; expected one that holds recordings")
    path = folder / RECORDINGS_FILE
    return read_config(RecordingsConfig, path) if path.is_file() else RecordingsConfig()


def with_settings_of(row: RecordedFile, config: RecordingsConfig) -> RecordedFile:
    """`row` with what is told of all recordings where it tells nothing itself."""
    common = {
        name: getattr(config, name)
        for name in ToldSettings.model_fields
        if getattr(row, name) is None
    }
    return row.model_copy(update=common)
