"""What must not change the Gaussians, what must move with them, and what must not leave them alone.

Weights are drawn by the golden rule, errors are norms of differences over norms, and means are compared in the first
camera's frame: to 1e-8 in float64 and 1e-4 in float32.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_views

from semgs.data.views import Views, stack
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance
from semgs.geometry.rotations import covariance, matrix_from_quaternion
from semgs.model.attention.camera_attention import token_transforms
from semgs.model.attention.transformer import Windows
from semgs.model.semgs import SemGS
from semgs.scene.encoding import Encoding

SIZE = (32, 48)
"""Of the pictures; `base`, which is slow in float64, gets smaller ones."""
TURN = matrix_from_quaternion(torch.tensor([0.3, -0.7, 0.2, 0.5], dtype=torch.float64))
LIMITS = {torch.float64: 1e-8, torch.float32: 1e-4}


def small_with_the_papers_heads() -> SemGS:
    return preset("small_plain", paper_heads=True)


NETWORKS = {
    "small": lambda: preset("small_plain"), "base": lambda: preset("base"), "small, paper_heads": small_with_the_papers_heads,
    "small, convex": lambda: preset("small_plain", depth_upsampling="convex"),
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A network, how many views it is given, and what it made of them."""

    model: SemGS
    views: Views
    encoding: Encoding
    limit: float


def encode(model: SemGS, views: Views) -> Encoding:
    with torch.inference_mode():
        return model(views)


def built(name: str, dtype: torch.dtype) -> SemGS:
    return fill_golden(NETWORKS[name]()).to(dtype)


@pytest.fixture(
    scope="module",
    params=[torch.float64, pytest.param(torch.float32, marks=pytest.mark.long)],
    ids=["float64", "float32"],
)
def dtype(request) -> torch.dtype:
    return request.param


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=pytest.mark.long if name == "base" else ()) for name in NETWORKS]
)
def model(request, dtype) -> SemGS:
    return built(request.param, dtype)


@pytest.fixture(scope="module", params=[pytest.param(2, marks=pytest.mark.long), 3], ids=["N=2", "N=3"])
def case(request, model, dtype) -> Case:
    views = posed_views(request.param, (16, 32) if model.name == "base" else SIZE, dtype=dtype)
    return Case(model, views, encode(model, views), LIMITS[dtype])


def difference(a: torch.Tensor, b: torch.Tensor) -> float:
    return float((a - b).norm() / b.norm())


def in_first(means: torch.Tensor, cameras: Cameras) -> torch.Tensor:
    """Positions in the frame of the first camera, in float64."""
    pose = cameras.world_from_camera[0]
    return (means.double() - pose[:3, 3]) @ pose[:3, :3]


def covariances(appearance: Appearance) -> torch.Tensor:
    return covariance(appearance.quaternions.double(), appearance.scales.double())


def by_view(tensor: torch.Tensor, order: list[int]) -> torch.Tensor:
    """The Gaussians' numbers with their views in another order."""
    return tensor.unflatten(0, (len(order), -1))[order].flatten(0, 1)


def moved(views: Views, translation: list[float]) -> tuple[Views, torch.Tensor]:
    motion = torch.eye(4, dtype=torch.float64)
    motion[:3, :3], motion[:3, 3] = TURN, torch.tensor(translation)
    cameras = Cameras(motion @ views.cameras.world_from_camera, views.cameras.intrinsics, views.size)
    return replace(views, cameras=cameras), motion


@pytest.mark.parametrize("translation", [[0.7, -2.1, 1.4], [800.0, -600.0, 30.0]], ids=["nearby", "a kilometre away"])
def test_moving_the_world_moves_the_gaussians(case: Case, translation):
    views, motion = moved(case.views, translation)
    a, b = case.encoding, encode(case.model, views)
    for x, y in ((a.gaussians.colour, b.gaussians.colour), (a.gaussians.semantic, b.gaussians.semantic)):
        assert difference(covariances(y), TURN @ covariances(x) @ TURN.T) < case.limit
        assert difference(y.scales, x.scales) < case.limit
    assert difference(b.gaussians.semantic.features, a.gaussians.semantic.features) < case.limit
    assert difference(b.gaussians.opacities, a.gaussians.opacities) < case.limit
    assert difference(b.depths, a.depths) < case.limit
    expected = a.gaussians.means.double() @ TURN.T + motion[:3, 3]
    if a.depths.dtype == torch.float64:
        error = in_first(b.gaussians.means, views.cameras) - in_first(a.gaussians.means, case.views.cameras)
        assert error.norm() / in_first(a.gaussians.means, case.views.cameras).norm() < case.limit
    else:
        # 1e-4 m, and 4 units in the last place of numbers of that size.
        ulp = 2.0 ** (expected.abs().log2().floor() - 23)
        assert ((b.gaussians.means.double() - expected).abs() <= 1e-4 + 4 * ulp).all()


