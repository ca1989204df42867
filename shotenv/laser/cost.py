"""What the acquisition of a frame costs: energy by part, light, heat, duty and wear."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

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
