"""Two looks at each view: the second one at its mirror image, enlarged, and the mean of both."""

from __future__ import annotations

from math import log

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_views
from torch import Tensor

from semgs.model.classes.mobilenet import downsampled_size
from semgs.model.classes.semantic import SHAPE, SemanticBranch, mean_logits, second_size
from semgs.model.layers.network_input import NetworkInput
from semgs.model.semgs import SemGS


def single_view_network() -> SemGS:
    """One whose classes come from single views."""
    return fill_golden(preset("small_plain", semantic_transformer=False)).eval()


def test_the_mean_is_of_probabilities():
    first = torch.tensor([0.0, 0.0]).reshape(1, 2, 1, 1)
    second = torch.tensor([0.9, 0.1]).reshape(1, 2, 1, 1)
    # (0.5 + 0.9) / 2 and (0.5 + 0.1) / 2
    assert mean_logits(first, second).exp().flatten().tolist() == pytest.approx([0.7, 0.3])
    # One look excludes a class, and so does the other; their mean stays finite.
    assert mean_logits(torch.tensor([200.0, -200.0]).reshape(1, 2, 1, 1), torch.tensor([1.0, 0.0]).reshape(1, 2, 1, 1))[
        0, 1
    ].item() == pytest.approx(log(1e-9))


@pytest.mark.parametrize(
    ("size", "second"),
    [
        ((48, 80), (64, 128)),  # 72 and 120 are halfway between multiples of 16
        ((240, 320), (352, 480)),
        ((208, 368), (320, 544)),  # 312 and 552 likewise
        ((272, 272), (352, 352)),  # 408 would be averaged down to 204
        ((480, 640), (352, 480)),  # read at 240x320
        ((352, 480), (352, 480)),
    ],
)
def test_the_second_look_is_nearer_as_far_as_the_backbone_reads_the_image_whole(
    size: tuple[int, int], second: tuple[int, int]
):
    assert second_size(size) == second
    assert downsampled_size(second, 4) == second


def test_an_image_is_mirrored_and_resized():
    views = posed_views(2, (48, 80))
    inputs = NetworkInput.of(views, torch.zeros(1), 2)
    mirrored = inputs.mirrored(1, (64, 128))
    assert mirrored.images.shape == (1, 3, 64, 128)
    assert mirrored.small.shape == (1, 3, 32, 64)
    left, right = views.images[1, ..., :40].mean(), views.images[1, ..., 40:].mean()
    torch.testing.assert_close(mirrored.images[..., 64:].mean(), left, atol=0.02, rtol=0)
    torch.testing.assert_close(mirrored.images[..., :64].mean(), right, atol=0.02, rtol=0)


def test_what_a_second_look_finds_is_where_it_is_in_the_view(monkeypatch: pytest.MonkeyPatch):
    model = single_view_network()
    seen = []

    def brightness(branch: SemanticBranch, single: object, inputs: NetworkInput) -> Tensor:
        """Logits that say how red each place of the image is: (2, 0, ...) where it is, and 0 elsewhere."""
        seen.append(tuple(inputs.images.shape))
        logits = inputs.small.new_zeros(len(inputs.small), model.class_count, *inputs.small.shape[-2:])
        logits[:, 0] = 2 * inputs.small[:, 0]
        return logits

    monkeypatch.setattr(SemanticBranch, "single_view_logits", brightness)
    images = torch.zeros(2, 3, 64, 96)
    images[0, 0, :, :48] = 1  # the left half of the first view is red
    inputs = NetworkInput.of(posed_views(2, (64, 96)), torch.zeros(1), 2)
    inputs = NetworkInput(images, images[..., ::2, ::2], inputs.cameras, inputs.depth_range, 2)
    assert model.semantic is not None
    with torch.no_grad():
        maps = model.semantic.second_look(inputs, model.cnn, alone=True)
    assert seen == [(1, 3, 96, 144)] * 2
    assert maps.shape == (2, 20, 32, 48)
    # e^2 / (e^2 + 19) = .28 in the left half, 1 / 20 elsewhere.
    assert maps[0, 0, 16, 8].item() == pytest.approx(0.2800, abs=1e-4)
    assert maps[0, 0, 16, 40].item() == pytest.approx(0.05, abs=1e-6)
    assert maps[1, 0, 16, 8].item() == pytest.approx(0.05, abs=1e-6)


@torch.no_grad()
def test_only_classes_change_and_each_view_gets_its_own():
    model, views = single_view_network(), posed_views(2, (48, 64))
    once = model(views)
    alone = model.class_maps(views, alone=True).distributions
    model.looks = 2
    twice = model(views)
    assert torch.equal(once.gaussians.means, twice.gaussians.means)
    assert torch.equal(once.gaussians.opacities, twice.gaussians.opacities)
    assert model.semantic is not None
    inputs = NetworkInput.of(views, model.cnn.conv1.weight, model.stride)
    second = model.semantic.second_look(inputs, model.cnn)
    single = model.semantic.refine(inputs, model.cnn)
    first = model.semantic(single, inputs)(slice(None))[:, SHAPE:].softmax(1)
    torch.testing.assert_close(model.class_maps(views).distributions, (first + second) / 2)
    assert not torch.allclose(first, second, atol=1e-3)
    second = model.semantic.second_look(inputs, model.cnn, alone=True)
    torch.testing.assert_close(model.class_maps(views, alone=True).distributions, (alone + second) / 2)
    # By parts of the views, as if memory were short.
    for name, one in vars(model(views, chunks=type(model.memory_plan(views).chunks)(heads=1))).items():
        if isinstance(one, Tensor):
            torch.testing.assert_close(one, getattr(twice, name))
    model.train()
    torch.testing.assert_close(model.class_maps(views, alone=True).distributions, alone)


def test_a_network_that_compares_views_looks_once():
    model = preset("small_plain")
    assert model.most_looks == 1
    with pytest.raises(ValueError, match="looks is 2; expected 1, as small_plain has no classes that depend on single"):
        model.looks = 2
    model = single_view_network()
    with pytest.raises(ValueError, match="looks is 3; expected 1 or 2"):
        model.looks = 3
