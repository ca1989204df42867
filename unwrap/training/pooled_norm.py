"""Batch normalisation over the frames of all processes that share a batch.

`torch.nn.SyncBatchNorm` does the same on GPUs alone.
"""

from __future__ import annotations

from typing import Any

import torch
from lightning.pytorch.plugins.layer_sync import LayerSync
from torch import Tensor, distributed, nn
from torch.autograd.function import once_differentiable
from torch.nn import functional


class PooledBatchNorm(nn.BatchNorm2d):
    """A batch normalisation whose mean and variance in training are those of the whole batch."""

    def forward(self, features: Tensor) -> Tensor:
        """features [B, C, H, W] -> the same shape; B may differ from process to process."""
        if not self.training:
            return super().forward(features)
        output, mean, variance, count = _Normalise.apply(features, self.weight, self.bias, self.eps)
        with torch.no_grad():
            assert self.running_mean is not None
            assert self.running_var is not None
            assert self.num_batches_tracked is not None
            assert self.momentum is not None
            self.num_batches_tracked.add_(1)
            self.running_mean.lerp_(mean, self.momentum)
            # As torch's own: what is kept is the unbiased variance.
            self.running_var.lerp_(variance * (count / (count - 1)), self.momentum)
        return output


class PooledNorms(LayerSync):
    """Makes the batch normalisations of a model `PooledBatchNorm`, and undoes it."""

    def apply(self, model: nn.Module) -> nn.Module:
        """Pool the statistics of all its batch normalisations."""
        return _of_class(model, nn.BatchNorm2d, PooledBatchNorm)

    def revert(self, model: nn.Module) -> nn.Module:
        """Back to each process's own."""
        return _of_class(model, PooledBatchNorm, nn.BatchNorm2d)


def _of_class(model: nn.Module, old: type[nn.Module], new: type[nn.Module]) -> nn.Module:
    for layer in model.modules():
        if type(layer) is old:
            # Only what it does is another: weights, state and the optimiser's hold of them stay.
            layer.__class__ = new
    return model


class _Normalise(torch.autograd.Function):
    """The normalisation, with one exchange of 3 C numbers forwards and one of 2 C backwards."""

    @staticmethod
    def forward(
        ctx: Any, features: Tensor, weight: Tensor, bias: Tensor, eps: float
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        # Statistics have the weights' precision, which features may fall short of.
        precise = features.to(weight.dtype)
        own_variance, own_mean = torch.var_mean(precise, (0, 2, 3), correction=0)
        pixels = torch.full_like(own_mean, features.numel() // features.shape[1])
        own = torch.stack((own_mean, own_variance, pixels))
        of_all = [torch.empty_like(own) for _ in range(distributed.get_world_size())]
        distributed.all_gather(of_all, own)
        means, variances, counts = torch.stack(of_all, 1)
        # The mean of all, and about it the variance of each process and that between them.
        count = counts.sum(0)
        mean = (counts * means).sum(0) / count
        variance = (counts * (variances + (means - mean).square())).sum(0) / count
        ctx.eps = eps
        ctx.save_for_backward(features, weight, mean, variance, count)
        ctx.mark_non_differentiable(mean, variance, count)
        output = functional.batch_norm(features, mean, variance, weight, bias, eps=eps)
        return output, mean, variance, count

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor, *_: Tensor) -> tuple[Tensor, Tensor, Tensor, None]:
        features, weight, mean, variance, count = ctx.saved_tensors
        # Torch's own backward pass for a mean and variance that do not depend on the features; its
        # gradients of weight and bias are the two sums that tell how they do.
        direct, of_weight, of_bias = torch.ops.aten.native_batch_norm_backward(
            gradient, features, weight, mean, variance, None, None, False, ctx.eps, [True] * 3
        )
        sums = torch.stack((of_weight, of_bias))
        distributed.all_reduce(sums)
        scale = (variance + ctx.eps).rsqrt()
        slope, offset = sums * (weight * scale / count)
        slope = slope * scale
        through = (features.to(weight.dtype) - mean[:, None, None]).mul_(slope[:, None, None])
        through = through.add_(offset[:, None, None]).to(direct.dtype)
        return direct - through, of_weight, of_bias, None
