"""A labelled mesh of a saved scene: fused depth, and for each vertex a colour, a class, how sure that is, and the thing that it belongs to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64, Int64, UInt8
from scipy.spatial import cKDTree

from semgs.geometry.cameras import Cameras, project, shrink_cameras
from semgs.mesh.fusion import TRUNCATION, DepthMap, fuse
from semgs.mesh.surface import Faces, Vertices, simplified, surface_of
from semgs.rendering.rendering import SEEN_ALPHA, Rendering, class_numbers
from semgs.rendering.temperatures import highest_probability
from semgs.scene.scene_file import SavedScene

METRIC_VOXEL = 0.02
"""Side of voxels in scenes in metres [m]."""

VOXELS_DEEP = 150
"""In other scenes, the median depth is so many voxels: 3 m at 2 cm."""

SURE_DEPTH = 0.03
"""Depth whose logarithm has a larger standard deviation than this counts less, by the inverse of its square, as in a weighted mean."""

SOLID = 0.1
"""Gaussians with less opacity say nothing about which thing a vertex belongs to."""


@dataclass(frozen=True)
class LabelledMesh:
    """A surface of triangles, anticlockwise seen from the front.

    Attributes:
        vertices: positions [unit of the scene].
        faces: three vertices each.
        colours: red, green and blue of each vertex.
        labels: position in the class table, 255 for none; None without classes.
        confidences: probability of the class, 0 to 1; None without classes.
        instances: the number of the thing that each vertex belongs to, 0 for none; None if things were not searched.
    """

    vertices: Vertices
    faces: Faces
    colours: UInt8[np.ndarray, "n 3"]
    labels: UInt8[np.ndarray, " n"] | None = None
    confidences: Float32[np.ndarray, " n"] | None = None
    instances: Int64[np.ndarray, " n"] | None = None

    def at(self, chosen: np.ndarray, vertices: Vertices, faces: Faces) -> LabelledMesh:
        """Another mesh, whose vertices have what these chosen ones have."""
        labels, confidences, instances = (
            None if one is None else one[chosen] for one in (self.labels, self.confidences, self.instances)
        )
        return LabelledMesh(vertices, faces, self.colours[chosen], labels, confidences, instances)

    def only(self, keep: Bool[np.ndarray, " m"]) -> LabelledMesh:
        """Some of the faces, with the vertices that they need."""
        used, faces = np.unique(self.faces[keep], return_inverse=True)
        return self.at(used, self.vertices[used], faces.reshape(-1, 3))

    def moved(self, to_from_here: Float64[np.ndarray, "4 4"]) -> LabelledMesh:
        """The mesh in another frame."""
        return replace(self, vertices=self.vertices @ to_from_here[:3, :3].T + to_from_here[:3, 3])

    def simplified(self, faces: int) -> LabelledMesh:
        """The mesh with about so many faces; each vertex has the labels of the nearest one of before.

        Raises:
            ImportError: fast-simplification is not installed.
        """
        vertices, triangles = simplified(self.vertices, self.faces, faces)
        return self.at(cKDTree(self.vertices).query(vertices)[1], vertices, triangles)


def mesh_of(
    scene: SavedScene, *, voxel: float | None = None, instances: Int64[np.ndarray, " g"] | None = None
) -> LabelledMesh:
    """The surface that the input views of a scene show, in the frame of its Gaussians.

    The views' depth maps are fused, and each vertex takes its colour and its class from the renderings of the views that see it. Pixels that the Gaussians
    hardly cover, and pixels between what is near and what is far, do not count; uncertain depth counts little.

    Args:
        scene: with two or more views and their depth.
        voxel: side of a voxel [unit of the scene]; None is 2 cm in metric scenes, and in others a 150th of the median depth.
        instances: the number of the thing that each Gaussian belongs to, 0 for none.

    Raises:
        ValueError: the scene has one view, or no depth, or no surface is left, or there are too many voxels.
        ImportError: scikit-image is not installed.
    """
    if len(scene.frames) < 2:
        raise ValueError("a mesh needs two or more views, and the scene has one")
    maps = [_depth_map(scene, view, rendering) for view, rendering in _renderings(scene, False)]
    known = np.concatenate([one.depths[one.worth > 0] for one in maps])
    if not len(known):
        raise ValueError("a mesh needs depth, and the views of the scene see nothing")
    if voxel is None:
        voxel = METRIC_VOXEL if scene.unit == "metric" else float(np.median(known)) / VOXELS_DEEP
    field = fuse(maps, voxel)
    vertices, faces = surface_of(field)
    if not len(faces):
        raise ValueError("no surface is left: the depth maps are too small, or have too many holes and steps")
    return _labelled(scene, vertices, faces, TRUNCATION * voxel, instances)


def _renderings(scene: SavedScene, classes: bool) -> Iterator[tuple[int, Rendering]]:
    """Each input view, rendered."""
    shown = scene if classes else replace(scene, gaussians=replace(scene.gaussians, semantic=None), classes=None)
    for view in range(len(scene.frames)):
        with torch.no_grad():
            yield view, shown.render(scene.cameras[view : view + 1])


def _depth_map(scene: SavedScene, view: int, rendering: Rendering) -> DepthMap:
    """What a view measures, where the Gaussians cover it: the depth of a sensor, in the blocks of pixels that have a Gaussian each; elsewhere that of the rendering,
    which all views agree on."""
    measured = (scene.confidences[view] == 1) & (scene.depths[view] > 0)
    depths = torch.where(measured, scene.depths[view], rendering.depths[0])
    worth = rendering.alphas[0] * (rendering.alphas[0] >= SEEN_ALPHA)
    if scene.depth_spread is not None:
        worth = worth * (SURE_DEPTH / scene.depth_spread[view].clamp(min=SURE_DEPTH)).square()
    stride = scene.stride if measured.any() else 1
    depths, worth = torch.nn.functional.avg_pool2d(torch.stack((depths, worth)), stride).double().numpy()
    return DepthMap(shrink_cameras(scene.cameras[view], stride), depths, worth)


def _labelled(
    scene: SavedScene, vertices: Vertices, faces: Faces, reach: float, instances: Int64[np.ndarray, " g"] | None
) -> LabelledMesh:
    """Colours and classes from the views that see each vertex, the near ones most; what none sees has those of the nearest vertex that one does."""
    classes = 0 if scene.classes is None else len(scene.classes)
    sums, seen = np.zeros((len(vertices), 3 + classes)), np.zeros(len(vertices))
    points = torch.from_numpy(vertices)
    for view, rendering in _renderings(scene, True):
        camera: Cameras = scene.cameras[view]
        u, v, z = project(points, camera).numpy().T
        height, width = camera.size
        inside = np.flatnonzero((z > 0) & (u >= 0) & (u < width) & (v >= 0) & (v < height))
        column, row, z = u[inside].astype(int), v[inside].astype(int), z[inside]
        alphas = rendering.alphas[0].numpy()[row, column]
        shown = (np.abs(rendering.depths[0].numpy()[row, column] - z) <= reach) & (alphas >= SEEN_ALPHA)
        inside, column, row = inside[shown], column[shown], row[shown]
        weights = alphas[shown] / z[shown] ** 2
        maps = [rendering.images[0], *([] if rendering.semantics is None else [rendering.semantics[0]])]
        sums[inside] += weights[:, None] * torch.cat(maps).numpy()[:, row, column].T
        seen[inside] += weights
    known = np.flatnonzero(seen > 0)
    if not len(known):
        raise ValueError("no surface is left: no view sees what the depth maps show")
    hidden = np.flatnonzero(seen == 0)
    means = sums / np.maximum(seen, 1e-30)[:, None]
    means[hidden] = means[known[cKDTree(vertices[known]).query(vertices[hidden])[1]]]
    mesh = LabelledMesh(vertices, faces, np.round(255 * means[:, :3].clip(0, 1)).astype(np.uint8))
    if classes:
        chances = torch.from_numpy(means[:, 3:])
        temperature = None if scene.temperatures is None else scene.temperatures.rendered
        confidences = highest_probability(chances, temperature).numpy().astype(np.float32)
        mesh = replace(mesh, labels=class_numbers(chances).numpy().astype(np.uint8), confidences=confidences)
    if instances is not None:
        solid = np.flatnonzero(scene.gaussians.opacities.numpy() >= SOLID)
        nearest = cKDTree(scene.gaussians.means.numpy()[solid]).query(vertices)[1]
        mesh = replace(mesh, instances=instances[solid[nearest]])
    return mesh
