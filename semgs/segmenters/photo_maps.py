"""Class distributions of photos, and how they come to the pixels of a view: through lens, crop and size, as the photo itself does."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit, kept_window, resampling
from semgs.data.tables.classes import IGNORE
from semgs.geometry.cameras import writable


def to_view(
    probabilities: Float32[np.ndarray, "class rows columns"],
    frame: Frame,
    size: tuple[int, int],
    fit: Fit = "crop",
    *,
    undistorted: bool,
) -> Float[Tensor, "class h w"]:
    """The distribution over classes of every pixel of a view: `resampled`, and normalised.

    Args:
        probabilities, frame, size, fit, undistorted: as for `resampled`.
    """
    return normalised(resampled(torch.from_numpy(writable(probabilities)), frame, size, fit, undistorted=undistorted))


def resampled(
    values: Float[Tensor, "c rows columns"],
    frame: Frame,
    size: tuple[int, int],
    fit: Fit = "crop",
    *,
    undistorted: bool,
) -> Float[Tensor, "c h w"]:
    """Maps of a photo at the pixels of a view. Areas are averaged where pixels get larger, and interpolated where they get smaller.

    Args:
        values: of the frame's photo, at any resolution.
        frame: the frame.
        size: (height, width) of the view, as for `Scene.read` [px].
        fit: what was done with a photo of another aspect, as for `Scene.read`.
        undistorted: whether the maps cover the undistorted photo; otherwise the photo as it is stored.
    """
    maps = None if undistorted or frame.lens.is_pinhole else frame.lens.maps()
    if maps is None:
        return _resized(values, frame.lens.size, size, fit)
    planes = []
    for plane in values:  # one at a time, as photos are large
        full = _stretched(plane, frame.lens.size)
        planes.append(_cropped(torch.from_numpy(frame.lens.undistorted(full.numpy(), maps)), size, fit))
    return torch.stack(planes)


def resized_map(
    probabilities: Float[Tensor, "class rows columns"], photo: tuple[int, int], size: tuple[int, int]
) -> Float[Tensor, "class h w"]:
    """A map of a whole photo, of any resolution, at the pixels of the view that `semgs.data.resampling.reframed` makes of the photo; normalised.

    Args:
        probabilities: covers the whole photo.
        photo: (height, width) of the undistorted photo [px].
        size: (height, width) of the view [px].
    """
    return normalised(_resized(probabilities, photo, size))


def normalised(probabilities: Float[Tensor, "*batch class h w"]) -> Float[Tensor, "*batch class h w"]:
    """The same, non-negative and summing to 1 over the classes."""
    positive = probabilities.clamp(min=0)
    return positive / positive.sum(-3, keepdim=True).clamp(min=1e-12)


def one_hot(labels: UInt8[Tensor, "h w"], classes: int) -> Float[Tensor, "class h w"]:
    """Each pixel's label as a distribution; even where there is no label (255)."""
    found = torch.nn.functional.one_hot(labels.long().clamp(max=classes), classes + 1)[..., :classes].float()
    return torch.where((labels == IGNORE)[..., None], 1 / classes, found).permute(2, 0, 1)


def _resized(
    values: Float[Tensor, "c rows columns"], photo: tuple[int, int], size: tuple[int, int], fit: Fit = "crop"
) -> Float[Tensor, "c h w"]:
    """As `resized_map`, without normalising."""
    if tuple(values.shape[-2:]) == size == photo:
        return values
    top, left, height, width = kept_window(photo, size, fit)
    rows = resampling(height, size[0]) @ resampling(values.shape[-2], photo[0])[top : top + height]
    columns = resampling(width, size[1]) @ resampling(values.shape[-1], photo[1])[left : left + width]
    return rows.to(values) @ values @ columns.to(values).mT


def _stretched(plane: Float[Tensor, "rows columns"], size: tuple[int, int]) -> Float[Tensor, "h w"]:
    """A map at the size of its photo."""
    rows, columns = (resampling(old, new).to(plane) for old, new in zip(plane.shape, size, strict=True))
    return rows @ plane @ columns.mT


def _cropped(plane: Float[Tensor, "rows columns"], size: tuple[int, int], fit: Fit) -> Float[Tensor, "h w"]:
    """A map of a photo at the photo's size, at the pixels of a view."""
    top, left, height, width = kept_window((plane.shape[0], plane.shape[1]), size, fit)
    return _stretched(plane[top : top + height, left : left + width], size)
