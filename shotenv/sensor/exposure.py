"""Light as it falls on the sensor, without noise: what a bank holds of its frames."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True)
class Exposure:
    """Noise-free light of a batch of frames, before laser power and integration time are chosen.

    Attributes
    ----------
    correlation : float32 [B, 8, H, W]
        Correlation of the active light with the demodulation signal of each sample, at that
        sample's own instant: Re(P_f exp(-i theta_k)), radiance in W m-2 sr-1 per watt of
        optical laser power.
    active : float32 [B, H, W]
        Active radiance, mean over the samples, in W m-2 sr-1 per watt of laser power.
    ambient : float32 [B, H, W]
        Ambient radiance inside the optical band filter, W m-2 sr-1.
    distance_m : float32 [B, H, W]
        True radial distance through the pixel's centre at the start of the frame, metres;
        infinite where nothing is hit (sky).
    """

    correlation: Tensor
    active: Tensor
    ambient: Tensor
    distance_m: Tensor

    def __getitem__(self, index) -> Exposure:
        """Frames chosen by a batch index."""
        return Exposure(
            self.correlation[index], self.active[index], self.ambient[index], self.distance_m[index]
        )
