"""What a depth sensor is worth: scores of held-out views by the source of depth and the baseline, with paired differences to the network.

    python scripts/sensor_depth.py small ROOMS [ROOMS ...] --baselines 0.05 0.1 0.2 0.4 --rooms 24

In each room, the two frames whose baseline is nearest to a share of the median depth are the input (if it is within a factor of 1.35 of it), and
the frame in the middle between them is held out. The rooms' depth is exact; the input views get what a Kinect would have measured instead
(`measured`). A pair of which it measures less than half is left out.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import conv2d, max_pool2d, normalize, pad

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.views import Views
from semgs.depth_maps.sensor_depth import FEWEST_MEASURED, place_gaussians, sensor_spread
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.predictions import Prediction
from semgs.evaluation.frames.protocols import TargetSample
from semgs.evaluation.scoring.frame_scores import FrameScores, score
from semgs.evaluation.scoring.intervals import intervals, paired_differences
from semgs.files.errors import InputError
from semgs.geometry.cameras import back_project
from semgs.model.weights.load import load
from semgs.rendering.rendering import Rendering, likeliest

SOURCES = ("network", "sensor", "both")
METRICS = ("psnr", "miou", "depth_abs_rel")
SIZE = (240, 320)
ALIKE = 1.35
"""A pair's baseline is within this factor of the wanted one."""

RANGE = (0.4, 5.0)
"""Of the sensor [m]."""
EDGE = 0.02
"""Nothing is measured beside pixels whose inverse depth is off the plane of its neighbours by this fraction."""
GRAZING = 0.17
"""Nothing is measured where the cosine between ray and normal is smaller."""
DARK, SHINY = 0.06, 0.92
"""Nothing is measured on darker surfaces, nor on half of the patches of brighter ones."""
PATCHES = (12, 16)
"""Of an image, by which shiny surfaces are measured or not."""


