"""Light becomes electrons, noise and converter words."""

from shotenv.sensor.acquire import (
    Sensitivity,
    acquire,
    expose,
    light_of,
    scored_pixels,
    sensitivity,
)
from shotenv.sensor.drift import distance_drift_m, imager_temperature_k, residual_drift_m
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.gray import capture_gray, sample_noise_lsb
from shotenv.sensor.noise import Purpose, draw_noise, noise_samples, stream, stream_seed
from shotenv.sensor.offsets import OffsetPattern, draw_offsets

__all__ = [
    "OffsetPattern",
    "Purpose",
    "Sensitivity",
    "acquire",
    "capture_gray",
    "distance_drift_m",
    "draw_noise",
    "draw_offsets",
    "electrons_per_radiance_second",
    "expose",
    "imager_temperature_k",
    "light_of",
    "noise_samples",
    "residual_drift_m",
    "sample_noise_lsb",
    "scored_pixels",
    "sensitivity",
    "stream",
    "stream_seed",
]
