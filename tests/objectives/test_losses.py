"""Losses against numbers worked out by hand and against the paper's sums written as loops."""

from __future__ import annotations

import math

import pytest
import torch

from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.objectives.losses import (
    LossWeights,
    cross_entropy,
    depth_error,
    losses,
    regional_smoothness,
)
from semgs.rendering.rendering import Rendering

TABLE = ClassTable("three", ("wall", "floor", "chair"), ((1, 2, 3), (4, 5, 6), (7, 8, 9)), (1, 2, 5))

LABELS = torch.tensor([[0, 0, 1, 1], [0, IGNORE, 1, 2], [2, 2, IGNORE, 2]], dtype=torch.uint8)
"""3 rows of 4 pixels, 10 of them labelled."""


def distributions(seed: int, views: int = 1, size: tuple[int, int] = (3, 4), classes: int = 3) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(views, classes, *size, generator=generator, dtype=torch.float64).softmax(1)


def views(images: torch.Tensor, labels: torch.Tensor | None) -> Views:
    leading, size = images.shape[:-3], images.shape[-2:]
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = torch.tensor([[0, -1, 0], [0.6, 0, -0.8], [0.8, 0, 0.6]])
    pose[:3, 3] = torch.tensor([0.3, -0.2, 1.1])
    intrinsics = torch.tensor([[5.0, 0, 1.7], [0, 4.0, 1.9], [0, 0, 1]], dtype=torch.float64)
    cameras = Cameras(pose.expand(*leading, 4, 4), intrinsics.expand(*leading, 3, 3), size)
    return Views(images, cameras, torch.tensor([0.5, 10.0]).expand(*leading, 2), labels=labels, classes=TABLE)


def rendering(images: torch.Tensor, semantics: torch.Tensor | None) -> Rendering:
    alphas = torch.ones(*images.shape[:-3], *images.shape[-2:], dtype=images.dtype)
    return Rendering(images, semantics, alphas * 2, alphas)


def smoothness_of_the_paper(one: torch.Tensor, labels: torch.Tensor) -> float:
    """The double sum over classes and their pixels, as the paper writes it, over the number of labelled pixels."""
    total = 0.0
    height, width = labels.shape
    for label in range(one.shape[0]):
        region = {(i, j) for i in range(height) for j in range(width) if labels[i, j] == label}
        for i, j in region:
            for neighbour in ((i + 1, j), (i, j + 1)):
                if neighbour in region:
                    total += abs(float(one[label][neighbour] - one[label][i, j]))
    return total / max(1, int((labels != IGNORE).sum()))


def test_cross_entropy_is_the_mean_of_minus_log_over_the_labelled_pixels_worked_out_by_hand():
    given = torch.full((1, 3, 3, 4), 0.25, dtype=torch.float64)
    given[:, 2] = 0.5
    # Four pixels are of class 2 with probability 1/2, six of the others with 1/4, two are ignored.
    by_hand = (4 * math.log(2) + 6 * math.log(4)) / 10
    assert cross_entropy(given, LABELS[None]).item() == pytest.approx(by_hand, rel=1e-12)


def test_a_coarse_distribution_answers_for_every_labelled_pixel_of_its_block():
    coarse = torch.tensor([[[[0.5, 0.25]], [[0.5, 0.75]]]])  # two texels of 2x2 pixels, of a picture 2 high and 3 wide
    labels = torch.tensor([[[0, 1, 0], [IGNORE, 1, 1]]], dtype=torch.uint8)
    expected = -(3 * math.log(0.5) + math.log(0.25) + math.log(0.75)) / 5
    assert float(cross_entropy(coarse, labels, stride=2)) == pytest.approx(expected)
    weighted = -(math.log(0.5) + 6 * math.log(0.5) + math.log(0.25) + 3 * math.log(0.75)) / 5
    assert float(cross_entropy(coarse, labels, [1.0, 3.0], stride=2)) == pytest.approx(weighted)


