"""Render: Gaussians and cameras in; images, class maps, depth and alpha out."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from types import ModuleType
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.harmonics import colours_from_harmonics
from semgs.rendering.rendering import Rendering
from semgs.rendering.rules import BLUR_PX2
from semgs.rendering.splats import Layer, Pinhole, Splats
from semgs.runtime.kernels import check_not_forked

Result = TypeVar("Result")

BACKENDS = ("auto", "numba", "gsplat", "reference")
"""The back-ends: `auto` is the fastest one for the Gaussians' device, `numba` runs on the CPU, `gsplat` on CUDA, `reference` is slow and
exact."""


def render(
    gaussians: Gaussians,
    cameras: Cameras,
    *,
    background: Sequence[float | int] | Float[Tensor, " 3"] = (0, 0, 0),
    near: float | int | Tensor | None = None,
    backend: str = "auto",
    clamp: bool = True,
    footprint: bool = False,
) -> Rendering:
    """Splat Gaussians into cameras: one pass for colour, depth and alpha, and one for classes, which have their own covariances.

    Differentiable in every field of the Gaussians and in the background, but not in the cameras. Light that passes all Gaussians takes
    the background's colour in `images` and is spread evenly over the classes in `semantics`, so that they sum to 1. If a back-end
    cannot render on the Gaussians' device, they are moved to the CPU and the results back. Autocast has no effect.

    Args:
        gaussians: of one scene (no batch axis), or of a batch [*b].
        cameras: the views of each scene, [v] or [*b v].
        background: RGB behind everything.
        near: near bound of the scene [m], one for all or [*b v]; Gaussians with a z-depth of 0.2 near or less are not rendered. None
            leaves out those closer than 2 % of the median depth in front of each camera.
        backend: `auto`, `numba`, `gsplat` or `reference`; `auto` is gsplat for Gaussians on a CUDA device, and Numba for all others and
            for float64, which gsplat does not support.
        footprint: blur as much as the Gaussians' own input views did. Splatting adds 0.3 px^2 to each Gaussian in the image. Where a pixel is smaller than in
            its own view, because the camera is nearer or its image larger, this adds the difference in the world, max(0, 0.3 ((z/f)^2 of its own view -
            (z/f)^2 of this camera)), and leaves no gaps. Without it, as in the paper, images are those that training and evaluation see.
        clamp: clamp `images` to 0..1. Harmonics can add up to more than 1. Losses use False, because a clamped pixel has no gradient.

    Returns:
        Rendering in the dtype of the means (half precision is computed in float32).

    Raises:
        ValueError: batch axes disagree, there is no view, a number of the Gaussians is not finite, an opacity is not in 0..1, a scale is
            negative, devices differ, intrinsics have skew, near is not positive, or the back-end is unknown or cannot render these Gaussians.
        ImportError: the back-end is gsplat, which is not installed.
        RuntimeError: this process was forked from one that had already rendered or encoded.
    """
    Gaussians.check_type(gaussians)
    backdrop = torch.as_tensor(background, dtype=torch.float64)
    if backdrop.shape != (3,):
        raise ValueError(f"background is {tuple(backdrop.shape)}; expected 3 numbers (red, green, blue)")
    dtype, device = gaussians.means.dtype, gaussians.means.device
    renderings = render_each_view(
        gaussians,
        cameras,
        near,
        backend,
        lambda scene, camera, bound, backend_module: _render_view(
            _seen_by(scene, camera) if footprint else scene, camera, bound, backdrop.to(scene.means), backend_module
        ),
    )

    def join_views(name: str) -> Tensor:
        parts = [getattr(rendering, name) for rendering in renderings]
        return torch.cat(parts).unflatten(0, cameras.batch).to(device, dtype)

    images = join_views("images")
    if clamp:
        images = images.clamp(0, 1)
    return Rendering(
        images=images,
        semantics=None if gaussians.semantic is None else join_views("semantics"),
        depths=join_views("depths"),
        alphas=join_views("alphas"),
    )


def render_each_view(
    gaussians: Gaussians,
    cameras: Cameras,
    near: float | int | Tensor | None,
    backend: str,
    render_view: Callable[[Gaussians, Pinhole, float | None, ModuleType], Result],
) -> list[Result]:
    """What a function makes of each view of each scene.

    Args:
        gaussians, cameras, near, backend: as for `render`.
        render_view: takes the Gaussians of one scene on the back-end's device, a camera, its near bound and the back-end.

    Raises:
        ValueError, ImportError, RuntimeError: as for `render`.
    """
    Cameras.check_type(cameras)
    check_not_forked()
    backend_module, device = _choose_backend(backend, gaussians.means)
    batch = tuple(gaussians.means.shape[:-2])
    if cameras.batch == batch:
        raise ValueError(
            f"cameras have axes {cameras.batch}, as the Gaussians have: there is no axis of views. For one camera write cameras[..., None], or index a "
            "list of views by [0:1] instead of [0]"
            if batch
            else "cameras are a single camera without an axis of views; index a list of views by [0:1] instead of [0]"
        )
    if not cameras.batch or cameras.batch[:-1] != batch or 0 in cameras.batch:
        raise ValueError(
            f"cameras have axes {cameras.batch} but Gaussians {batch}; expected those of the Gaussians and one more for views"
        )
    _check_gaussians(gaussians)
    bounds = _near_bounds(near, cameras.batch)
    dtype = gaussians.means.dtype
    moved = gaussians.to(device, dtype if dtype in (torch.float32, torch.float64) else torch.float32)
    results: list[Result] = []
    with torch.autocast(device.type, enabled=False):
        for at in np.ndindex(batch):
            scene = moved.map(lambda tensor, at=at: tensor[at])
            for view in range(cameras.batch[-1]):
                camera = Pinhole.of(cameras[(*at, view)])
                results.append(render_view(scene, camera, bounds[len(results)], backend_module))
    return results


def _seen_by(scene: Gaussians, camera: Pinhole) -> Gaussians:
    """The Gaussians with that part of their footprints which the blur of a camera's pixels lacks."""
    if scene.footprints is None:
        return scene
    depths = camera.offsets(scene.means) @ camera.axes[2].to(scene.means)
    pixels = BLUR_PX2 * depths.square() / math.prod(camera.focal_px)
    return scene.blurred((scene.footprints - pixels).clamp(min=0))


