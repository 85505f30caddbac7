"""The front door: axes, background, near, dtypes, what is empty, what is refused."""

from __future__ import annotations

from dataclasses import replace
from inspect import unwrap

import pytest
import torch

from semgs.geometry.cameras import Cameras, project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.render import render, render_each_view

FIELDS = ("images", "semantics", "depths", "alphas")
BACKENDS = pytest.mark.parametrize("backend", ["reference", "numba"])
DC = 0.28209479177387814


@BACKENDS
def test_weights_and_transmittance_sum_to_one(random_scene, backend: str) -> None:
    gaussians, cameras = random_scene(0)
    white = torch.zeros_like(gaussians.colour.features)
    white[:, 0] = 0.5 / DC
    gaussians = replace(gaussians, colour=replace(gaussians.colour, features=white))
    images = render(gaussians, cameras, background=(1, 1, 1), backend=backend).images
    torch.testing.assert_close(images, torch.ones_like(images), rtol=0, atol=1e-12)


@BACKENDS
def test_the_class_map_sums_to_one_at_every_pixel_empty_ones_too(random_scene, backend: str) -> None:
    gaussians, cameras = random_scene(1, count=20, classes=7)
    rendering = render(gaussians, cameras, backend=backend)
    assert (rendering.alphas == 0).any()
    total = rendering.semantics.sum(-3)
    torch.testing.assert_close(total, torch.ones_like(total), rtol=0, atol=1e-12)
    assert (rendering.semantics > 0).all()


@BACKENDS
@pytest.mark.parametrize("harmonics", [1, 16])
def test_no_gaussians_are_background_uniform_classes_and_no_depth(random_scene, backend: str, harmonics: int) -> None:
    gaussians, cameras = random_scene(2, count=3, views=3, classes=4, harmonics=harmonics)
    nothing = gaussians.map(lambda tensor: tensor[:0].requires_grad_())
    rendering = render(nothing, cameras, background=(0.1, 0.2, 0.3), backend=backend)
    assert rendering.images.shape == (3, 3, 37, 53)
    torch.testing.assert_close(rendering.images[1, :, 5, 6], torch.tensor([0.1, 0.2, 0.3]).double())
    assert (rendering.semantics == 0.25).all()
    assert (rendering.depths == 0).all()
    assert (rendering.alphas == 0).all()
    rendering.images.sum().backward()
    assert nothing.means.grad.shape == (0, 3)


@BACKENDS
def test_depth_is_the_mean_of_z_by_weight(random_scene, backend: str) -> None:
    _, cameras = random_scene(3, views=1)
    pose = cameras.world_from_camera
    through_a_centre = torch.tensor([[[40.0, 0, 20.5], [0, 38, 11.5], [0, 0, 1]]])
    cameras = Cameras(pose, through_a_centre, cameras.size)
    means = pose[0, :3, 3] + torch.tensor([[1.5], [2.5]]).double() * pose[0, :3, 2]
    axes = torch.tensor([[1.0, 0, 0, 0]] * 2).double()
    look = Appearance(axes, torch.full((2, 3), 0.2).double(), torch.zeros(2, 1, 3).double())
    rendering = render(Gaussians(means, torch.tensor([0.3, 0.8], dtype=torch.float64), look), cameras, backend=backend)
    front, back = 0.3, 0.7 * 0.8
    assert rendering.alphas[0, 11, 20].item() == pytest.approx(front + back, rel=1e-12)
    expected = (front * 1.5 + back * 2.5) / (front + back)
    assert rendering.depths[0, 11, 20].item() == pytest.approx(expected, rel=1e-12)
    assert rendering.semantics is None


@BACKENDS
def test_moving_the_principal_point_by_a_pixel_moves_the_picture_by_a_pixel(random_scene, backend: str) -> None:
    gaussians, cameras = random_scene(4)
    # Within the picture, so that the Jacobian's clamp does not enter.
    seen = torch.stack([project(gaussians.means, cameras[view]) for view in range(2)])
    inside = (seen[..., 2] > 0.5) & (seen[..., :2] > 0).all(-1) & (seen[..., 0] < 53) & (seen[..., 1] < 37)
    gaussians = gaussians.map(lambda tensor: tensor[inside.all(0)])
    assert len(gaussians) > 20
    plain = render(gaussians, cameras, backend=backend)
    for axis, image_axis in ((0, -1), (1, -2)):
        intrinsics = cameras.intrinsics.clone()
        intrinsics[:, axis, 2] += 1
        shifted = render(gaussians, Cameras(cameras.world_from_camera, intrinsics, cameras.size), backend=backend)
        for name in FIELDS:
            one, other = getattr(shifted, name), getattr(plain, name)
            length = one.shape[image_axis] - 1
            moved, still = one.narrow(image_axis, 1, length), other.narrow(image_axis, 0, length)
            torch.testing.assert_close(moved, still, rtol=0, atol=1e-10)


