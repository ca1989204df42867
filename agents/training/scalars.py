"""Numbers of a run for TensorBoard."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

FOLDER: Final = "tensorboard"


class Scalars:
    """Curves in the folder `tensorboard` of `out`; of None, nothing is written.

    Raises
    ------
    ImportError
        TensorBoard is not installed.
    """

    def __init__(self, out: Path | None) -> None:
        self._writer: Any = None
        if out is not None:
            try:
                from torch.utils.tensorboard import SummaryWriter
            except ImportError:
                raise ImportError(
                    "agent.tensorboard needs tensorboard, which is not installed: "
                    "pip install tensorboard"
                ) from None
            self._writer = SummaryWriter(str(out / FOLDER))

    def add(self, name: str, value: float, step: int) -> None:
        """One point of the curve `name`."""
        if self._writer is not None:
            self._writer.add_scalar(name, value, step)
            self._writer.flush()
