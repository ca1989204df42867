"""Frames of a described camera to depth, by the same rules as any recording's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from unwrap.cameras.camera_frames import CameraFrames
from unwrap.cameras.files import CameraDescription
from unwrap.cameras.pixel_rays import rays_of
from unwrap.cameras.three_frequencies import unwrap_three
from unwrap.depth import Eight, Merge
from unwrap.networks import Unwrapper
from unwrap.recordings import (
    Camera,
    CorrectedFrame,
    camera_of,
    correct_recording,
    require_gray,
    with_stored_offset,
)
from unwrap.signal import SensorDescription, unambiguous_range_m

AGREEING_SHARE = 0.4
"""Disagreement of frequencies that is still trusted, over the least one of a wrong candidate: with
two 0.5 is the most there is. As 1 m is of the 2.5 m of 24 and 10 MHz."""


def least_disagreement_m(frequencies_hz: Sequence[float], max_range_m: float) -> float:
    """How far the frequencies are apart, metres, at the wrong candidate where they agree best.

    Examples
    --------
    >>> round(least_disagreement_m((24e6, 10e6), 25.0), 2)
    2.5
    >>> round(least_disagreement_m((120e6, 80e6, 16e6), 18.7), 2)
    0.62
    """
    first_m, *others_m = map(unambiguous_range_m, frequencies_hz)
    found = [min(others_m)]  # No wrong candidate within the range: none is further than this.
    for n in range(1, math.floor(max_range_m / first_m) + 1):
        # What is left over the nearest whole wrap of each; at the first frequency it is zero.
        apart_m = [0.0, *(math.remainder(n * first_m, range_m) for range_m in others_m)]
        found.append(max(apart_m) - min(apart_m))
    return min(found)


def sensor_of(
    camera: CameraDescription, frequencies_hz: tuple[float, ...], *, unwrapped: bool
) -> SensorDescription:
    """What unwrapping must know of the camera.

    No wiggle is taken away: a table of another sensor's, or a simulated one, is none of this one's.

    Parameters
    ----------
    frequencies_hz : tuple of float
        Of the frames, descending.
    unwrapped : bool
        Whether a network unwraps samples of one frequency.
    """
    first_hz, range_m, agreeing_m = frequencies_hz[0], unambiguous_range_m(frequencies_hz[0]), 0.0
    second_hz = first_hz if len(frequencies_hz) == 1 else frequencies_hz[1]
    if len(frequencies_hz) > 1:
        range_m = camera.range_m
        # A hair less than the joint range, at whose end the first candidate comes again.
        apart_m = least_disagreement_m(frequencies_hz, range_m * (1 - 1e-6))
        agreeing_m = AGREEING_SHARE * apart_m
    elif unwrapped:
        range_m = camera.max_range_m or SensorDescription.max_range_m
    return SensorDescription(
        f1_hz=first_hz,
        f2_hz=second_hz,  # Of one frequency alone it is never asked for.
        max_range_m=range_m,
        # No distance is mistrusted for being close to the range's end.
        saturation_range_m=unambiguous_range_m(first_hz),
        max_residual_m=agreeing_m,
        noise_lsb=SensorDescription.noise_lsb if camera.noise_lsb is None else camera.noise_lsb,
    )


def camera_for(
    camera: CameraDescription,
    sensor: SensorDescription,
    size: tuple[int, int],
    folder: Path,
    *,
    unwrapper: str | None,
    merge: Merge = "nearest",
    eight: Eight = "two_frequency",
    wiggle: Path | None = None,
    noise_lsb: float | None = None,
) -> Camera:
    """How recordings of the described camera are corrected.

    Parameters
    ----------
    sensor : SensorDescription
        See `sensor_of`.
    size : (int, int)
        Rows and columns of the frames.
    folder : Path
        Of the description's file, which a table of rays is relative to.

    Raises
    ------
    ValueError
        What `camera_of` and `rays_of` refuse.
    """
    return camera_of(
        sensor,
        bits=camera.words.bits,
        unwrapper=unwrapper,
        merge=merge,
        eight=eight,
        horizontal_fov_deg=camera.lens.horizontal_fov_deg or 60.0,  # The rays take its place.
        wiggle=wiggle,
        noise_lsb=noise_lsb,
        rays=rays_of(camera.lens, size, folder),
    )


def correct_frames(
    frames: CameraFrames,
    camera: CameraDescription,
    settings: Camera,
    where: str,
    *,
    offset: Path | None = None,
    network: Unwrapper | None = None,
) -> list[CorrectedFrame]:
    """Depth of frames; two and three frequencies unwrap each other, three without any network.

    Parameters
    ----------
    settings : Camera
        See `camera_for`.
    where : str
        Name of the recording, for what is refused.
    offset : Path, optional
        Stored dark-offset map, LSB.

    Raises
    ------
    ValueError
        Three frequencies with wiggle tables, or for a network; samples that tell no noise, where
        none is told; or what `correct_recording` refuses.
    """
    three = len(frames.frequencies_hz) > 2
    if three:
        if settings.description.wiggle is not None or settings.eight == "network":
            raise ValueError(
                f"{where}: three frequencies are unwrapped without wiggle tables and networks; "
                "expected no --wiggle, and --eight two_frequency or kernel_density"
            )
        settings = replace(settings, unwrapper=None)
    recording = (frames.at_highest_frequency() if three else frames).recording()
    if offset is not None:
        recording = with_stored_offset(recording, offset)
    if settings.unwrapper is not None:
        require_gray(recording, where)
    tells_noise = not recording.made and recording.raw.shots > 2
    if not tells_noise and settings.noise_lsb is None and camera.noise_lsb is None:
        raise ValueError(
            f"{where}: such samples do not tell their noise, and without it noise passes as "
            f"signal; expected --noise-lsb, or noise_lsb in the description of {camera.name}"
        )
    corrected = correct_recording(recording, settings, network)
    return unwrap_three(frames, corrected, settings) if three else corrected
