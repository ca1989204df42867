"""Light to distance with every effect: a slow loop over pixels, wiggle, drift, 8 = 4 = 2 DCS."""

from __future__ import annotations

import math

import pytest
import torch
from acquisitions import INTEGRATION_S, POWER_W, acquired

from shotenv.config.reader import find_config, merged, read_config
from shotenv.config.sensor import SensorConfig
from shotenv.sensor.description import description_of
from shotenv.sensor.drift import imager_temperature_k, residual_drift_m
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.noise import Purpose, draw_noise, stream
from shotenv.sensor.offsets import draw_offsets
from unwrap.depth.correction import correct
from unwrap.signal.decoding import TWO_PI
from unwrap.signal.description import SensorDescription
from unwrap.signal.frequencies import candidate_spacing_m, unambiguous_range_m
from unwrap.signal.shots import Shots, demodulation_phase_rad, frequency_index, harmonic_weights
from unwrap.signal.wiggle import WiggleTable, wiggle_of

C_M_S = 299_792_458.0
AMBIENT_K = 306.15
FINE = {
    "gain_lsb_per_e": 0.2,
    "adc_bits": 16,
    "full_well_e": 1e9,
    "offset_std_lsb": 0.0,
    "offset_ambient_lsb": 0.0,
    "read_noise_e": 0.0,
    "distance_drift_m_per_k": 0.0,
    # Every wrapped distance is trusted.
    "saturation_range_m": unambiguous_range_m(24e6),
}


def scene(sensor, distance, active, ambient) -> Exposure:
    """One-bounce light of maps [H, W], with the sensor's overtones."""
    frequencies = (sensor.f1_hz, sensor.f2_hz)
    weights = harmonic_weights(sensor.harmonic_strength, sensor.highest_harmonic)
    samples = []
    for k in range(8):
        phase = 4 * math.pi * frequencies[frequency_index(k)] / C_M_S * distance.double()
        angle = phase - demodulation_phase_rad(k)
        samples.append(active * sum(w * torch.cos(h * angle) for h, w in weights))
    correlation = torch.stack(samples).float()
    return Exposure(correlation[None], active[None], ambient[None], distance[None])


def errors_m(sensor, distance, *, shift_m=None) -> dict[Shots, torch.Tensor]:
    """Measured minus true distance of a static, noise-free scene with a perfect prediction."""
    exposure = scene(sensor, distance, torch.full_like(distance, 0.01), torch.zeros_like(distance))
    found = {}
    for shots in Shots:
        raw = acquired(exposure, sensor, shots)
        frame = correct(raw, distance[None], description_of(sensor), shift_m=shift_m)
        assert frame.valid.all()
        found[shots] = (frame.distance_m - distance)[0]
    return found


@pytest.fixture
def walls():
    """Walls from 1 to 21 m, well inside the range that is unwrapped."""
    return torch.linspace(1.0, 21.0, 4800).reshape(48, 100)


def per_radian_m(frequency_hz):
    return unambiguous_range_m(frequency_hz) / TWO_PI


def test_calibrated_overtones_leave_less_than_a_milliradian_whatever_the_shots(sensor, walls):
    squares = {"harmonic_strength": 1.0, "wiggle_calibrated_share": 1.0}
    found = errors_m(merged(sensor, {**FINE, **squares}), walls)
    for shots in (Shots.TWO, Shots.FOUR):
        assert found[shots].abs().max() < 1e-3 * per_radian_m(sensor.f1_hz)
    # The fused distance may err by as much as its weaker half.
    assert found[Shots.EIGHT].abs().max() < 1e-3 * per_radian_m(sensor.f2_hz)


