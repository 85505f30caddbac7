"""gsplat against the reference: on a GPU itself, elsewhere a stand-in that takes what gsplat takes."""

from __future__ import annotations

import sys
import types
from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from semgs.geometry.cameras import Cameras, inverse_rigid
from semgs.geometry.gaussians import Gaussians
from semgs.geometry.rotations import quaternion_from_matrix
from semgs.rendering import gsplat_backend, numba_backend, reference
from semgs.rendering import render as door
from semgs.rendering.render import render
from semgs.rendering.rendering import Rendering
from semgs.rendering.splats import Pinhole, Splats

FIELDS = ("images", "semantics", "depths", "alphas")
BACKGROUND = (0.2, 0.7, 0.1)
CASES = pytest.mark.parametrize(
    ("seed", "views", "size", "harmonics", "classes", "near"),
    [
        (0, 2, (37, 53), 16, 5, None),
        (1, 3, (16, 31), 4, 20, 0.5),
        (2, 4, (33, 17), 1, 2, torch.tensor([0.3, 0.5, 2.0, 9.0])),
        (3, 1, (1, 7), 9, 40, None),
    ],
)


def drawn_with_gradients(
    gaussians: Gaussians, cameras: Cameras, near: float | Tensor | None, backend: str, like: Tensor
) -> tuple[dict[str, Tensor], list[Tensor]]:
    """The rendering's fields, and the gradients of a random linear function of them in every tensor of the Gaussians."""
    leaves: list[Tensor] = []

    def leaf(tensor: Tensor) -> Tensor:
        leaves.append(tensor.detach().to(like).clone().requires_grad_())
        return leaves[-1]

    rendering = render(gaussians.map(leaf), cameras, background=BACKGROUND, near=near, backend=backend)
    fields = {name: getattr(rendering, name) for name in FIELDS}
    generator = torch.Generator().manual_seed(7)
    weights = {name: torch.randn(one.shape, generator=generator, dtype=torch.float64) for name, one in fields.items()}
    sum((fields[name].cpu() * weights[name]).sum() for name in FIELDS).backward()
    return {name: one.detach().cpu().double() for name, one in fields.items()}, [
        one.grad.cpu().double() for one in leaves
    ]


def difference(a: Tensor, b: Tensor) -> float:
    """Norm of the difference over the norm."""
    return float((a - b).norm() / b.norm())


@pytest.mark.gpu
@CASES
def test_gsplat_equals_the_reference_in_value_and_gradient(
    gsplat, random_scene, seed, views, size, harmonics, classes, near
) -> None:
    gaussians, cameras = random_scene(seed, 150, views, size, harmonics, classes)
    gaussians = gaussians.to(torch.float32)
    exact = torch.zeros(0, dtype=torch.float64)
    truth, truth_gradients = drawn_with_gradients(gaussians, cameras, near, "reference", exact)
    found, found_gradients = drawn_with_gradients(gaussians, cameras, near, "auto", torch.zeros(0, device=gsplat))
    for name in FIELDS:
        torch.testing.assert_close(found[name], truth[name], rtol=1e-4, atol=1e-4)
    for one, other in zip(found_gradients, truth_gradients, strict=True):
        assert difference(one, other) < 1e-3


@pytest.mark.gpu
def test_gsplat_loses_nothing_a_kilometre_from_the_origin(gsplat, random_scene) -> None:
    gaussians, cameras = random_scene(8, 200, 2)
    far = torch.tensor([1000.0, -400.0, 250.0])
    near_home = gaussians.to(torch.float32)
    moved = Gaussians(near_home.means + far, near_home.opacities, near_home.colour, near_home.semantic)
    poses = cameras.world_from_camera.clone()
    poses[..., :3, 3] += far
    there = Cameras(poses, cameras.intrinsics, cameras.size)
    truth = render(moved.to(torch.float64), there, backend="reference")
    found = render(moved.to(gsplat), there)
    for name in FIELDS:
        assert getattr(found, name).device.type == "cuda"
        torch.testing.assert_close(getattr(found, name).cpu().double(), getattr(truth, name), rtol=1e-4, atol=1e-4)


