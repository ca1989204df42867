"""All that the recordings of one camera tell, and what they do not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from unwrap.calibration.dark_offsets import (
    ambient_slope,
    drift_of_pattern,
    offset_map,
    pattern_parts,
)
from unwrap.calibration.delays import (
    common_delay_m,
    drift_per_kelvin,
    drift_points,
    rad_per_m,
    wall_curves,
)
from unwrap.calibration.full_well import full_well_e, taps_e
from unwrap.calibration.intervals import Estimate, jackknife
from unwrap.calibration.moments import Moments
from unwrap.calibration.overtones import fundamentals, strength_of, table_of
from unwrap.calibration.photon_transfer import (
    ambient_e,
    gray_gain,
    has_electrons,
    photon_transfer,
    read_noise_e,
    transfer_points,
)
from unwrap.signal import WiggleTable

Array = np.ndarray
SAME_K = 1.0
"""Recordings in the dark within a kelvin of each other are of one temperature."""
SEED = 1
"""Of the draws behind two intervals."""


@dataclass(frozen=True)
class Assumed:
    """What is taken from the kind of camera where its recordings cannot tell it.

    Attributes
    ----------
    frequencies_hz : tuple of K floats
    bits, highest_harmonic : int
        Of the converter; highest odd overtone.
    contrast, harmonic_strength, gain_lsb_per_e, full_well_e : float
        As in a sensor's configuration.
    """

    frequencies_hz: tuple[float, ...]
    bits: int
    contrast: float
    gain_lsb_per_e: float
    full_well_e: float
    harmonic_strength: float
    highest_harmonic: int


@dataclass(frozen=True)
class Calibration:
    """Numbers of a camera with their intervals.

    Attributes
    ----------
    numbers : dict of Estimate
        By the name of the sensor's configuration, and `distance_offset_m`; the delay at each
        frequency as `distance_offset_m at 24 MHz`.
    leaning : dict of str to str
        Of numbers that lean on a value that was not measured: its name.
    missing : dict of str to str
        Of numbers that the recordings do not tell: what to record.
    tables : dict of WiggleTable
        Measured tables by modulation frequency, Hz, the delay included.
    offset_lsb : float32 [H, W] or None
        Dark-offset map.
    temperature_k : float or None
        Of the imager when offsets and distances were recorded.
    recordings : tuple of Moments
    stretch : [P]
        Radial distance of each pixel over that along the optical axis.
    assumed : Assumed
        What stood in where the recordings tell nothing.
    """

    numbers: dict[str, Estimate]
    leaning: dict[str, str]
    missing: dict[str, str]
    tables: dict[float, WiggleTable]
    offset_lsb: Array | None
    temperature_k: float | None
    recordings: tuple[Moments, ...] = field(repr=False)
    stretch: Array = field(repr=False)
    assumed: Assumed

    def value(self, name: str) -> float:
        """The measured number, or the assumed one."""
        return self.numbers[name].value if name in self.numbers else getattr(self.assumed, name)


WHAT_TO_RECORD = {
    "gain_lsb_per_e": "a still scene with the laser on (16 frames or more, amplitudes from dark to "
    "bright)",
    "contrast": "the laser off in at least two levels of ambient light, with gray images and their "
    "exposure, beside a still scene with the laser on in the dark",
    "read_noise_e": "dark frames: laser off, lens covered, 16 or more",
    "full_well_e": "a still scene so bright that some pixels saturate in some frames, with the "
    "camera's saturation flags",
    "offset_std_lsb": "dark frames: laser off, lens covered, 16 or more",
    "offset_row_share": "dark frames: laser off, lens covered, 16 or more",
    "offset_ambient_lsb": "dark frames, and the laser off in ambient light with gray images and "
    "their exposure",
    "offset_drift_lsb_per_k": "dark frames at two imager temperatures or more, 10 K apart",
    "harmonic_strength": "a flat wall at known distances that cover a quarter of each unambiguous "
    "range",
    "distance_offset_m": "a flat wall at known distances that cover a quarter of each unambiguous "
    "range",
    "distance_drift_m_per_k": "a still scene at three imager temperatures or more",
}


def calibrate_camera(
    recordings: Sequence[Moments], shape: tuple[int, int], stretch: Array, assumed: Assumed
) -> Calibration:
    """All that the recordings tell.

    Parameters
    ----------
    recordings : Moments
        Of one camera, in any order.
    shape : (int, int)
        Height and width of the image.
    stretch : [P]
        Radial distance of a pixel over that along the optical axis; see `wall_curves`.
    assumed : Assumed
        What stands in where they tell nothing.
    """
    generator = np.random.default_rng(SEED)
    temperature_k = _calibration_temperature(recordings)
    numbers: dict[str, Estimate | None] = {
        **jackknife(
            partial(_pixel_numbers, recordings, shape, stretch, assumed, temperature_k),
            shape[0] * shape[1],
        )
    }
    dark = _reference_dark(recordings, temperature_k)
    pattern_lsb = None
    if dark:
        pattern, noise_lsb2 = offset_map(dark)
        pattern_lsb = pattern.reshape(shape)
        std, share = pattern_parts(pattern_lsb, noise_lsb2, generator)
        numbers |= {"offset_std_lsb": std, "offset_row_share": share}
    all_dark = [r for r in recordings if is_dark(r) and r.setting.temperature_k is not None]
    numbers["offset_drift_lsb_per_k"] = drift_of_pattern(all_dark, generator)
    strength = numbers.get("harmonic_strength")
    points = drift_of_distance(
        recordings, assumed.harmonic_strength if strength is None else strength.value, assumed
    )
    numbers["distance_drift_m_per_k"] = drift_per_kelvin(*points)
    told = {name: number for name, number in numbers.items() if number is not None}
    return Calibration(
        numbers=told,
        leaning=_leaning(told, recordings),
        missing={name: what for name, what in WHAT_TO_RECORD.items() if name not in told},
        tables=_tables(recordings, stretch, assumed),
        offset_lsb=pattern_lsb,
        temperature_k=temperature_k,
        recordings=tuple(recordings),
        stretch=stretch,
        assumed=assumed,
    )


def drift_of_distance(
    recordings: Sequence[Moments], strength: float, assumed: Assumed
) -> tuple[Array, Array]:
    """Temperatures of a temperature run, and how much farther than in the first, K and m."""
    warm = [r for r in recordings if r.setting.kind == "warm"]
    kelvin = np.array([r.setting.temperature_k for r in warm], float)
    if not warm:
        return kelvin, kelvin
    light = [fundamentals(r.phasors, strength, assumed.highest_harmonic) for r in warm]
    return kelvin, drift_points(light, assumed.frequencies_hz, [r.flagged for r in warm])


def amplitudes_of(recording: Moments, strength: float, highest: int) -> Array:
    """Amplitude of the fundamental [K, P], LSB; 0 where the laser is off."""
    if recording.setting.kind == "dark":
        return np.zeros(recording.variance_lsb2.shape)
    return np.abs(fundamentals(recording.phasors, strength, highest))


def _pixel_numbers(
    recordings: Sequence[Moments],
    shape: tuple[int, int],
    stretch: Array,
    assumed: Assumed,
    temperature_k: float | None,
    pixels: Array,
) -> Mapping[str, float]:
    """What some of the pixels tell, in one chain: each number leans on those before; else NaN."""
    chosen = [recording.of(pixels) for recording in recordings]
    found = _wall_numbers(chosen, stretch[pixels], assumed)
    strength = _or_assumed(found["harmonic_strength"], assumed.harmonic_strength)
    amplitudes = [amplitudes_of(r, strength, assumed.highest_harmonic) for r in chosen]

    gray = gray_gain(chosen)
    over_contrast, gain, dark_lsb2 = photon_transfer(*transfer_points(chosen, amplitudes, gray))
    found["contrast"] = gain / over_contrast
    # Without ambient light only gain over contrast is told.
    found["gain_lsb_per_e"] = _or_assumed(gain, over_contrast * assumed.contrast)
    gain = _or_assumed(found["gain_lsb_per_e"], assumed.gain_lsb_per_e)
    contrast = _or_assumed(found["contrast"], assumed.contrast)
    read_e = read_noise_e(dark_lsb2, gain)
    dark = _reference_dark(chosen, temperature_k)
    found["read_noise_e"] = read_e if dark else np.nan

    pattern = offset_map(dark)[0] if dark else None
    electrons = [ambient_e(r, gray) for r in chosen]
    lit = [
        (r, taps_e(r, r.offset_lsb if pattern is None else pattern, a, e, gain, contrast))
        for r, a, e in zip(chosen, amplitudes, electrons, strict=True)
        if r.setting.kind != "dark" and np.isfinite(e).all()
    ]
    found["full_well_e"] = full_well_e(*_columns(lit), read_e, assumed.bits)
    ambient = [
        (r, e)
        for r, e in zip(chosen, electrons, strict=True)
        if r.setting.kind == "dark" and has_electrons(r)
    ]
    found["offset_ambient_lsb"] = np.nan
    if pattern is not None:
        parity = np.where(pixels // shape[1] % 2 == 0, 1.0, -1.0)
        well_e = _or_assumed(found["full_well_e"], assumed.full_well_e)
        # Of light that fills both taps.
        slope = ambient_slope(pattern, *_columns(ambient), parity)
        found["offset_ambient_lsb"] = slope * 2 * well_e
    return found


def _columns(pairs: Sequence[tuple[Moments, Array]]) -> tuple[list[Moments], list[Array]]:
    return [first for first, _ in pairs], [second for _, second in pairs]


def _wall_numbers(
    recordings: Sequence[Moments], stretch: Array, assumed: Assumed
) -> dict[str, float]:
    """Strength of the overtones and the delay, of all frequencies together and of each."""
    names = [f"distance_offset_m at {hz / 1e6:g} MHz" for hz in assumed.frequencies_hz]
    found = dict.fromkeys(("harmonic_strength", "distance_offset_m", *names), float("nan"))
    walls = [r for r in recordings if r.setting.kind == "wall"]
    if not walls:
        return found
    curves = wall_curves(walls, stretch, assumed.frequencies_hz)
    delays = curves[:, 0] / rad_per_m(assumed.frequencies_hz)
    found |= dict(zip(names, delays.tolist(), strict=True))
    told = np.isfinite(curves[:, 0])
    if told.any():
        hz = np.asarray(assumed.frequencies_hz)[told]
        found["distance_offset_m"] = common_delay_m(curves[told, 0], hz)
        wave = float(curves[told, 2].mean())
        found["harmonic_strength"] = strength_of(wave, assumed.highest_harmonic)
    return found


def _tables(
    recordings: Sequence[Moments], stretch: Array, assumed: Assumed
) -> dict[float, WiggleTable]:
    walls = [r for r in recordings if r.setting.kind == "wall"]
    if not walls:
        return {}
    curves = wall_curves(walls, stretch, assumed.frequencies_hz)
    return {
        hz: table_of(curve)
        for hz, curve in zip(assumed.frequencies_hz, curves, strict=True)
        if np.isfinite(curve).all()
    }


def is_dark(recording: Moments) -> bool:
    """Laser off and no other light."""
    return recording.setting.kind == "dark" and not recording.setting.ambient


def _calibration_temperature(recordings: Sequence[Moments]) -> float | None:
    """Temperature of the walls, or else of the first recording in the dark."""
    walls = [r for r in recordings if r.setting.kind == "wall"]
    for group in (walls, [r for r in recordings if is_dark(r)][:1]):
        told = [k for r in group if (k := r.setting.temperature_k) is not None]
        if told and len(told) == len(group):
            return float(np.mean(told))
    return None


def _reference_dark(recordings: Sequence[Moments], temperature_k: float | None) -> list[Moments]:
    """Recordings in the dark at the temperature nearest to that of the calibration."""
    dark = [r for r in recordings if is_dark(r)]
    told = [(r, k) for r in dark if (k := r.setting.temperature_k) is not None]
    if not told:
        return dark
    wanted = told[0][1] if temperature_k is None else temperature_k
    nearest = min(abs(k - wanted) for _, k in told)
    return [r for r, k in told if abs(k - wanted) <= nearest + SAME_K]


def _or_assumed(number: float, assumed: float) -> float:
    return number if np.isfinite(number) else assumed


LEANS_ON = {
    "gain_lsb_per_e": ("contrast",),
    "contrast": ("harmonic_strength",),
    "read_noise_e": ("gain_lsb_per_e",),
    "full_well_e": ("gain_lsb_per_e", "contrast"),
    "offset_ambient_lsb": ("full_well_e",),
    "distance_drift_m_per_k": ("harmonic_strength",),
}
"""What each number is computed with; the gain needs a contrast where no ambient light tells it."""


def _leaning(estimates: Mapping[str, Estimate], recordings: Sequence[Moments]) -> dict[str, str]:
    told = {*estimates, *(["contrast"] if any(map(has_electrons, recordings)) else [])}
    missing = {
        name: [other for other in others if other not in (told if "gain" in name else estimates)]
        for name, others in LEANS_ON.items()
    }
    return {name: ", ".join(o) for name, o in missing.items() if o and name in estimates}
