"""How near meshes are to the surfaces of generated rooms, and whether their classes are right.

    python scripts/mesh_error.py small ROOMS [ROOMS ...] --frames 6

The rooms need true classes and depth, as `semgs rooms` draws them. All of the first frames are input views. A vertex is accurate if a pixel of an input view has its surface
within two voxels of it, and a pixel of an input view is complete if a vertex is as near. Classes are compared at the nearest such pixel. Prints a Markdown table: depth and classes
of the network, refined as `semgs reconstruct` does; or true depth, as of a sensor, with the network's classes or true ones.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch.nn.functional import one_hot

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.tables.classes import IGNORE
from semgs.data.views import Views
from semgs.depth_maps.sensor_depth import place_gaussians
from semgs.geometry.cameras import back_project
from semgs.mesh.labelled import METRIC_VOXEL, mesh_of
from semgs.model.weights.load import load
from semgs.scene.photo_refinement import refine
from semgs.scene.scene_file import SavedScene

SIZE = (240, 320)


def with_true_classes(scene: SavedScene, labels: torch.Tensor) -> SavedScene:
    """The scene, of whose Gaussians each has the class of the first pixel that it stands for, and none if that has none."""
    first = labels[:, :: scene.stride, :: scene.stride].long().flatten()
    first = first if scene.places is None else first[scene.places]
    count = len(scene.classes)
    sure = torch.where((first == IGNORE)[:, None], 1 / count, one_hot(first.clamp(max=count - 1), count).float())
    semantic = replace(scene.gaussians.semantic, features=sure)
    return replace(scene, gaussians=replace(scene.gaussians, semantic=semantic))


def errors(scene: SavedScene, views: Views) -> tuple[float, ...]:
    """Shares of accurate vertices, of complete pixels and of right classes; faces, and seconds of computing."""
    start = process_time()
    mesh = mesh_of(scene)
    seconds = process_time() - start
    known = (views.depths > 0).numpy()
    points = back_project(views.depths.double(), views.cameras).numpy()[known]
    labels = views.labels.numpy()[known]
    off, nearest = cKDTree(points).query(mesh.vertices)
    missed, _ = cKDTree(mesh.vertices).query(points)
    has = labels[nearest] != IGNORE
    right = mesh.labels[has] == labels[nearest][has]
    near = 2 * METRIC_VOXEL
    return float((off <= near).mean()), float((missed <= near).mean()), float(right.mean()), len(mesh.faces), seconds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("network")
    parser.add_argument("data", nargs="+", type=Path)
    parser.add_argument("--frames", type=int, default=6, help="input views of each room")
    parser.add_argument("--rooms", type=int, default=8, help="rooms of each folder")
    options = parser.parse_args()
    network = load(options.network)
    rows: dict[str, list[tuple[float, ...]]] = {}
    for folder in options.data:
        for path in scene_paths(folder)[: options.rooms]:
            views = open_scene(path).read(range(options.frames), SIZE)
            made = network(views)
            placed, _ = place_gaussians(made, views, "sensor")
            scenes = [SavedScene.of(one, views, unit="metric") for one in (refine(made, views), placed)]
            scenes.append(with_true_classes(scenes[1], views.labels))
            for name, scene in zip(("network | network", "true | network", "true | true"), scenes, strict=True):
                rows.setdefault(name, []).append(errors(scene, views))
            print(path, file=sys.stderr)
    print("| depth | classes | accurate | complete | right class | faces | s |\n|---|---|---|---|---|---|---|")
    for name, found in rows.items():
        accurate, complete, right, faces, seconds = np.mean(found, 0)
        print(f"| {name} | {accurate:.3f} | {complete:.3f} | {right:.3f} | {faces:.0f} | {seconds:.1f} |")


if __name__ == "__main__":
    main()
