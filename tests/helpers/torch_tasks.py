"""A task that computes with torch; worker processes import it by name."""

from __future__ import annotations

import torch


def threads(number: int) -> int:
    return torch.get_num_threads()
