"""A scene made of a splat: with cameras, depth of what they see, and a view for each Gaussian, as a reconstruction has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from statistics import median
from typing import Literal

import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor

from semgs.geometry.cameras import Cameras, project
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.render import render
from semgs.rendering.rendering import SEEN_ALPHA, Rendering
from semgs.scene.scene_file import SavedScene

TOO_DARK = 15.0
"""Photos that a splat renders with a lower PSNR, where it shows something, are probably not of this splat, or not in its coordinates [dB]."""

FEW_LIKE_OWN = 0.5
"""If no more of the renderings than this are like their own photo, the cameras are in other coordinates."""

LEAST_ALIKE, SIMILAR = 0.25, 0.05
"""Renderings of the right camera have at least the first correlation with its photo, and at most the second less than with a photo from close by."""

LEAST_CONTRAST, LEAST_CONTRAST_OF_PHOTO, FEWEST_PIXELS = 0.02, 0.005, 50
"""A smaller standard deviation of grey, and fewer pixels, say nothing; photos may be dark."""

SAME = 0.05
"""A Gaussian is seen by a view if it is at most this share behind the depth there."""

NEAR, FAR = 0.5, 2.0
"""Bounds of the depth of each view, from the nearest and the farthest depth that is usual there."""

USUAL = (0.01, 0.99)
"""Quantiles of the depth of a view that say so."""


def splat_scene(
    gaussians: Gaussians,
    cameras: Cameras,
    *,
    rendered: Sequence[Rendering] | None = None,
    frames: Sequence[str] = (),
    source: str = "",
    model: str = "",
    unit: Literal["metric", "unknown"] = "unknown",
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> SavedScene:
    """The scene of a splat as some cameras see it.

    Depth is rendered, 0 where less than half of the light is stopped; confidence is the opacity there. Each Gaussian gets the place of the pixel that shows it: in a
    view that sees it, or else in one whose image it is in behind something, or else at the border of the nearest image.

    Args:
        gaussians: of colour, relative to `origin`.
        cameras: [v], relative to `origin`.
        rendered: of these cameras, as from `render_plain`; None renders them.
        frames: names of the views; by default their positions.
        source, model: names of the file and of its format.
        unit: "metric" if lengths are in metres.
        origin: as in `SavedScene`.

    Raises:
        ValueError: no camera sees anything.
    """
    views = render_plain(gaussians, cameras) if rendered is None else rendered
    alphas = torch.cat([view.alphas for view in views]).clamp(0, 1)
    depths = torch.where(alphas >= SEEN_ALPHA, torch.cat([view.depths for view in views]).clamp(min=0), 0)
    if not depths.any():
        raise ValueError("no camera sees the splat")
    return SavedScene(
        gaussians=gaussians,
        cameras=cameras,
        depths=depths,
        confidences=alphas,
        depth_range=torch.stack([_bounds(view if view.any() else depths) for view in depths]),
        unit=unit,
        classes=None,
        frames=tuple(frames) or tuple(map(str, range(len(depths)))),
        source=source,
        model=model,
        origin=origin,
        stride=1,
        places=find_places(gaussians.means, cameras, depths),
    )


def render_plain(gaussians: Gaussians, cameras: Cameras) -> list[Rendering]:
    """Each view, without the colours that depend on the direction."""
    plain = without_harmonics(gaussians)
    return [render(plain, cameras[view : view + 1]) for view in range(cameras.batch[0])]


def note_on_look(decibels: float, own: float | None = 0.0) -> str:
    """What to say of a splat that renders photos with this PSNR [dB] from their cameras, in the pixels that it shows, and so many of them most like their own
    photo (`share_like_own`); empty if it looks like them."""
    like = (
        f"The splat does not look like the photos from their cameras (PSNR {decibels:.1f} dB in what it shows of them"
    )
    if own is None or own > FEW_LIKE_OWN:
        said = (
            "): are these cameras in its coordinates?"
            if own is None
            else "), but the cameras fit: exposure or colours may differ."
        )
        return "" if decibels >= TOO_DARK else like + said
    return f"{like}, {own:.0%} of its renderings are most like their own photo): are these cameras in its coordinates?"


def share_like_own(
    images: Float[Tensor, "v 3 h w"], photos: Float[Tensor, "v 3 h w"], seen: Bool[Tensor, "v h w"]
) -> float | None:
    """The share of renderings that are like their own photo, and no photo of another camera more: of wrong cameras few are, whatever the exposure.

    Alike is the correlation of the greys of the pixels that a rendering shows. Renderings without contrast do not count; None without any other.

    Args:
        images: rendered.
        photos: from the same cameras.
        seen: the pixels that count.
    """
    found = [
        bool(alike[own] >= LEAST_ALIKE and alike[own] >= alike.max() - SIMILAR)
        for own, alike in _correlations(images, photos, seen)
    ]
    return sum(found) / len(found) if found else None


def likeness_to_own(
    images: Float[Tensor, "v 3 h w"], photos: Float[Tensor, "v 3 h w"], seen: Bool[Tensor, "v h w"]
) -> float:
    """The median correlation of renderings with their own photo, as for `share_like_own`; at least 0, which it also is if none counts."""
    alike = [float(row[own]) for own, row in _correlations(images, photos, seen)]
    return max(0.0, median(alike)) if alike else 0.0


def _correlations(
    images: Float[Tensor, "v 3 h w"], photos: Float[Tensor, "v 3 h w"], seen: Bool[Tensor, "v h w"]
) -> Iterator[tuple[int, Float64[Tensor, " v"]]]:
    """The renderings that count, and the correlation of each with all photos."""
    for own, (image, mask) in enumerate(zip(images.mean(1), seen, strict=True)):
        greys = torch.cat((image[None], photos.mean(1)))[:, mask].double()
        if (
            greys.shape[1] >= FEWEST_PIXELS
            and float(greys[0].std()) >= LEAST_CONTRAST
            and float(greys[own + 1].std()) >= LEAST_CONTRAST_OF_PHOTO
        ):
            yield own, torch.corrcoef(greys)[0, 1:].nan_to_num(0)


def without_harmonics(gaussians: Gaussians) -> Gaussians:
    """Gaussians of the same shapes whose colours are constant: enough for depth and opacity, in two thirds of the time."""
    return replace(gaussians, colour=replace(gaussians.colour, features=gaussians.colour.features[:, :1]))


def find_places(means: Float[Tensor, "g 3"], cameras: Cameras, depths: Float[Tensor, "v h w"]) -> Int64[Tensor, " g"]:
    """The pixel that shows each Gaussian, counted by view, row and column.

    Of the views that see it, it is the nearest one.

    Args:
        means: positions.
        cameras: of the views.
        depths: of each pixel, 0 where nothing is.
    """
    height, width = cameras.size
    places = torch.zeros(len(means), dtype=torch.int64)
    best = torch.full((len(means),), torch.inf, dtype=torch.float64)
    for view in range(len(depths)):
        seen = project(means.double(), cameras[view])
        z = seen[:, 2]
        in_front = z > 0
        pixels = torch.where(in_front[:, None], seen[:, :2], 0)
        outside = torch.maximum(-pixels, pixels - torch.tensor([width, height])).amax(-1).clamp(0, 1e9)
        column = pixels[:, 0].clamp(0, width - 1).long()
        row = pixels[:, 1].clamp(0, height - 1).long()
        inside = in_front & (outside == 0)
        shown = inside & (z <= (1 + SAME) * depths[view, row, column])
        # In this order: shown, hidden, outside, behind the camera. The nearest of each comes first, or the one that is least outside.
        group = torch.where(shown, 0, torch.where(inside, 1, torch.where(in_front, 2, 3)))
        away = (means.double() - cameras.centres[view]).norm(dim=-1)
        away = torch.where(group == 2, outside, away)
        rank = group + away / (1 + away)
        better = rank < best
        best = torch.where(better, rank, best)
        places = torch.where(better, (view * height + row) * width + column, places)
    return places


def _bounds(depths: Float[Tensor, " *shape"]) -> Float[Tensor, " 2"]:
    """Near and far of a view."""
    known = depths[depths > 0].double()
    known = known[:: -(-len(known) // 1_000_000)]
    near, far = (float(known.quantile(share)) for share in USUAL)
    return torch.tensor([NEAR * near, FAR * far], dtype=torch.float64)
