"""The pyramid of the semantic branch."""

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_views
from torch.nn.functional import avg_pool2d, interpolate

from semgs.model.pyramid import SemanticPyramid, near_side
from semgs.training.state import hold_statistics
from semgs.weights.file import save
from semgs.weights.load import load

SHRINK = 4


def pyramid() -> SemanticPyramid:
    return fill_golden(SemanticPyramid(16, (24, 32), 5)).double().eval()


def given(height: int, width: int) -> tuple[torch.Tensor, torch.Tensor]:
    torch.manual_seed(0)
    features = torch.randn(2, 16, height, width, dtype=torch.float64)
    return features, torch.rand(2, 3, SHRINK * height, SHRINK * width, dtype=torch.float64)


@pytest.mark.parametrize("size", [(8, 12), (15, 20), (5, 3)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_features_keep_their_size_also_where_it_cannot_be_halved(size):
    features, pictures = given(*size)
    assert pyramid().refined(features, pictures).shape == features.shape


def test_pictures_are_averaged_down_by_the_whole_number_that_brings_their_shorter_side_nearest_to_240():
    sizes = {
        (240, 320): (240, 320),
        (352, 480): (352, 480),
        (368, 480): (184, 240),
        (480, 640): (240, 320),
        (736, 992): (248, 332),
    }
    assert {size: near_side(torch.zeros(1, 3, *size), SHRINK).shape[-2:] for size in sizes} == sizes
    pictures = torch.rand(1, 3, 480, 480)
    assert torch.allclose(near_side(pictures, SHRINK), avg_pool2d(pictures, 2), atol=1e-6)


@pytest.mark.parametrize("shared", [True, False])
def test_a_picture_twice_as_large_has_the_features_of_the_small_one_widened(shared):
    views = posed_views(2, (32, 48))
    pictures = views.images
    large = pictures.repeat_interleave(2, -2).repeat_interleave(2, -1)
    model = fill_golden(preset("small", semantic_pyramid=(24, 32), shared_layers=shared)).eval()
    cnn = model.semantic.cnn or model.cnn
    with torch.no_grad(), pytest.MonkeyPatch.context() as patch:
        patch.setattr("semgs.model.pyramid.SIDE", 32)
        found, few = (model.semantic.refinement(one, cnn).features for one in (large, pictures))
    expected = interpolate(few, scale_factor=2, mode="bilinear", align_corners=False)
    assert torch.allclose(found, expected, atol=1e-5)
    with torch.no_grad():
        assert not torch.allclose(model.semantic.refinement(large, cnn).features, expected, atol=1e-2)


def test_a_texel_sees_features_and_picture_far_beyond_two_residual_blocks():
    features, pictures = given(32, 32)
    features.requires_grad_(True)
    pictures.requires_grad_(True)
    pyramid().refined(features, pictures)[0, :, 16, 16].sum().backward()
    reach = torch.nonzero(features.grad[0].abs().sum(0))
    seen = torch.nonzero(pictures.grad[0].abs().sum(0))
    assert (16 - reach.min(0).values > 8).all()  # two residual blocks of two convolutions reach 4
    assert (SHRINK * 16 - seen.min(0).values > SHRINK * 8).all()
    assert not features.grad[1].any()


def test_pictures_are_pixels_not_colours_relative_to_their_mean():
    features, pictures = given(8, 8)
    model = pyramid()
    with torch.no_grad():
        assert (model.refined(features, pictures) - model.refined(features, pictures + 0.3)).abs().amax() > 1e-3


def test_a_network_that_asks_for_it_refines_its_semantic_features_so_and_its_file_brings_it_back(tmp_path):
    model = preset("small", semantic_pyramid=(16, 24))
    assert isinstance(model.semantic.refinement, SemanticPyramid)
    views = posed_views(2, (32, 48))
    with torch.inference_mode():
        assert model.eval()(views).gaussians.semantic.features.shape == (2 * 16 * 24, 20)
    save(tmp_path / "pyramid.safetensors", model, {})
    again = load("small", tmp_path / "pyramid.safetensors")
    assert isinstance(again.semantic.refinement, SemanticPyramid)
    assert again.settings == model.settings
    assert not isinstance(preset("small").semantic.refinement, SemanticPyramid)


def test_a_view_by_itself_has_the_pyramids_classes_and_a_fresh_head_leaves_them_as_they_are():
    torch.manual_seed(3)
    model = preset("small", semantic_pyramid=(16, 24)).eval()
    views = posed_views(2, (32, 48))
    with torch.inference_mode():
        torch.testing.assert_close(model.classify(views), model.classify(views, alone=True))
        assert model.classify(views, alone=True).amax(-3).sub(0.05).amax() > 1e-3
        model.semantic.head[-1].weight[7:12] += 0.1
        assert (model.classify(views) - model.classify(views, alone=True)).abs().amax() > 1e-3


def test_what_teaches_a_view_by_itself_are_the_layers_of_a_backbone_alone():
    model = preset("small", class_backbone=True)
    model.classify(posed_views(2, (32, 48)), alone=True).square().sum().backward()
    learned = {name for name, parameter in model.named_parameters() if parameter.grad is not None}
    assert learned == model.semantic_parameters(alone=True)
    assert {".".join(name.split(".")[:3]) for name in learned} == {
        f"semantic.refinement.{layer}" for layer in ("backbone", "lateral", "merged", "last", "classifier")
    }


def test_what_teaches_a_view_by_itself_are_the_layers_of_the_pyramid_alone():
    model = preset("small", semantic_pyramid=(16, 24))
    model.classify(posed_views(2, (32, 48)), alone=True).square().sum().backward()
    learned = {name for name, parameter in model.named_parameters() if parameter.grad is not None}
    assert learned == model.semantic_parameters(alone=True)
    assert {name.split(".")[0] for name in learned} == {"cnn", "semantic"}
    assert {name.split(".")[1] for name in learned if name.startswith("semantic")} == {"refinement"}


def test_its_norms_tell_pictures_of_a_batch_apart_and_measure_only_while_they_may():
    model = pyramid().train()
    features, pictures = given(8, 8)
    before = model.stem[1].running_mean.clone()
    hold_statistics(model)
    held = model.refined(features, pictures)
    assert torch.equal(model.stem[1].running_mean, before)
    torch.testing.assert_close(model.refined(features[:1], pictures[:1]), held[:1])
    model.train()
    model.refined(features, pictures)
    assert not torch.equal(model.stem[1].running_mean, before)


def test_the_pyramid_sees_colours_of_minus_one_to_one():
    features, pictures = given(8, 8)
    model, seen = pyramid(), []
    model.stem.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0][:, 16:]))
    with torch.no_grad():
        for grey in (0.0, 0.75, 1.0):
            model.refined(features, torch.full_like(pictures, grey))
    assert [one.unique().tolist() for one in seen] == [[-1.0], [0.5], [1.0]]
