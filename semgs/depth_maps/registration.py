"""Whether depth maps are registered to their images: the edges of depth should be where the images have edges.

The network's own depth is too coarse for this test; images are not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import max_pool2d

WINDOW = 9
"""An edge of depth is within a window of this many pixels, because sensors measure nothing right beside it."""

JUMP = 0.08
"""Log depths that differ by more than this within the window are an edge."""

BRIGHTEST = 0.15
"""Stronger edges of the image count as this."""

STEP, REACH = 2, 8
"""Shifts are tried in steps of this many pixels, up to this many steps."""

FEWEST_EDGES = 1000
"""With fewer pixels near edges of depth, nothing can be said."""

CLEARLY = 1.2
"""Maps are shifted if the edges under them are stronger by this factor elsewhere. In registered rooms the gain was at most 1.1."""


@final
@dataclass(frozen=True)
class Registration:
    """Where the edges of depth fit the images best.

    Attributes:
        right, down: by which the depth maps seem to be shifted against the images, to within a few pixels [px].
        gain: edges under the depth edges there, relative to those at no shift: 1 if no shift is better.
        pixels: near edges of depth.
    """

    right: int
    down: int
    gain: float
    pixels: int

    @property
    def shifted(self) -> bool:
        """Whether the maps are clearly shifted. The largest shifts do not count: the best fit may be further away, and of something else."""
        inside = STEP < max(abs(self.right), abs(self.down)) < STEP * REACH
        return self.pixels >= FEWEST_EDGES and self.gain > CLEARLY and inside


def registration(images: Float[Tensor, "v 3 h w"], depths: Float[Tensor, "v h w"]) -> Registration:
    """Compare depth maps with their images, for all views together.

    Args:
        images: of the views.
        depths: z-depth of every pixel, 0 where nothing was measured [m].
    """
    margin = STEP * REACH
    inner = (slice(None), slice(margin, -margin), slice(margin, -margin))
    edges, strength = _near_edges(depths)[inner].to(images), _strength(images)
    pixels = int(edges.sum())
    if not pixels:
        return Registration(0, 0, 1.0, 0)
    height, width = edges.shape[-2:]
    found = {}
    for down in range(-margin, margin + 1, STEP):
        for right in range(-margin, margin + 1, STEP):
            under = strength[:, margin - down :, margin - right :][:, :height, :width]
            found[right, down] = float((under * edges).sum()) / pixels
    # Of shifts that are equally good, as within a window, the smallest counts.
    right, down = max(found, key=lambda shift: (round(found[shift], 4), -abs(shift[0]) - abs(shift[1])))
    return Registration(right, down, found[right, down] / max(found[0, 0], 1e-6), pixels)


def _near_edges(depths: Float[Tensor, "v h w"]) -> Bool[Tensor, "v h w"]:
    """Whether measured depths around each pixel differ by more than `JUMP`."""
    logs = depths.clamp(min=1e-3).log()
    known = depths > 0
    far, near = (
        max_pool2d(torch.where(known, sign * logs, -torch.inf)[:, None], WINDOW, 1, WINDOW // 2)[:, 0]
        for sign in (1, -1)
    )
    return far + near > JUMP


def _strength(images: Float[Tensor, "v 3 h w"]) -> Float[Tensor, "v h w"]:
    """The gradient of each image's brightness across two pixels, at most `BRIGHTEST`."""
    grey = torch.nn.functional.pad(images.mean(1, keepdim=True), (1, 1, 1, 1), mode="replicate")[:, 0]
    across, down = grey[:, 1:-1, 2:] - grey[:, 1:-1, :-2], grey[:, 2:, 1:-1] - grey[:, :-2, 1:-1]
    return (across.square() + down.square()).sqrt().clamp(max=BRIGHTEST)
