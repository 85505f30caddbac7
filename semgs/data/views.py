"""Views: posed images with their labels and depths. Image and camera always change together."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from os import PathLike
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, UInt8
from torch import Tensor

from semgs.data.array_checks import check_intrinsics, warn_of_copies, warn_of_poses
from semgs.data.tables.classes import IGNORE, SCANNET20, ClassTable
from semgs.files.images.notebook import class_row, depth_row, html, photo_row
from semgs.geometry.cameras import Arrays, Cameras, as_float64, writable
from semgs.geometry.summaries import array_of, describe

INDOOR_DEPTH_RANGE = (0.5, 10.0)
"""Near and far of rooms [m], if nothing better is known."""

FAR_OUT = 1000.0
"""Largest coordinate for float32, where its steps are 0.06 mm if the unit is metres. For larger ones, an origin is subtracted."""


@dataclass(frozen=True, init=False)
class Views:
    """Posed images of one scene, or of a batch of scenes.

    The constructor checks every number. Views made from checked views (`map`, `arranged`, `changed` and everything that uses them) are not
    checked again.

    Attributes:
        images: 0..1, RGB.
        cameras: one per image, of the images' size.
        depth_range: near and far z-depth of each view [m].
        labels: class of each pixel, 255 = ignore, or None.
        depths: z-depth of each pixel [m], 0 = unknown, or None.
        classes: the class table of the labels.
        hidden: pixels that show nothing of the scene: the black border of a photo, and what a mask hides. They get no opacity and count in
            no score or loss. None if there are none.

    Raises:
        ValueError: sizes or axes disagree, images are not in 0..1, near >= far or near <= 0, a label is outside the table.
    """

    images: Float[Tensor, "*batch v 3 h w"]
    cameras: Cameras
    depth_range: Float64[Tensor, "*batch v 2"]
    labels: UInt8[Tensor, "*batch v h w"] | None = None
    depths: Float[Tensor, "*batch v h w"] | None = None
    classes: ClassTable = SCANNET20
    hidden: Bool[Tensor, "*batch v h w"] | None = None

    def __init__(
        self,
        images: Tensor,
        cameras: Cameras,
        depth_range: Arrays,
        labels: Tensor | None = None,
        depths: Tensor | None = None,
        classes: ClassTable = SCANNET20,
        hidden: Tensor | None = None,
    ) -> None:
        bounds = as_float64(depth_range)
        vars(self).update(
            images=images,
            cameras=cameras,
            depth_range=bounds,
            labels=labels,
            depths=depths,
            classes=classes,
            hidden=hidden,
        )
        _check_shapes(self)
        _check_numbers(self)

    @classmethod
    def trusted(cls, **parts: Any) -> Views:
        """Views with these fields, without the checks of the constructor: for parts that were checked, or will be after joining."""
        views = object.__new__(cls)
        vars(views).update({field.name: field.default for field in fields(cls)} | parts)
        return views

    @classmethod
    def from_arrays(
        cls,
        images: Arrays,
        world_from_camera: Arrays,
        intrinsics: Arrays,
        depth_range: Arrays | None = None,
    ) -> Views:
        """Views from plain arrays.

        Args:
            images: [v h w 3] uint8, or [v 3 h w] float in 0..1, or a list of images.
            world_from_camera: [v 4 4], camera to world, OpenCV axes [m].
            intrinsics: [v 3 3] or one [3 3] for all [px]; 4x4 matrices [K 0; 0 1] will do.
            depth_range: (near, far), or [v 2] [m]; None is 0.5 to 10 m, with a warning.

        Poses further than `FAR_OUT` from the origin cause a warning, because Gaussians there are coarse in float32. So do poses that look
        like world to camera or OpenGL's, a view that is there twice, and intrinsics that look like those of images of another size.

        Raises:
            ValueError: as the constructor; for images that are neither uint8 HWC nor float CHW; for intrinsics that no lens has, are divided by the
                image size, or have the principal point in the corner.
            TypeError: the images are paths or something else than arrays.
        """
        if isinstance(images, np.ndarray | Tensor) and images.ndim == 3:
            raise ValueError(
                f"images are {tuple(images.shape)}; expected a list of images, or [v h w 3] uint8 or [v 3 h w] float"
            )
        if not isinstance(images, Iterable) or isinstance(images, str):
            raise TypeError(
                f"images are {type(images).__name__}; expected [v h w 3] uint8, [v 3 h w] float, or a list of images"
            )
        listed = [_as_image(image) for image in images]
        sizes = sorted({tuple(image.shape[1:]) for image in listed})
        if len(sizes) != 1:
            found = "none" if not listed else f"sizes {sizes[0]} and {sizes[1]} (height, width)"
            raise ValueError(f"images have {found}; expected one or more of one size")
        pixels = torch.stack(listed)
        matrices = as_float64(intrinsics)
        count = len(pixels)
        if matrices.shape[-2:] == (4, 4):
            if not torch.equal(matrices, _homogeneous(matrices[..., :3, :3])):
                raise ValueError("intrinsics are 4x4; expected 3x3, or [K 0; 0 1] with K in the upper left")
            matrices = matrices[..., :3, :3]
        if matrices.ndim == 2:
            matrices = matrices.expand(count, 3, 3)
        if depth_range is None:
            warnings.warn(
                "depth_range is not given: taken as {:g} to {:g} metres".format(*INDOOR_DEPTH_RANGE), stacklevel=2
            )
            depth_range = INDOOR_DEPTH_RANGE
        bounds = as_float64(depth_range)
        if bounds.ndim == 1:
            bounds = bounds.expand(count, 2)
        cameras = Cameras(world_from_camera, matrices, tuple(pixels.shape[-2:]))
        if (farthest := float(cameras.centres.abs().max())) > FAR_OUT:
            warnings.warn(
                f"cameras are {farthest:.4g} from the origin, where float32 is too coarse for Gaussians: subtract a point near them from "
                "all poses, as Cameras.relative_to does",
                stacklevel=2,
            )
        check_intrinsics(cameras)
        views = cls(pixels, cameras, bounds)
        warn_of_copies(views.images, cameras)
        warn_of_poses(views.images, cameras)
        return views

    def __repr__(self) -> str:
        return describe(
            "Views",
            images=self.images,
            cameras=self.cameras,
            depth_range=self.depth_range,
            labels=self.labels,
            depths=self.depths,
            hidden=self.hidden,
            classes=None if self.labels is None else f"{self.classes.name}, {len(self.classes)} classes",
        )

    def _repr_html_(self) -> str:
        """The images, and labels and depths if there are some, for a notebook."""
        rows = [photo_row("images", array_of(self.images))]
        if self.labels is not None:
            rows.append(class_row("labels", self.labels.cpu().numpy(), self.classes))
        if self.depths is not None:
            rows.append(depth_row("depths", array_of(self.depths)))
        return html(repr(self), rows)

    def __len__(self) -> int:
        """The number of views per scene."""
        return self.images.shape[-4]

    @property
    def size(self) -> tuple[int, int]:
        """Image (height, width) [px]."""
        return self.cameras.size

    def checked(self) -> Views:
        """These views, with every number checked.

        Raises:
            ValueError: as the constructor.
        """
        return replace(self)

    def changed(self, **parts: Any) -> Views:
        """These views with some fields replaced, without checks; `dataclasses.replace` does the same with checks."""
        return Views.trusted(**(vars(self) | parts))

    def map(
        self,
        maps: Callable[[Tensor], Tensor],
        images: Callable[[Tensor], Tensor] | None = None,
        cameras: Cameras | None = None,
        hidden: Callable[[Tensor], Tensor] | None = None,
    ) -> Views:
        """These views with a function applied to their pixels.

        Args:
            maps: for labels and depths, and for images and hidden pixels too unless the next ones are given.
            images: for the images.
            hidden: for the hidden pixels.
            cameras: of the new pixels; None keeps the cameras.
        """
        return self.changed(
            images=(images or maps)(self.images),
            cameras=cameras or self.cameras,
            labels=None if self.labels is None else maps(self.labels),
            depths=None if self.depths is None else maps(self.depths),
            hidden=None if self.hidden is None else (hidden or maps)(self.hidden),
        )

    def arranged(self, function: Callable[..., Tensor], *others: Views) -> Views:
        """Views in another arrangement: `function` indexes, joins or reshapes the leading axes of every array, including the cameras'.

        Args:
            function: called with the array of these views, then that of each of the others.
            others: views of the same size, with the same class table. Labels and depths are kept only if all have them, hidden pixels if
                one has them.
        """
        views = (self, *others)
        hidden = None
        if any(each.hidden is not None for each in views):
            hidden = function(
                *(
                    torch.zeros_like(each.images[..., 0, :, :], dtype=torch.bool)
                    if each.hidden is None
                    else each.hidden
                    for each in views
                )
            )

        def arrange_maps(maps: Sequence[Tensor | None]) -> Tensor | None:
            return None if any(part is None for part in maps) else function(*maps)

        return self.changed(
            images=function(*(each.images for each in views)),
            cameras=self.cameras.arranged(function, *(each.cameras for each in others)),
            depth_range=function(*(each.depth_range for each in views)),
            labels=arrange_maps([each.labels for each in views]),
            depths=arrange_maps([each.depths for each in views]),
            hidden=hidden,
        )

    def select(self, indices: Sequence[int]) -> Views:
        """The views at these positions of the view axis, in the given order."""
        positions, axis = torch.as_tensor(list(indices), dtype=torch.int64), self.images.ndim - 4
        return self.arranged(lambda array: array.index_select(axis, positions.to(array.device)))

    def to(self, device: torch.device | str) -> Views:
        """These views with images and maps on a device; cameras and depth range stay on the CPU."""
        tensors = (self.images, self.labels, self.depths, self.hidden)
        if all(tensor is None or tensor.device == torch.device(device) for tensor in tensors):
            return self
        return self.map(lambda maps: maps.to(device))


@dataclass(frozen=True)
class Batch:
    """The data of one training or evaluation step: input views, and target views to compare with.

    Attributes:
        context: the input views [b v ...].
        target: the views to render [b v ...].
        scenes: the name of each scene in the batch.
        taught: a teacher network's class probabilities for the input views, 0 where it has none; None without a teacher.
    """

    context: Views
    target: Views
    scenes: tuple[str, ...]
    taught: Float[Tensor, "*batch v k h8 w8"] | None = None


def stack(views: Sequence[Views]) -> Views:
    """Views of several scenes as one batch, with a new leading axis; labels and depths only if all have them."""
    return views[0].arranged(lambda *arrays: torch.stack(arrays), *views[1:])


def joined(views: Sequence[Views]) -> Views:
    """Views of the same scenes, concatenated along the view axis; labels and depths only if all have them."""
    axis = views[0].images.ndim - 4
    return views[0].arranged(lambda *arrays: torch.cat(arrays, dim=axis), *views[1:])


def _check_shapes(views: Views) -> None:
    """Refuse parts whose sizes or leading axes disagree."""
    images, cameras = views.images, views.cameras
    if images.ndim < 4 or images.shape[-3] != 3:
        raise ValueError(f"images are {tuple(images.shape)}; expected [... view 3 height width]")
    leading, size = tuple(images.shape[:-3]), tuple(images.shape[-2:])
    if size != cameras.size:
        raise ValueError(
            f"images are {size} (height, width) but their cameras are for {cameras.size}; crop or resize both together"
        )
    if cameras.batch != leading:
        raise ValueError(f"there are {leading} images but {cameras.batch} cameras; expected one camera per image")
    bounds_shape = tuple(views.depth_range.shape)
    if bounds_shape != (*leading, 2):
        raise ValueError(f"depth_range is {bounds_shape}; expected {(*leading, 2)}: near and far of each view")
    for name, maps in (("labels", views.labels), ("depths", views.depths), ("hidden", views.hidden)):
        if maps is not None and tuple(maps.shape) != (*leading, *size):
            raise ValueError(f"{name} are {tuple(maps.shape)}; expected {(*leading, *size)}, like the images")


def _check_numbers(views: Views) -> None:
    """Refuse bounds, colours, labels and depths outside of their ranges."""
    images, bounds, labels, depths = views.images, views.depth_range, views.labels, views.depths
    near, far = bounds.unbind(-1)
    if not (torch.isfinite(bounds).all() and (near > 0).all() and (near < far).all()):
        raise ValueError(f"depth_range is {bounds.tolist()}; expected 0 < near < far for each view")
    if images.numel() and not (images.amin() >= 0 and images.amax() <= 1):
        raise ValueError(f"images go from {images.amin():.4g} to {images.amax():.4g}; expected finite numbers in 0..1")
    if labels is not None:
        outside = (labels >= len(views.classes)) & (labels != IGNORE)
        if outside.any():
            raise ValueError(
                f"labels contain {int(labels[outside][0])}; expected 0..{len(views.classes) - 1} of table "
                f"{views.classes.name}, or {IGNORE} for none"
            )
    if views.hidden is not None and views.hidden.dtype != torch.bool:
        raise ValueError(f"hidden is {views.hidden.dtype}; expected torch.bool, True for hidden pixels")
    if depths is not None and not (torch.isfinite(depths).all() and (depths >= 0).all()):
        raise ValueError("depths contain a number that is negative or not finite; expected z-depths, 0 where unknown")


def _homogeneous(matrices: Float64[Tensor, "*batch 3 3"]) -> Float64[Tensor, "*batch 4 4"]:
    """Matrices as [K 0; 0 1]."""
    padded = torch.nn.functional.pad(matrices, (0, 1, 0, 1))
    padded[..., 3, 3] = 1
    return padded


def _as_image(image: Arrays) -> Float[Tensor, "3 h w"]:
    """One image as float CHW."""
    if isinstance(image, str | bytes | PathLike):
        raise TypeError(
            f"an image is a path, {image!r}; expected pixels. semgs.open_scene reads folders of images with cameras"
        )
    try:
        tensor = image.detach().cpu() if isinstance(image, Tensor) else torch.as_tensor(writable(np.asarray(image)))
    except TypeError as error:
        raise TypeError(
            f"an image is a {type(image).__name__}; expected an array, uint8 [h w 3] or float [3 h w] in 0..1"
        ) from error
    if tensor.dtype == torch.uint8 and tensor.ndim == 3 and tensor.shape[-1] == 3:
        return tensor.permute(2, 0, 1).float() / 255
    if tensor.is_floating_point() and tensor.ndim == 3 and tensor.shape[0] == 3:
        return tensor.float()
    raise ValueError(
        f"an image is {tensor.dtype} {tuple(tensor.shape)}; expected uint8 [h w 3] or float [3 h w] in 0..1"
    )
