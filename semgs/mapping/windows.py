"""Windows: a scene from more views than the network takes at once.

Each view is encoded with the views that go best with it, and its Gaussians come from that window. Then all views are merged at once, as a recording is frame by
frame in `semgs.mapping.mapper`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import torch
from jaxtyping import Shaped
from torch import Tensor

from semgs.data.views import Views
from semgs.mapping.keyframes import Known, near
from semgs.mapping.merging import LAYERS, join_parts, parts_of, settle, unshrunk
from semgs.mapping.voxels import join_in_voxels
from semgs.scene.encoding import Encoding

REFINED_LAYERS = 2
"""As `LAYERS`, for a scene that will be refined: then more layers make nothing sharper, and take twice the time."""

VOXEL_SHARE = 0.0015
"""Size of voxels as a share of the typical depth; 3 mm in metric scenes."""


def encode_in_windows(
    views: Views, windows: Sequence[Sequence[int]], encode: Callable[[Views], Encoding], done: Callable[[int], object]
) -> Encoding:
    """The Gaussians of each view from a window of its own, not merged, at the sizes of two views.

    Args:
        views: of one scene [v].
        windows: of each view: its place and those of the others, ascending. Equal ones are encoded once.
        encode: a window of views.
        done: called after each window with the number of windows so far.
    """
    encodings: dict[tuple[int, ...], Encoding] = {}
    for window in map(tuple, windows):
        if window not in encodings:
            members = views.select(list(window))
            encodings[window] = unshrunk(encode(members), members.cameras)
            done(len(encodings))
    own = [(encodings[tuple(window)], list(window).index(view)) for view, window in enumerate(windows)]
    parts = [encoding.gaussians.map(partial(_of_view, len(encoding.depths), at)) for encoding, at in own]
    tensors = [list(part.tensors().values()) for part in parts]
    together = iter([torch.cat(one) for one in zip(*tensors, strict=True)])
    return replace(
        own[0][0],
        gaussians=parts[0].map(lambda _: next(together)),
        depths=torch.stack([encoding.depths[at] for encoding, at in own]),
        confidences=torch.stack([encoding.confidences[at] for encoding, at in own]),
        depth_spread=torch.stack([encoding.depth_spread[at] for encoding, at in own]),
        depth_range=views.depth_range,
    )


def _of_view(views: int, view: int, numbers: Shaped[Tensor, "g ..."]) -> Shaped[Tensor, "n ..."]:
    """Those of the Gaussians of one of several views."""
    return numbers.unflatten(0, (views, -1))[view]


def merge(encoding: Encoding, views: Views, voxel: float | None, layers: int = LAYERS) -> Encoding:
    """The scene with each surface once, after all views have judged one another's Gaussians.

    Args:
        encoding: a Gaussian for each pixel, or block of pixels, of the views.
        views: its input views [v].
        voxel: Gaussians in the same voxel of this size are joined; None joins none [m].
        layers: a surface gets the Gaussians of so many views.
    """
    parts = parts_of(encoding, views, range(len(views)), layers)
    known = [Known(views.cameras[view], None) for view in range(len(views))]
    settled = []
    for view, part in enumerate(parts):
        for other in near(known[view].camera, known):
            if other != view:
                part = part.judged_by(parts[other].sheet)
        settled.append(settle(part))
    gaussians, places = join_parts(settled)
    if voxel is not None:
        gaussians, places = join_in_voxels(gaussians, places, voxel)
    return replace(encoding, gaussians=gaussians, places=places)
