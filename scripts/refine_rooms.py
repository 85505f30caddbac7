"""What refining gives in rooms: PSNR and depth error of views between and beside the input views, before and after.

    python scripts/refine_rooms.py SCENES [--views 2] [--passes 15] [--scenes 24]

Scenes need six frames or more and true depth. With 2 input views these are frames 1 and 3, frame 2 is between them, 0 and 4 are beside. With 4 they are 0, 1, 3
and 4, and 5 is beside. No frame decides when to stop. Prints a Markdown table with means over scenes, and the worst change of PSNR in a scene.
"""

from __future__ import annotations

import argparse
from time import process_time

import torch
from shared import markdown

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.views import Views
from semgs.model.weights.load import load
from semgs.reconstruction.scores import mean_scores, scores
from semgs.scene.encoding import Encoding
from semgs.scene.photo_refinement import PASSES, refine

SIZE = (240, 320)
BETWEEN = (2,)
CONTEXT, BESIDE = {2: (1, 3), 4: (0, 1, 3, 4)}, {2: (0, 4), 4: (5,)}


@torch.no_grad()
def score(encoding: Encoding, views: Views) -> tuple[float, float]:
    """Mean PSNR [dB] and depth error of some views."""
    means = mean_scores(scores(encoding.render(views.cameras), views))
    return means.psnr, means.depth_abs_rel or 0.0


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data")
    parser.add_argument("--views", type=int, default=2, choices=CONTEXT)
    parser.add_argument("--passes", type=int, default=PASSES)
    parser.add_argument("--scenes", type=int, default=24)
    given = parser.parse_args()
    torch.set_num_threads(1)
    network, seconds = load("small").eval(), 0.0
    found: dict[str, list[tuple[float, ...]]] = {"between": [], "beside": []}
    paths = list(scene_paths(given.data))[: given.scenes]
    for path in paths:
        scene = open_scene(path)
        context = scene.read(CONTEXT[given.views], SIZE)
        with torch.no_grad():
            encoding = network(context)
        start = process_time()
        refined = refine(encoding, context, given.passes)
        seconds += process_time() - start
        for place, frames in (("between", BETWEEN), ("beside", BESIDE[given.views])):
            views = scene.read(frames, SIZE)
            found[place].append((*score(encoding, views), *score(refined, views)))
    rows = []
    for place, numbers in found.items():
        table = torch.tensor(numbers, dtype=torch.float64)
        psnr, error, psnr_after, error_after = table.mean(0).tolist()
        worst = float((table[:, 2] - table[:, 0]).min())
        rows.append((place, f"{psnr:.2f}", f"{psnr_after:.2f}", f"{worst:+.2f}", f"{error:.3f}", f"{error_after:.3f}"))
    print(markdown(("views", "PSNR", "refined", "worst", "depth error", "refined"), rows))
    print(f"\n{len(paths)} scenes, {given.passes} passes, {seconds / len(paths):.1f} core-seconds a scene")


if __name__ == "__main__":
    main()
