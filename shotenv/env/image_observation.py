"""The image observation: gray of this frame, depth and validity of the last, 60 x 80 pixels."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from shotenv.decision import Acquisition, Problem, State, acquire_depth
from shotenv.env.arguments import IMAGE_SHAPE
from shotenv.laser import emitted_power_w
from shotenv.sensor import full_scale_lsb
from unwrap.signal import Shots
from unwrap.support import take

SIZE = IMAGE_SHAPE[1:]


@torch.inference_mode()
def acquired_again(problem: Problem, state: State, shots: Shots) -> Acquisition:
    """What the frames at `state` brought with `shots` samples each, number for number.

    Noise belongs to the drive, the frame and the sample, so that a frame that was played can be
    taken again.
    """
    drive = state.drive
    power_w = emitted_power_w(drive.laser_power_w, state.laser.temperature_k, problem.config.laser)
    return acquire_depth(problem, drive, state.step, shots, power_w)


def gray_images(problem: Problem, frames: Tensor) -> np.ndarray:
    """Gray images uint8 [B, 60, 80] of bank frames int64 [B]; 255 is full scale."""
    gray = problem.bank.gray(frames).to(torch.float32)
    return _bytes(_small(gray / full_scale_lsb(problem.config.sensor.adc_bits)))


def depth_images(problem: Problem, before: State, shots: Tensor) -> np.ndarray:
    """Depth and validity uint8 [B, 2, 60, 80] of the frames at `before`, taken with `shots` [B].

    Depth is the mean over the valid pixels, 255 the scored range (`sensor.max_range_m`), 0 where
    none is valid; validity is the share of pixels that is valid, 255 all of them. Both are 0 of
    a frame without laser.
    """
    found = np.zeros((len(shots), 2, *SIZE), np.uint8)
    for count in sorted(set(shots.tolist()) - {0}):
        rows = (shots == count).nonzero().squeeze(1)
        depth = acquired_again(problem, take(before, rows), Shots(count)).depth
        range_m = problem.config.sensor.max_range_m
        # Sums of depth over sums of pixels: means over the valid ones.
        share = _small(depth.valid.to(torch.float32))
        distance_m = _small(torch.where(depth.valid, depth.distance_m, 0.0))
        mean_m = torch.where(share > 0.0, distance_m / share, 0.0)
        found[rows.numpy(), 0] = _bytes(mean_m / range_m)
        found[rows.numpy(), 1] = _bytes(share)
    return found


def no_depth_images(batch: int) -> np.ndarray:
    """What stands for depth and validity before the first frame of `batch` drives."""
    return np.zeros((batch, 2, *SIZE), np.uint8)


def _small(maps: Tensor) -> Tensor:
    """Maps [B, H, W] averaged over areas, [B, 60, 80]."""
    return torch.nn.functional.adaptive_avg_pool2d(maps.unsqueeze(1), SIZE).squeeze(1)


def _bytes(shares: Tensor) -> np.ndarray:
    """Shares of 1 as uint8, rounded."""
    return (shares * 255.0).round_().clamp_(0.0, 255.0).to(torch.uint8).numpy()
