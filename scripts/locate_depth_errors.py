"""Locate depth errors: the error after each step of the network, by texture, depth borders, and visibility in one or both views.

    python scripts/locate_depth_errors.py WEIGHTS SCENES [SCENES ...]

The input views are each scene's two middle frames at 240x320, which need true depth. Prints a Markdown table with the mean relative error of the
candidate with the best raw cost, of the expectation after the regressor, and of the final depth, and how often the best raw candidate is the right
one or its neighbour. Places are texels at 1/4 of the image's resolution.

A place is a border where depths within two pixels differ by over 5 %. It is near an edge within 6 pixels of a step in depth of over 10 %. Of the others, one is textured where grey values within four pixels vary by
over 0.02 (standard deviation, 0..1). It is seen by both if the other view's true depth there agrees within 3 %. The last row is the share of flyers:
Gaussians that hang between a near and a far surface, over 7 % off every true depth within 6 pixels.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from shared import markdown, pixels_that_see
from torch import Tensor
from torch.nn.functional import avg_pool2d, max_pool2d, pad

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.geometry.cameras import back_project
from semgs.geometry.plane_sweep import expected_depth
from semgs.model.layers.network_input import NetworkInput
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load
from semgs.objectives.depth_losses import NEAR_EDGE, near_edges
from semgs.scene.coarse_depth import SHRINK

SIZE = (240, 320)
STEPS = ("raw cost", "regressor", "final")
PLACES = ("all", "textured", "flat", "border", "near an edge", "elsewhere", "seen by both", "seen by one")
FLYER = 0.07
"""A flyer is farther than this from every surface, as a share of the surface's depth."""


@dataclass(frozen=True)
class Found:
    """Depth of two views at 1/4 of the image by each of `STEPS`, whether the best raw candidate is right, and which Gaussians are flyers."""

    depths: dict[str, Float[Tensor, "2 h4 w4"]]
    right: Bool[Tensor, "2 h4 w4"]
    flying: Bool[Tensor, "2 h w"]


@torch.no_grad()
def found(model: SemGS, views: Views, truth: Float[Tensor, "2 h4 w4"]) -> Found:
    """The depths after each step of the network, against the true depths at the texels' centres."""
    scene = NetworkInput.of(views, model.cnn.conv1.weight, model.stride)
    features = model.colour.transformer(model.cnn(scene.images), scene)
    cost = model.colour.depth.cost(features, scene, None)
    swept, final = model.sweep(views), model(views).depths
    candidates = swept.candidates[..., None, None]
    best = cost.argmax(1, keepdim=True)
    nearest = (1 / candidates - 1 / truth.clamp(min=1e-3)[:, None]).abs().argmin(1, keepdim=True)
    by_step = {
        "raw cost": candidates.expand(cost.shape).gather(1, best)[:, 0],
        "regressor": expected_depth(swept.probabilities, swept.candidates, swept.spacing),
        "final": at_centres(final),
    }
    flying = flyers(final, views.depths, model.stride)
    return Found(by_step, ((best - nearest).abs() <= 1)[:, 0], flying)


def flyers(
    depths: Float[Tensor, "n height width"], truth: Float[Tensor, "n height width"], stride: int
) -> Bool[Tensor, "n h w"]:
    """Which Gaussians, one for `stride` x `stride` pixels, are between true depths of the pixels around and over `FLYER` off each of them."""
    middle = stride // 2
    own, size = depths[..., middle::stride, middle::stride], depths.shape[-2:]
    wide = pad(truth, (NEAR_EDGE,) * 4)  # unknown beyond the border
    before, behind, off = (
        torch.zeros_like(own, dtype=bool),
        torch.zeros_like(own, dtype=bool),
        torch.ones_like(own, dtype=bool),
    )
    for row in range(2 * NEAR_EDGE + 1):
        for column in range(2 * NEAR_EDGE + 1):
            there = wide[..., row : row + size[0], column : column + size[1]][..., middle::stride, middle::stride]
            known = there > 0
            before |= known & (there < own)
            behind |= known & (there > own)
            off &= ~known | ((own - there).abs() > FLYER * there)
    return before & behind & off


def at_centres(maps: Float[Tensor, "*n h w"]) -> Float[Tensor, "*n h4 w4"]:
    """The pixel below and to the right of each texel's centre."""
    return maps[..., SHRINK // 2 :: SHRINK, SHRINK // 2 :: SHRINK]


def places(views: Views) -> dict[str, Bool[Tensor, "2 h4 w4"]]:
    """The texels that belong to each of `PLACES`; those without true depth belong to none."""
    depths = views.depths
    known = at_centres(depths) > 0
    logs = depths.clamp(min=1e-3).log()
    border = at_centres(max_pool2d(logs, 5, 1, 2) + max_pool2d(-logs, 5, 1, 2)) > 0.05
    grey = views.images.mean(-3)
    mean, square = (avg_pool2d(maps, 9, 1, 4, count_include_pad=False) for maps in (grey, grey.square()))
    textured = at_centres(square - mean.square()) > 0.02**2
    edge = at_centres(near_edges(depths))
    both = torch.stack([_agrees(views, here, 1 - here) for here in (0, 1)])
    found = {
        "all": known, "textured": textured & ~border, "flat": ~textured & ~border, "border": border,
        "near an edge": edge, "elsewhere": ~edge, "seen by both": both, "seen by one": ~both,
    }  # fmt: skip
    return {name: mask & known for name, mask in found.items()}


def _agrees(views: Views, here: int, there: int) -> Bool[Tensor, "h4 w4"]:
    """Whether another view's true depth agrees with this view's points where it sees them."""
    points = at_centres(back_project(views.depths[here].double(), views.cameras[here]).movedim(-1, 0)).movedim(0, -1)
    return pixels_that_see(points.flatten(end_dim=-2), views, there, 0.03)[0].reshape(points.shape[:2])


def pairs(folders: list[str]) -> Iterator[Views]:
    """The two middle frames of every scene."""
    for folder in folders:
        for path in scene_paths(folder):
            scene = open_scene(path)
            middle = len(scene) // 2
            views = scene.read([middle - 1, middle], SIZE)
            if views.depths is None:
                raise InputError(path, "a scene with true depth", "one without")
            yield views


def table(weights: str, folders: list[str]) -> str:
    """The errors as Markdown."""
    model = load(weights).eval()
    errors: dict[tuple[str, str], list[Tensor]] = defaultdict(list)
    flying: list[Tensor] = []
    for views in pairs(folders):
        truth = at_centres(views.depths)
        result = found(model, views, truth)
        flying.append(result.flying.double().flatten())
        for place, mask in places(views).items():
            errors["right", place].append(result.right[mask].double())
            for step in STEPS:
                errors[step, place].append((result.depths[step][mask] / truth[mask] - 1).abs().double())
    whole = sum(map(len, errors["right", "all"]))
    rows = []
    for place in PLACES:
        share = sum(map(len, errors["right", place])) / whole
        means = [float(torch.cat(errors[step, place]).mean()) for step in STEPS]
        right = float(torch.cat(errors["right", place]).mean())
        rows.append([place, f"{share:.0%}", *[f"{mean:.3f}" for mean in means], f"{right:.0%}"])
    rows.append(["flyers, of all Gaussians", f"{torch.cat(flying).mean():.1%}", *[""] * (len(STEPS) + 1)])
    return markdown(["place", "share", *[f"{step}: AbsRel" for step in STEPS], "best raw candidate right"], rows)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    try:
        print(table(sys.argv[1], sys.argv[2:]))
    except InputError as error:
        sys.exit(f"error: {error}")
