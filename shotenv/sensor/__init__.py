"""Light becomes electrons, noise and converter words."""

from shotenv.sensor.acquire import (
    Electrons,
    Sensitivity,
    acquire,
    charge,
    collect,
    expose,
    sensitivity,
    single_sample_snr,
)
from shotenv.sensor.drift import distance_drift_m, imager_temperature_k, residual_drift_m
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.gray import capture_gray, sample_noise_lsb
from shotenv.sensor.noise import Purpose, draw_noise, noise_samples, stream, stream_seed
from shotenv.sensor.offsets import OffsetPattern, draw_offsets

__all__ = [
    "Electrons",
    "OffsetPattern",
    "Purpose",
    "Sensitivity",
    "acquire",
    "capture_gray",
    "charge",
    "collect",
    "distance_drift_m",
    "draw_noise",
    "draw_offsets",
    "electrons_per_radiance_second",
    "expose",
    "imager_temperature_k",
    "noise_samples",
    "residual_drift_m",
    "sample_noise_lsb",
    "sensitivity",
    "single_sample_snr",
    "stream",
    "stream_seed",
]
