"""What an ONNX file computes: a network with what comes before and after it."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from unwrap.depth import RULES, Merge
from unwrap.networks import Needs, Prediction, Unwrapper, predict_thinned
from unwrap.signal import (
    GRAY_FULL_SCALE,
    RawFrame,
    Sensed,
    SensorDescription,
    unambiguous_range_m,
    wrapped_and_valid,
)


class Exported(nn.Module):
    """What an ONNX file computes: the names of its inputs and outputs are those of `forward`.

    Parameters
    ----------
    unwrapper : Unwrapper
    sensor : SensorDescription
    merge : "nearest", "floor" or "none"

    Raises
    ------
    ValueError
        The network was trained for another frequency.
    """

    def __init__(self, unwrapper: Unwrapper, sensor: SensorDescription, merge: Merge):
        super().__init__()
        unwrapper.require_frequency(sensor)
        self.network, self.stride = unwrapper.network, unwrapper.stride
        self.sensor, self.merge = sensor, merge

    def look(self, sensed: Sensed) -> Prediction:
        """The network's prediction for frames, thinned for it as `Unwrapper.predict_sensed` does.

        In float32 wherever it runs, so that a file does not depend on the machine that wrote it.
        """
        stride = self.stride(*sensed.gray.shape[-2:])
        return predict_thinned(self.network, sensed, self.sensor, stride)

    def merged(self, predicted_m: Tensor, wrapped_m: Tensor) -> Tensor:
        """Wrapped distance with the wraps that the prediction tells, all [1, H, W] in metres."""
        unambiguous_m = unambiguous_range_m(self.sensor.f1_hz)
        limit_m = self.sensor.saturation_range_m
        return RULES[self.merge].of_tensors(predicted_m, wrapped_m, unambiguous_m, limit_m)

    def wraps(self, distance_m: Tensor, wrapped_m: Tensor) -> Tensor:
        """Whole unambiguous ranges from `wrapped_m` to `distance_m`, rounded; int32 [1, H, W]."""
        # Rounded: pixels that are not trusted keep a prediction, which is no wrap candidate.
        turns = (distance_m - wrapped_m) / unambiguous_range_m(self.sensor.f1_hz)
        return turns.round().clamp(min=0).to(torch.int32)


class ExportedGray(Exported):
    """A gray image and a wrapped map to distance, by a network of the gray image alone."""

    def forward(self, gray: Tensor, wrapped_m: Tensor) -> dict[str, Tensor]:
        """Predicted distance, wraps and corrected distance.

        Parameters
        ----------
        gray : uint16 [1, H, W]
            12-bit gray image.
        wrapped_m : float32 [1, H, W]
            Distance within the unambiguous range at f1, metres.

        Returns
        -------
        predicted_m, wraps, distance_m : float32, int32, float32 [1, H, W]
            The network's distance; whole unambiguous ranges from `wrapped_m` to `distance_m`,
            rounded; and the two merged.
        """
        predicted_m = self.look(Sensed(fractions(gray))).distance_m
        distance_m = self.merged(predicted_m, wrapped_m)
        return {
            "predicted_m": predicted_m,
            "wraps": self.wraps(distance_m, wrapped_m),
            "distance_m": distance_m,
        }


class ExportedSamples(Exported):
    """A gray image and samples to distance, by a network that looks at both; without memory."""

    def forward(
        self,
        gray: Tensor,
        dcs_lsb: Tensor,
        saturated: Tensor,
        offset_lsb: Tensor,
        noise_lsb: Tensor,
        shift_m: Tensor,
    ) -> dict[str, Tensor]:
        """Predicted distance, wraps, corrected distance, confidence and validity.

        Parameters
        ----------
        gray : uint16 [1, H, W]
            12-bit gray image.
        dcs_lsb : float32 [1, n, H, W]
            Two or four samples at f1, finite.
        saturated : bool [1, H, W]
        offset_lsb, noise_lsb : float32 [1, H, W]
            Stored dark offset, and standard deviation of one sample, above 0.
        shift_m : float32 [1]
            Added to the wrapped distances, metres; see `unwrap.signal.calibrated.decode_at`.

        Returns
        -------
        predicted_m, wraps, distance_m : float32, int32, float32 [1, H, W]
            The network's distance; whole unambiguous ranges from the samples' own wrapped distance
            to `distance_m`, rounded; and what `unwrap.depth.correction.correct` makes of both.
        confidence, valid : float32, bool [1, H, W]
            The network's own, and where the signal is strong enough and not saturated.
        """
        # The exported arctangent takes minus zero, which rounding gives, for a negative number.
        dcs_lsb = torch.where(dcs_lsb == 0, 0.0, dcs_lsb)
        raw = RawFrame(dcs_lsb, saturated)
        sensed = Sensed(fractions(gray), raw, offset_lsb, noise_lsb, shift_m)
        prediction = self.look(sensed)
        predicted_m = prediction.distance_m
        wrapped_m, valid = wrapped_and_valid(sensed, self.sensor)
        distance_m = self.merged(predicted_m, wrapped_m).where(valid, predicted_m)
        return {
            "predicted_m": predicted_m,
            "wraps": self.wraps(distance_m, wrapped_m),
            "distance_m": distance_m,
            "confidence": prediction.confidence,
            "valid": valid,
        }


EXPORTED: dict[Needs, type[Exported]] = {"gray": ExportedGray, "samples": ExportedSamples}
"""By what the network looks at."""


def exported_network(unwrapper: Unwrapper, sensor: SensorDescription, merge: Merge) -> Exported:
    """What the file of a network computes, in evaluation mode; see `Exported`."""
    return EXPORTED[unwrapper.network.needs](unwrapper, sensor, merge).eval()


def fractions(gray: Tensor) -> Tensor:
    """12-bit gray image in [0, 1], float32."""
    return gray.to(torch.float32) / GRAY_FULL_SCALE
