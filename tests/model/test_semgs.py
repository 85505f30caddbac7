import json
from dataclasses import asdict, replace

import pytest
import torch
from golden import fill_golden
from networks import network, preset
from posed import posed_views

from semgs.data.views import Views, stack
from semgs.geometry.cameras import Cameras, project
from semgs.model.build import build
from semgs.model.layers.network_input import NetworkInput
from semgs.model.networks import NETWORKS
from semgs.model.settings import NetworkSettings
from semgs.model.sweep.depth import Depth
from semgs.model.switches import Switches, switches_of
from semgs.model.switches import switched as with_switches
from semgs.scene.encoding import Encoding

SIZE = (32, 48)


@pytest.fixture(scope="module", params=["small_plain", pytest.param("base", marks=pytest.mark.long)])
def model(request):
    return fill_golden(preset(request.param)).double()


@pytest.fixture(scope="module")
def small():
    return fill_golden(preset("small_plain"))


def encode(model, views) -> Encoding:
    with torch.inference_mode():
        return model(views)


def difference(a: torch.Tensor, b: torch.Tensor) -> float:
    return float((a - b).norm() / b.norm())


def test_each_pixel_becomes_a_gaussian_on_its_ray(model):
    views = posed_views(2, SIZE, dtype=torch.float64)
    encoding = encode(model, views)
    stride = model.stride
    assert encoding.depths.shape == (2, *SIZE)
    assert encoding.gaussians.means.shape == (2 * SIZE[0] * SIZE[1] // stride**2, 3)
    seen = project(encoding.gaussians.means.reshape(2, -1, 3), views.cameras).reshape(
        2, SIZE[0] // stride, SIZE[1] // stride, 3
    )
    rows = (torch.arange(SIZE[0] // stride) + 0.5) * stride
    columns = (torch.arange(SIZE[1] // stride) + 0.5) * stride
    assert (seen[..., 0] - columns).abs().max() <= stride / 2
    assert (seen[..., 1] - rows[:, None]).abs().max() <= stride / 2
    assert torch.allclose(seen[..., 2], encoding.depths[:, ::stride, ::stride], rtol=1e-9)
    assert torch.allclose(encoding.gaussians.semantic.features.sum(-1), torch.ones(1, dtype=torch.float64))


def test_depth_stays_within_its_range(model):
    encoding = encode(model, posed_views(2, SIZE, dtype=torch.float64))
    assert encoding.depths.min() >= 0.5 - 1e-9
    assert encoding.depths.max() <= 10 + 1e-9


def test_other_sizes_are_padded_with_their_camera(small):
    views = posed_views(2, (37, 51))
    encoding = encode(small, views)
    assert encoding.depths.shape == (2, 37, 51)
    assert encoding.confidences.shape == (2, 37, 51)
    assert len(encoding.gaussians) == 2 * 19 * 26


def test_padding_repeats_the_last_row_and_the_last_column_below_and_right():
    views = posed_views(2, (37, 51))
    padded = NetworkInput.of(views, torch.zeros(1), 2).images
    assert padded.shape == (2, 3, 48, 64)
    for row in range(48):
        for column in (0, 20, 50, 51, 63):
            expected = views.images[..., min(row, 36), min(column, 50)]
            assert torch.equal(padded[..., row, column], expected)


def test_one_view_is_refused(small):
    with pytest.raises(ValueError, match="got 1 view"):
        small(posed_views(2, SIZE).select([0]))


def test_half_precision_of_pictures_follows_the_network(small):
    views = posed_views(2, SIZE, dtype=torch.float64)
    assert encode(small, views).depths.dtype == torch.float32


def test_cameras_of_four_views_and_leading_axes_are_free(small):
    views = posed_views(4, SIZE)
    alone = encode(small, views)
    nested = encode(small, stack([stack([views, views])]))
    assert nested.depths.shape == (1, 2, 4, *SIZE)
    assert difference(nested.depths[0, 1], alone.depths) < 1e-4


def test_settings_rebuild_the_network(small):
    again = build(NetworkSettings.from_json(json.loads(json.dumps(small.settings.as_json()))))
    assert again.settings == small.settings
    assert {k: v.shape for k, v in again.state_dict().items()} == {k: v.shape for k, v in small.state_dict().items()}


TINY = {
    "channels": 16, "cnn_widths": (8, 8, 16), "candidates": 8, "cost_width": 8, "upsampled_channels": 16,
    "refine_width": 8, "refine_levels": 3, "projected_channels": 8, "colour_blocks": 2, "semantic_blocks": 2,
}  # fmt: skip
CAMERA_BLIND = {"camera_aware_colour": False, "camera_aware_semantic": False}


@pytest.mark.parametrize(
    "switch",
    [
        {"shared_layers": False},
        {"windows": 1},
        {"windows_semantic": 1},
        CAMERA_BLIND,
        {"shared_layers": False, "windows": 1, **CAMERA_BLIND},
        {"output_transform": False},
        {"paper_heads": True},
    ],
    ids=lambda switch: ", ".join(switch),
)
def test_the_ablations_switches_build_and_change_the_output(switch):
    plain, switched = fill_golden(network(**TINY)), fill_golden(network(**TINY, **switch))
    views = posed_views(2, SIZE)
    a, b = encode(plain, views), encode(switched, views)
    assert difference(b.gaussians.semantic.features, a.gaussians.semantic.features) > 1e-3
    assert switched.settings == with_switches(plain.settings, switch)
    assert asdict(switches_of(switched.settings)) == asdict(Switches()) | switch


def moved(views: Views) -> Views:
    poses = views.cameras.world_from_camera.clone()
    poses[1, :3, 3] += torch.tensor([0.3, 0.1, -0.2])
    return replace(views, cameras=Cameras(poses, views.cameras.intrinsics, SIZE))


def test_without_camera_awareness_features_and_classes_are_blind_to_cameras_and_depth_sees_them_in_the_cost_volume():
    views = posed_views(2, SIZE)
    for switches, blind in (({}, False), (CAMERA_BLIND, True)):
        model = fill_golden(network(**TINY, **switches))
        features: list[torch.Tensor] = []
        model.colour.transformer.register_forward_hook(lambda m, i, o, kept=features: kept.append(o))
        a, b = encode(model, views), encode(model, moved(views))
        assert torch.equal(*features) is blind
        assert torch.equal(a.gaussians.semantic.features, b.gaussians.semantic.features) is blind
        assert difference(b.depths[0], a.depths[0]) > 1e-3


@pytest.mark.parametrize("branch", ["colour", "semantic"])
def test_each_branch_has_a_camera_switch_of_its_own(branch):
    views = posed_views(2, SIZE)
    model = fill_golden(network(**TINY, **{f"camera_aware_{branch}": False}))
    features: dict[str, list[torch.Tensor]] = {"colour": [], "semantic": []}
    for name, kept in features.items():
        model.get_submodule(f"{name}.transformer").register_forward_hook(lambda m, i, o, kept=kept: kept.append(o))
    encode(model, views)
    encode(model, moved(views))
    for name, kept in features.items():
        assert torch.equal(*kept) is (name == branch)


def test_one_switch_shares_the_shallow_layers_and_another_gives_the_semantic_branch_its_own():
    views = posed_views(2, SIZE)
    for shared in (True, False):
        model = fill_golden(network(**TINY, shared_layers=shared))
        before = encode(model, views).gaussians.semantic.features
        with torch.no_grad():
            model.cnn.layer3[1].conv2.weight.mul_(-1)
        after = encode(model, views).gaussians.semantic.features
        assert torch.equal(before, after) is not shared


def test_base_has_the_papers_sizes():
    base = preset("base")
    assert len(base.colour.transformer.swin.layers) == 6
    assert len(base.semantic.transformer.swin.layers) == 3
    assert base.colour.depth.settings.candidates == 128
    assert base.cnn.conv2.out_channels == 128
    assert len([*base.cnn.layer1, *base.cnn.layer2, *base.cnn.layer3]) == 6
    assert len(base.semantic.refinement.residual) == 2
    for two_layers in (base.colour.depth.regressor.head, base.colour.heads.colour, base.semantic.head):
        first, activation, last = two_layers
        assert isinstance(first, torch.nn.Conv2d)
        assert isinstance(activation, torch.nn.GELU)
        assert isinstance(last, torch.nn.Conv2d)
    assert len(base.classes) == 20
    assert base.cnn(torch.zeros(1, 3, 32, 48)).shape == (1, 128, 8, 12)
    for transformer in (base.colour.transformer.swin, base.semantic.transformer.swin):
        assert transformer.windows == 2
        assert all(hasattr(block, "self_attn") and hasattr(block, "cross_attn_ffn") for block in transformer.layers)


def test_classify_gives_each_pixel_the_distribution_of_its_gaussian(model):
    size = (30, 44)  # padded inside
    views = posed_views(2, size, dtype=torch.float64)
    with torch.inference_mode():
        found = model.classify(views)
        features = model(views).gaussians.semantic.features
    assert found.shape == (2, 20, *size)
    grid = features.reshape(2, size[0] // model.stride, size[1] // model.stride, 20).movedim(-1, 1)
    assert torch.allclose(found[..., :: model.stride, :: model.stride], grid, rtol=1e-9, atol=1e-12)
    assert torch.equal(found[..., :: model.stride, :], found[..., model.stride - 1 :: model.stride, :])


def test_classified_alone_a_view_knows_nothing_of_others_nor_of_cameras(model):
    views = posed_views(2, SIZE, dtype=torch.float64)
    with torch.inference_mode():
        together, alone = model.classify(views), model.classify(views, alone=True)
        first = model.classify(views.select([0]), alone=True)
        elsewhere = model.classify(moved(views), alone=True)
    assert difference(alone, together) > 1e-3
    assert torch.allclose(first, alone[:1], rtol=1e-9, atol=1e-12)
    assert torch.equal(elsewhere, alone)


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("shared", [True, False])
def test_semantic_parameters_are_those_that_classify_depends_on(shared: bool, alone: bool):
    model = fill_golden(network(channels=16, cnn_widths=(8, 8, 16), candidates=8, semantic_blocks=1, colour_blocks=1,
                              cost_width=16, upsampled_channels=16, harmonics=4, shared_layers=shared))  # fmt: skip
    model.classify(posed_views(2, (16, 32)), alone)[:, 0].sum().backward()
    learning = {name for name, one in model.named_parameters() if one.grad is not None}
    assert learning == model.semantic_parameters(alone=alone)


def test_the_sweep_alone_finds_what_the_whole_network_s_does_cropped_to_the_views(model):
    size = (30, 45)  # padded inside to 8x12 texels, of which 7x11 have their centres in the view
    views = posed_views(2, size, dtype=torch.float64)
    depths: list[Depth] = []
    with torch.inference_mode():
        handle = model.colour.depth.register_forward_hook(lambda module, inputs, depth: depths.append(depth))
        model(views)
        found = model.sweep(views)
        handle.remove()
    inside, _ = depths
    assert torch.equal(found.probabilities, inside.probabilities[..., :7, :11])
    assert torch.equal(found.candidates, inside.planes.depths)
    assert found.spacing == "inverse"
    disparities = torch.einsum("nlhw,nl->nhw", inside.probabilities, 1 / inside.planes.depths)
    wide = torch.nn.functional.interpolate(disparities[:, None], scale_factor=4, mode="bilinear")[:, 0]
    torch.testing.assert_close(found.depths, 1 / wide[:, : size[0], : size[1]], rtol=1e-12, atol=0)


def test_a_batch_is_swept_as_its_scenes_are_and_one_view_is_refused(model):
    scenes = [posed_views(3, (16, 32), seed=seed, dtype=torch.float64) for seed in (1, 2)]
    with torch.inference_mode():
        together, each = model.sweep(stack(scenes)), [model.sweep(scene) for scene in scenes]
    for name in ("depths", "probabilities", "candidates"):
        alone = torch.stack([getattr(one, name) for one in each])
        torch.testing.assert_close(getattr(together, name), alone, rtol=1e-9, atol=1e-12)
    with pytest.raises(ValueError, match="1 view; expected two or more"):
        model.sweep(posed_views(1, (16, 32)))


@pytest.mark.parametrize(
    "switches", [{}, {"shared_layers": False}, {"classes": None}], ids=["shared", "own", "colour only"]
)
def test_depth_parameters_are_those_that_the_sweep_depends_on(switches: dict):
    model = fill_golden(network(channels=16, cnn_widths=(8, 8, 16), candidates=8, semantic_blocks=1, colour_blocks=1,
                              cost_width=16, upsampled_channels=16, harmonics=4, **switches))  # fmt: skip
    model.sweep(posed_views(2, (16, 32))).depths.sum().backward()
    learning = {name for name, one in model.named_parameters() if one.grad is not None}
    assert learning == model.depth_parameters()
    shallow = {name for name in learning if name.startswith("cnn.")}
    assert shallow
    assert model.depth_parameters(shared=False) == learning - (set() if switches else shallow)
    assert learning <= model.parts()["shared"] | model.parts()["depth"]


def test_a_network_of_colours_alone_does_not_classify():
    with pytest.raises(ValueError, match="no semantic branch"):
        preset("mvsplat").classify(posed_views(2, SIZE))


@pytest.mark.parametrize("backbone", [False, True], ids=["blocks", "backbone"])
def test_convolutions_keep_channels_last_but_in_training_and_the_numbers_do_not_change(backbone: bool):
    model = fill_golden(preset("small_plain", class_backbone=backbone))
    views = posed_views(2, (32, 48))
    kernel = model.colour.heads.refinement.project.weight
    assert kernel.is_contiguous(memory_format=torch.channels_last)
    with torch.inference_mode():
        last = model(views).gaussians
    before = kernel.clone()
    model.train()
    assert kernel.is_contiguous()
    assert torch.equal(kernel, before)
    for module in model.modules():
        module.training = False  # the numbers of eval in the layout of training
    with torch.inference_mode():
        first = model(views).gaussians
    torch.testing.assert_close(last.means, first.means, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(last.semantic.features, first.semantic.features, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("name", ["small_plain", "small"])
@torch.no_grad()
def test_without_the_semantic_transformer_the_head_reads_each_view_alone(name):
    views = posed_views(2, SIZE)
    other = replace(views, images=torch.stack((views.images[0], 1 - views.images[1])))
    for compares in (True, False):
        settings = with_switches(NETWORKS[name](), {"semantic_transformer": compares})
        model = fill_golden(build(settings)).eval()
        assert any(".transformer." in part for part in model.semantic.state_dict(prefix="x.")) == compares
        raw = [
            model.semantic(model.semantic.refine(inputs, model.cnn), inputs)(slice(0, 1))
            for inputs in map(model._inputs, (views, other))
        ]
        assert torch.equal(*raw) != compares
        assert torch.isfinite(model(views).gaussians.semantic.scales).all()
        channels = model.semantic.upsampler.conv.in_channels
        assert channels == settings.channels * (2 if compares else 1)
