"""Configuration of a scene of one's own: its file, materials, lights, and the ways through it."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from shotenv.config.families import Split
from shotenv.config.mounts import Degrees, Finite, Point
from unwrap.support import Fraction, NonNegative, Positive, Section

OWN: Literal["own"] = "own"
"""Family of every scene that came from a file."""
Elevation = Annotated[float, Field(ge=-90.0, le=90.0)]


class SurfaceConfig(Section):
    """What a material of the scene is in the sensor's optical band (940 nm, not what eyes see)."""

    albedo: Fraction | tuple[Fraction, Fraction] = Field(
        description="diffuse albedo, or two, between which a noise texture varies"
    )
    texture_m: Positive = Field(1.0, description="length after which that texture repeats, m")
    retro: NonNegative = Field(0.0, description="retro-reflection, times the Lambertian return")
    emission: NonNegative = Field(0.0, description="radiance of a face that glows, W m-2 sr-1")
    mirror: Fraction = Field(0.0, description="share of the light that is mirrored")
    clear: Fraction = Field(0.0, description="share that passes straight through")

    @model_validator(mode="after")
    def _shares(self) -> SurfaceConfig:
        if self.mirror + self.clear > 1:
            raise ValueError(
                f"mirror is {self.mirror:g} and clear {self.clear:g}; expected at most 1 together"
            )
        return self


class SunConfig(Section):
    """Direct sun."""

    irradiance: NonNegative = Field(11.6, description="on a surface facing it, in band, W m-2")
    azimuth_deg: Degrees = Field(0.0, description="from x towards y, degrees")
    elevation_deg: Elevation = Field(45.0, description="above the horizon, degrees")


class SkyConfig(Section):
    """Radiance of the sky, linear in the sine of elevation."""

    zenith: NonNegative = Field(description="overhead, in band, W m-2 sr-1")
    horizon: NonNegative = Field(description="at the horizon, in band, W m-2 sr-1")


class OwnLamp(Section):
    """A small lamp that lights other things; its own face does not glow."""

    position_m: Point = Field(description="where it is, m")
    intensity_w_sr: NonNegative = Field(description="radiant intensity in band, W sr-1")
    radius_m: Positive = Field(0.1, description="its size; keeps light finite close by, m")
    direction: Point = Field((0.0, 0.0, -1.0), description="its axis")
    cutoff_deg: float = Field(
        180.0, gt=0.0, le=180.0, description="angle from the axis where it ends; 180 = nowhere"
    )
    rides: bool = Field(False, description="moves with the car, from its place at the start")

    @model_validator(mode="after")
    def _has_an_axis(self) -> OwnLamp:
        if not any(self.direction):
            raise ValueError("direction is (0, 0, 0); expected a vector")
        return self


class LightsConfig(Section):
    """Passive light, in band; beside that of the scene's file, where there is any."""

    sun: SunConfig | None = None
    sky: SkyConfig | None = None
    lamps: tuple[OwnLamp, ...] = ()


class PoseConfig(Section):
    """Where the car's reference is at a time."""

    time_s: NonNegative = Field(description="time, s")
    position_m: Point = Field(description="place, m")
    yaw_deg: Finite = Field(0.0, description="heading from x towards y, degrees")
    pitch_deg: Degrees = Field(0.0, description="down, degrees")
    roll_deg: Degrees = Field(0.0, description="right side down, degrees")


class OwnClip(Section):
    """One way through the scene: poses over time, or way points and a speed over time."""

    split: Split = Field("train", description="split that the clip belongs to")
    poses: tuple[PoseConfig, ...] = Field((), description="poses, in the order of their times")
    waypoints_m: tuple[Point, ...] = Field((), description="places that are driven through, m")
    speed_m_s: tuple[tuple[NonNegative, Finite], ...] = Field(
        (), description="(time, speed) pairs, s and m/s; negative reverses"
    )

    @model_validator(mode="after")
    def _consistent(self) -> OwnClip:
        if bool(self.poses) == bool(self.waypoints_m or self.speed_m_s):
            raise ValueError(
                "a clip has poses and way points, or neither; expected poses alone, or "
                "waypoints_m with speed_m_s"
            )
        for field, count in (
            ("poses", len(self.poses)),
            ("waypoints_m", len(self.waypoints_m)),
            ("speed_m_s", len(self.speed_m_s)),
        ):
            if count < 2 and (field == "poses") == bool(self.poses):
                raise ValueError(f"{field} has {count} entries; expected at least 2")
        for before, after in pairwise(self.times_s):
            if after <= before:
                raise ValueError(
                    f"{'poses' if self.poses else 'speed_m_s'} has time {after:g} s after "
                    f"{before:g} s; expected times that rise"
                )
        for first, second in pairwise(self.waypoints_m):
            if first == second:
                raise ValueError(f"waypoints_m has {first} twice in a row; expected places apart")
        return self

    @property
    def times_s(self) -> tuple[float, ...]:
        """Times that the clip is told at, s."""
        if self.poses:
            return tuple(pose.time_s for pose in self.poses)
        return tuple(time_s for time_s, _ in self.speed_m_s)

    def frames(self, frame_rate_hz: float) -> int:
        """Frames that the clip is long, each a frame period."""
        # A rounding short of a whole number of frames is that number.
        return int((self.times_s[-1] - self.times_s[0]) * frame_rate_hz + 1e-6)


class ScenePathConfig(Section):
    """How a scene's file is read, what lights it, and the ways through it."""

    unit_m: Positive = Field(1.0, description="length of the file's unit, m")
    up: Literal["z", "y"] | None = Field(
        None, description="the file's axis that points up; z, but y in GLB, unless told"
    )
    most_faces: int = Field(2_000_000, ge=1, le=20_000_000, description="faces taken at most")
    lights: LightsConfig = LightsConfig()
    clips: tuple[OwnClip, ...] = Field(min_length=1, description="ways through the scene")


class MaterialsConfig(Section):
    """The table of a scene's materials."""

    materials: dict[str, SurfaceConfig] = Field(
        default_factory=dict, description="surface by the name that the file gives the material"
    )


class OwnSceneConfig(ScenePathConfig, MaterialsConfig):
    """A scene of one's own in a bank: made by `shotenv render --scene`."""

    file: str = Field(description="path of the scene's file")
    digest: str = Field(
        pattern=r"^[0-9a-f]{64}$", description="of the triangles, surfaces and lights in it"
    )
