"""Merging a prediction with a wrapped distance map: eq. 6, eq. 8, the nearest candidate, or none.

All take and return [..., H, W] in metres. Equation numbers are those of Nagiub et al. (2023).
`wrapped_m` is the distance within one unambiguous range, `saturation_m` the wrapped distance from
which on the sensor is not to be trusted.
"""

from __future__ import annotations

import torch
from torch import Tensor


def nearest_wraps(predicted_m: Tensor, wrapped_m: Tensor, unambiguous_m: float) -> Tensor:
    """Whole wraps, as floats, that bring `wrapped_m` nearest to `predicted_m`; never negative."""
    return predicted_m.sub(wrapped_m).mul_(1 / unambiguous_m).round_().clamp_(min=0)


def merge_regression(
    predicted_m: Tensor, wrapped_m: Tensor, unambiguous_m: float, saturation_m: float
) -> Tensor:
    """Eq. 6: floor(d_p / d_u) d_u + d_M1 where d_M1 < d_sat, else d_p."""
    wraps = predicted_m.mul(1 / unambiguous_m).floor_()
    return _merged(wraps, wrapped_m, unambiguous_m, predicted_m, saturation_m)


def merge_segmentation(
    wraps: Tensor, wrapped_m: Tensor, unambiguous_m: float, saturation_m: float
) -> Tensor:
    """Eq. 8: class d_u + d_M1 where d_M1 < d_sat, else class d_u."""
    return _merged(wraps, wrapped_m, unambiguous_m, wraps * unambiguous_m, saturation_m)


def merge_nearest(
    predicted_m: Tensor, wrapped_m: Tensor, unambiguous_m: float, saturation_m: float
) -> Tensor:
    """n d_u + d_M1 with n = max(0, round((d_p - d_M1) / d_u)) where d_M1 < d_sat, else d_p.

    Ours. Right wherever the prediction errs by less than half an unambiguous range, while eq. 6
    errs as soon as prediction and truth lie on different sides of a wrap.
    """
    wraps = nearest_wraps(predicted_m, wrapped_m, unambiguous_m)
    return _merged(wraps, wrapped_m, unambiguous_m, predicted_m, saturation_m)


def merge_none(
    predicted_m: Tensor, wrapped_m: Tensor, unambiguous_m: float, saturation_m: float
) -> Tensor:
    """The prediction as it is: of networks that have seen the samples and refine each distance."""
    return predicted_m.clone()


def _merged(
    wraps: Tensor, wrapped_m: Tensor, unambiguous_m: float, otherwise_m: Tensor, saturation_m: float
) -> Tensor:
    unwrapped_m = torch.add(wrapped_m, wraps, alpha=unambiguous_m)
    trusted = below(wrapped_m, saturation_m)
    return otherwise_m.to(unwrapped_m).lerp(unwrapped_m, trusted)


def below(values: Tensor, limit: Tensor | float) -> Tensor:
    """1 where `values` are below `limit`, else 0, of their type.

    Comparing into floats and choosing by `lerp` with these weights is exact and several times
    faster than comparing into a bool and choosing by `torch.where`.
    """
    return torch.lt(values, limit, out=torch.empty_like(values))


def weights_of(mask: Tensor) -> Tensor:
    """1 where the bool `mask` holds, else 0, float32; by way of bytes, which are converted faster.

    >>> weights_of(torch.tensor([True, False]))
    tensor([1., 0.])
    """
    return mask.view(torch.uint8).to(torch.float32)