def test_each_view_has_its_own_camera(random_scene) -> None:
    gaussians, cameras = random_scene(5, views=4)
    together = render(gaussians, cameras)
    for view in range(4):
        alone = render(gaussians, cameras[view : view + 1])
        for name in FIELDS:
            assert torch.equal(getattr(together, name)[view], getattr(alone, name)[0])


@pytest.mark.parametrize("batch", [(2,), (2, 1)])
def test_a_batch_of_scenes_is_each_scene_alone(random_scene, batch: tuple[int, ...]) -> None:
    gaussians, cameras = random_scene(6, count=60, views=3, batch=batch)
    together = render(gaussians, cameras)
    assert together.semantics.shape == (*batch, 3, 5, 37, 53)
    last = tuple(size - 1 for size in batch)
    alone = render(gaussians.map(lambda tensor: tensor[last]), cameras[last])
    for name in FIELDS:
        assert torch.equal(getattr(together, name)[last], getattr(alone, name))


def test_what_a_scene_of_one_batch_shows_sends_no_gradient_to_another(random_scene) -> None:
    gaussians, cameras = random_scene(7, count=60, batch=(2,))
    gaussians = gaussians.map(lambda tensor: tensor.requires_grad_())
    render(gaussians, cameras).images[1].sum().backward()
    assert (gaussians.means.grad[0] == 0).all()
    assert (gaussians.means.grad[1] != 0).any()


def test_colour_does_not_know_the_semantic_covariances(random_scene) -> None:
    gaussians, cameras = random_scene(8)
    assert gaussians.semantic is not None
    other = replace(gaussians, semantic=replace(gaussians.semantic, scales=3 * gaussians.semantic.scales))
    one, two = render(gaussians, cameras), render(other, cameras)
    assert torch.equal(one.images, two.images)
    assert torch.equal(one.depths, two.depths)
    assert torch.equal(one.alphas, two.alphas)
    assert not torch.allclose(one.semantics, two.semantics)
    plain = render(replace(gaussians, semantic=None), cameras)
    assert plain.semantics is None
    assert torch.equal(plain.images, one.images)


def test_near_may_differ_between_views(random_scene) -> None:
    gaussians, cameras = random_scene(9, views=2)
    both = render(gaussians, cameras, near=torch.tensor([0.5, 9.0], dtype=torch.float64))
    for view, near in enumerate((0.5, 9.0)):
        assert torch.equal(both.images[view], render(gaussians, cameras, near=near).images[view])
    assert not torch.equal(both.images, render(gaussians, cameras, near=0.5).images)


@BACKENDS
def test_images_lie_in_0_to_1_unless_a_loss_asks_for_them_as_they_are(backend: str) -> None:
    """A broad, nearly opaque Gaussian of colour (1.5, 0.5, 0): red is cut at 1 and then has no gradient."""
    cameras = Cameras(torch.eye(4)[None], torch.tensor([[[30.0, 0, 11.5], [0, 28, 8.5], [0, 0, 1]]]), (16, 24))
    harmonics = torch.tensor([[[1.0, 0.0, -0.5]]], dtype=torch.float64) / DC
    harmonics.requires_grad_()
    shape = Appearance(torch.tensor([[1.0, 0, 0, 0]]).double(), torch.full((1, 3), 0.6).double(), harmonics)
    gaussians = Gaussians(torch.tensor([[0.02, 0.03, 2.0]]).double(), torch.tensor([0.99]).double(), shape)
    raw = render(gaussians, cameras, backend=backend, clamp=False)
    shown = render(gaussians, cameras, backend=backend)
    centre = (0, slice(None), 8, 11)
    torch.testing.assert_close(raw.images[centre], torch.tensor([1.485, 0.495, 0]).double(), rtol=2e-2, atol=1e-12)
    assert shown.images[centre][0] == 1
    assert torch.equal(shown.images, raw.images.clamp(0, 1))
    (slope,) = torch.autograd.grad(raw.images[centre][0], harmonics, retain_graph=True)
    (cut,) = torch.autograd.grad(shown.images[centre][0], harmonics)
    assert slope[0, 0, 0] == pytest.approx(0.99 * DC, rel=2e-2)
    assert (cut == 0).all()


def test_the_background_shows_where_light_passes_and_carries_a_gradient(random_scene) -> None:
    gaussians, cameras = random_scene(10)
    background = torch.tensor([0.3, 0.6, 0.9], dtype=torch.float64, requires_grad=True)
    rendering = render(gaussians, cameras, background=background, clamp=False)
    black = render(gaussians, cameras, clamp=False)
    light = 1 - black.alphas
    expected = black.images + light[:, None] * background.detach()[:, None, None]
    torch.testing.assert_close(rendering.images, expected, rtol=0, atol=1e-12)
    rendering.images.sum().backward()
    torch.testing.assert_close(background.grad, light.sum().expand(3))


