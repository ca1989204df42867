"""The values that pass between renderer, sensor and environment: frozen, batch first."""

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


ENERGY_PARTS = (
    "laser_energy_j",
    "driver_energy_j",
    "readout_energy_j",
    "static_energy_j",
    "network_energy_j",
)
"""Where the energy of a frame goes; fields of `ShotCost`."""


@dataclass(frozen=True)
class ShotCost:
    """What an acquisition of each environment in the batch costs; float64 [B] each.

    Attributes
    ----------
    laser_energy_j, driver_energy_j, readout_energy_j, static_energy_j, network_energy_j
        Electrical energy of the laser, of the modulation driver, of the readouts (that of the gray
        image too), of the imager standing by, and of network compute, joules.
    energy_j
        Sum of these, joules.
    optical_j
        Light that leaves the laser, joules.
    heat_j
        Heat that the laser leaves in its package, joules.
    duty
        Laser-on time per frame period, 0..1.
    life_used_h
        Hours of the laser's rated life.
    """

    laser_energy_j: Tensor
    driver_energy_j: Tensor
    readout_energy_j: Tensor
    static_energy_j: Tensor
    network_energy_j: Tensor
    energy_j: Tensor
    optical_j: Tensor
    heat_j: Tensor
    duty: Tensor
    life_used_h: Tensor