@pytest.mark.gpu
def test_gsplat_draws_no_gaussians_and_those_that_no_camera_sees(gsplat, random_scene) -> None:
    gaussians, cameras = random_scene(2, count=30, views=2)
    gaussians = gaussians.to(gsplat, torch.float32)
    behind = gaussians.map(lambda tensor: tensor)
    behind = Gaussians(
        behind.means - torch.tensor([0, 0, 30.0], device=gsplat), behind.opacities, behind.colour, behind.semantic
    )
    aside = Gaussians(
        gaussians.means + torch.tensor([500.0, 0, 0], device=gsplat),
        gaussians.opacities, gaussians.colour, gaussians.semantic,
    )  # fmt: skip
    for unseen in (gaussians.map(lambda tensor: tensor[:0]), behind, aside):
        leaves = unseen.map(lambda tensor: tensor.detach().requires_grad_())
        rendering = render(leaves, cameras, background=(0.1, 0.2, 0.3))
        assert torch.allclose(rendering.images[1, :, 5, 6].cpu(), torch.tensor([0.1, 0.2, 0.3]))
        assert torch.allclose(rendering.semantics, torch.tensor(0.2, device=gsplat))
        assert (rendering.alphas == 0).all()
        rendering.images.sum().backward()


@pytest.mark.gpu
def test_autocast_does_not_reach_into_rendering_on_cuda(gsplat, random_scene) -> None:
    gaussians, cameras = random_scene(10)
    gaussians = gaussians.to(gsplat, torch.float32)
    plain = render(gaussians, cameras)
    with torch.autocast("cuda", torch.bfloat16):
        inside = render(gaussians, cameras)
    for name in FIELDS:
        assert torch.equal(getattr(plain, name), getattr(inside, name))


def rasterization(
    means: Tensor, quats: None, scales: None, opacities: Tensor, colors: Tensor, viewmats: Tensor, Ks: Tensor,
    width: int, height: int, near_plane: float, far_plane: float, eps2d: float, packed: bool, covars: Tensor,
) -> tuple[Tensor, Tensor, dict]:  # fmt: skip
    """What gsplat documents of its function of this name, drawn by our reference in gsplat's order of depth.

    World-to-camera matrices, K in pixels, covariances in the world; out come pictures [1 h w c] and alphas [1 h w 1].
    """
    assert (quats, scales, packed, eps2d, far_plane) == (None, None, False, 0.3, float("inf"))
    assert len(means) > 0
    pose = inverse_rigid(viewmats[0].double())
    camera = Pinhole.of(Cameras(pose, Ks[0].double(), (height, width)))
    # R S S^T R^T back into axes and sizes.
    squares, axes = torch.linalg.eigh(covars)
    axes = axes * torch.linalg.det(axes)[:, None, None].sign()
    splats = Splats(means, quaternion_from_matrix(axes), squares.clamp(min=0).sqrt(), opacities, colors)
    depths = (means @ viewmats[0, :3, :3].T + viewmats[0, :3, 3])[:, 2]
    order = torch.argsort(depths.float(), stable=True)
    assert (depths >= near_plane).all()
    layer = reference.splat(splats, order, camera)
    return layer.picture.permute(1, 2, 0)[None], 1 - layer.transmittance[None, ..., None], {}


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Rendering]:
    """`render`, drawing with our gsplat back-end on the CPU through the stand-in for gsplat."""
    package = types.ModuleType("gsplat")
    package.rasterization = rasterization  # type: ignore[attr-defined]
    backend = types.ModuleType("gsplat.cuda._backend")
    backend._C = object()  # type: ignore[attr-defined]
    for name, module in (("gsplat", package), ("gsplat.cuda", types.ModuleType("gsplat.cuda"))):
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "gsplat.cuda._backend", backend)
    monkeypatch.setattr(door, "_choose_backend", lambda name, means: (gsplat_backend, torch.device("cpu")))
    return render


@CASES
def test_what_gsplat_is_given_draws_the_reference(
    stand_in, random_scene, seed, views, size, harmonics, classes, near
) -> None:
    gaussians, cameras = random_scene(seed, 80, views, size, harmonics, classes)
    found = stand_in(gaussians, cameras, background=BACKGROUND, near=near)
    truth = reference_rendering(gaussians, cameras, near)
    for name in FIELDS:
        torch.testing.assert_close(getattr(found, name), getattr(truth, name), rtol=0, atol=1e-9)


