"""Measure how well `up_of` finds which way is up in generated rooms.

    python scripts/up_error.py [SEED [PITCH [STYLE]]]

Generates 24 rooms of a seed (31) in a style (home) at 240x320, with all cameras pitched by a further angle (0 degrees, up is positive), encodes the two views that
`semgs reconstruct` would choose with the included weights, and prints the angle between up and the true one. The scenes are turned at random first, so that no axis
of the world helps.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from math import radians
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from semgs.data.choosing.choice import choose
from semgs.data.scenes import open_scene
from semgs.geometry.rigid import move_cameras, move_gaussians
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.model.weights.load import load
from semgs.rooms.sets.carried_cameras import draw_camera, draw_habit, draw_path
from semgs.rooms.sets.room_scenes import RoomSettings, build_room, write_views
from semgs.rooms.sets.room_stream import generator, keep_overlap, shoot
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import up_of

ROOMS, FRAMES, SIZE = 24, 8, (240, 320)


def write_room(folder: Path, settings: RoomSettings, index: int, pitch: float) -> None:
    """Room `index` of a set with these settings, as `semgs rooms` writes it, with pitched cameras [degrees]."""
    rng = generator(settings.seed, index)
    room = build_room(rng, settings.library, settings.style)
    habit = draw_habit(rng, settings.style)
    camera = draw_camera(rng, settings.size, habit)
    reach = (settings.frames - 1) / 2
    path = draw_path(rng, room, camera, reach, habit)
    path = keep_overlap(rng, room, replace(path, pitch=path.pitch + radians(pitch)), camera, habit.overlap)
    poses = [path.pose(float(s)) for s in np.linspace(-reach, reach, settings.frames)]
    write_views(folder, shoot(rng, room, poses, camera))


@torch.no_grad()
def main() -> None:
    """Print the error in each room and the summary."""
    given = [*sys.argv[1:], *("31", "0", "home")[len(sys.argv) - 1 :]]
    settings, pitch = RoomSettings(int(given[0]), SIZE, FRAMES, given[2]), float(given[1])  # type: ignore[arg-type]
    model, errors = load("small"), []
    for index in range(ROOMS):
        with TemporaryDirectory() as folder:
            write_room(Path(folder), settings, index, pitch)
            scene = open_scene(folder)
            choice = choose(scene, 2)
            views = scene.read(choice.context, SIZE, choice.depth_range)
        saved = SavedScene.of(model(views), views, unit="metric")
        turn = torch.eye(4, dtype=torch.float64)
        quaternion = torch.randn(4, generator=torch.Generator().manual_seed(index), dtype=torch.float64)
        turn[:3, :3] = matrix_from_quaternion(quaternion / quaternion.norm())
        turned = replace(
            saved, gaussians=move_gaussians(turn, saved.gaussians), cameras=move_cameras(turn, saved.cameras)
        )
        found = up_of(turned)
        errors.append(torch.rad2deg(torch.acos((found.direction @ turn[:3, 2]).clamp(-1, 1))).item())
        print(f"{index:2d}  {errors[-1]:5.2f} degrees  {'' if found.certain else 'uncertain'}", flush=True)
    print(
        f"mean {np.mean(errors):.2f}, median {np.median(errors):.2f}, worst {max(errors):.2f} degrees; {sum(one < 3 for one in errors)} of {ROOMS} within 3"
    )


if __name__ == "__main__":
    main()
