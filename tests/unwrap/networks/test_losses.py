"""Losses against closed forms of their values and gradients."""

import pytest
import torch

from unwrap.networks.losses import (
    depth_guided_loss,
    masked_mean,
    regression_loss,
    scale_invariant_loss,
    ssim_loss,
    wrap_loss,
)


@pytest.fixture
def depths():
    generator = torch.Generator().manual_seed(2)
    prediction, truth = torch.rand(2, 3, 24, 32, generator=generator, dtype=torch.float64)
    return prediction.requires_grad_(), truth


@pytest.mark.parametrize("mean_share", [0.0, 0.85, 1.0])
def test_scale_invariant_gradient_is_the_closed_form(depths, mean_share):
    prediction, truth = depths
    scale_invariant_loss(prediction, truth, mean_share).backward()
    # d/dp of mean(d^2) - s mean(d)^2, with d = truth - p.
    error = (prediction - truth).detach()
    mean = error.mean((1, 2), keepdim=True)
    expected = 2 * (error - mean_share * mean) / error.numel()
    torch.testing.assert_close(prediction.grad, expected)


def test_scale_invariant_loss_as_printed_ignores_a_constant(depths):
    prediction, truth = depths
    loss = scale_invariant_loss(prediction, truth)
    torch.testing.assert_close(scale_invariant_loss(prediction + 3, truth), loss)
    assert scale_invariant_loss(prediction + 3, truth, 0.85) > loss + 1


def test_depth_guided_gradient_touches_only_the_farthest_pixels(depths):
    prediction, truth = depths
    depth_guided_loss(prediction, truth).backward()
    count = (32 // 10) * (24 // 10)
    threshold = truth.flatten(1).sort(descending=True).values[:, count - 1]
    far = truth >= threshold[:, None, None]
    expected = torch.where(far, 2 * (prediction - truth).detach() / (3 * count), 0)
    torch.testing.assert_close(prediction.grad, expected)


def test_ssim_loss_of_equal_and_of_constant_images(depths):
    truth = depths[1].float()
    assert float(ssim_loss(truth, truth)) == pytest.approx(0, abs=1e-6)
    # Constant images: only the luminance term differs from one.
    a, b = torch.full((1, 16, 16), 0.2), torch.full((1, 16, 16), 0.6)
    luminance = (2 * 0.2 * 0.6 + 1e-4) / (0.2**2 + 0.6**2 + 1e-4)
    assert float(ssim_loss(a, b)) == pytest.approx(1 - luminance, abs=1e-4)


def test_ssim_is_that_of_the_definition_at_one_window(depths):
    prediction, truth = (image.detach()[:1, :11, :11] for image in depths)
    offsets = torch.arange(-5.0, 6.0, dtype=torch.float64)
    weights = torch.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * 1.5**2))
    weights = weights / weights.sum()
    mean_p, mean_t = (weights * prediction[0]).sum(), (weights * truth[0]).sum()
    var_p = (weights * (prediction[0] - mean_p) ** 2).sum()
    var_t = (weights * (truth[0] - mean_t) ** 2).sum()
    cov = (weights * (prediction[0] - mean_p) * (truth[0] - mean_t)).sum()
    c1, c2 = 1e-4, 9e-4
    ssim = (2 * mean_p * mean_t + c1) * (2 * cov + c2)
    ssim = ssim / ((mean_p**2 + mean_t**2 + c1) * (var_p + var_t + c2))
    loss = ssim_loss(prediction.float(), truth.float())
    assert float(loss) == pytest.approx(1 - float(ssim), abs=1e-5)


def test_ssim_needs_a_whole_window():
    with pytest.raises(ValueError, match="11 x 11"):
        ssim_loss(torch.zeros(1, 10, 40), torch.zeros(1, 10, 40))


def test_regression_loss_is_equation_7(depths):
    prediction, truth = (30 * image.detach().float() for image in depths)
    terms = (
        0.5 * scale_invariant_loss(prediction / 30, truth / 30),
        0.4 * ssim_loss(prediction / 30, truth / 30),
        0.1 * depth_guided_loss(prediction / 30, truth / 30),
    )
    torch.testing.assert_close(regression_loss(prediction, truth, range_m=30.0), sum(terms))


def test_wrap_loss_at_known_errors():
    truth = torch.full((1, 2, 2), 10.0)
    assert float(wrap_loss(truth, truth, 6.0)) == 0
    # An error of half a range: 1 and 1 / 2, averaged.
    assert float(wrap_loss(truth + 3, truth, 6.0)) == pytest.approx(0.75)


def test_unknown_pixels_are_never_the_farthest():
    truth = torch.full((1, 20, 20), 5.0)
    truth[:, 0] = 25.0  # unknown, and the farthest were they known
    known = torch.ones(1, 20, 20, dtype=torch.bool)
    known[:, 0] = False
    prediction = torch.full((1, 20, 20), 7.0)
    assert depth_guided_loss(prediction, truth, known).item() == pytest.approx(4.0)
    assert depth_guided_loss(prediction, truth).item() == pytest.approx(18.0**2)


def test_where_fewer_pixels_are_known_than_count_the_others_are_no_difference():
    truth, known = torch.full((1, 20, 20), 5.0), torch.zeros(1, 20, 20, dtype=torch.bool)
    known[:, 3, 3] = True  # One of the four that count.
    for wrong in (100.0, torch.nan):
        prediction = torch.full((1, 20, 20), 7.0).masked_fill(~known, wrong)
        assert depth_guided_loss(prediction, truth, known).item() == pytest.approx(2.0**2 / 4)


def test_equation_7_counts_unknown_pixels_as_right():
    generator = torch.Generator().manual_seed(0)
    prediction, truth = 30 * torch.rand(2, 2, 24, 24, generator=generator)
    known = torch.rand(2, 24, 24, generator=generator) < 0.7
    other = torch.where(known, truth, 30 - truth)
    one, same = (regression_loss(prediction, t, known=known) for t in (truth, other))
    assert one.item() == same.item()
    right = torch.where(known, truth, prediction)
    assert regression_loss(prediction, right, known=known).item() == pytest.approx(one.item())


def test_a_masked_mean_is_zero_where_nothing_is_in_the_mask():
    values = torch.tensor([1.0, torch.nan, 3.0])
    assert masked_mean(values, torch.tensor([True, False, True])) == 2.0
    assert masked_mean(values, torch.zeros(3, dtype=torch.bool)) == 0.0
