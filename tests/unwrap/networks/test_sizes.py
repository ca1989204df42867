"""Frames larger than those a network was trained on: thinned, and the prediction brought back."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from unwrap_source import HEIGHT, SENSOR, WIDTH, Walls

from unwrap.networks.network import Settings, autocast
from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.registry import build_network
from unwrap.networks.sizes import stride_to, thin, trained_size, upsample
from unwrap.networks.weight_files import save_weights
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.signal.sensed import Memory, Sensed, wrapped_and_valid
from unwrap.signal.shots import Shots
from unwrap.support.tensors import mapped

SMALL = (HEIGHT // 2, WIDTH // 2)
RANGE_M = unambiguous_range_m(SENSOR.f1_hz)


def write(path, name, **told):
    """An untrained network whose outputs vary from pixel to pixel."""
    torch.manual_seed(0)
    network = build_network(name, Settings(width=4))
    last = network.judge[-1] if name == "toffusionnet" else network.head
    last.weight.data.mul_(30.0)
    save_weights(path, network, {"network": name, "width": 4, "f1_hz": SENSOR.f1_hz, **told})
    return path


@pytest.fixture
def small(tmp_path):
    """Makes a network that was trained on frames of half the height and width of `Walls`."""

    def trained_on_half(name):
        told = {"trained_height": SMALL[0], "trained_width": SMALL[1]}
        return load_unwrapper(write(tmp_path / f"{name}.safetensors", name, **told))

    return trained_on_half


@pytest.mark.parametrize(
    ("size", "stride"),
    [
        ((120, 160), 1),
        ((240, 320), 2),
        ((480, 640), 4),
        ((240, 160), 1),
        ((240, 480), 1),
        ((240, 321), 1),
        ((60, 80), 1),
        ((24, 32), 1),
    ],
)
def test_only_whole_multiples_are_thinned(size, stride):
    assert stride_to((120, 160), size) == stride


@pytest.mark.parametrize("stride", [1, 2, 3])
def test_enlarged_maps_are_linear_between_the_pixels_that_were_seen(stride):
    maps = torch.rand(2, 5, 7, generator=torch.Generator().manual_seed(0))
    rows, columns = (np.arange(n * stride) / stride for n in maps.shape[1:])
    expected = [
        # np.interp holds the last value behind the last place, as `upsample` does.
        [np.interp(columns, range(7), row) for row in image]
        for image in maps.numpy()
    ]
    expected = np.array(
        [[np.interp(rows, range(5), column) for column in np.transpose(i)] for i in expected]
    ).transpose(0, 2, 1)
    np.testing.assert_allclose(upsample(maps, stride).numpy(), expected, atol=1e-6)


def test_everything_that_has_pixels_is_thinned():
    sensed, _ = Walls(2).batch([0, 1], draw=0, shots=Shots.FOUR)
    memory = Memory(sensed.gray + 1, sensed.gray)
    whole = Sensed(sensed.gray, sensed.raw, sensed.gray + 2, sensed.noise_lsb, torch.ones(2))
    whole = Sensed(**{**vars(whole), "memory": memory})
    few, seen = thin(whole, 2), []
    mapped(lambda t: seen.append(t.shape), few)
    assert seen.count((2, *SMALL)) == 6 and (2, 4, *SMALL) in seen and (2,) in seen
    assert torch.equal(few.raw.dcs_lsb, whole.raw.dcs_lsb[..., ::2, ::2])


@pytest.mark.parametrize("name", ["tofregnet", "tofsegnet"])
def test_gray_networks_see_large_frames_as_they_were_trained(small, name):
    unwrapper, gray = small(name), torch.rand(2, HEIGHT, WIDTH)
    large, seen = unwrapper.predict(gray), unwrapper.predict(gray[:, ::2, ::2])
    for whole, part in (
        (large.distance_m, seen.distance_m),
        (large.confidence, seen.confidence),
    ):
        assert whole.shape == gray.shape and whole.dtype == torch.float32
        torch.testing.assert_close(whole[:, ::2, ::2], part)
        middle = (part[:, :, 1:] + part[:, :, :-1]) / 2
        torch.testing.assert_close(whole[:, ::2, 1:-1:2], middle)
    assert seen.distance_m.std() > 0.1


def test_networks_of_samples_tell_the_distance_of_every_pixel(small):
    unwrapper = small("toffusionnet")
    sensed, _ = Walls(2).batch([0, 1], draw=1, shots=Shots.FOUR)
    large = unwrapper.predict_sensed(sensed, SENSOR).distance_m
    coarse = upsample(unwrapper.predict_sensed(thin(sensed, 2), SENSOR).distance_m, 2)
    wrapped_m, valid = wrapped_and_valid(sensed, SENSOR)
    assert 0.05 < 1 - valid.float().mean() < 0.9
    wraps = (large - wrapped_m) / RANGE_M
    assert (wraps - wraps.round())[valid].abs().max() < 1e-4
    assert len(wraps[valid].round().unique()) > 1
    # Nearest: at most half a range off, but for the first wrap, before which there is none.
    off_m = (large - coarse)[valid & (wraps.round() > 0)]
    assert off_m.abs().max() <= RANGE_M / 2 + 1e-3
    torch.testing.assert_close(large[~valid], coarse[~valid])


def test_other_sizes_are_seen_as_they_are(small):
    unwrapper = small("tofregnet")
    gray = torch.rand(1, HEIGHT, WIDTH + 1)
    with torch.inference_mode(), autocast(gray.device):
        expected_m = unwrapper.network(gray[:, None])
    apart_m = (unwrapper.predict(gray).distance_m - expected_m).abs()
    assert apart_m.mean() < 0.1


def test_macs_are_those_of_the_pixels_that_are_seen(small):
    unwrapper = small("tofregnet")
    assert unwrapper.macs(HEIGHT, WIDTH) == unwrapper.macs(*SMALL)
    assert unwrapper.macs(HEIGHT, WIDTH + 32) > 2 * unwrapper.macs(*SMALL)


def test_files_that_do_not_tell_were_trained_on_120_x_160(tmp_path):
    unwrapper = load_unwrapper(write(tmp_path / "old.safetensors", "tofregnet"))
    assert trained_size(unwrapper.metadata) == (120, 160)
    assert unwrapper.stride(240, 320) == 2 and unwrapper.stride(HEIGHT, WIDTH) == 1


@pytest.mark.parametrize("value", [0, -1, 1.5, "many", True])
def test_sizes_that_are_none_are_refused(tmp_path, value):
    path = write(tmp_path / "net.safetensors", "tofregnet", trained_width=value)
    with pytest.raises(ValueError, match=r"net\.safetensors.*trained_width is"):
        load_unwrapper(path)
