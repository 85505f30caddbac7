"""MOSAIC beside the class backbone."""

from __future__ import annotations

from dataclasses import replace
from math import log

import pytest
import torch
from networks import preset
from posed import posed_views
from torch import Tensor, nn

from semgs.model.classes.mosaic import (
    Block,
    ContextLevel,
    GeometricMean,
    InvertedResidual,
    Mosaic,
    Translation,
    enlarge,
    window_means,
)
from semgs.model.semgs import SemGS
from semgs.model.settings import MosaicBeside
from semgs.model.switches import switches_of


def set_middle_taps(*layers: tuple[nn.Conv2d, tuple[float, ...], tuple[float, ...]]) -> None:
    """Fill convolutions whose middle tap alone counts."""
    with torch.no_grad():
        for conv, weights, biases in layers:
            conv.weight.zero_()
            middle = conv.kernel_size[0] // 2
            conv.weight[..., middle, middle] = torch.tensor(weights).reshape(conv.weight.shape[:2])
            conv.bias.copy_(torch.tensor(biases))


def test_a_block_cuts_negative_numbers_only_and_adds_its_input():
    block = InvertedResidual(1, Block(2, 3, 1, 1, 1))
    set_middle_taps(
        (block.expand, (1.0, -1.0), (0.0, 0.0)),
        (block.depthwise, (0.5, 1.0), (0.0, 2.0)),
        (block.project, (1.0, -10.0), (1.0,)),
    )
    x = torch.tensor([[[[8.0]]]])
    # 8 is widened to (8, 0), then (4, 2), then 4 - 20 + 1 = -15, which is not cut, plus 8.
    narrow, wide = block(x)
    assert wide.flatten().tolist() == [4, 2]
    assert narrow.item() == -7


def test_a_block_with_a_stride_halves_the_map_and_adds_nothing():
    block = InvertedResidual(2, Block(4, 5, 2, 1, 2))
    set_middle_taps((block.project, 8 * (0.0,), (3.0, -1.0)))
    x = torch.rand(1, 2, 6, 8)
    narrow, wide = block(x)
    assert narrow[0, :, 0, 0].tolist() == [3, -1]
    assert wide.shape == (1, 4, 3, 4)


def test_taps_of_a_dilated_convolution_are_two_texels_apart():
    block = InvertedResidual(1, Block(1, 5, 1, 2, 1))
    set_middle_taps((block.expand, (1.0,), (0.0,)))
    with torch.no_grad():
        block.depthwise.weight.zero_()
        block.depthwise.weight[0, 0, 2, 3] = 1  # the tap right of the middle one
        block.depthwise.bias.zero_()
    assert block(torch.tensor([[[[1.0, 2.0, 3.0, 4.0]]]]))[1].flatten().tolist() == [3, 4, 0, 0]


def test_windows_past_the_border_are_means_of_what_they_cover():
    counted = torch.arange(1.0, 7.0).reshape(1, 1, 2, 3)
    # Rows (1 2 3) and (4 5 6): the first window holds 1, 2, 4, 5, the second 3 and 6.
    assert window_means(counted, 2).flatten().tolist() == [3, 4.5]
    assert window_means(counted, 4).flatten().tolist() == [3.5]


def test_a_map_is_enlarged_between_its_texels_and_continues_past_the_last():
    row = torch.tensor([[[[0.0, 4.0]]]])
    like = torch.zeros(1, 7, 1, 7)
    assert enlarge(row, 4, like).flatten().tolist() == [0, 1, 2, 3, 4, 4, 4]


def test_a_level_of_the_context_convolves_one_half_by_3_and_the_other_by_5():
    level = ContextLevel(4, window=2)
    assert level.depthwise3.weight.shape == (2, 1, 3, 3)
    assert level.depthwise5.weight.shape == (2, 1, 5, 5)
    flat = torch.ones(1, 4, 5, 7)
    with torch.no_grad():
        for layer in level.children():
            layer.weight.zero_()
            layer.bias.fill_(-1)
        level.pointwise5.bias.fill_(2)
    assert level(flat).shape == (1, 128, 5, 7)
    assert level(flat)[0, [0, 63, 64, 127], 2, 3].tolist() == [0, 0, 2, 2]


