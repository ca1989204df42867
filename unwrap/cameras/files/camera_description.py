"""What must be told of a camera before its recordings can be read: nothing of it is guessed.

Whether a plane is the sample at 90 or at 270 degrees, and whether it grows or falls with the light,
cannot be seen in the numbers: another order gives other distances, and no less smooth ones.
`unwrap.cameras.labelling` tries the orders where a distance is known.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from unwrap.signal import joint_range_m, unambiguous_range_m
from unwrap.support import Positive, Section

Container = Literal[
    "espros_hdf5", "espros_wire", "arrays", "packed_raw12", "kinect_hdf5", "dump", "simulation"
]
"""Kinds of files; "simulation" describes a camera whose samples are not to be had."""
Frequency = Annotated[float, Field(ge=1e5, le=1e9)]
Pixels = Annotated[int, Field(ge=1, le=2**14)]
Bits = Annotated[int, Field(ge=8, le=16)]
NEEDED = {
    "packed_raw12": ("height", "width", "row_bytes"),
    "dump": ("height", "width", "axes", "dtype"),
    "arrays": ("axes",),
    "espros_wire": ("height", "width", "dcs_type", "gray_type"),
}
"""Fields of `layout` that a container cannot do without."""


class LayoutConfig(Section):
    """How planes lie in a file; each container needs some of the fields."""

    height: Pixels | None = Field(None, description="rows of an image, at most those of the chip")
    width: Pixels | None = Field(None, description="columns of an image")
    row_bytes: int | None = Field(None, ge=1, le=2**20, description="bytes from row to row")
    trailer_rows: int = Field(0, ge=0, le=2**14, description="rows after a frequency's planes")
    trailer_bytes: int = Field(0, ge=0, le=2**24, description="bytes after those rows")
    axes: str | None = Field(
        None,
        pattern="^[FPHW]+$",
        description="letter of each axis, outermost first: F frame, P plane, H row, W column",
    )
    dtype: Literal["<i2", ">i2", "<u2", ">u2", "<i4", ">i4", "<f4", ">f4"] | None = Field(
        None, description="number format of a dump"
    )
    dcs_type: int | None = Field(None, ge=0, le=65535, description="header's type of four samples")
    gray_type: int | None = Field(None, ge=0, le=65535, description="header's type of a gray image")

    @model_validator(mode="after")
    def _axes_once(self) -> LayoutConfig:
        if self.axes is not None and (
            len(set(self.axes)) < len(self.axes) or not set("PHW") <= set(self.axes)
        ):
            raise ValueError(f"axes is {self.axes!r}; expected P, H, W and maybe F, each once")
        return self


class WordsConfig(Section):
    """What a stored number means as a sample."""

    bits: Bits = Field(12, description="bits of a sample")
    stored_bits: Bits | None = Field(
        None, description="bits of a stored word, where more than those of a sample"
    )
    signed: bool = Field(
        False, description="two's complement; of unsigned words the low `bits` are sign-extended"
    )
    real: bool = Field(False, description="floating-point numbers, which have no range")
    mid_scale: int = Field(0, ge=0, le=65535, description="word of a sample of zero")
    overflow: tuple[int, ...] = Field((), description="words by which the converter overflows")
    saturation: tuple[int, ...] = Field((), description="words of a full pixel")
    ends_overflow: bool = Field(
        True, description="whether the lowest and the highest word report overflow, too"
    )

    @property
    def limits(self) -> tuple[int, int]:
        """Lowest and highest stored word that is a sample."""
        if self.signed:
            return -(2 ** (self.bits - 1)), 2 ** (self.bits - 1) - 1
        # Centred on zero, as by software that has subtracted the mid-scale already.
        return 0, 2**self.bits - 1

    @model_validator(mode="after")
    def _stored_bits_hold_the_sample(self) -> WordsConfig:
        if self.stored_bits is not None and self.stored_bits < self.bits:
            raise ValueError(
                f"stored_bits is {self.stored_bits}; expected at least bits = {self.bits}"
            )
        return self


class SamplesConfig(Section):
    """Which sample each plane of one frequency is: + m S cos(phi - phase_deg), plus an offset."""

    kind: Literal["samples", "phasors"] = Field(
        "samples",
        description="correlation samples, or real and imaginary parts, which have no offset",
    )
    phase_deg: tuple[float, ...] = Field(
        min_length=2,
        max_length=4,
        description="demodulation phase of each plane as stored, degrees",
    )
    sign: Literal[1, -1] = Field(1, description="-1 where planes fall as the correlation grows")

    @property
    def phases_deg(self) -> tuple[float, ...]:
        """Phase of each plane in [0, 360), the sign included."""
        turned = 0.0 if self.sign > 0 else 180.0
        return tuple((phase + turned) % 360.0 for phase in self.phase_deg)

    @model_validator(mode="after")
    def _tell_a_phase(self) -> SamplesConfig:
        if self.kind == "phasors" and len(self.phase_deg) != 2:
            raise ValueError(f"phase_deg is {self.phase_deg}; expected two for phasors")
        if self.kind == "samples" and len(self.phase_deg) == 2 and set(self.phases_deg) != {0, 90}:
            raise ValueError(
                f"phase_deg is {self.phase_deg}; expected 0 and 90 of two samples, since others "
                "turn the sign of their offset"
            )
        apart = min(
            abs((a - b + 180.0) % 360.0 - 180.0)
            for i, a in enumerate(self.phase_deg)
            for b in self.phase_deg[:i]
        )
        # Nearer phases would make noise of the difference between planes; assumed.
        if apart < 10.0:
            raise ValueError(f"phase_deg is {self.phase_deg}; expected phases 10 degrees apart")
        if self.kind == "phasors" and abs(apart - 90.0) > 45.0:
            raise ValueError(f"phase_deg is {self.phase_deg}; expected phases about 90 apart")
        return self


class PassiveConfig(Section):
    """Where the gray image without laser light is."""

    where: Literal["none", "recording", "plane", "file"] = Field(
        "none",
        description="nowhere, in the recording, one of its planes, or a file of its own (--gray)",
    )
    plane: int | None = Field(None, ge=0, le=64, description="number of that plane, from 0")
    highest: Positive = Field(4095.0, description="stored value of full scale")


class NotStoredConfig(Section):
    """What recordings do not store, each with a sentence on who supplies it."""

    gray: str | None = Field(None, description="passive image")
    frequencies_hz: str | None = Field(None, description="modulation frequencies")
    temperature_k: str | None = Field(None, description="temperature of the imager")
    integration_s: str | None = Field(None, description="integration time of a sample")
    laser_power_w: str | None = Field(None, description="optical power of the laser")
    timestamp_s: str | None = Field(None, description="time of each frame")


class ConstantsConfig(Section):
    """What recordings do not store and is the same in all of them, told here instead."""

    temperature_k: float | None = Field(None, ge=200.0, le=450.0, description="imager, K")
    integration_s: Positive | None = Field(None, le=1.0, description="of one sample, s")
    laser_power_w: Positive | None = Field(None, description="optical power while on, W")


class AxesConfig(Section):
    """How the stored image lies in the view, which has its upper left pixel first."""

    transpose: bool = Field(False, description="rows and columns are exchanged")
    flip_rows: bool = Field(False, description="then: the lowest row comes first")
    flip_columns: bool = Field(False, description="then: the rightmost column comes first")


class LensConfig(Section):
    """Directions of pixels: a pinhole with radial distortion, or a table of rays."""

    horizontal_fov_deg: float | None = Field(
        None, ge=1, le=179, description="field of view of a pinhole with square pixels"
    )
    focal_px: tuple[Positive, Positive] | None = Field(
        None, description="focal length across and down, pixels, in place of a field of view"
    )
    center_px: tuple[float, float] | None = Field(
        None, description="column and row of the principal point; the image's centre without"
    )
    radial: tuple[float, float, float] = Field(
        (0.0, 0.0, 0.0), description="k1, k2, k3 of Brown's radial distortion"
    )
    rays: str | None = Field(
        None, description=".npy [H, W, 3], unit vectors right, down, ahead; beside the YAML file"
    )

    @model_validator(mode="after")
    def _one_way(self) -> LensConfig:
        ways = (self.horizontal_fov_deg, self.focal_px, self.rays)
        if sum(way is not None for way in ways) != 1:
            raise ValueError(
                "lens tells no direction, or several ways; expected one of horizontal_fov_deg, "
                "focal_px, rays"
            )
        return self


class CameraDescription(Section):
    """A camera: its files, its samples, and what its recordings do not tell."""

    name: str = Field(description="name of the camera")
    container: Container = Field(description="kind of its files")
    layout: LayoutConfig = Field(LayoutConfig(), description="how planes lie in a file")
    words: WordsConfig = Field(WordsConfig(), description="what a stored number means")
    samples: SamplesConfig = Field(description="which sample each plane is")
    frequencies_hz: tuple[Frequency, ...] = Field(
        min_length=1, max_length=3, description="modulation frequencies in the order of the planes"
    )
    selectable_hz: tuple[Frequency, ...] = Field(
        (), description="frequencies that a recording which stores its own may tell"
    )
    passive: PassiveConfig = Field(PassiveConfig(), description="the gray image")
    not_stored: NotStoredConfig = Field(NotStoredConfig(), description="what is not in a recording")
    constants: ConstantsConfig = Field(ConstantsConfig(), description="told here instead")
    noise_lsb: Positive | None = Field(
        None, description="standard deviation of a sample, where samples do not tell it, LSB"
    )
    max_range_m: Positive | None = Field(
        None, description="range that is unwrapped; the joint range of the frequencies without, m"
    )
    axes: AxesConfig = Field(AxesConfig(), description="how the image lies in the view")
    lens: LensConfig = Field(description="directions of the pixels")

    @property
    def planes(self) -> int:
        """Samples of a frame."""
        return len(self.frequencies_hz) * len(self.samples.phase_deg)

    @property
    def stored_planes(self) -> int:
        """Planes of a frame as stored, a passive one counted."""
        return self.planes + (self.passive.where == "plane")

    @property
    def range_m(self) -> float:
        """Range over which the frequencies together are unambiguous, or less where told, metres."""
        common, *others = self.frequencies_hz
        for other in others:
            # c / (2 r) is the frequency of a range, too: here that of the joint one.
            common = unambiguous_range_m(joint_range_m(common, other))
        joint_m = unambiguous_range_m(common)
        return joint_m if self.max_range_m is None else min(joint_m, self.max_range_m)

    @model_validator(mode="after")
    def _layout_fits(self) -> CameraDescription:
        missing = [
            name for name in NEEDED.get(self.container, ()) if getattr(self.layout, name) is None
        ]
        if missing:
            raise ValueError(
                f"layout.{missing[0]} is missing; expected one for container {self.container}"
            )
        if len(set(self.frequencies_hz)) < len(self.frequencies_hz):
            raise ValueError(f"frequencies_hz is {self.frequencies_hz}; expected different ones")
        if self.passive.where == "plane":
            fits = self.passive.plane is not None and self.passive.plane <= self.planes
            if self.container not in ("arrays", "dump") or not fits:
                raise ValueError(
                    f"passive.plane is {self.passive.plane}; expected 0 to {self.planes}, and a "
                    "container of plain planes (arrays, dump)"
                )
        width, row_bytes = self.layout.width or 0, self.layout.row_bytes or 0
        if self.container == "packed_raw12" and (width % 2 or row_bytes < width // 2 * 3):
            raise ValueError(
                f"layout.row_bytes is {row_bytes} and width {width}; expected an even width, "
                "and three bytes for every two pixels"
            )
        return self
