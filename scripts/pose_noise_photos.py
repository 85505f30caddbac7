"""What slightly wrong cameras cost a scene without labels, such as real photos, and what `--refine-poses` gives back.

    python scripts/pose_noise_photos.py SCENE [--turn 1] [--shift 0.02] [--seeds 1 2 3]

Noise as in `scripts/pose_noise.py` is added to the cameras of the input views that `semgs reconstruct` would choose; held-out cameras stay.
Prints for two and for four input views, and each seed: the median epipolar error before and after, the mean error of the relative rotations,
and PSNR of the held-out views with the cameras as they are, with noise, refined, and refined without noise.
"""

from __future__ import annotations

import argparse
from itertools import combinations

import numpy as np
import torch
from pose_noise import noisy, with_poses
from scipy.spatial.transform import Rotation

from semgs.data.choosing.choice import Choice, choose
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load
from semgs.reconstruction.scores import mean_scores, scores
from semgs.sfm.camera_refinement import refine_cameras


def turn_deg(poses: np.ndarray, true: np.ndarray) -> float:
    """The mean error of the relative rotations over pairs of cameras [degrees]."""
    pairs = combinations(range(len(true)), 2)
    off = [poses[i, :3, :3].T @ poses[j, :3, :3] @ (true[i, :3, :3].T @ true[j, :3, :3]).T for i, j in pairs]
    return float(np.degrees(Rotation.from_matrix(off).magnitude()).mean())


@torch.no_grad()
def psnr(model: SemGS, scene: Scene, choice: Choice) -> float:
    """Of the held-out views [dB]."""
    views, truth = (scene.read(list(frames), (240, 320)) for frames in (choice.context, choice.targets))
    return mean_scores(scores(model(views).render(truth.cameras), truth)).psnr


def main() -> None:
    """Print a line for each number of views and seed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--turn", type=float, default=1.0, help="degrees")
    parser.add_argument("--shift", type=float, default=0.02, help="share of the spacing")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    arguments = parser.parse_args()
    scene, model = open_scene(arguments.scene), load("small").eval()
    print(
        "views | seed | epipolar error [px] | rotation [degrees] | PSNR as it is, noisy, refined, refined without noise"
    )
    for views in (2, 4):
        choice = choose(scene, views)
        order = sorted(choice.context)
        frames = [*order, *choice.targets]
        true = np.stack([scene.frames[index].world_from_camera for index in order])
        untouched = refine_cameras(scene, frames).applied(scene)
        for seed in arguments.seeds:
            given = noisy(true, arguments.turn, arguments.shift, np.random.default_rng(seed))
            moved = with_poses(scene, dict(zip(order, given, strict=True)))
            found = refine_cameras(moved, frames)
            refined = found.applied(moved)
            turns = [turn_deg(poses, true) for poses in (given, found.poses[: len(order)])]
            values = [psnr(model, one, choice) for one in (scene, moved, refined, untouched)]
            print(
                f"{views} | {seed} | {found.before_px:.2f} to {found.after_px:.2f} | {turns[0]:.2f} to {turns[1]:.2f} | "
                + ", ".join(f"{value:.2f}" for value in values),
                flush=True,
            )


if __name__ == "__main__":
    main()