def reference_rendering(gaussians: Gaussians, cameras: Cameras, near: float | Tensor | None) -> Rendering:
    """The reference's, past the replaced choice of a back-end."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(door, "_choose_backend", lambda name, means: (reference, torch.device("cpu")))
        return render(gaussians, cameras, background=BACKGROUND, near=near)


def test_gaussians_of_equal_float32_depth_are_drawn_in_their_float64_order(stand_in, random_scene) -> None:
    gaussians, cameras = random_scene(4, 60, 1)
    camera = Pinhole.of(cameras[0])
    # All on one plane before the camera, one part in 1e12 apart, in a shuffled order.
    steps = torch.randperm(60, generator=torch.Generator().manual_seed(1)).double() * 1e-12
    inside = torch.cat((gaussians.means[:, :2] * 0.5, torch.ones(60, 1).double()), dim=1) * (2 + steps)[:, None]
    means = inside @ camera.axes + camera.centre
    flat = Gaussians(means, gaussians.opacities, gaussians.colour, gaussians.semantic)
    order = gsplat_backend.depth_order(means, camera, None)
    assert torch.equal(order, numba_backend.depth_order(means, camera, None))
    found, truth = stand_in(flat, cameras, background=BACKGROUND), reference_rendering(flat, cameras, None)
    for name in FIELDS:
        torch.testing.assert_close(getattr(found, name), getattr(truth, name), rtol=0, atol=1e-9)


def test_nothing_to_draw_is_not_given_to_gsplat(stand_in, random_scene) -> None:
    gaussians, cameras = random_scene(5, count=4, classes=4)
    nothing = gaussians.map(lambda tensor: tensor[:0].requires_grad_())
    rendering = stand_in(nothing, cameras, background=(0.1, 0.2, 0.3))
    assert torch.allclose(rendering.images[0, :, 3, 4], torch.tensor([0.1, 0.2, 0.3], dtype=torch.float64))
    assert (rendering.semantics == 0.25).all()
    rendering.images.sum().backward()
    assert nothing.means.grad.shape == (0, 3)


def test_a_compiler_or_gsplat_itself_does_not_make_the_cpu_draw_with_it(random_scene, tmp_path, monkeypatch) -> None:
    compiler = tmp_path / "bin" / "nvcc"
    compiler.parent.mkdir()
    compiler.write_text("#!/bin/sh\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("PATH", str(compiler.parent))
    monkeypatch.setenv("CUDA_HOME", str(tmp_path))
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(door, "find_spec", lambda name: object())
    means = random_scene(6)[0].means
    assert door._choose_backend("auto", means.float()) == (numba_backend, torch.device("cpu"))
    with pytest.raises(ValueError, match=r"backend is 'gsplat' but means is torch.float32 on cpu; expected"):
        door._choose_backend("gsplat", means.float())


class OnCuda(Tensor):
    """A tensor that says it is on the second CUDA device, and holds nothing."""

    @staticmethod
    def __new__(cls, dtype: torch.dtype) -> OnCuda:
        return Tensor._make_wrapper_subclass(cls, (4, 3), dtype=dtype, device="cuda:1")  # type: ignore[attr-defined]

    def __torch_dispatch__(self, *args, **kwargs):
        raise NotImplementedError


def test_gaussians_on_cuda_are_drawn_there_if_gsplat_is_installed_and_they_are_not_float64(monkeypatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(door, "find_spec", lambda name: object())
    on_the_cpu = (numba_backend, torch.device("cpu"))
    for dtype in (torch.float32, torch.bfloat16, torch.float16):
        assert door._choose_backend("auto", OnCuda(dtype)) == (gsplat_backend, torch.device("cuda", 1))
    assert door._choose_backend("auto", OnCuda(torch.float64)) == on_the_cpu
    monkeypatch.setattr(door, "find_spec", lambda name: None)
    with pytest.warns(UserWarning, match=r"rendered on the CPU, because gsplat is not installed; pip install"):
        assert door._choose_backend("auto", OnCuda(torch.float32)) == on_the_cpu
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert door._choose_backend("auto", OnCuda(torch.float32)) == on_the_cpu


def test_what_is_missing_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "gsplat", None)
    with pytest.raises(ImportError, match=r"needs gsplat: pip install -e '\.\[cuda\]' in SemGS's folder"):
        gsplat_backend.rasterizer()
    package, backend = types.ModuleType("gsplat"), types.ModuleType("gsplat.cuda._backend")
    package.rasterization, backend._C = rasterization, None  # type: ignore[attr-defined]
    for name, module in (("gsplat", package), ("gsplat.cuda", types.ModuleType("c")), (backend.__name__, backend)):
        monkeypatch.setitem(sys.modules, name, module)
    with pytest.raises(ImportError, match=r"found no CUDA toolkit \(nvcc\)"):
        gsplat_backend.rasterizer()


@pytest.mark.parametrize("backend", ["numba", "reference"])
def test_autocast_does_not_reach_into_rendering(random_scene, backend: str) -> None:
    gaussians, cameras = random_scene(10, count=60)
    gaussians = gaussians.to(torch.float32)
    plain = render(gaussians, cameras, backend=backend)
    with torch.autocast("cpu", torch.bfloat16):
        inside = render(gaussians, cameras, backend=backend)
    for name in FIELDS:
        assert torch.equal(getattr(plain, name), getattr(inside, name))
