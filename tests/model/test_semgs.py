import json
from dataclasses import replace

import pytest
import torch
from golden import fill_golden
from posed import posed_views

from semgs.data.classes import SCANNET20
from semgs.data.views import stack
from semgs.geometry.cameras import Cameras, project
from semgs.geometry.rotations import covariance
from semgs.model import presets
from semgs.model.conventions import Conventions
from semgs.model.encoding import Encoding
from semgs.model.semgs import SemGS

SIZE = (32, 48)


@pytest.fixture(scope="module", params=["small", "base"])
def model(request):
    return fill_golden(getattr(presets, request.param)()).double()


@pytest.fixture(scope="module")
def small():
    return fill_golden(presets.small())


def encode(model, views) -> Encoding:
    with torch.inference_mode():
        return model(views)


def difference(a: torch.Tensor, b: torch.Tensor) -> float:
    return float((a - b).norm() / b.norm())


def compare(a: Encoding, b: Encoding, limit: float) -> None:
    for x, y in ((a.gaussians.colour, b.gaussians.colour), (a.gaussians.semantic, b.gaussians.semantic)):
        assert difference(x.scales, y.scales) < limit
        assert difference(x.features, y.features) < limit
        assert difference(covariance(x.quaternions, x.scales), covariance(y.quaternions, y.scales)) < limit
    assert difference(a.gaussians.opacities, b.gaussians.opacities) < limit
    assert difference(a.depths, b.depths) < limit


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


@pytest.mark.parametrize("views", [2, 3])
def test_moving_the_world_moves_the_gaussians(model, views):
    still = posed_views(views, SIZE, dtype=torch.float64)
    motion = torch.eye(4, dtype=torch.float64)
    motion[:3, :3] = torch.tensor([[0.0, 0.6, -0.8], [1, 0, 0], [0, -0.8, -0.6]], dtype=torch.float64)
    motion[:3, 3] = torch.tensor([800.0, -600.0, 30.0])
    cameras = Cameras(motion @ still.cameras.world_from_camera, still.cameras.intrinsics, SIZE)
    a, b = encode(model, still), encode(model, replace(still, cameras=cameras))
    means = a.gaussians.means @ motion[:3, :3].T + motion[:3, 3]
    assert (b.gaussians.means - means).norm() / (a.gaussians.means - still.cameras.centres[0]).norm() < 1e-8
    turned = motion[:3, :3] @ covariance(a.gaussians.colour.quaternions, a.gaussians.colour.scales) @ motion[:3, :3].T
    assert difference(covariance(b.gaussians.colour.quaternions, b.gaussians.colour.scales), turned) < 1e-8
    assert difference(b.depths, a.depths) < 1e-8
    assert difference(b.gaussians.semantic.features, a.gaussians.semantic.features) < 1e-8


def test_permuting_the_views_permutes_the_output(model):
    views = posed_views(3, SIZE, dtype=torch.float64)
    order = [2, 0, 1]
    a, b = encode(model, views), encode(model, views.select(order))
    assert difference(b.depths, a.depths[order]) < 1e-8
    per_view = a.gaussians.opacities.reshape(3, -1)[order].flatten()
    assert difference(b.gaussians.opacities, per_view) < 1e-8


def test_scaling_world_and_bounds_scales_means_and_sizes(model):
    views = posed_views(2, SIZE, dtype=torch.float64)
    poses = views.cameras.world_from_camera.clone()
    poses[:, :3, 3] *= 7
    scaled = replace(views, cameras=Cameras(poses, views.cameras.intrinsics, SIZE), depth_range=views.depth_range * 7)
    a, b = encode(model, views), encode(model, scaled)
    assert difference(b.gaussians.means, 7 * a.gaussians.means) < 1e-8
    assert difference(b.gaussians.semantic.scales, 7 * a.gaussians.semantic.scales) < 1e-8


def test_a_batch_of_two_scenes_equals_two_batches_of_one(model):
    first, second = (posed_views(2, SIZE, seed=seed, dtype=torch.float64) for seed in (1, 5))
    both = encode(model, stack([first, second]))
    for index, views in enumerate((first, second)):
        alone = encode(model, views)
        assert difference(both.depths[index], alone.depths) < 1e-10
        assert difference(both.gaussians.means[index], alone.gaussians.means) < 1e-10


@pytest.mark.parametrize("what", ["pose", "picture", "intrinsics"])
def test_changing_only_the_other_view_changes_depth_and_classes(model, what):
    views = posed_views(2, SIZE, dtype=torch.float64)
    images, poses, k = views.images.clone(), views.cameras.world_from_camera.clone(), views.cameras.intrinsics.clone()
    if what == "pose":
        poses[1, :3, 3] += torch.tensor([0.3, 0.1, -0.2])
    elif what == "picture":
        images[1] = images[1].flip(-1)
    else:
        k[1, 0, 0] *= 1.3
    changed = replace(views, images=images, cameras=Cameras(poses, k, SIZE))
    a, b = encode(model, views), encode(model, changed)
    count = len(a.gaussians) // 2
    assert difference(b.depths[0], a.depths[0]) > 1e-2
    assert difference(b.gaussians.semantic.features[:count], a.gaussians.semantic.features[:count]) > 1e-2


def test_other_sizes_are_padded_with_their_camera(small):
    views = posed_views(2, (37, 51))
    encoding = encode(small, views)
    assert encoding.depths.shape == (2, 37, 51)
    assert encoding.confidences.shape == (2, 37, 51)
    assert len(encoding.gaussians) == 2 * 19 * 26


def test_one_view_is_refused(small):
    with pytest.raises(ValueError, match="given 1 view"):
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
    plain = json.loads(json.dumps(small.settings))
    settings = plain | {"conventions": Conventions(**plain["conventions"]), "cnn_widths": tuple(plain["cnn_widths"])}
    again = SemGS(classes=SCANNET20, **settings)
    assert {k: v.shape for k, v in again.state_dict().items()} == {k: v.shape for k, v in small.state_dict().items()}


@pytest.mark.parametrize(
    "switch",
    [
        {"shared_layers": False},
        {"windows": 1},
        {"camera_aware_colour": False, "camera_aware_semantic": False},
        {"output_transform": False},
    ],
)
def test_the_ablations_switches_build_and_change_the_output(switch):
    settings = {"channels": 16, "cnn_widths": (8, 8, 16), "candidates": 8, "cost_width": 8, "upsampled_channels": 16}
    tiny = {**settings, "refine_width": 8, "refine_levels": 3, "projected_channels": 8}
    plain, switched = fill_golden(SemGS(**tiny)), fill_golden(SemGS(**tiny, **switch))
    views = posed_views(2, SIZE)
    a, b = encode(plain, views), encode(switched, views)
    assert difference(b.gaussians.semantic.features, a.gaussians.semantic.features) > 1e-3


def test_base_has_the_papers_sizes():
    base = presets.base()
    assert len(base.colour_transformer.layers) == 6
    assert len(base.semantic_transformer.layers) == 3
    assert base.candidates == 128
    assert base.cnn.conv2.out_channels == 128
    assert len([*base.cnn.layer1, *base.cnn.layer2, *base.cnn.layer3]) == 6
    assert len(base.semantic_refinement) == 2
