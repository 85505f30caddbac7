"""What depth maps of other networks are worth: errors of depth with true maps that are disturbed as such networks disturb them.

    python scripts/depth_maps.py small ROOMS [ROOMS ...] --bends 0.05 0.1 0.2 --rooms 24

The input views are the two middle frames of each room. Their true depth gets what monocular networks do to it (`disturbed`): soft edges, a smooth bend of up to
5 to 20 %, and per view a random factor, for inverse depth also a random constant. The maps are aligned to the network's depth and weighed with it, as
`semgs reconstruct --depth FOLDER` does. AbsRel is the mean error of the input views' depth, all pixels together, with paired differences over rooms.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
import torch
from jaxtyping import Float
from scipy.stats import bootstrap
from torch import Tensor
from torch.nn.functional import conv2d, interpolate, pad

from semgs.data.scenes import open_scene
from semgs.depth_maps.depth_source import Meaning
from semgs.depth_maps.map_depth import find_reference, place_at_maps
from semgs.files.errors import InputError
from semgs.model.weights.load import load

SIZE = (240, 320)
SOFT = 2.0
"""Standard deviation of the blur of inverse depth, which makes edges soft [px]."""
KNOTS = (3, 4)
"""The bend is a smooth surface through so many random numbers by so many."""


@dataclass(frozen=True)
class Disturbed:
    """Disturbed maps as a source.

    Attributes:
        meaning: what their numbers are.
    """

    meaning: Meaning
    title: str = "disturbed maps"
    made_by: None = None


def disturbed(depths: Float[Tensor, "v h w"], bend: float, meaning: Meaning, seed: int) -> Float[Tensor, "v h w"]:
    """What a monocular network would say of views with this depth.

    Args:
        depths: the truth; unknown pixels (0) become the median.
        bend: the largest error of log depth of the smooth bend.
        meaning: metric maps keep their scale.
        seed: of bend, factor and constant.
    """
    draw = torch.Generator().manual_seed(seed)
    maps = []
    for truth in depths:
        known = torch.where(truth > 0, truth, truth[truth > 0].median())
        knots = torch.randn(1, 1, *KNOTS, generator=draw)
        surface = interpolate(knots, truth.shape, mode="bicubic", align_corners=True)[0, 0]
        values = blurred(1 / known) * (-bend * surface / surface.abs().max()).exp()
        factor, constant = 0.3 + 3 * torch.rand((), generator=draw), 0.3 * torch.rand((), generator=draw) - 0.1
        if meaning == "inverse":
            maps.append(factor * values + constant)
        else:
            maps.append((factor if meaning == "scaled" else 1) / values)
    return torch.stack(maps)


def blurred(values: Float[Tensor, "h w"]) -> Float[Tensor, "h w"]:
    """Blurred with a Gaussian of `SOFT`."""
    reach = round(3 * SOFT)
    row = torch.exp(-0.5 * (torch.arange(-reach, reach + 1) / SOFT).square())
    row = row / row.sum()
    padded = pad(values[None, None], (reach,) * 4, mode="replicate")
    return conv2d(conv2d(padded, row[None, None, None]), row[None, None, :, None])[0, 0]


def abs_rel(depths: Float[Tensor, "v h w"], truth: Float[Tensor, "v h w"]) -> float:
    """The mean error of depth where the truth is known, relative to it."""
    known = truth > 0
    return float((depths[known] / truth[known] - 1).abs().mean())


@torch.no_grad()
def errors(network: torch.nn.Module, path: Path, bends: list[float], seed: int) -> dict[str, float]:
    """The error of the network alone, and with each kind of maps."""
    scene = open_scene(path)
    middle = [len(scene) // 2 - 1, len(scene) // 2]
    views = scene.read(middle, SIZE)
    assert views.depths is not None
    encoding = network(views)
    found = {"network": abs_rel(encoding.placed_depths(views.cameras), views.depths)}
    reference = find_reference(encoding, scene, middle, views, independent=False)
    for bend in bends:
        for meaning in get_args(Meaning):
            maps = disturbed(views.depths, bend, meaning, seed)
            placed, _ = place_at_maps(encoding, views, maps, Disturbed(meaning), reference)
            found[f"{meaning} {bend:.0%}"] = abs_rel(placed.depths, views.depths)
    return found


def difference(changes: np.ndarray) -> str:
    """A mean over rooms with its interval, for several rooms."""
    if len(changes) < 2:
        return f"{changes.mean():+.3f}"
    low, high = bootstrap((changes,), np.mean, n_resamples=5000, method="percentile", rng=0).confidence_interval
    return f"{changes.mean():+.3f} ({low:+.3f} to {high:+.3f})"


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights")
    parser.add_argument("data", nargs="+", type=Path)
    parser.add_argument("--bends", nargs="+", type=float, default=[0.05, 0.1, 0.2])
    parser.add_argument("--rooms", type=int, default=24, help="at most this many of each set")
    arguments = parser.parse_args()
    network = load(arguments.weights).eval()
    print("| set | rooms | maps, bend | AbsRel | difference to the network (95 %) |\n|" + " --- |" * 5)
    for data in arguments.data:
        paths = sorted(data.glob("scene_*"))[: arguments.rooms]
        rooms = [errors(network, path, arguments.bends, seed) for seed, path in enumerate(paths)]
        for name in rooms[0] if rooms else ():
            values, base = (np.array([room[kind] for room in rooms]) for kind in (name, "network"))
            shown = "" if name == "network" else difference(values - base)
            print(f"| {data.name} | {len(rooms)} | {name} | {values.mean():.3f} | {shown} |", flush=True)


if __name__ == "__main__":
    try:
        main()
    except (InputError, ValueError) as error:
        sys.exit(f"error: {error}")
