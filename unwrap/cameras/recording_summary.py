"""What is in a recording, in numbers and sentences: what there is, what is odd, what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from unwrap.cameras.camera_frames import CameraFrames, dropped_frames
from unwrap.cameras.camera_recording import BESIDE, CameraRecording

WARM_UP_K, WORDS = 5.0, {"temperature_k": "K", "integration_s": "s", "laser_power_w": "W"}
"""Change of temperature from which on one calibration does not serve all frames, 6 cm at 12.5 mm/K
(assumed); units of what is told beside the maps."""


@dataclass
class Summary:
    """Numbers of a recording, gathered piece by piece.

    Attributes
    ----------
    frames, pixels, saturated : int
    lowest_lsb, highest_lsb : float
        Of samples that are not saturated.
    gray : (float, float) or None
        Darkest and brightest value, share of full scale.
    told : dict of list of float
        What is told of each frame beside its maps.
    """

    frequencies_hz: tuple[float, ...] = ()
    made: bool = False
    frames: int = 0
    pixels: int = 0
    saturated: int = 0
    lowest_lsb: float = np.inf
    highest_lsb: float = -np.inf
    gray: tuple[float, float] | None = None
    told: dict[str, list[float]] = field(default_factory=dict)

    def add(self, frames: CameraFrames) -> None:
        """Take in a piece."""
        self.frequencies_hz, self.made = frames.frequencies_hz, frames.made
        self.frames += len(frames)
        self.pixels += frames.saturated.numel()
        self.saturated += int(frames.saturated.sum())
        good = frames.samples_lsb.movedim(0, 2)[:, :, ~frames.saturated]
        if good.numel():
            self.lowest_lsb = min(self.lowest_lsb, float(good.min()))
            self.highest_lsb = max(self.highest_lsb, float(good.max()))
        if frames.gray is not None:
            low, high = self.gray or (np.inf, -np.inf)
            self.gray = min(low, float(frames.gray.min())), max(high, float(frames.gray.max()))
        for name in BESIDE:
            values = getattr(frames, name)
            if values is not None:
                self.told.setdefault(name, []).extend(values)

    def numbers(self) -> dict[str, object]:
        """As JSON has it."""
        return {
            "frequencies_hz": list(self.frequencies_hz),
            "made": self.made,
            "frames": self.frames,
            "saturated_share": self.saturated / self.pixels,
            "samples_lsb": _finite((self.lowest_lsb, self.highest_lsb)),
            "gray": self.gray,
            **{name: _finite((min(v), max(v))) for name, v in self.told.items()},
        }


def summary_of(recording: CameraRecording) -> tuple[Summary, list[str], list[str]]:
    """Numbers, lines on what there is and is not, and sentences on what is odd.

    Raises
    ------
    ValueError
        What reading the recording refuses.
    """
    summary = Summary()
    for piece in recording.pieces():
        summary.add(piece)
    return summary, list(_lines(summary, recording)), list(_oddities(summary, recording.names))


def _lines(summary: Summary, recording: CameraRecording) -> Iterator[str]:
    camera, (height, width) = recording.camera, recording.size
    megahertz = " and ".join(f"{hz / 1e6:g}" for hz in summary.frequencies_hz)
    stored = len(camera.samples.phase_deg)
    kind = "parts of a phasor" if camera.samples.kind == "phasors" else "samples"
    made = ", four samples made of each" if summary.made else ""
    yield (
        f"{recording.source.path}: {camera.name}, {summary.frames} frames of {height} x {width}, "
        f"{stored} {kind} at {megahertz} MHz{made}"
    )
    yield (
        f"samples from {summary.lowest_lsb:g} to {summary.highest_lsb:g} LSB, "
        f"{100 * summary.saturated / summary.pixels:.2f} % of the pixels saturated"
    )
    yield f"unambiguous to {camera.range_m:.2f} m, all frequencies together"
    if summary.gray is not None:
        low, high = summary.gray
        yield f"gray images from {low:.3f} to {high:.3f} of full scale"
    for name, unit in WORDS.items():
        if name in summary.told:
            low, high = min(summary.told[name]), max(summary.told[name])
            yield f"{name[: name.rindex('_')].replace('_', ' ')} {low:.4g} to {high:.4g} {unit}"
    if len(summary.told.get("timestamp_s", ())) > 1:
        times = summary.told["timestamp_s"]
        yield f"a frame every {float(np.median(np.diff(times))):.4g} s"
    there = {"frequencies_hz", *summary.told, *(("gray",) if summary.gray is not None else ())}
    for name, who in camera.not_stored.model_dump().items():
        if who is None:
            continue
        if name == "frequencies_hz":
            yield f"not stored: {name}, taken from the description; else {who}"
        elif name not in there:
            yield f"not stored: {name}; {who}"
        elif getattr(camera.constants, name, None) is not None:
            yield f"not stored: {name}, taken from the description"


def _oddities(summary: Summary, names: Sequence[str]) -> Iterator[str]:
    if "timestamp_s" in summary.told:
        yield from dropped_frames(summary.told["timestamp_s"], names)
    temperatures = summary.told.get("temperature_k")
    if temperatures and max(temperatures) - min(temperatures) > WARM_UP_K:
        coldest, hottest = (int(f(temperatures)) for f in (np.argmin, np.argmax))
        yield (
            f"the temperature goes from {min(temperatures):.1f} K in frame {names[coldest]} to "
            f"{max(temperatures):.1f} K in frame {names[hottest]}: distances drift with it"
        )
    times = summary.told.get("integration_s")
    if times and max(times) > min(times):
        other = next(i for i, time in enumerate(times) if time != times[0])
        yield (
            f"the integration time changes from {times[0]:g} s to {times[other]:g} s in frame "
            f"{names[other]}: amplitudes of these frames do not compare"
        )


def _finite(values: tuple[float, float]) -> list[float] | None:
    return list(values) if all(np.isfinite(values)) else None