@pytest.mark.parametrize("stride", [1, 2, 3])
def test_the_coarse_cross_entropy_is_that_of_the_repeated_distributions(stride: int):
    generator = torch.Generator().manual_seed(stride)
    coarse = torch.rand(2, 3, 4, 5, generator=generator, dtype=torch.float64).softmax(1).requires_grad_()
    size = (4 * stride - (stride > 1), 5 * stride - (stride > 2))
    labels = torch.randint(0, 4, (2, *size), generator=generator).to(torch.uint8)
    labels[labels == 3] = IGNORE
    whole = coarse.repeat_interleave(stride, -1).repeat_interleave(stride, -2)[..., : size[0], : size[1]]
    found, slow = cross_entropy(coarse, labels, stride=stride), cross_entropy(whole, labels)
    torch.testing.assert_close(found, slow)
    torch.testing.assert_close(*(torch.autograd.grad(loss.sum(), coarse, retain_graph=True) for loss in (found, slow)))


def test_smoothness_of_a_single_step_worked_out_by_hand():
    given = torch.full((1, 3, 3, 4), 1 / 3, dtype=torch.float64)
    given[0, :, 0, 0] = torch.tensor([0.7, 0.2, 0.1], dtype=torch.float64)
    # Pixel (0, 0) is of class 0, as are its neighbours right and down; both differ from it by 0.7 - 1/3 in channel 0.
    assert regional_smoothness(given, LABELS[None]).item() == pytest.approx(2 * (0.7 - 1 / 3) / 10, rel=1e-12)
    assert regional_smoothness(given, LABELS[None], "sum").item() == pytest.approx(2 * (0.7 - 1 / 3), rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_smoothness_equals_the_double_sum_of_the_paper(seed: int):
    generator = torch.Generator().manual_seed(seed)
    labels = torch.randint(0, 3, (2, 5, 7), generator=generator).to(torch.uint8)
    labels[torch.rand(2, 5, 7, generator=generator) < 0.2] = IGNORE
    given = distributions(seed, views=2, size=(5, 7))
    expected = [smoothness_of_the_paper(*pair) for pair in zip(given, labels, strict=True)]
    assert regional_smoothness(given, labels).tolist() == pytest.approx(expected, rel=1e-12)


def test_the_loss_has_the_smoothness_of_a_labelled_pixel_or_the_sum_of_a_view():
    images, semantics = (
        torch.zeros(1, 3, 3, 4, dtype=torch.float64),
        torch.full((1, 3, 3, 4), 1 / 3, dtype=torch.float64),
    )
    semantics[0, :, 0, 0] = torch.tensor([0.7, 0.2, 0.1], dtype=torch.float64)
    target = views(images, LABELS[None])
    mean = losses(rendering(images, semantics), target, LossWeights(0.0, 0.0, 1.0))
    whole = losses(rendering(images, semantics), target, LossWeights(0.0, 0.0, 1.0, smoothness_over="sum"))
    assert mean.total.item() == pytest.approx((0.7 - 1 / 3) / 5)
    assert whole.total.item() == pytest.approx(2 * (0.7 - 1 / 3))


def test_smoothness_is_zero_where_each_region_is_constant_however_sharp_the_borders():
    per_class = torch.tensor(
        [[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.0, 0.3, 0.7], [0.2, 0.3, 0.5]], dtype=torch.float64
    )
    given = per_class[torch.where(LABELS == IGNORE, 3, LABELS).long()].permute(2, 0, 1)[None]
    assert regional_smoothness(given, LABELS[None]).item() == 0


def test_smoothness_is_blind_to_channels_other_than_the_region_s_own():
    labels = torch.zeros(1, 3, 4, dtype=torch.uint8)
    given = distributions(4)
    given[:, 0] = 0.2
    assert regional_smoothness(given, labels).item() == 0


@pytest.mark.parametrize("term", [cross_entropy, regional_smoothness])
def test_ignored_pixels_change_nothing_and_get_no_gradient(term):
    given = distributions(5).requires_grad_()
    value = term(given, LABELS[None]).sum()
    (gradient,) = torch.autograd.grad(value, given)
    assert (gradient[:, :, LABELS == IGNORE] == 0).all()
    changed = given.detach().clone()
    changed[:, :, LABELS == IGNORE] = torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64)[:, None]
    assert term(changed, LABELS[None]).item() == value.item()


