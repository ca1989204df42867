"""A drive through nothing, before a camera starts: loops are compiled, and networks have run."""

from __future__ import annotations

import torch

from shotenv.bank import ClipSettings
from shotenv.config import EnvConfig
from shotenv.decision import Measurement, observe, reset, step
from shotenv.live.live_bank import LiveBank
from shotenv.live.live_camera import GrayFrame, Samples
from shotenv.live.live_problem import Networks, live_problem, look, measure_live
from unwrap.signal import GRAY_FULL_SCALE, Shots


class BlankCamera:
    """A camera that sees an even gray, and nothing by its laser."""

    name = "blank camera"

    def __init__(self, size: tuple[int, int], settings: ClipSettings) -> None:
        self.size = size
        self.laser_power_w, self.integration_s = settings.laser_power_w, settings.integration_s
        self._ambient_k = settings.ambient_k

    def start(self) -> None:
        """See `Camera.start`."""

    def next_frame(self) -> GrayFrame:
        """See `Camera.next_frame`."""
        return GrayFrame(torch.full(self.size, GRAY_FULL_SCALE // 3, dtype=torch.uint16), 1e-3)

    def acquire(self, shots: Shots) -> Samples:
        """See `Camera.acquire`."""
        shape = int(shots), *self.size
        return Samples(torch.zeros(shape), torch.zeros(shape, dtype=torch.bool))

    def temperature_k(self) -> float:
        """See `Camera.temperature_k`."""
        return self._ambient_k

    def close(self) -> None:
        """See `Camera.close`."""


def warm_up(
    config: EnvConfig, networks: Networks, settings: ClipSettings, size: tuple[int, int]
) -> None:
    """Play a frame of each number of samples of a camera that sees nothing."""
    bank = LiveBank(BlankCamera(size, settings), config.frames_per_drive + 1, settings)
    problem = live_problem(bank, config, networks)
    state = reset(problem, (0,))

    def measure(*asked) -> Measurement:
        return measure_live(*asked)[0]

    # Two frames at least are in every drive.
    for action in (Shots.TWO.action, Shots.EIGHT.action):
        bank.next_frame()
        look(problem, bank, networks[0])
        observe(problem, state)
        state, _ = step(problem, state, torch.tensor([action]), measure=measure)
