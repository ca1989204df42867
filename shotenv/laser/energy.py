"""What a frame costs: optical power, efficiency, and where the energy goes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import torch
from torch import Tensor

from shotenv.config import ROOM_K, LaserConfig
from shotenv.laser.ageing import ageing_rate
from shotenv.laser.cost import ShotCost

Array = Any
SECONDS_PER_HOUR = 3600.0
PREFIXES = (2, 4, 8)
"""Samples of the acquisitions, `unwrap.signal.Shots`: each holds the shorter ones."""


class NetworkWork(NamedTuple):
    """Multiply-accumulates that networks take, each charged in the frames in which it runs.

    Attributes
    ----------
    gray : float
        Of the prediction from the gray image: in every frame, for the observation tells it.
    samples : float
        Of a network that looks at the samples: once for the samples taken, and once for each
        shorter acquisition in them, for what fewer samples would have brought is observed too.
    """

    gray: float = 0.0
    samples: float = 0.0


NO_NETWORK = NetworkWork()


def emitted_power_w(power_w: Array, temperature_k: Array, laser: LaserConfig) -> Array:
    """Optical power while on, W, after derating.

    Above `derate_k` it falls by `derate_per_k` of the undiminished `power_w` per kelvin, down to
    `derate_floor` of it.
    """
    if not laser.derate_per_k:
        return power_w
    above_k = temperature_k - laser.derate_k
    return power_w * (1.0 - laser.derate_per_k * above_k).clip(laser.derate_floor, 1.0)


def efficiency_at(temperature_k: Array, laser: LaserConfig) -> Array:
    """Optical over electrical power; falls linearly from 25 C to the trip temperature.

    A VCSEL loses about 0.001 to 0.003 per kelvin (assumed).
    """
    if not laser.efficiency_slope_per_k:
        return laser.efficiency
    # No light is made above the trip; without that bound the line would fall through zero, and a
    # division by it follows.
    above_k = (temperature_k - ROOM_K).clip(0.0, max(laser.trip_k - ROOM_K, 0.0))
    return laser.efficiency - laser.efficiency_slope_per_k * above_k


def electrical_power_w(optical_power_w: Array, temperature_k: Array, laser: LaserConfig) -> Array:
    """What the laser takes while on, W.

    Power and efficiency are those at the start of the frame, in which the junction warms by tenths
    of a kelvin. Modulation is in `optical_power_w` already, a mean while on.
    """
    return optical_power_w / efficiency_at(temperature_k, laser)


def heat_of(
    shots: Tensor,
    laser: LaserConfig,
    *,
    optical_power_w: Tensor,
    temperature_k: Tensor,
    integration_s: Tensor,
) -> Tensor:
    """What the laser leaves in its package, joules: `ShotCost.heat_j` alone, see `shot_cost`."""
    on_s = shots * integration_s
    electrical_w = electrical_power_w(optical_power_w, temperature_k, laser)
    return on_s * electrical_w - on_s * optical_power_w


@lru_cache(maxsize=64)
def chip_energies_j(
    readout_j: float, static_j: float, gray_network_j: float, samples_network_j: float
) -> Tensor:
    """What does not depend on the laser, by number of samples, float64 [4, 9], joules.

    Of the readouts, of the imager standing by, of the networks, and of all three. As a table,
    because a step looks up its row faster than it could work it out.
    """
    rows = []
    for shots in range(PREFIXES[-1] + 1):
        # One readout more, of the gray image.
        readouts_j = (shots + 1) * readout_j
        passes = sum(fewer <= shots for fewer in PREFIXES)
        networks_j = gray_network_j + samples_network_j * passes
        rows.append((readouts_j, static_j, networks_j, readouts_j + static_j + networks_j))
    return torch.tensor(rows, dtype=torch.float64).T.contiguous()


def shot_cost(
    shots: Tensor,
    laser: LaserConfig,
    *,
    optical_power_w: Tensor,
    temperature_k: Tensor,
    integration_s: Tensor,
    frame_period_s: float,
    network: NetworkWork = NO_NETWORK,
) -> ShotCost:
    """Energy, duty, heat and wear of one frame.

    Laser, modulation driver and readouts go with the samples, one readout more with the gray
    image; the imager's static power with the frame period; networks with their predictions, see
    `NetworkWork`.

    Parameters
    ----------
    shots : int64 [B]
        0 (laser off), 2, 4 or 8.
    optical_power_w, integration_s : float64 [B]
        Emitted power while on, W; time of one sample, s.
    temperature_k : float64 [B]
        Of the junction, at the start of the frame.
    frame_period_s : float
        Seconds from frame to frame.
    network : NetworkWork
        None by default.
    """
    on_s = shots * integration_s
    electrical_w = electrical_power_w(optical_power_w, temperature_k, laser)
    optical_j, laser_j = on_s * optical_power_w, on_s * electrical_w
    driver_j = on_s * laser.driver_power_w
    chips = chip_energies_j(
        laser.readout_energy_j,
        laser.static_power_w * frame_period_s,
        laser.energy_per_mac_j * network.gray,
        laser.energy_per_mac_j * network.samples,
    )
    readout_j, static_j, network_j, chips_j = chips.index_select(1, shots).unbind()
    wear = ageing_rate(electrical_w, temperature_k, laser)
    return ShotCost(
        laser_energy_j=laser_j,
        driver_energy_j=driver_j,
        readout_energy_j=readout_j,
        static_energy_j=static_j,
        network_energy_j=network_j,
        energy_j=laser_j + driver_j + chips_j,
        optical_j=optical_j,
        heat_j=laser_j - optical_j,
        duty=on_s / frame_period_s,
        life_used_h=on_s * (wear / SECONDS_PER_HOUR),
    )
