"""The body of the networks: sizes, layers, gradients, a heap left in order."""

import os
import subprocess
import sys

import pytest
import torch
from torch import nn

from unwrap.networks.autoencoder import STRIDE, convolution, pad
from unwrap.networks.network import Settings, multiply_accumulates
from unwrap.networks.registry import PLACES, build_network
from unwrap.networks.tofregnet import TofRegNet
from unwrap.networks.tofsegnet import TofSegNet


@pytest.mark.parametrize(("height", "width"), [(32, 64), (45, 61), (33, 32), (5, 100)])
def test_output_has_the_input_s_resolution(height, width):
    gray = torch.rand(2, 1, height, width)
    assert TofRegNet(4)(gray).shape == (2, height, width)
    assert TofSegNet(4, classes=3)(gray).shape == (2, 3, height, width)


def test_depth_is_positive_and_within_the_range():
    depth = TofRegNet(4, range_m=12.0)(torch.rand(2, 1, 32, 32))
    assert depth.dtype == torch.float32
    assert 0 < depth.min() <= depth.max() < 12


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_black_and_white_images_give_finite_depth(level):
    assert TofRegNet(4).eval()(torch.full((1, 1, 32, 32), level)).isfinite().all()


def test_body_is_a_resnet18_autoencoder():
    network = TofRegNet(64)
    blocks = [module for stage in network.encoder for module in stage]
    assert len(network.encoder) == 4
    assert len(blocks) == 8
    transposed = [m for m in network.up.modules() if isinstance(m, nn.ConvTranspose2d)]
    plain = [m for m in network.plain.modules() if isinstance(m, nn.Conv2d)]
    assert len(transposed) == len(plain) == 4
    # Four stages of the published ResNet18 without its stem and classifier.
    assert sum(p.numel() for p in network.encoder.parameters()) == 11_166_976


def test_networks_differ_only_in_the_head():
    shapes = [
        {name: tensor.shape for name, tensor in network.state_dict().items()}
        for network in (TofRegNet(4), TofSegNet(4))
    ]
    assert {name for name, _ in shapes[0].items() ^ shapes[1].items()} == {
        "head.weight",
        "head.bias",
    }


def test_padding_repeats_the_border():
    gray = torch.rand(1, 1, 30, 33)
    padded = pad(gray)
    assert padded.shape == (1, 1, STRIDE, 2 * STRIDE)
    assert torch.equal(padded[..., :30, :33], gray)
    assert torch.equal(padded[..., :30, -1], gray[..., -1])


def test_every_parameter_gets_a_gradient():
    network = TofSegNet(4)
    network(torch.rand(2, 1, 64, 64)).square().mean().backward()
    dead = [name for name, p in network.named_parameters() if not p.grad.abs().sum() > 0]
    assert dead == []


TRAINING = """
import torch
from unwrap.networks import TofRegNet
torch.manual_seed(0)
torch.set_num_threads(1)
network = TofRegNet(4).to(memory_format=torch.channels_last)
optimizer = torch.optim.SGD(network.parameters(), 1e-3)
for _ in range(30):
    optimizer.zero_grad()
    network(torch.rand(2, 1, 64, 64)).mean().backward()
    optimizer.step()
"""


@pytest.mark.slow
def test_training_of_a_narrow_network_leaves_the_heap_in_order():
    # glibc's checking allocator aborts the process at the first spoilt block. Elsewhere the two
    # variables do nothing, but a spoilt heap seldom lasts thirty steps.
    checks = {"LD_PRELOAD": "libc_malloc_debug.so.0", "MALLOC_CHECK_": "3"}
    done = subprocess.run(
        [sys.executable, "-c", TRAINING],
        env={**os.environ, **checks},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", PLACES)
def test_no_kernel_of_one_pixel_is_strided(name):
    # See `unwrap.networks.autoencoder.BasicBlock.forward`.
    convolutions = [
        m for m in build_network(name, Settings(width=4)).modules() if isinstance(m, nn.Conv2d)
    ]
    assert convolutions
    assert all(m.kernel_size != (1, 1) or m.stride == (1, 1) for m in convolutions)


def test_multiply_accumulates_of_known_layers():
    layers = nn.Sequential(nn.Conv2d(1, 6, 3, 2, 1), nn.ConvTranspose2d(6, 5, 2, stride=2))
    convolved, transposed = 8 * 10 * 6 * 9, 8 * 10 * 6 * 5 * 4
    assert multiply_accumulates(layers, torch.zeros(1, 1, 16, 20)) == convolved + transposed
    assert multiply_accumulates(convolution(1, 2), torch.zeros(1, 1, 4, 4)) == 16 * 2 * 9