def test_a_translation_divides_the_probability_of_each_known_class():
    translation = Translation(2, 3)
    with torch.no_grad():
        # The first known class is the first or the second new one, one to three; the second is always the third.
        translation.weight.copy_(torch.tensor([[log(1), -99], [log(3), -99], [-99, 0]]))
    # Logits 0 and log 3: probabilities 1/4 and 3/4.
    found = translation(torch.tensor([0.0, log(3)]).reshape(1, 2, 1, 1)).exp().flatten()
    torch.testing.assert_close(found, torch.tensor([1 / 16, 3 / 16, 3 / 4]))


def test_a_fresh_translation_knows_nothing():
    found = Translation(32, 5)(torch.randn(1, 32, 2, 3))
    torch.testing.assert_close(found, torch.full((1, 5, 2, 3), log(1 / 5)))


def as_logits(*probabilities: float) -> Tensor:
    """A texel with this distribution, as logits that are not normalised [1 class 1 1]."""
    return torch.tensor(probabilities).log().reshape(1, -1, 1, 1) + 3


def test_the_mean_is_geometric():
    mean = GeometricMean(2, share=0.25)
    # 16^(1/4) = 2, so the first class is twice as likely as the second.
    found = mean(as_logits(0.5, 0.5), as_logits(16 / 17, 1 / 17)).exp().flatten()
    torch.testing.assert_close(found, torch.tensor([2 / 3, 1 / 3]))


def test_classes_that_the_second_network_does_not_know_stay_as_likely_as_they_were():
    mean = GeometricMean(3, share=0.5)
    mean.known[2] = False
    # The roots of .4 x .1 and .1 x .4 are alike, so each gets half of the first network's .5; the rest is as it was.
    found = mean(as_logits(0.4, 0.1, 0.5), as_logits(0.1, 0.4, 0.5)).exp().flatten()
    torch.testing.assert_close(found, torch.tensor([0.25, 0.25, 0.5]))


def test_half_precision_is_not_used_for_the_mean():
    mean = GeometricMean(3, share=0.5)
    first, second = torch.randn(1, 3, 2, 4), torch.randn(1, 3, 2, 4)
    with torch.autocast("cpu", torch.bfloat16):
        found = mean(first, second)
    assert torch.equal(found, mean(first, second))


@pytest.mark.parametrize(
    ("size", "enlarged"),
    [
        ((240, 320), (384, 512)),
        ((480, 640), (384, 512)),  # the MobileNet reads half of it
        ((48, 80), (77, 128)),
    ],
)
def test_images_are_enlarged_relative_to_those_of_the_mobilenet(size, enlarged):
    assert Mosaic(2).enlarged(torch.rand(1, 3, *size)).shape == (1, 3, *enlarged)


def test_enlarged_images_of_one_colour_keep_it():
    image = torch.tensor([0.2, 0.5, 0.9])[None, :, None, None].expand(1, 3, 480, 640)
    for size in ((480, 640), (48, 80)):
        found = Mosaic(2).enlarged(image[..., : size[0], : size[1]])
        torch.testing.assert_close(found, image[..., : found.shape[-2], : found.shape[-1]])


def test_the_network_has_1_8_million_parameters_and_the_published_names():
    network = Mosaic(20)
    own = 20 * 32 + 2 * (64 + 1) * 20
    assert sum(one.numel() for one in network.parameters()) == 1_862_176 + own
    names = list(network.state_dict())
    assert names[:2] == ["stem.weight", "stem.bias"]
    assert {"blocks.15.project.bias", "pyramid.2.pointwise5.weight", "context.bias", "merge.bias", "low.bias"} <= {
        *names
    }
    assert len(names) == 2 * (1 + 16 * 3 + 1 + 3 * 4 + 1 + 1 + 1 + 1 + 1) + 1 + 1 + 2 * 2


