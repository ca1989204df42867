"""Frames larger than those that a network was trained on.

How wide things are in pixels is part of what a network learns, so that it does badly on the same
view with more pixels. Frames whose height and width are the same multiple k of the trained ones are
therefore thinned to every k-th row and column, and the prediction is upsampled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from torch import Tensor
from torch.nn import functional

from unwrap.depth import nearest_wraps
from unwrap.networks.network import Needs, Network, Prediction
from unwrap.signal import Sensed, SensorDescription, unambiguous_range_m, wrapped_and_valid
from unwrap.support import mapped

FIRST_SIZE = (120, 160)
"""Size that networks were trained on whose metadata does not tell it."""


def trained_size(metadata: Mapping[str, Any]) -> tuple[int, int]:
    """Height and width of the frames that a network was trained on, pixels.

    Raises
    ------
    ValueError
        `trained_height` or `trained_width` is no positive whole number.
    """
    size = []
    for name, usual in zip(("trained_height", "trained_width"), FIRST_SIZE, strict=True):
        value = metadata.get(name, usual)
        if type(value) is not int or value < 1:
            raise ValueError(f"{name} is {value!r}; expected a positive whole number")
        size.append(value)
    return size[0], size[1]


def stride_to(trained: tuple[int, int], size: tuple[int, int]) -> int:
    """Every how many rows and columns of a frame of `size` give one as large as `trained`.

    1 where both are not the same whole multiple.

    Examples
    --------
    >>> stride_to((120, 160), (240, 320)), stride_to((120, 160), (240, 321))
    (2, 1)
    """
    stride = size[0] // trained[0]
    fits = stride > 1 and size == (stride * trained[0], stride * trained[1])
    return stride if fits else 1


def thin(sensed: Sensed, stride: int) -> Sensed:
    """Every `stride`-th row and column of all maps, from the first on."""
    if stride == 1:
        return sensed
    return mapped(lambda t: t[..., ::stride, ::stride] if t.ndim > 1 else t, sensed)


def upsample(maps: Tensor, stride: int) -> Tensor:
    """Thinned maps [B, h, w] at full size [B, h stride, w stride].

    Linear between the rows and columns that were looked at, which keep their values; the last ones
    serve for those behind them.

    Examples
    --------
    >>> import torch
    >>> upsample(torch.tensor([[[1.0, 3.0]]]), 2)[0, 0]
    tensor([1., 2., 3., 3.])
    """
    if stride == 1:
        return maps
    size = [(pixels - 1) * stride + 1 for pixels in maps.shape[-2:]]
    # Aligned corners put pixel i of the small map on pixel i stride, where it was taken from.
    between = functional.interpolate(maps.unsqueeze(1), size, mode="bilinear", align_corners=True)
    behind = stride - 1
    return functional.pad(between, (0, behind, 0, behind), mode="replicate").squeeze(1)


def upsample_prediction(
    prediction: Prediction, sensed: Sensed, sensor: SensorDescription, stride: int, needs: Needs
) -> Prediction:
    """Prediction of the thinned frames at the size of `sensed`.

    Distance and confidence are upsampled. Networks that need samples tell the distance of each
    pixel, which no interpolation does: where a pixel is valid, the upsampled distance only chooses
    the nearest of its own wrap candidates.
    """
    if stride == 1:
        return prediction
    distance_m = upsample(prediction.distance_m, stride)
    confidence = upsample(prediction.confidence, stride)
    if needs == "samples":
        wrapped_m, valid = wrapped_and_valid(sensed, sensor)
        unambiguous_m = unambiguous_range_m(sensor.f1_hz)
        wraps = nearest_wraps(distance_m, wrapped_m, unambiguous_m)
        distance_m = (wrapped_m + wraps * unambiguous_m).where(valid, distance_m)
    return Prediction(distance_m, confidence)


def predict_thinned(
    network: Network,
    sensed: Sensed,
    sensor: SensorDescription,
    stride: int,
    *,
    forward: Callable[[Tensor], Tensor] | None = None,
) -> Prediction:
    """Predict frames that are thinned for the network; the prediction has their own size.

    `forward` takes the place of the network's own forward pass, as an
    `unwrap.networks.engines.Engine` does.
    """
    shown = thin(sensed, stride)
    output = (forward or network)(network.features(shown, sensor))
    prediction = network.predict(output, shown, sensor)
    return upsample_prediction(prediction, sensed, sensor, stride, network.needs)
