"""MobileNetV2 and its decoder, for the class branch."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_views
from safetensors.torch import load_file
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, conv2d, interpolate, linear, relu6

from semgs.model.classes.mobilenet import InvertedResidual, MobileNetRefinement, MobileNetV2, SameConv2d, downsample
from semgs.training.state import freeze_statistics

RED_FOX = 278
"""Position of the red fox among the 1,001 classes of the ImageNet file."""


def one_tap(row: int, column: int) -> SameConv2d:
    """A 3x3 convolution with stride 2 that reads one of its nine taps."""
    conv = SameConv2d(1, 1, 3, stride=2)
    with torch.no_grad():
        conv.weight.zero_()
        conv.weight[0, 0, row, column] = 1
        conv.bias.zero_()
    return conv


@pytest.mark.parametrize(
    ("side", "tap", "texels"),
    [
        (4, 0, [1, 3]),  # even: nothing before, the windows start at texels 1 and 3
        (4, 2, [3, 0]),  # ... and the last one ends on the zero after
        (6, 1, [2, 4, 6]),
        (5, 0, [0, 2, 4]),  # odd: one zero before
        (5, 1, [1, 3, 5]),
        (5, 2, [2, 4, 0]),  # ... and one after
        (1, 1, [1]),
    ],
)
def test_an_even_side_is_padded_by_one_zero_after_it_and_an_odd_one_on_both_sides(side, tap, texels):
    counted = torch.arange(1.0, side + 1)
    column = one_tap(tap, 1)(counted[None, None, :, None].expand(1, 1, side, 3))
    assert column[0, 0, :, 0].tolist() == texels
    row = one_tap(1, tap)(counted[None, None, None, :].expand(1, 1, 3, side))
    assert row[0, 0, 0].tolist() == texels


def test_a_block_widens_convolves_narrows_and_adds_its_input():
    block = InvertedResidual(1, 1, expansion=2, stride=1)
    with torch.no_grad():
        for conv, weights, biases in (
            (block.expand, (1.0, -1.0), (0.0, 0.0)),
            (block.depthwise, (0.5, 1.0), (0.0, 2.0)),
            (block.project, (1.0, -10.0), (1.0,)),
        ):
            conv.weight.zero_()
            middle = conv.kernel_size[0] // 2
            conv.weight[..., middle, middle] = torch.tensor(weights).reshape(conv.weight.shape[:2])
            conv.bias.copy_(torch.tensor(biases))
    # 8 is widened to (8, -8) and cut to (6, 0), then (3, 2), then 3 - 20 + 1 = -16, which is not cut, plus 8.
    assert block(torch.tensor([[[[8.0]]]])).item() == -8
    # Of two such texels side by side each is by itself, as only middle taps are set.
    assert block(torch.tensor([[[[8.0, -1.0]]]])).flatten().tolist() == [-8, 0 - 10 * 3 + 1 - 1]


@pytest.mark.parametrize(("inputs", "outputs", "stride"), [(1, 2, 1), (2, 2, 2)])
def test_a_block_that_changes_width_or_size_adds_nothing(inputs, outputs, stride):
    block = InvertedResidual(inputs, outputs, 6, stride)
    nn.init.zeros_(block.project.weight)
    nn.init.zeros_(block.project.bias)
    assert not block(torch.ones(1, inputs, 4, 6)).any()
    assert block(torch.ones(1, inputs, 4, 6)).shape == (1, outputs, 4 // stride, 6 // stride)


def test_the_backbone_has_the_names_of_the_published_files_and_no_norm():
    backbone = MobileNetV2()
    names = list(backbone.state_dict())
    assert names[:6] == [f"{one}.{what}" for one in ("stem", "blocks.0.depthwise", "blocks.0.project") for what in ("weight", "bias")]  # fmt: skip
    assert names[6] == "blocks.1.expand.weight"
    assert names[-1] == "blocks.16.project.bias"
    assert len(names) == 2 * (1 + 2 + 16 * 3)
    assert not any(isinstance(one, nn.BatchNorm2d) for one in backbone.modules())


def test_the_backbone_has_1_80_million_parameters_and_the_refinement_1_94():
    backbone = MobileNetV2()
    # torchvision's layers of the same name have 1,811,712 parameters, two a channel in norms; folded, one bias is left of them.
    channels = sum(one.out_channels for one in backbone.modules() if isinstance(one, nn.Conv2d))
    assert channels == 15_776
    assert count(backbone) == 1_811_712 - channels
    laterals = 96 * (24 + 32 + 96 + 320) + 4 * 2 * 96
    merged = 3 * 96 * (9 + 2)
    ends = 96 * 96 * 9 + 2 * 96 + (96 + 1) * 20 + (96 + 1) * 128
    assert count(MobileNetRefinement(128, 20)) == count(backbone) + laterals + merged + ends == 1_942_676


def count(module: nn.Module) -> int:
    return sum(one.numel() for one in module.parameters())


@pytest.mark.parametrize(
    ("size", "coarsest"), [((64, 96), (2, 3)), ((48, 80), (2, 3)), ((240, 320), (8, 10)), ((16, 16), (1, 1))]
)
def test_maps_are_halved_and_rounded_up_where_a_side_is_no_multiple_of_32(size, coarsest):
    height, width = size
    pictures = torch.rand(1, 3, *size)
    with torch.inference_mode():
        maps = MobileNetV2()(pictures)
        refined = MobileNetRefinement(12, 5, width=8).eval()(pictures, not_asked)
    fine = (height // 4, width // 4)
    assert [one.shape[1:] for one in maps] == [
        (24, *fine), (32, height // 8, width // 8), (96, height // 16, width // 16), (320, *coarsest)
    ]  # fmt: skip
    assert refined.features.shape == (1, 12, *fine)
    assert refined.evidence.shape == (1, 8, *fine)


def not_asked(pictures: Tensor) -> Tensor:
    raise AssertionError("the shallow features were asked for")


def test_pictures_are_scaled_as_the_weights_expect_it():
    backbone = MobileNetV2()
    given = []
    backbone.stem.register_forward_pre_hook(lambda _, inputs: given.append(inputs[0]))
    with torch.inference_mode():
        backbone(torch.tensor([0.0, 128 / 255, 1.0])[None, :, None, None].expand(1, 3, 16, 32))
    torch.testing.assert_close(given[0][0, :, 0, 0], torch.tensor([-1.0, 0.0, 127 / 128]))


def test_a_fresh_backbone_neither_loses_nor_inflates_what_the_picture_says():
    torch.manual_seed(0)
    with torch.inference_mode():
        maps = MobileNetV2()(torch.rand(2, 3, 64, 96))
    assert all(0.1 < one.std() < 10 for one in maps)


def refinement() -> MobileNetRefinement:
    return fill_golden(MobileNetRefinement(12, 5, width=16)).double()


def test_a_coarse_texel_sees_491_pixels_that_lie_further_to_the_right_and_below():
    backbone = MobileNetV2().double()
    for name, tensor in backbone.state_dict().items():
        # All positive and small: nothing cancels, and nothing reaches the 6 where it would be cut.
        tensor.fill_(0 if name.endswith("bias") else 0.5 / tensor[0].numel())
    pictures = torch.full((1, 3, 1024, 64), 0.9, dtype=torch.float64, requires_grad=True)
    backbone(pictures)[-1][0, :, 16].sum().backward()
    seen = torch.nonzero(pictures.grad[0].sum((0, 2)))
    # Texel j at 1/32: j - 3 to j + 3 there, 2j - 12 to 2j + 14 at 1/16, 4j - 26 to 4j + 32 at 1/8, 8j - 53 to 8j + 67 at 1/4,
    # 16j - 107 to 16j + 137 at 1/2, 32j - 214 to 32j + 276 in the picture.
    assert (seen.min(), seen.max(), len(seen)) == (512 - 214, 512 + 276, 491)


def test_a_picture_is_seen_by_itself():
    pictures = torch.rand(2, 3, 48, 80, dtype=torch.float64, requires_grad=True)
    refinement()(pictures, not_asked).evidence[0].sum().backward()
    assert pictures.grad[0].any()
    assert not pictures.grad[1].any()


def test_shallow_features_are_not_read_and_features_are_linear_in_the_decoders_map():
    torch.manual_seed(0)
    model, pictures = refinement(), torch.rand(1, 3, 48, 80, dtype=torch.float64)
    with torch.no_grad():
        refined, decoded = model(pictures, not_asked), model.decode(model.backbone(pictures))
    torch.testing.assert_close(refined.evidence, decoded)
    by_hand = torch.einsum("kc,nchw->nkhw", model.features.weight[..., 0, 0], decoded)
    torch.testing.assert_close(refined.features, by_hand + model.features.bias[:, None, None])


def test_pictures_are_averaged_down_by_the_whole_number_that_brings_their_shorter_side_nearest_to_240():
    sizes = {
        (240, 320): (240, 320),
        (352, 480): (352, 480),
        (368, 480): (184, 240),
        (480, 640): (240, 320),
        (736, 992): (248, 332),
    }
    assert {size: downsample(torch.zeros(1, 3, *size), 4).shape[-2:] for size in sizes} == sizes
    pictures = torch.rand(1, 3, 480, 480)
    assert torch.allclose(downsample(pictures, 4), avg_pool2d(pictures, 2), atol=1e-6)


def test_a_picture_twice_as_large_has_the_maps_of_the_small_one_widened(monkeypatch):
    monkeypatch.setattr("semgs.model.classes.mobilenet.SIDE", 32)
    torch.manual_seed(0)
    model, pictures = refinement(), torch.rand(1, 3, 32, 48, dtype=torch.float64)
    large = pictures.repeat_interleave(2, -2).repeat_interleave(2, -1)
    with torch.inference_mode():
        few = model(pictures, not_asked)
        many = model(large, not_asked)
    for small, wide in ((few.features, many.features), (few.evidence, many.evidence)):
        torch.testing.assert_close(wide, interpolate(small, scale_factor=2, mode="bilinear", align_corners=False))


def test_a_view_by_itself_has_the_backbones_classes_and_a_fresh_head_leaves_them_as_they_are():
    torch.manual_seed(3)
    model = preset("small_plain", class_backbone=True).eval()
    views = posed_views(2, (32, 48))
    with torch.inference_mode():
        torch.testing.assert_close(model.classify(views), model.classify(views, alone=True))
        assert model.classify(views, alone=True).amax(-3).sub(0.05).amax() > 1e-3
        model.semantic.head[-1].weight[7:12] += 0.1
        assert (model.classify(views) - model.classify(views, alone=True)).abs().amax() > 1e-3


@pytest.mark.parametrize("backbone", [False, True], ids=["blocks", "backbone"])
def test_what_teaches_a_view_by_itself_are_the_layers_that_see_it_alone(backbone: bool):
    model = preset("small_plain", class_backbone=backbone)
    model.classify(posed_views(2, (32, 48)), alone=True).square().sum().backward()
    learned = {name for name, parameter in model.named_parameters() if parameter.grad is not None}
    assert learned == model.semantic_parameters(alone=True)
    if backbone:
        assert {".".join(name.split(".")[:3]) for name in learned} == {
            f"semantic.refinement.{layer}" for layer in ("backbone", "lateral", "merged", "last", "classifier")
        }
    else:
        assert not any(name.startswith("semantic.transformer") for name in learned)


def test_norms_tell_pictures_of_a_batch_apart_and_measure_only_while_they_may():
    torch.manual_seed(0)
    model, pictures = refinement().train(), torch.rand(2, 3, 48, 80, dtype=torch.float64)
    norm = model.last[1]
    before = norm.running_mean.clone()
    freeze_statistics(model)
    held = model(pictures, not_asked).evidence
    assert torch.equal(norm.running_mean, before)
    torch.testing.assert_close(model(pictures[:1], not_asked).evidence, held[:1])
    model.train()
    model(pictures, not_asked)
    assert not torch.equal(norm.running_mean, before)


def test_the_imagenet_file_knows_a_fox(shared: Path):
    weights = shared / "pretrained" / "mobilenet_v2_imagenet.safetensors"
    if not weights.is_file():
        pytest.skip("the published weights are not here")
    tensors = {name: tensor.float() for name, tensor in load_file(weights).items()}
    backbone = MobileNetV2()
    backbone.load_state_dict({name: tensors[name] for name in backbone.state_dict()})
    image = cv2.imread(str(shared / "data" / "fox" / "images" / "0014.jpg"))[420:1500, :, ::-1]
    small = cv2.resize(image, (224, 224), interpolation=cv2.INTER_AREA)
    with torch.inference_mode():
        coarsest = backbone(torch.from_numpy(small).permute(2, 0, 1)[None] / 255)[-1]
        top = relu6(conv2d(coarsest, tensors["top.weight"], tensors["top.bias"])).mean((-2, -1))
        logits = linear(top, tensors["classifier.weight"], tensors["classifier.bias"])[0]
    assert logits.argmax() == RED_FOX
    assert logits.softmax(0)[RED_FOX] > 0.3


def test_the_decoder_sums_its_four_maps_from_coarse_to_fine():
    model = MobileNetRefinement(4, 3, width=2)
    model.lateral, model.merged = (nn.ModuleList(nn.Identity() for _ in one) for one in (model.lateral, model.merged))
    model.last = nn.Identity()
    maps = [torch.full((1, 2, 24 // 2**k, 32 // 2**k), value) for k, value in enumerate((1.0, 20.0, 300.0, 4000.0))]
    assert torch.equal(model.decode(maps), torch.full((1, 2, 24, 32), 4321.0))
