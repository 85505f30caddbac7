"""Render: Gaussians and cameras in; pictures, class maps, depth and alpha out."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.harmonics import colours_from_harmonics
from semgs.rendering.pinhole import Pinhole
from semgs.rendering.rendering import Rendering
from semgs.rendering.splats import Splats

BACKENDS = ("auto", "numba", "reference")
"""Who draws: `auto` is the fastest here, `numba` runs on the CPU, `reference` is slow and exact."""


def render(
    gaussians: Gaussians,
    cameras: Cameras,
    *,
    background: Sequence[float] | Float[Tensor, "3"] = (0.0, 0.0, 0.0),
    near: float | Tensor | None = None,
    backend: str = "auto",
) -> Rendering:
    """Splat Gaussians into cameras: one pass for colour, depth and alpha, one for classes with covariances of their own.

    Differentiable in every field of the Gaussians and in the background, not in the cameras. What light passes all
    Gaussians is the background's in `images` and spread evenly over the classes in `semantics`, so that those sum to 1.
    Tensors on another device are drawn on the CPU and brought back.

    Args:
        gaussians: of one scene (no batch axis), or of a batch [*b].
        cameras: the views of each scene, [v] or [*b v].
        background: RGB behind everything.
        near: near bound of the scene [m], one for all or [*b v]; what has a z-depth of 0.2 near or less is not drawn. None
            leaves out what is closer than 2 % of the median depth in front of each camera.
        backend: `auto`, `numba` or `reference`.

    Returns:
        Rendering in the dtype of the means (half precision is computed in float32).

    Raises:
        ValueError: batch axes disagree, there is no view axis, a number of the Gaussians' geometry is not finite, dtypes or
            devices differ, intrinsics have skew, near is not positive, or the back-end is unknown.
    """
    drawing = _backend(backend)
    batch = tuple(gaussians.means.shape[:-2])
    if not cameras.batch or cameras.batch[:-1] != batch or 0 in cameras.batch:
        raise ValueError(
            f"cameras have axes {cameras.batch} but Gaussians {batch}; expected those of the Gaussians and then at least one view"
        )
    _check(gaussians)
    dtype, device = gaussians.means.dtype, gaussians.means.device
    working = dtype if dtype in (torch.float32, torch.float64) else torch.float32
    scenes = gaussians.to("cpu", working).map(
        lambda tensor: tensor.flatten(0, len(batch) - 1) if batch else tensor[None]
    )
    backdrop = torch.as_tensor(background, dtype=working, device="cpu")
    if backdrop.shape != (3,):
        raise ValueError(f"background is {tuple(backdrop.shape)}; expected 3 numbers (red, green, blue)")
    bounds = _near_bounds(near, cameras.batch)

    views = cameras.batch[-1]
    poses = cameras.world_from_camera.reshape(-1, 4, 4)
    intrinsics = cameras.intrinsics.reshape(-1, 3, 3)
    drawn = []
    for index in range(len(poses)):
        scene = scenes.map(lambda tensor, at=index // views: tensor[at])
        camera = Pinhole.of(Cameras(poses[index], intrinsics[index], cameras.size))
        drawn.append(_view(scene, camera, bounds[index], backdrop, drawing))

    def stacked(name: str) -> Tensor:
        return torch.stack([getattr(one, name) for one in drawn]).unflatten(0, cameras.batch).to(device, dtype)

    return Rendering(
        images=stacked("images"),
        semantics=None if gaussians.semantic is None else stacked("semantics"),
        depths=stacked("depths"),
        alphas=stacked("alphas"),
    )


def _view(scene: Gaussians, camera: Pinhole, near: float | None, background: Tensor, drawing: ModuleType) -> Rendering:
    """One view of one scene; its Rendering has no leading axes."""
    order = drawing.depth_order(scene.means, camera, near)

    def layer(appearance: Appearance, features: Tensor):
        splats = Splats(scene.means, appearance.quaternions, appearance.scales, scene.opacities, features)
        drawn = drawing.splat(splats, order, camera)
        return drawn.picture, drawn.transmittance

    offsets = camera.offsets(scene.means)
    colours = colours_from_harmonics(scene.colour.features, torch.nn.functional.normalize(offsets, dim=-1))
    depths = offsets @ camera.axes[2].to(offsets)
    picture, light = layer(scene.colour, torch.cat((colours, depths[:, None]), dim=-1))
    dtype = picture.dtype
    alphas = (1 - light).to(dtype)
    seen = alphas > 0
    classes = None
    if scene.semantic is not None:
        shares, class_light = layer(scene.semantic, scene.semantic.features)
        classes = shares + (class_light / len(shares)).to(dtype)
    return Rendering(
        images=picture[:3] + light.to(dtype) * background[:, None, None],
        semantics=classes,
        depths=torch.where(seen, picture[3] / torch.where(seen, alphas, 1), 0),
        alphas=alphas,
    )


def _backend(name: str) -> ModuleType:
    """The module that draws: it has `depth_order` and `splat`."""
    if name in ("auto", "numba"):
        from semgs.rendering import numba_backend

        return numba_backend
    if name == "reference":
        from semgs.rendering import reference

        return reference
    raise ValueError(f"backend is {name!r}; expected one of {', '.join(BACKENDS)}")


def _check(gaussians: Gaussians) -> None:
    """Refuse geometry that is not finite (it would vanish from the picture unseen) and tensors of different kinds."""
    tensors = {"means": gaussians.means, "opacities": gaussians.opacities}
    for name, appearance in (("colour", gaussians.colour), ("semantic", gaussians.semantic)):
        if appearance is not None:
            tensors[f"{name}.quaternions"] = appearance.quaternions
            tensors[f"{name}.scales"] = appearance.scales
            tensors[f"{name}.features"] = appearance.features
    for name, tensor in tensors.items():
        if (tensor.dtype, tensor.device) != (gaussians.means.dtype, gaussians.means.device):
            raise ValueError(
                f"{name} is {tensor.dtype} on {tensor.device} but means is {gaussians.means.dtype} on "
                f"{gaussians.means.device}; bring all to one dtype and device with Gaussians.to"
            )
        if not name.endswith("features") and not torch.isfinite(tensor).all():
            raise ValueError(f"{name} hold a number that is not finite; expected finite numbers")


def _near_bounds(near: float | Tensor | None, batch: tuple[int, ...]) -> list[float | None]:
    """The near bound of each view, views of all scenes in one list."""
    if near is None:
        return [None] * torch.Size(batch).numel()
    bounds = torch.as_tensor(near).detach().to("cpu", torch.float64)
    if not (bounds > 0).all() or not torch.isfinite(bounds).all():
        raise ValueError(f"near is {bounds.tolist()}; expected positive finite numbers, or None")
    return bounds.expand(batch).reshape(-1).tolist()