def measured(views: Views, seed: int) -> Float[Tensor, "v h w"]:
    """What a depth camera would have measured: noise that grows with depth squared, holes, and a limited range.

    The noise is that of `semgs.depth_maps.sensor_depth.sensor_spread`.

    Args:
        views: with true depth and labels.
        seed: of the noise.
    """
    assert views.depths is not None
    generator = torch.Generator().manual_seed(seed)
    depths = views.depths.double()
    points = back_project(depths, views.cameras)
    across, down = points[:, 1:-1, 2:] - points[:, 1:-1, :-2], points[:, 2:, 1:-1] - points[:, :-2, 1:-1]
    rays = normalize(points - views.cameras.centres[:, None, None], dim=-1)[:, 1:-1, 1:-1]
    inner = (normalize(torch.linalg.cross(across, down), dim=-1) * rays).sum(-1).abs()
    cosine = pad(inner[:, None], (1, 1, 1, 1), mode="replicate")[:, 0]
    inverse = 1 / depths[:, None].clamp(min=1e-3)
    cross = inverse.new_tensor([[0, 1, 0], [1, -4, 1], [0, 1, 0]])[None, None]
    bend = conv2d(pad(inverse, (1, 1, 1, 1), mode="replicate"), cross).abs() / inverse
    beside_edge = max_pool2d((bend > EDGE).double(), 3, 1, 1)[:, 0] > 0
    light = views.images.double().mean(1)
    patches = torch.rand((len(views), *PATCHES), generator=generator, dtype=depths.dtype) < 0.5
    rows, columns = (side // patch for side, patch in zip(views.size, PATCHES, strict=True))
    shiny = (light > SHINY) & patches.repeat_interleave(rows, 1).repeat_interleave(columns, 2)
    noise = torch.randn(depths.shape, generator=generator, dtype=depths.dtype)
    found = depths * (1 + sensor_spread(depths) * noise)
    lost = beside_edge | (cosine < GRAZING) | (light < DARK) | shiny | (depths == 0)
    near, far = RANGE
    return torch.where(lost | (found < near) | (found > far), 0, found).float()


def pair(scene: Scene, baseline: float) -> TargetSample | None:
    """The pair whose baseline is nearest to this share of the median depth; None if none is near."""
    centres = np.stack([frame.world_from_camera[:3, 3] for frame in scene.frames])
    depths = scene.frames[0].measured()
    assert depths is not None
    ratios = np.linalg.norm(centres[:, None] - centres, axis=-1) / np.median(depths[depths > 0]) / baseline
    found = [(abs(np.log(max(ratios[i, j], 1e-9))), i, j) for j in range(len(centres)) for i in range(j - 1)]
    error, first, second = min(found)
    return TargetSample((first, second), (first + second) // 2) if error < np.log(ALIKE) else None


def held_out_scores(task: Task, rendering: Rendering, truth: Views) -> FrameScores:
    """The scores of one held-out view."""
    labels = None if rendering.semantics is None else likeliest(rendering.semantics[0])
    return score(task, Prediction(labels, rendering.images[0], rendering.depths[0]), truth)


@torch.no_grad()
def scored(network: torch.nn.Module, scene: Scene, sample: TargetSample, seed: int) -> dict[str, FrameScores] | None:
    """The scores by source of depth; None if the sensor measures too little."""
    bounds: DepthRange = scene.depth_range()
    context = scene.read(sample.contexts, SIZE, bounds)
    target = scene.read([sample.target], SIZE, bounds)
    views = replace(context, depths=measured(context, seed))
    assert views.depths is not None
    if (views.depths > 0).double().mean((1, 2)).min() < FEWEST_MEASURED:
        return None
    own, found = network(context), {}
    task = Task(scene, SIZE, sample)
    for source in SOURCES:
        encoding = own if source == "network" else place_gaussians(own, views, source)[0]
        found[source] = held_out_scores(task, encoding.render(target.cameras), target)
    return found


def table(results: dict[str, list[FrameScores]]) -> list[str]:
    """The rows of each metric for one baseline, as Markdown."""
    base = results["network"]
    numbers = intervals(base)
    rows = []
    for metric in METRICS:
        cells = [f"{numbers[metric].value:.3f}"]
        for source in SOURCES[1:]:
            value, change = intervals(results[source])[metric].value, paired_differences(base, results[source])[metric]
            cells.append(f"{value:.3f}, {change.value:+.3f} ({change.low:+.3f} to {change.high:+.3f})")
        rows.append(f"{metric} | {' | '.join(cells)}")
    return rows


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights")
    parser.add_argument("data", nargs="+", type=Path)
    parser.add_argument("--baselines", nargs="+", type=float, default=[0.05, 0.1, 0.2, 0.4])
    parser.add_argument("--rooms", type=int, default=24, help="at most this many of each set")
    arguments = parser.parse_args()
    network = load(arguments.weights).eval()
    print(
        "| set | baseline | rooms | | network | sensor, difference (95 %) | both, difference (95 %) |\n|" + " --- |" * 7
    )
    for data in arguments.data:
        for baseline in arguments.baselines:
            results: dict[str, list[FrameScores]] = {source: [] for source in SOURCES}
            for seed, path in enumerate(sorted(data.glob("scene_*"))):
                scene = open_scene(path)
                chosen = pair(scene, baseline)
                found = None if chosen is None else scored(network, scene, chosen, seed)
                for source, measures in (found or {}).items():
                    results[source].append(measures)
                    depth = 0.0 if measures.depth is None else measures.depth.abs_rel
                    print(
                        f"{path.name} {baseline:.0%} {source}: PSNR {measures.psnr:.2f}, AbsRel {depth:.3f}",
                        file=sys.stderr,
                    )
                if len(results["network"]) == arguments.rooms:
                    break
            count = len(results["network"])
            for row in table(results) if count > 1 else ():
                print(f"| {data.name} | {baseline:.0%} | {count} | {row} |", flush=True)


if __name__ == "__main__":
    try:
        main()
    except (InputError, ValueError) as error:
        sys.exit(f"error: {error}")