def one_network(**changes: object) -> SemGS:
    """`small_plain` with the second network, in evaluation mode."""
    torch.manual_seed(1)
    return preset("small_plain", class_backbone=True, class_mosaic=True, **changes).eval()


def test_depth_and_colour_do_not_know_the_second_network():
    views = posed_views(2, (32, 48))
    model = one_network()
    with torch.no_grad():
        before = model(views)
        for parameter in model.semantic.mosaic.parameters():
            parameter.add_(0.1 * torch.randn_like(parameter))
        after = model(views)
    assert torch.equal(before.depths, after.depths)
    for part in ("means", "opacities", "colour", "semantic"):
        found = [getattr(encoding.gaussians, part) for encoding in (before, after)]
        if isinstance(found[0], Tensor):
            assert torch.equal(*found)
        else:
            assert torch.equal(found[0].scales, found[1].scales)
            assert torch.equal(found[0].features, found[1].features) == (part == "colour")
    model.semantic.mosaic = None
    with torch.no_grad():
        without = model(views)
    assert torch.equal(without.gaussians.semantic.scales, after.gaussians.semantic.scales)
    assert torch.equal(without.gaussians.semantic.quaternions, after.gaussians.semantic.quaternions)


def test_with_no_share_the_classes_are_those_without_it():
    views = posed_views(2, (32, 48))
    model = one_network()
    model.semantic.mosaic.mixture.share = 0.0
    joined = [model.class_maps(views, alone).distributions for alone in (False, True)]
    model.semantic.mosaic = None
    for alone, found in zip((False, True), joined, strict=True):
        torch.testing.assert_close(found, model.class_maps(views, alone).distributions)


def test_with_all_of_the_share_the_classes_are_its_own():
    views = posed_views(2, (32, 48))
    model = one_network()
    mosaic = model.semantic.mosaic
    mosaic.mixture.share = 1.0
    own = mosaic(views.images).softmax(1)
    assert own.shape == (2, 20, 13, 20)  # 51 x 77 pixels
    found = model.class_maps(views, True).distributions
    assert found.shape == (2, 20, 16, 24)
    torch.testing.assert_close(found.mean((-2, -1)), own.mean((-2, -1)), atol=0.02, rtol=0)


def test_gradients_reach_every_layer_of_it_in_single_images():
    views = posed_views(1, (64, 96))
    model = one_network()
    learning = model.semantic_parameters(shared=False, alone=True)
    names = {name for name, _ in model.named_parameters() if name.startswith("semantic.mosaic.")}
    assert names <= learning
    model.class_maps(views, alone=True).distributions[..., 0, :, :].log().mean().backward()
    parameters = dict(model.named_parameters())
    assert not [name for name in names if parameters[name].grad is None or not parameters[name].grad.isfinite().all()]


def test_its_layers_are_pretrained_but_for_those_of_the_classes():
    model = one_network()
    parts, pretrained = model.parts(), model.pretrained_parameters()
    own = {name for name in parts["classes"] if name.startswith("semantic.mosaic.")}
    assert {name.split(".")[2] for name in own} == {"translation", "mixture", "own", "own_low"}
    theirs = {name for name in model.state_dict() if name.startswith("semantic.mosaic.")}
    assert theirs - own <= pretrained
    assert not own & pretrained
    assert theirs <= parts["semantic"] | parts["classes"]


def test_the_switch_is_there_and_back():
    with_it = preset("small_plain", class_mosaic=True).settings
    assert switches_of(with_it).class_mosaic
    assert with_it.semantic.mosaic == MosaicBeside(share=0.4, enlargement=1.6)
    assert type(with_it).from_json(with_it.as_json()) == with_it
    assert not switches_of(preset("small_plain").settings).class_mosaic


@pytest.mark.parametrize("values", [{"share": 1.5}, {"share": -0.1}, {"enlargement": 0.5}, {"enlargement": 5.0}])
def test_settings_out_of_bounds_are_refused(values):
    with pytest.raises(ValueError, match="expected"):
        replace(MosaicBeside(), **values)