@pytest.mark.parametrize("term", [cross_entropy, regional_smoothness])
def test_gradients_of_the_semantic_terms_are_those_of_finite_differences(term):
    given = distributions(6, views=2).requires_grad_()
    labels = torch.stack([LABELS, LABELS.flip(0)])
    assert torch.autograd.gradcheck(lambda s: term(s, labels), (given,), eps=1e-7, atol=1e-8)


def test_gradient_of_the_total_is_that_of_finite_differences():
    images = torch.rand(2, 3, 3, 4, generator=torch.Generator().manual_seed(7), dtype=torch.float64).requires_grad_()
    target = views(
        torch.rand(2, 3, 3, 4, dtype=torch.float64, generator=torch.Generator().manual_seed(8)),
        torch.stack([LABELS, LABELS.flip(1)]),
    )
    semantics = distributions(9, views=2).requires_grad_()
    weights = LossWeights(semantic=0.3, colour=0.9, smoothness=0.4)
    assert torch.autograd.gradcheck(
        lambda i, s: losses(rendering(i, s), target, weights).total, (images, semantics), eps=1e-7, atol=1e-8
    )


def test_the_total_is_the_weighted_sum_with_the_paper_s_weights_by_default():
    images = torch.full((1, 3, 3, 4), 0.5, dtype=torch.float64)
    target = views(torch.full((1, 3, 3, 4), 0.7, dtype=torch.float64), LABELS[None])
    result = losses(rendering(images, distributions(10)), target)
    assert result.colour.item() == pytest.approx(0.04, rel=1e-12)
    assert result.total.item() == pytest.approx(
        0.1 * result.semantic.item() + 1.0 * result.colour.item() + 0.001 * result.smoothness.item(), rel=1e-12
    )


def test_the_three_losses_of_a_view_of_3x4_pixels_worked_out_by_hand():
    """Ten labelled pixels; two ignored ones count in the colour term alone.

    L_sem: wall has probability 1/2 at its three pixels but 1/4 at the first, floor 1/4 at three, chair 1/8 at four:
    (2 log 2 + log 4 + 3 log 4 + 4 log 8) / 10 = 22 log 2 / 10.
    L_rs: the first pixel differs by 1/4 from the walls right of it and below it, all else is constant: (1/4 + 1/4) / 10.
    L_c: two of the 36 numbers are wrong by 0.3, one of them at an ignored pixel: 2 * 0.09 / 36.
    """
    given = torch.empty(1, 3, 3, 4, dtype=torch.float64)
    for label, distribution in enumerate(([0.5, 0.25, 0.25], [0.5, 0.25, 0.25], [0.5, 0.375, 0.125])):
        given[0, :, label == LABELS] = torch.tensor(distribution, dtype=torch.float64)[:, None]
    given[0, :, 0, 0] = torch.tensor([0.25, 0.5, 0.25])
    given[0, :, LABELS == IGNORE] = torch.tensor([0.9, 0.05, 0.05], dtype=torch.float64)[:, None]
    truth = torch.full((1, 3, 3, 4), 0.4, dtype=torch.float64)
    images = truth.clone()
    images[0, 1, 0, 2] += 0.3
    images[0, 2, 1, 1] -= 0.3  # (1, 1) is ignored
    result = losses(rendering(images, given), views(truth, LABELS[None]))
    assert result.semantic.item() == pytest.approx(2.2 * math.log(2), rel=1e-12)
    assert result.smoothness.item() == pytest.approx(0.05, rel=1e-12)
    assert result.colour.item() == pytest.approx(0.005, rel=1e-12)
    assert result.total.item() == pytest.approx(0.1 * 2.2 * math.log(2) + 1.0 * 0.005 + 0.001 * 0.05, rel=1e-12)


def test_a_view_without_labels_adds_zero_and_is_counted():
    labels = torch.stack([LABELS, torch.full_like(LABELS, IGNORE)])
    images = torch.zeros(2, 3, 3, 4, dtype=torch.float64)
    given = distributions(11, views=2)
    both = losses(rendering(images, given), views(images, labels))
    alone = losses(rendering(images[:1], given[:1]), views(images[:1], labels[:1]))
    assert both.unlabelled == 1
    assert both.semantic.item() == pytest.approx(alone.semantic.item() / 2, rel=1e-12)
    assert both.smoothness.item() == pytest.approx(alone.smoothness.item() / 2, rel=1e-12)


