"""The strip of images from a validation: each rendered image next to the true one."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.data.views import Views
from semgs.figures.class_images import class_picture, true_class_picture
from semgs.files.images.colours import depth_limits, depth_picture
from semgs.rendering.rendering import Rendering, label_maps


def strip(rendering: Rendering, target: Views) -> UInt8[np.ndarray, "h w 3"]:
    """The first target view in one row: image, truth, classes, truth, depth, truth; what is missing is left out.

    Unseen areas of the class map are hatched. Both depths are coloured by the range of the true one.
    """
    first = _first_view(rendering)
    panels = [_picture(_first(first.images, 3)), _picture(_first(target.images, 3))]
    if first.semantics is not None:
        panels.append(class_picture(label_maps(first)[0], target.classes))
    if target.labels is not None:
        panels.append(true_class_picture(_first(target.labels, 2), target.classes))
    return np.concatenate([*panels, *_depth_panels(first.depths, target)], axis=1)


def class_strip(distributions: Float[Tensor, "*batch v class h w"], views: Views) -> UInt8[np.ndarray, "h w_all 3"]:
    """The first view in one row: image, classes, truth if there is one; for distributions that were not rendered."""
    classes = _first(distributions, 3).argmax(0).astype(np.uint8)
    panels = [_picture(_first(views.images, 3)), class_picture(classes, views.classes)]
    if views.labels is not None:
        panels.append(true_class_picture(_first(views.labels, 2), views.classes))
    return np.concatenate(panels, axis=1)


def depth_strip(depths: Float[Tensor, "*batch v h w"], views: Views) -> UInt8[np.ndarray, "h w_all 3"]:
    """The first view in one row: image, depth, truth if there is one; for depth that was not rendered."""
    return np.concatenate([_picture(_first(views.images, 3)), *_depth_panels(depths, views)], axis=1)


def _depth_panels(depths: Float[Tensor, "*batch v h w"], views: Views) -> list[UInt8[np.ndarray, "h w 3"]]:
    """The depth of the first view and the true one, if there is one, both coloured by the range of the true one."""
    maps = [_first(depth, 2) for depth in (depths, views.depths) if depth is not None]
    limits = depth_limits(maps[-1:])
    return [depth_picture(depth, limits) for depth in maps]


def _first_view(rendering: Rendering) -> Rendering:
    """The first view of the first scene, without batch axes."""
    first = (0,) * (rendering.depths.ndim - 3)
    semantics = None if rendering.semantics is None else rendering.semantics[first][:1]
    return Rendering(rendering.images[first][:1], semantics, rendering.depths[first][:1], rendering.alphas[first][:1])


def _first(maps: Tensor, axes: int) -> np.ndarray:
    """The first map, without any but its last `axes` axes."""
    return maps.detach().cpu().flatten(end_dim=-axes - 1)[0].numpy()


def _picture(image: np.ndarray) -> UInt8[np.ndarray, "h w 3"]:
    """An image [3 h w] in 0..1 as bytes."""
    return np.rint(255 * image.clip(0, 1)).astype(np.uint8).transpose(1, 2, 0)
