"""Measure how well `semgs poses` estimates cameras that are known, and what a reconstruction loses by them.

    python scripts/pose_error.py [--focal] SCENE [SCENE ...]

Drops the poses of each scene, estimates them from its photos alone, without the focal length or, with --focal, with the known one, and prints for each scene

- the share of frames that were registered,
- the median error of the relative rotation and of the direction of translation over pairs of registered frames [degrees], and the ratio of focal lengths,
- PSNR and mIoU of the held-out frames with the known and with the estimated cameras, whose scale is set by the known distance of the two cameras that are furthest
  apart. Both use the frames that `semgs reconstruct` would choose with the known cameras, if they were registered; "-" if not.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import torch

from semgs.data.choosing.choice import choose
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load
from semgs.reconstruction.scores import mean_scores, scores
from semgs.sfm.photos import PhotoSet, UprightPhoto
from semgs.sfm.scale import scaled
from semgs.sfm.solving import PosedPhoto, solve


def angle_deg(first: np.ndarray, second: np.ndarray) -> float:
    """The angle between two directions [degrees]."""
    cosine = first @ second / np.linalg.norm(first) / np.linalg.norm(second)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def turn_deg(first: np.ndarray, second: np.ndarray) -> float:
    """The angle between two rotations [degrees]."""
    return float(np.degrees(np.arccos(np.clip((np.trace(first.T @ second) - 1) / 2, -1, 1))))


def estimated(scene: Scene, with_focal: bool) -> dict[str, PosedPhoto]:
    """The estimated cameras of a scene's photos by file name, perhaps with the known focal length; empty if they are refused."""
    pictures = [Path(str(frame.picture)) for frame in scene.frames]
    photos = tuple(
        UprightPhoto(one.name, frame.lens.size, frame.lens.focal[0] if with_focal else None)
        for one, frame in zip(pictures, scene.frames, strict=True)
    )
    try:
        found = solve(PhotoSet(scene.path, pictures[0].parent, photos), photos, with_focal)
    except InputError as error:
        print(f"{scene.name}: {error}")
        return {}
    return {one.name: one for one in found.photos}


def with_cameras(scene: Scene, found: dict[str, PosedPhoto]) -> Scene:
    """The registered frames of a scene with estimated cameras: the first at its known pose, in the known scale."""
    frames = [frame for frame in scene.frames if Path(frame.name).name in found]
    known = np.stack([frame.world_from_camera for frame in frames])
    ours = np.stack([found[Path(frame.name).name].world_from_camera for frame in frames])
    lengths = [np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=-1) for poses in (known, ours)]
    furthest = np.unravel_index(lengths[0].argmax(), lengths[0].shape)
    scale = float(lengths[0][furthest] / lengths[1][furthest])
    ours = np.stack([scaled(pose, scale) for pose in ours])
    ours = known[0] @ np.linalg.inv(ours[0]) @ ours
    lenses = [found[Path(frame.name).name].lens for frame in frames]
    posed = [
        replace(frame, lens=lens, world_from_camera=pose)
        for frame, lens, pose in zip(frames, lenses, ours, strict=True)
    ]
    return replace(scene, frames=tuple(posed))


@torch.no_grad()
def held_out(model: SemGS, scene: Scene, context: list[str], targets: list[str]) -> tuple[float, float | None]:
    """PSNR [dB] and mIoU of held-out frames."""
    views = scene.read(context, (240, 320))
    truth = scene.read(targets, (240, 320))
    found = mean_scores(scores(model(views).render(truth.cameras), truth))
    return found.psnr, found.miou


def main() -> None:
    """Print a line for each scene."""
    model = load("small").eval()
    print("scene | registered | rotation | direction | focal | PSNR known, estimated | mIoU known, estimated")
    with_focal = "--focal" in sys.argv
    for path in (one for one in sys.argv[1:] if one != "--focal"):
        scene = open_scene(path)
        found = estimated(scene, with_focal)
        if not found:
            continue
        posed = with_cameras(scene, found)
        names = [frame.name for frame in posed.frames]
        known = [frame for frame in scene.frames if frame.name in names]
        turns, bearings = [], []
        for i, j in combinations(range(len(names)), 2):
            first, second = (
                np.linalg.inv(frames[i].world_from_camera) @ frames[j].world_from_camera
                for frames in (known, posed.frames)
            )
            turns.append(turn_deg(first[:3, :3], second[:3, :3]))
            bearings.append(angle_deg(first[:3, 3], second[:3, 3]))
        focal = posed.frames[0].lens.focal[0] / known[0].lens.focal[0]
        choice = choose(scene, 2)
        context = [scene.frames[index].name for index in choice.context]
        targets = [scene.frames[index].name for index in choice.targets if scene.frames[index].name in names]
        text = "- | -"
        if set(context) <= set(names) and targets:
            pairs = [held_out(model, one, context, targets) for one in (scene, posed)]
            mious = ["-" if miou is None else f"{miou:.3f}" for _, miou in pairs]
            text = f"{pairs[0][0]:.1f}, {pairs[1][0]:.1f} | {', '.join(mious)}"
        print(
            f"{scene.name} | {len(names)} of {len(scene)} | {np.median(turns):.2f} | {np.median(bearings):.1f} | {focal:.2f} | {text}",
            flush=True,
        )


if __name__ == "__main__":
    main()