def test_colour_only_renderings_and_unlabelled_targets_have_no_semantic_terms_and_every_view_counts():
    images = torch.zeros(2, 3, 3, 4, dtype=torch.float64)
    for semantics, labels in ((None, torch.stack([LABELS, LABELS])), (distributions(12, views=2), None)):
        result = losses(rendering(images, semantics), views(images, labels))
        assert (result.semantic.item(), result.smoothness.item(), result.unlabelled) == (0, 0, 2)


def test_two_shards_of_a_batch_average_to_the_whole():
    generator = torch.Generator().manual_seed(13)
    images = torch.rand(2, 3, 3, 3, 4, generator=generator, dtype=torch.float64)
    truth = torch.rand(2, 3, 3, 3, 4, generator=generator, dtype=torch.float64)
    labels = torch.randint(0, 3, (2, 3, 3, 4), generator=generator).to(torch.uint8)
    labels[0, 0, 0] = labels[1, 2] = IGNORE
    given = distributions(14, views=6).unflatten(0, (2, 3))

    def total(part: slice) -> float:
        return losses(rendering(images[part], given[part]), views(truth[part], labels[part])).total.item()

    assert total(slice(0, 2)) == pytest.approx((total(slice(0, 1)) + total(slice(1, 2))) / 2, rel=1e-12)


def test_class_weights_multiply_the_terms_of_their_class():
    given = distributions(15)
    weighted = cross_entropy(given, LABELS[None], (2.0, 0.0, 0.5)).item()
    terms = [
        factor * -math.log(float(given[0, label, i, j]))
        for i in range(3) for j in range(4) for label in [int(LABELS[i, j])] if label != IGNORE
        for factor in [(2.0, 0.0, 0.5)[label]]
    ]  # fmt: skip
    assert weighted == pytest.approx(sum(terms) / 10, rel=1e-12)


def test_a_probability_that_rounded_to_zero_gives_a_finite_loss():
    given = torch.zeros(1, 3, 3, 4)
    given[:, 0] = 1
    assert torch.isfinite(cross_entropy(given, LABELS[None])).all()


def test_depth_error_is_the_mean_absolute_log_ratio_over_known_pixels():
    truth = torch.tensor([[[[1.0, 2.0, 0.0], [4.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]]]])
    error = depth_error(torch.where(truth > 0, truth, 7) * 1.1, truth)
    assert error.item() == pytest.approx(math.log(1.1), rel=1e-6)
    assert depth_error(truth + 1, torch.zeros_like(truth)).item() == 0


def test_disagreeing_shapes_and_tables_are_refused_by_name():
    images = torch.zeros(1, 3, 3, 4, dtype=torch.float64)
    with pytest.raises(ValueError, match=r"rendering is \(1, 3, 4, 3\)"):
        losses(rendering(images.mT, None), views(images, LABELS[None]))
    with pytest.raises(ValueError, match="has 4 classes but table three of the target has 3"):
        losses(rendering(images, distributions(16, classes=4)), views(images, LABELS[None]))
    with pytest.raises(ValueError, match="class_weights has 2 factors; expected 3"):
        losses(rendering(images, distributions(17)), views(images, LABELS[None]), class_weights=(1.0, 2.0))


def test_hidden_pixels_add_nothing_to_the_colour_loss() -> None:
    """Two views of 3x4 pixels; an error of 0.5 at the hidden ones of view 0, of 0.1 elsewhere, and of 0.2 in view 1: (0.01 + 0.04) / 2."""
    truth = torch.full((2, 3, 3, 4), 0.25, dtype=torch.float64)
    images, hidden = truth.clone(), torch.zeros(2, 3, 4, dtype=torch.bool)
    hidden[0, :, :2] = True
    images[0] += torch.where(hidden[0], 0.5, 0.1)
    images[1] += 0.2
    target = views(truth, None).changed(hidden=hidden)
    assert losses(rendering(images, None), target).colour.item() == pytest.approx(0.025)
    everything = target.changed(hidden=torch.ones_like(hidden))
    assert losses(rendering(images, None), everything).colour == 0