@pytest.mark.parametrize("dtype", [torch.bfloat16, torch.float16])
def test_half_precision_is_computed_in_float32(random_scene, dtype: torch.dtype) -> None:
    gaussians, cameras = random_scene(11)
    half = gaussians.to(dtype)
    found, expected = render(half, cameras), render(half.to(torch.float32), cameras)
    for name in FIELDS:
        assert getattr(found, name).dtype == dtype
        assert torch.equal(getattr(found, name), getattr(expected, name).to(dtype))


def test_by_itself_the_cpu_uses_numba(random_scene) -> None:
    gaussians, cameras = random_scene(12)
    assert torch.equal(render(gaussians, cameras).images, render(gaussians, cameras, backend="numba").images)


def test_a_camera_without_its_list_of_views_is_refused_with_what_to_write(random_scene) -> None:
    gaussians, cameras = random_scene(13, count=5)
    assert len(render(gaussians, cameras[0:1]).images) == 1
    with pytest.raises(
        ValueError, match=r"without an axis of views; index a list of views by \[0:1\] instead of \[0\]"
    ):
        render(gaussians, cameras[0])
    for other in (
        cameras.world_from_camera,
        "camera.json",
    ):  # what a user calls does not check types, unlike in the tests
        with pytest.raises(TypeError, match=r"expected semgs\.Cameras, such as views\.cameras"):
            unwrap(render_each_view)(gaussians, other, None, "auto", None)


def test_what_cannot_be_rendered_is_refused(random_scene) -> None:
    gaussians, cameras = random_scene(13, count=5)
    with pytest.raises(ValueError, match=r"backend is 'cuda'; expected one of auto, numba, gsplat, reference"):
        render(gaussians, cameras, backend="cuda")
    with pytest.raises(ValueError, match=r"a single camera without an axis of views"):
        render(gaussians, cameras[0])
    with pytest.raises(ValueError, match=r"cameras have axes \(2,\) but Gaussians \(1,\)"):
        render(gaussians.map(lambda tensor: tensor[None]), cameras)
    with pytest.raises(ValueError, match=r"near is -1\.0; expected positive"):
        render(gaussians, cameras, near=-1.0)
    with pytest.raises(ValueError, match=r"near is \(3,\)"):
        render(gaussians, cameras, near=torch.ones(3))
    with pytest.raises(ValueError, match=r"background is \(2,\); expected 3 numbers"):
        render(gaussians, cameras, background=(0.5, 0.5))
    skewed = cameras.intrinsics.clone()
    skewed[1, 0, 1] = 2
    with pytest.raises(ValueError, match="intrinsics have skew 2"):
        render(gaussians, Cameras(cameras.world_from_camera, skewed, cameras.size))
    lost = gaussians.means.clone()
    lost[2, 1] = torch.nan
    with pytest.raises(ValueError, match="means contains a number that is not finite"):
        render(replace(gaussians, means=lost), cameras)


@pytest.mark.parametrize("name", ["quaternions", "scales", "features"])
@pytest.mark.parametrize("branch", ["colour", "semantic"])
@pytest.mark.parametrize("number", [torch.nan, torch.inf, -torch.inf])
def test_no_field_of_a_branch_may_have_a_number_that_is_not_finite(random_scene, branch: str, name: str, number: float):
    gaussians, cameras = random_scene(13, count=5)
    field = getattr(getattr(gaussians, branch), name).clone()
    field[(3, *[-1] * (field.ndim - 1))] = number
    wrong = replace(gaussians, **{branch: replace(getattr(gaussians, branch), **{name: field})})
    with pytest.raises(ValueError, match=rf"^{branch}\.{name} contains a number that is not finite"):
        render(wrong, cameras)


@pytest.mark.parametrize("branch", ["colour", "semantic"])
def test_scales_are_not_negative_and_may_be_zero(random_scene, branch: str):
    gaussians, cameras = random_scene(13, count=5)
    shape = getattr(gaussians, branch)
    scales = shape.scales.clone()
    scales[4, 1] = 0
    render(replace(gaussians, **{branch: replace(shape, scales=scales)}), cameras)
    scales[4, 1] = -0.25
    with pytest.raises(ValueError, match=rf"^{branch}\.scales go down to -0\.25; expected 0 or more"):
        render(replace(gaussians, **{branch: replace(shape, scales=scales)}), cameras)


@pytest.mark.parametrize("number", [torch.nan, torch.inf])
def test_an_opacity_is_finite(random_scene, number: float):
    gaussians, cameras = random_scene(13, count=5)
    opacities = gaussians.opacities.clone()
    opacities[2] = number
    with pytest.raises(ValueError, match=r"^opacities contains a number that is not finite"):
        render(replace(gaussians, opacities=opacities), cameras)
