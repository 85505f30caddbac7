"""Gaussians: what they refuse, and what moves, casts and indexes them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch
from jaxtyping import config

from semgs.geometry.gaussians import Appearance, Gaussians


def appearance(features: torch.Tensor, leading: tuple[int, ...]) -> Appearance:
    generator = torch.Generator().manual_seed(1)
    quaternions = torch.nn.functional.normalize(torch.randn(*leading, 4, generator=generator), dim=-1)
    return Appearance(quaternions, torch.rand(*leading, 3, generator=generator) + 0.01, features)


def gaussians(leading: tuple[int, ...] = (7,), harmonics: int = 4, classes: int | None = 5) -> Gaussians:
    generator = torch.Generator().manual_seed(0)
    return Gaussians(
        means=torch.randn(*leading, 3, generator=generator),
        opacities=torch.rand(*leading, generator=generator),
        colour=appearance(torch.randn(*leading, harmonics, 3, generator=generator), leading),
        semantic=None
        if classes is None
        else appearance(torch.randn(*leading, classes, generator=generator).softmax(-1), leading),
    )


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Turns off the annotations' checks, which callers do not have either."""
    config.update("jaxtyping_disable", True)
    yield
    config.update("jaxtyping_disable", False)


@pytest.mark.parametrize("leading", [(7,), (2, 7), (3, 2, 7)])
def test_leading_batch_axes_are_free_and_the_length_counts_one_scene(leading: tuple[int, ...]):
    assert len(gaussians(leading)) == 7


@pytest.mark.parametrize("harmonics", [1, 4, 9, 16])
def test_harmonics_come_in_whole_degrees_up_to_the_third(harmonics: int):
    assert gaussians(harmonics=harmonics).colour.features.shape == (7, harmonics, 3)


@pytest.mark.parametrize("harmonics", [2, 25])
def test_other_numbers_of_harmonics_are_refused(harmonics: int):
    with pytest.raises(ValueError, match=r"expected \[\.\.\. g k 3\] with k = 1, 4, 9 or 16"):
        gaussians(harmonics=harmonics)


@pytest.mark.usefixtures("unchecked")
def test_means_and_opacities_of_different_numbers_are_refused():
    whole = gaussians()
    with pytest.raises(ValueError, match=r"means are \(7, 3\) and opacities \(6,\)"):
        replace(whole, opacities=whole.opacities[:6])


def test_a_branch_of_another_number_of_gaussians_is_refused_by_name():
    whole, fewer = gaussians(), gaussians((6,))
    with pytest.raises(ValueError, match=r"semantic has \(6,\) Gaussians but means has \(7,\)"):
        replace(whole, semantic=fewer.semantic)
    with pytest.raises(ValueError, match=r"colour has \(6,\) Gaussians but means has \(7,\)"):
        replace(whole, colour=fewer.colour)


def test_class_features_have_one_axis_more_than_the_gaussians():
    whole = gaussians()
    with pytest.raises(ValueError, match=r"semantic\.features are \(7, 4, 3\); expected \[\.\.\. g class\]"):
        replace(whole, semantic=whole.colour)


@pytest.mark.usefixtures("unchecked")
def test_scales_and_features_must_go_with_their_quaternions():
    shape = gaussians().colour
    with pytest.raises(ValueError, match=r"quaternions are \(7, 4\), scales \(6, 3\)"):
        replace(shape, scales=shape.scales[:6])
    with pytest.raises(ValueError, match=r"features \(6, 4, 3\)"):
        replace(shape, features=shape.features[:6])


def test_map_reaches_every_tensor_and_leaves_the_original():
    whole = gaussians()
    doubled = whole.map(lambda tensor: 2 * tensor)
    for one, two in (
        (whole.means, doubled.means),
        (whole.opacities, doubled.opacities),
        (whole.colour.quaternions, doubled.colour.quaternions),
        (whole.colour.scales, doubled.colour.scales),
        (whole.colour.features, doubled.colour.features),
        (whole.semantic.quaternions, doubled.semantic.quaternions),
        (whole.semantic.scales, doubled.semantic.scales),
        (whole.semantic.features, doubled.semantic.features),
    ):
        assert torch.equal(2 * one, two)


def test_indexing_through_map_takes_the_same_gaussians_of_both_branches():
    whole = gaussians()
    kept = torch.tensor([5, 0, 3])
    some = whole.map(lambda tensor: tensor[kept])
    assert len(some) == 3
    assert torch.equal(some.means[1], whole.means[0])
    assert torch.equal(some.semantic.features[0], whole.semantic.features[5])


def test_a_cast_there_and_back_changes_nothing():
    whole = gaussians(classes=None)
    back = whole.to(torch.float64).to(torch.float32)
    assert back.semantic is None
    assert torch.equal(back.means, whole.means)
    assert torch.equal(back.colour.features, whole.colour.features)


def test_detached_gaussians_carry_no_gradient():
    whole = gaussians().map(lambda tensor: tensor.requires_grad_())
    assert whole.colour.scales.requires_grad
    free = whole.detach()
    assert not any(t.requires_grad for t in (free.means, free.opacities, free.colour.scales, free.semantic.features))