def test_permuting_the_views_permutes_the_output(case: Case):
    count = len(case.views)
    order = [1, 0] if count == 2 else [2, 0, 1]
    a, b = case.encoding, encode(case.model, case.views.select(order))
    assert difference(b.depths, a.depths[order]) < case.limit
    cameras = case.views.cameras
    pairs = [
        (in_first(b.gaussians.means, cameras), in_first(by_view(a.gaussians.means, order), cameras)),
        (b.gaussians.opacities, by_view(a.gaussians.opacities, order)),
    ]
    for x, y in ((a.gaussians.colour, b.gaussians.colour), (a.gaussians.semantic, b.gaussians.semantic)):
        pairs.append((covariances(y), by_view(covariances(x), order)))
        pairs.append((y.features, by_view(x.features, order)))
    assert all(difference(found, expected) < case.limit for found, expected in pairs)
    assert difference(b.depths, a.depths) > 1e-2


def scaled(views: Views, factor: float) -> Views:
    poses = views.cameras.world_from_camera.clone()
    poses[:, :3, 3] *= factor
    cameras = Cameras(poses, views.cameras.intrinsics, views.size)
    return replace(views, cameras=cameras, depth_range=views.depth_range * factor)


def test_scaling_world_and_bounds_scales_means_and_sizes(case: Case):
    views = scaled(case.views, 7.0)
    a, b = case.encoding, encode(case.model, views)
    means = in_first(b.gaussians.means, views.cameras)
    assert difference(means, 7 * in_first(a.gaussians.means, case.views.cameras)) < case.limit
    for x, y in ((a.gaussians.colour, b.gaussians.colour), (a.gaussians.semantic, b.gaussians.semantic)):
        assert difference(y.scales, 7 * x.scales) < case.limit
        assert difference(y.features, x.features) < case.limit
    assert difference(b.gaussians.opacities, a.gaussians.opacities) < case.limit
    assert difference(b.depths, 7 * a.depths) < case.limit


def test_mvsplats_network_knows_the_scale_of_its_world():
    """Its refinement reads disparity in 1 / m (D8)."""
    model = fill_golden(preset("mvsplat"))
    views = posed_views(2, SIZE)
    a, b = encode(model, views), encode(model, scaled(views, 7.0))
    assert difference(b.depths, 7 * a.depths) > 1e-2


def test_a_batch_of_two_different_scenes_equals_two_batches_of_one(case: Case):
    other = posed_views(len(case.views), case.views.size, seed=5, dtype=case.views.images.dtype)
    other = replace(other, depth_range=other.depth_range * 1.5)
    both = encode(case.model, stack([case.views, other]))
    for index, alone in enumerate((case.encoding, encode(case.model, other))):
        assert difference(both.depths[index], alone.depths) < case.limit
        assert difference(both.gaussians.means[index], alone.gaussians.means) < case.limit
        assert difference(both.gaussians.semantic.features[index], alone.gaussians.semantic.features) < case.limit
        assert difference(both.gaussians.colour.scales[index], alone.gaussians.colour.scales) < case.limit
    assert difference(both.depths[0], both.depths[1]) > 1e-2


@pytest.mark.parametrize("what", ["pose", "picture", "intrinsics"])
def test_changing_only_one_other_view_changes_depth_and_classes(case: Case, what: str):
    views = case.views
    images, poses, k = views.images.clone(), views.cameras.world_from_camera.clone(), views.cameras.intrinsics.clone()
    if what == "pose":
        poses[1, :3, 3] += torch.tensor([0.3, 0.1, -0.2])
    elif what == "picture":
        images[1] = images[1].flip(-1)
    else:
        k[1, 0, 0] *= 1.5
    a, b = case.encoding, encode(case.model, replace(views, images=images, cameras=Cameras(poses, k, views.size)))
    first = len(a.gaussians) // len(views)
    assert difference(b.depths[0], a.depths[0]) > 1e-2
    assert difference(b.gaussians.semantic.features[:first], a.gaussians.semantic.features[:first]) > 1e-2


@pytest.mark.parametrize("branch", ["colour", "semantic"])
def test_every_key_view_twice_changes_nothing_in_cross_attention_and_one_of_two_twice_does(model, dtype, branch):
    """The layer with shifted windows, so that the mask takes part; each key view brings its own camera."""
    layer = model.get_submodule(f"{branch}.transformer.swin").layers[1].cross_attn_ffn
    channels = layer.q_proj.in_features
    grid = (8, 12)
    views = posed_views(3, SIZE, dtype=dtype)
    cameras = views.cameras[None, :]
    tokens = torch.randn(1, 3, *grid, channels, generator=torch.Generator().manual_seed(2), dtype=dtype)
    transforms = token_transforms(cameras, views.depth_range[:1, 0], grid, channels, tokens)

    def first(order: list[int]) -> torch.Tensor:
        given = replace(transforms, projection=transforms.projection[:, order], inverse=transforms.inverse[:, order])
        x = tokens[:, order]
        with torch.inference_mode():
            return layer(x, x, Windows(grid, 2, True), given, cross=True)[:, 0]

    assert difference(first([0, 1, 2, 1, 2]), first([0, 1, 2])) < LIMITS[dtype]
    assert difference(first([0, 1, 2, 1]), first([0, 1, 2])) > 1e-3