def test_without_the_table_the_wiggle_is_the_closed_form(sensor, walls):
    squares = {"harmonic_strength": 1.0, "wiggle_calibrated_share": 0.0, "highest_harmonic": 7}
    found = errors_m(merged(sensor, {**FINE, **squares}), walls)
    phase = walls.double() / per_radian_m(sensor.f1_hz)
    weights = harmonic_weights(1.0, 7)
    cosine = sum(w * torch.cos(h * phase) for h, w in weights)
    sine = sum(w * (-1) ** (h // 2) * torch.sin(h * phase) for h, w in weights)
    wiggle_rad = torch.remainder(torch.atan2(sine, cosine) - phase + math.pi, TWO_PI) - math.pi
    expected_m = wiggle_rad * per_radian_m(sensor.f1_hz)
    assert 0.07 < float(expected_m.abs().max()) < 0.08
    for shots in (Shots.TWO, Shots.FOUR):
        assert (found[shots] - expected_m).abs().max() < 1e-3


@pytest.mark.parametrize("share", [0.0, 0.9])
def test_drift_shifts_every_measurement_alike(sensor, walls, share):
    drifting = merged(
        sensor,
        {
            **FINE,
            "harmonic_strength": 0.0,
            "distance_drift_m_per_k": 12.5e-3,
            "drift_compensated_share": share,
            "calibration_temperature_k": 298.15,
            "self_heating_k": 8.0,
        },
    )
    imager_k = imager_temperature_k(drifting, torch.tensor([AMBIENT_K]))
    shift_m = residual_drift_m(drifting, imager_k)
    for error_m in errors_m(drifting, walls, shift_m=shift_m).values():
        assert (error_m - 16 * 12.5e-3 * (1 - share)).abs().max() < 2e-3


@pytest.mark.parametrize("name", ["epc660", "mlx75027"])
def test_shipped_sensors_measure_alike_with_2_4_and_8_shots(name, walls):
    """What their tables leave of the wiggle, and no wrong wrap, over the whole range."""
    shipped = read_config(SensorConfig, find_config("sensor", name))
    fine = merged(shipped, {**FINE, "saturation_range_m": unambiguous_range_m(shipped.f1_hz)})
    left = 1 - fine.wiggle_calibrated_share
    weights = harmonic_weights(fine.harmonic_strength, fine.highest_harmonic)
    wiggle_rad = max(map(abs, wiggle_of(weights).error_rad))
    for error_m in errors_m(fine, walls).values():
        # One word of 0.5 moves the weakest phase by less than a milliradian.
        assert error_m.abs().max() < (left * wiggle_rad + 1e-3) * per_radian_m(fine.f2_hz)
    assert description_of(fine).max_residual_m < 0.5 * candidate_spacing_m(
        fine.f1_hz, fine.f2_hz, fine.max_range_m
    )


# --- every effect at once, one number at a time

EVERYTHING = {
    "harmonic_strength": 0.8,
    "wiggle_calibrated_share": 0.7,
    "distance_drift_m_per_k": 12.5e-3,
    "drift_compensated_share": 0.5,
    "calibration_temperature_k": 298.15,
    "self_heating_k": 10.0,
    "offset_drift_lsb_per_k": 0.3,
    "offset_calibrated_share": 0.9,
    "offset_ambient_lsb": 20.0,
    "min_snr": 2.0,
}


def slow_words(sensor, distance, active, ambient, pattern_lsb, normals, row):
    """Words of one pixel and whether it is saturated; `normals` [8][2]."""
    rate = electrons_per_radiance_second(sensor) * INTEGRATION_S
    words, saturated = [], False
    for k in range(8):
        frequency_hz = sensor.f1_hz if k < 4 else sensor.f2_hz
        angle = 4 * math.pi * frequency_hz * distance / C_M_S - (k % 4) * math.pi / 2
        correlated = math.cos(angle)
        for h in range(3, sensor.highest_harmonic + 1, 2):
            correlated += sensor.harmonic_strength / h**2 * math.cos(h * angle)
        taps = []
        for sign, normal in zip((1, -1), normals[k], strict=True):
            light = active * POWER_W * (1 + sign * sensor.contrast * correlated) + ambient
            charge = rate * light / 2
            packet = charge + math.sqrt(charge + sensor.read_noise_e**2) * normal
            saturated |= packet >= sensor.full_well_e
            # Of a full tap the reading alone is noisy; none here is about to fill.
            full = charge > sensor.full_well_e
            held = sensor.full_well_e + sensor.read_noise_e * normal
            taps.append(held if full else packet)
        filled = min(rate * ambient / 2 / sensor.full_well_e, 1.0)
        parity_lsb = sensor.offset_ambient_lsb * filled * (-1) ** row
        word = round((taps[0] - taps[1]) * sensor.gain_lsb_per_e + pattern_lsb + parity_lsb)
        words.append(min(max(word, -2048), 2047))
        saturated |= not -2047 <= word <= 2046
    return words, saturated


def slow_phase(words, offset_lsb, table: WiggleTable, shift_rad):
    """Phase and amplitude of two or four samples."""
    d = [word - offset_lsb for word in words]
    cosine, sine = (d[0] - d[2], d[1] - d[3]) if len(d) == 4 else (d[0], d[1])
    phase = math.atan2(sine, cosine) % TWO_PI
    place = phase / TWO_PI * len(table.error_rad)
    left = int(place) % len(table.error_rad)
    right = (left + 1) % len(table.error_rad)
    error = table.error_rad[left] * (1 - place % 1) + table.error_rad[right] * (place % 1)
    amplitude = math.hypot(sine, cosine) / (2 if len(d) == 4 else 1)
    return (phase - error + shift_rad) % TWO_PI, amplitude


def slow_depth(words, saturated, offset_lsb, predicted, noise_lsb, shift_m, known):
    """Corrected distance of one pixel, and whether it is valid."""
    ranges = [unambiguous_range_m(f) for f in (known.f1_hz, known.f2_hz)]
    parts = [words[:4], words[4:]] if len(words) == 8 else [words]
    wrapped = []
    for part, range_m, table in zip(parts, ranges, known.wiggle, strict=False):
        phase, amplitude = slow_phase(part, offset_lsb, table, shift_m / range_m * TWO_PI)
        wrapped.append(phase / TWO_PI * range_m)
        strong = amplitude >= known.min_snr * noise_lsb
        if len(wrapped) == 1:
            valid = strong and not saturated
    near = wrapped[0] + ranges[0] * max(0, round((predicted - wrapped[0]) / ranges[0]))
    distance = predicted if wrapped[0] >= known.saturation_range_m else near
    if len(wrapped) == 2:
        fused, apart = slow_dual(wrapped, ranges, known)
        distance = fused if strong and apart <= known.max_residual_m else distance
    return (distance if valid else predicted), valid


def slow_dual(wrapped, ranges, known):
    """Best pair of candidates within the range, fused by inverse variance, and their distance."""
    weight2 = known.f2_hz**2 / (known.f1_hz**2 + known.f2_hz**2)
    pairs = []
    for n in range(int(known.max_range_m / ranges[0]) + 1):
        first = wrapped[0] + n * ranges[0]
        if n == 0 or first <= known.max_range_m:
            second = wrapped[1] + ranges[1] * round((first - wrapped[1]) / ranges[1])
            pairs.append((abs(first - second), first + weight2 * (second - first)))
    apart, fused = min(pairs)
    return max(fused, 0.0), apart


@pytest.mark.parametrize("shots", list(Shots))
def test_a_slow_loop_over_pixels_gives_the_same_depth(sensor, shots):
    everything = merged(sensor, EVERYTHING)
    known: SensorDescription = description_of(everything)
    generator = torch.Generator().manual_seed(12)
    unit = torch.rand(3, 16, 16, generator=generator)
    distance, ambient = 0.5 + 22.0 * unit[0], 10.0 ** (3.5 * unit[1] - 3.0)
    active = 0.3 / distance**2
    predicted = distance + 6.0 * (unit[2] - 0.5)
    imager_k = imager_temperature_k(everything, torch.tensor([AMBIENT_K], dtype=torch.float64))
    shift_m = residual_drift_m(everything, imager_k)
    offsets = draw_offsets(
        everything, 16, 16, generator=stream(Purpose.OFFSETS, 3), imager_k=float(imager_k)
    )
    noise = draw_noise(5, 6, 8, 16, 16)[None]
    exposure = scene(everything, distance, active, ambient)
    raw = acquired(exposure, everything, shots, noise=noise, offsets=offsets)
    frame = correct(
        raw,
        predicted[None],
        known,
        offset_lsb=offsets.calibrated_lsb,
        noise_lsb=2.0,
        shift_m=shift_m,
    )
    different = 0
    for y in range(16):
        for x in range(16):
            words, saturated = slow_words(
                everything,
                float(distance[y, x]),
                float(active[y, x]),
                float(ambient[y, x]),
                float(offsets.pattern_lsb[0, y, x]),
                noise[0, :, :, y, x].tolist(),
                y,
            )
            slow, valid = slow_depth(
                words[: int(shots)],
                bool(raw.saturated[0, y, x]),
                float(offsets.calibrated_lsb[0, y, x]),
                float(predicted[y, x]),
                2.0,
                float(shift_m),
                known,
            )
            same_words = raw.dcs_lsb[0, :, y, x].tolist() == words[: int(shots)]
            if shots == Shots.EIGHT and same_words:
                assert bool(raw.saturated[0, y, x]) == saturated
            same = same_words and abs(float(frame.distance_m[0, y, x]) - slow) < 1e-4
            different += not (same and bool(frame.valid[0, y, x]) == valid)
    # Float32 may round a value next to one half the other way.
    assert different <= 3
    assert 0.2 < float(frame.valid.float().mean()) < 1.0
    assert bool(raw.saturated.any())