def _render_view(
    scene: Gaussians, camera: Pinhole, near: float | None, background: Tensor, backend: ModuleType
) -> Rendering:
    """One view of one scene, with a view axis of length one."""
    order = backend.depth_order(scene.means, camera, near)

    def splat(appearance: Appearance, features: Tensor) -> Layer:
        splats = Splats(scene.means, appearance.quaternions, appearance.scales, scene.opacities, features)
        return backend.splat(splats, order, camera)

    offsets = camera.offsets(scene.means)
    colours = colours_from_harmonics(scene.colour.features, torch.nn.functional.normalize(offsets, dim=-1))
    depths = offsets @ camera.axes[2].to(offsets)
    colour = splat(scene.colour, torch.cat((colours, depths[:, None]), dim=-1))
    dtype = colour.picture.dtype
    alphas = (1 - colour.transmittance).to(dtype)
    seen = alphas > 0
    semantics = None
    if scene.semantic is not None:
        classes = splat(scene.semantic, scene.semantic.features)
        semantics = classes.picture + (classes.transmittance / len(classes.picture)).to(dtype)
    return Rendering(
        images=(colour.picture[:3] + colour.transmittance.to(dtype) * background[:, None, None])[None],
        semantics=None if semantics is None else semantics[None],
        depths=torch.where(seen, colour.picture[3] / torch.where(seen, alphas, 1), 0)[None],
        alphas=alphas[None],
    )


def _choose_backend(name: str, means: Tensor) -> tuple[ModuleType, torch.device]:
    """The back-end's module, with `depth_order` and `splat`, and the device that it renders on.

    The choice depends on the Gaussians' device, not on whether a compiler is found.
    """
    if name not in BACKENDS:
        raise ValueError(f"backend is {name!r}; expected one of {', '.join(BACKENDS)}")
    on_cuda = means.device.type == "cuda" and torch.cuda.is_available() and means.dtype != torch.float64
    if name == "gsplat" and not on_cuda:
        raise ValueError(
            f"backend is 'gsplat' but means is {means.dtype} on {means.device}; expected float32 or less on a CUDA device"
        )
    if name == "auto":
        name = "gsplat" if on_cuda and _is_gsplat_installed() else "numba"
    if name == "gsplat":
        from semgs.rendering import gsplat_backend

        return gsplat_backend, means.device
    if name == "numba":
        from semgs.rendering import numba_backend

        return numba_backend, torch.device("cpu")
    from semgs.rendering import reference

    return reference, torch.device("cpu")


def _is_gsplat_installed() -> bool:
    """Whether gsplat is installed; if not, a warning says that rendering would be faster with it."""
    if find_spec("gsplat") is not None:
        return True
    warnings.warn(
        "Gaussians on a CUDA device are rendered on the CPU, because gsplat is not installed; pip install -e '.[cuda]' in SemGS's folder for speed",
        stacklevel=4,
    )
    return False


def _check_gaussians(gaussians: Gaussians) -> None:
    """Refuse numbers that are not finite (Gaussians would vanish silently, or blacken pixels), invalid opacities, negative scales, and several devices."""
    for name, tensor in gaussians.tensors().items():
        if tensor.device != gaussians.means.device:
            raise ValueError(
                f"{name} is on {tensor.device} but means is on {gaussians.means.device}; move all to one with Gaussians.to"
            )
        if not _finite(tensor):
            raise ValueError(f"{name} contains a number that is not finite; expected finite numbers only")
        if name.endswith("scales") and tensor.numel() and not tensor.amin() >= 0:
            raise ValueError(f"{name} go down to {float(tensor.amin()):g}; expected 0 or more")
    opacities = gaussians.opacities
    if opacities.numel() and not (opacities.amin() >= 0 and opacities.amax() <= 1):
        low, high = float(opacities.amin()), float(opacities.amax())
        raise ValueError(f"opacities go from {low:g} to {high:g}; expected 0 to 1")


def _finite(tensor: Tensor) -> bool:
    """Whether all numbers are finite. A finite sum, which takes only one pass, proves it."""
    return bool(tensor.detach().sum().isfinite()) or bool(tensor.isfinite().all())


def _near_bounds(near: float | int | Tensor | None, batch: tuple[int, ...]) -> list[float | None]:
    """The near bound of each view, over all scenes in one list."""
    if near is None:
        return [None] * torch.Size(batch).numel()
    bounds = torch.as_tensor(near).detach().to("cpu", torch.float64)
    if not (bounds > 0).all() or not torch.isfinite(bounds).all():
        raise ValueError(f"near is {bounds.tolist()}; expected positive finite numbers, or None")
    try:
        return bounds.expand(batch).reshape(-1).tolist()
    except RuntimeError:
        raise ValueError(f"near is {tuple(bounds.shape)}; expected one number, or {batch}: one for each view") from None
