"""A bank of what a camera delivered: words of samples in place of light."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.bank.bank import Bank, Clip
from shotenv.bank.files import BankError, TruthLevel
from shotenv.sensor import Exposure
from unwrap.signal import RawFrame, Shots


@dataclass(frozen=True)
class ClipSettings:
    """What was set, or known, as a clip was recorded: constants of a drive that plays it.

    Attributes
    ----------
    laser_power_w, integration_s : float
        Optical power while on, time of one sample.
    ambient_k : float
        Ambient temperature: that of the imager less the sensor's own rise.
    shift_m : float
        Added to every distance, metres: minus what the imager's temperature made of it.
    offset_lsb : float32 [H, W]
        Calibrated dark offset, subtracted from two samples; zeros where none is known.
    """

    laser_power_w: float
    integration_s: float
    ambient_k: float
    shift_m: float
    offset_lsb: Tensor

    def is_like(self, other: ClipSettings) -> bool:
        """Whether clips of both may be strung together."""
        return self._numbers == other._numbers and torch.equal(self.offset_lsb, other.offset_lsb)

    @property
    def _numbers(self) -> tuple[float, ...]:
        return self.laser_power_w, self.integration_s, self.ambient_k, self.shift_m


class WordBank(Bank):
    """Frames of which a bank has the samples that a camera took, and not the light.

    Nothing is added to the words as they are played: noise and offsets are in them. A drive has
    the settings of its clips.
    """

    @property
    def is_recorded(self) -> bool:
        """See `Bank.is_recorded`."""
        return True

    @property
    @abstractmethod
    def truth_level(self) -> TruthLevel:
        """What distances are scored against."""

    @property
    @abstractmethod
    def answers(self) -> tuple[Shots, ...]:
        """Acquisitions that it can answer, ascending: 2 and 4 samples, or 2, 4 and 8."""

    @abstractmethod
    def words(self, frames: Tensor, shots: Shots) -> RawFrame:
        """The first `shots` samples of the frames [B], one of `answers`; flags are of these alone.

        Where fewer samples of the same frames are asked for as well, the most are asked for first.
        """

    @abstractmethod
    def settings(self, clip: Clip) -> ClipSettings:
        """What the clip was recorded with."""

    @abstractmethod
    def distance_m(self, indices: Tensor) -> Tensor:
        """Reference float32 [B, H, W] of the frames [B], metres; NaN where there is none.

        Pixels without reference are not scored. With `truth_level` "own" or "none" nobody asks.
        """

    def exposure(self, indices: Tensor) -> Exposure:
        """Of what was recorded no light is known.

        Raises
        ------
        BankError
            Always.
        """
        raise BankError(
            f"bank {self.name} holds samples that a camera took, and no light to acquire others "
            "from; choose a rendered bank such as starter"
        )

    def require_answer(self, shots: Tensor) -> None:
        """Refuse numbers of samples [B] that were not recorded.

        Raises
        ------
        ValueError
            Names action, bank and what it answers.
        """
        known = torch.tensor([int(count) for count in self.answers])
        wrong = shots[~torch.isin(shots, known)]
        if len(wrong):
            asked = Shots(int(wrong[0]))
            can = " and ".join(f"{count.action} ({int(count)} DCS)" for count in self.answers)
            raise ValueError(
                f"action is {asked.action} ({int(asked)} DCS), but bank {self.name} only answers "
                f"{can}; choose by action_masks()"
            )
