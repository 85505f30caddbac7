"""Things: the Gaussians of each class in clusters, one for each piece of furniture.

For each class, the Gaussians that have it as their likeliest are thinned to voxels, and DBSCAN (Ester et al., KDD 1996) on their middles, weighted by opacity, finds
the groups that are connected over gaps of at most `gap`. Groups that touch and whose class distributions are alike, such as half a table and half a desk, are one thing,
with the class that is likeliest over all of it. What is too small or too thin is no thing.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
import torch
from jaxtyping import Float64, Int64, Integer
from scipy.spatial import cKDTree

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.rendering import UNSEEN, class_numbers
from semgs.rendering.temperatures import tempered
from semgs.robotics.boxes import Box, box_of
from semgs.robotics.level import level_from_world
from semgs.robotics.object_libraries import clustering_library
from semgs.runtime.argument_types import check_type

STUFF = ("wall", "floor", "ceiling")
"""Classes that are no things: ScanNet's instances leave out the first two; other tables have the third."""

CORE = 5
"""A point is inside a group if the opacities around it sum to this."""

ALIKE = 0.8
"""Groups that touch are one thing if the Bhattacharyya coefficient of their mean class distributions is at least this."""

SURE = 0.56
"""If things are named only where their class is at least so likely, nine of ten names are right, over generated rooms and the world `other`, and 73 % of the things have one."""

UNKNOWN_OBJECT = "unknown object"
"""The name of the others."""

LIKELIEST = 3
"""So many classes of a thing are named."""

FINER = 4
"""Voxels for clustering have a side of the gap divided by this."""


@dataclass(frozen=True)
class Thing:
    """One thing.

    Attributes:
        instance: its number, from 1; the thing with the most Gaussians is the first.
        label: position of its class in the table.
        name: of its class, or `UNKNOWN_OBJECT` if that is not likely enough.
        confidence: mean probability of the class, 0..1, weighted by opacity.
        likeliest: the classes with the highest mean probability and these, its own first; at most `LIKELIEST`.
        box: around it, in the level frame.
        distance: to the nearest point of the box [m].
        count: Gaussians that belong to it.
    """

    instance: int
    label: int
    name: str
    confidence: float
    box: Box
    distance: float
    count: int
    likeliest: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Objects:
    """The things of a scene.

    Attributes:
        things: in the order of their numbers.
        instances: the number of the thing that each Gaussian belongs to; 0 for none.
        level_from_world: from the frame of the Gaussians to the level frame of the boxes, a rotation.
    """

    things: tuple[Thing, ...]
    instances: Int64[np.ndarray, " g"]
    level_from_world: Float64[np.ndarray, "3 3"]

    def only(self, *, classes: Collection[str] = (), min_confidence: float = 0.0) -> Objects:
        """Some of the things, with the numbers that they have.

        Args:
            classes: their names; empty for all.
            min_confidence: the least confidence.
        """
        kept = tuple(
            one for one in self.things if one.confidence >= min_confidence and (not classes or one.name in classes)
        )
        numbers = [thing.instance for thing in kept]
        return replace(self, things=kept, instances=np.where(np.isin(self.instances, numbers), self.instances, 0))


def objects(
    gaussians: Gaussians,
    classes: ClassTable = SCANNET20,
    *,
    up: Sequence[float] = (0.0, 0.0, 1.0),
    seen_from: Sequence[float] = (0.0, 0.0, 0.0),
    temperature: float | None = None,
    stuff: Collection[str] = STUFF,
    gap: float = 0.1,
    min_opacity: float = 0.1,
    min_gaussians: float = 150.0,
    min_size: float = 0.1,
    sure: float = 0.0,
) -> Objects:
    """Find the things of a scene: connected groups of Gaussians, each with a class and a box that is turned about gravity only.

    One scene has one numbering: in a merged walk a thing has the same number in every view.

    Args:
        gaussians: of one scene in metres, with classes.
        classes: the table of the classes.
        up: the direction that is up.
        seen_from: the point from which distances are measured, such as the first camera's centre.
        temperature: calibrates the class distributions; None leaves them as they are.
        stuff: names of the classes that are no things.
        gap: Gaussians that are further apart belong to two things [m].
        min_opacity: Gaussians that are more transparent belong to no thing.
        min_gaussians: a thing has at least this sum of opacities.
        min_size: the longest side of a thing is at least this [m].
        sure: a thing whose likeliest class has a lower mean probability is an unknown object; the default names all.

    Raises:
        ValueError: the Gaussians have no classes or another number than the table, have a batch axis, or an argument is out of range.
        ImportError: scikit-learn or trimesh is not installed.
    """
    Gaussians.check_type(gaussians)
    check_type("classes are", classes, ClassTable, "a class table, such as load_scene(...).classes")
    if gaussians.semantic is None:
        raise ValueError("the Gaussians have no classes; expected those of a model with a semantic branch")
    features = gaussians.semantic.features.detach().cpu()
    if features.ndim != 2 or features.shape[-1] != len(classes):
        raise ValueError(
            f"the class distributions are {tuple(features.shape)}; expected [g {len(classes)}] for table {classes.name}"
        )
    if not (0 < gap < inf and min_size >= 0):
        raise ValueError(f"gap is {gap} and min_size {min_size}; expected a positive gap, and 0 or more")
    eye = np.asarray(seen_from, np.float64)
    if eye.shape != (3,) or not np.isfinite(eye).all():
        raise ValueError(f"seen_from is {seen_from}; expected a point of three finite numbers")
    level = level_from_world(up)
    points = gaussians.means.detach().cpu().double().numpy() @ level.T
    weights = gaussians.opacities.detach().cpu().double().numpy()
    raw = features.double().numpy()
    chances = raw if temperature is None else tempered(features, temperature).double().numpy()
    solid = torch.from_numpy((weights >= min_opacity) & (weights > 0))
    labels = torch.where(solid, class_numbers(features), UNSEEN).numpy()
    eye = level @ eye
    of_things = [label for label, name in enumerate(classes.names) if name not in stuff]
    groups = connected(np.where(np.isin(labels, of_things), labels, -1), points, weights, gap)
    groups = joined(groups, points, weights, raw, gap)
    found = []
    for number in np.unique(groups[groups > 0]).tolist():
        members = np.flatnonzero(groups == number)
        if weights[members].sum() >= min_gaussians:
            box = box_of(points[members])
            if max(box.size) >= min_size:
                found.append((members, np.average(chances[members], axis=0, weights=weights[members])[of_things], box))
    found.sort(key=lambda one: (-len(one[0]), one[1].argmax(), one[0][0]))
    instances = np.zeros(len(points), np.int64)
    things = []
    for instance, (members, means, box) in enumerate(found, 1):
        instances[members] = instance
        ranked = np.argsort(-means, kind="stable")[:LIKELIEST]
        likeliest = tuple((classes.names[of_things[place]], float(means[place])) for place in ranked)
        label = of_things[int(ranked[0])]
        confidence = likeliest[0][1]
        name = likeliest[0][0] if confidence >= sure else UNKNOWN_OBJECT
        things.append(Thing(instance, label, name, confidence, box, box.distance(eye), len(members), likeliest))
    return Objects(tuple(things), instances, level)


def connected(
    families: Integer[np.ndarray, " n"],
    points: Float64[np.ndarray, "n 3"],
    weights: Float64[np.ndarray, " n"],
    gap: float,
) -> Int64[np.ndarray, " n"]:
    """The group of each Gaussian, from 1, 0 for none: those of one family (-1 for none) that are connected over gaps of at most `gap`.

    Raises:
        ImportError: scikit-learn or trimesh is not installed.
    """
    cluster, groups = clustering_library(), np.zeros(len(points), np.int64)
    for family in np.unique(families[families >= 0]):
        members = np.flatnonzero(families == family)
        found = _groups(cluster, points[members], weights[members], gap)
        groups[members] = np.where(found < 0, 0, found + 1 + groups.max())
    return groups


def joined(
    groups: Int64[np.ndarray, " n"],
    points: Float64[np.ndarray, "n 3"],
    weights: Float64[np.ndarray, " n"],
    distributions: Float64[np.ndarray, "n class"],
    gap: float,
    least: float = ALIKE,
) -> Int64[np.ndarray, " n"]:
    """The groups, 0 for none, of which the two that touch and are most alike became one, until no two were at least so alike."""
    inside = np.flatnonzero(groups)
    if not len(inside):
        return groups
    voxels = np.column_stack((np.floor(points[inside] / (gap / 2)), groups[inside]))
    thinned = inside[np.unique(voxels, axis=0, return_index=True)[1]]
    near = groups[thinned][cKDTree(points[thinned]).query_pairs(gap, output_type="ndarray")]
    pairs = np.unique(np.sort(near), axis=0)
    sums = np.stack([np.bincount(groups, weights * one) for one in distributions.T], -1)
    names = np.arange(len(sums))
    while True:
        pairs = pairs[pairs[:, 0] != pairs[:, 1]]
        roots = np.sqrt(sums / np.maximum(sums.sum(-1, keepdims=True), 1e-12))
        alike = (roots[pairs[:, 0]] * roots[pairs[:, 1]]).sum(-1)
        if alike.max(initial=0) < least:
            return names[groups]
        one, other = pairs[alike.argmax()]
        sums[one] += sums[other]
        names[names == other] = one
        pairs[pairs == other] = one


def _groups(
    cluster, points: Float64[np.ndarray, "n 3"], weights: Float64[np.ndarray, " n"], gap: float
) -> Int64[np.ndarray, " n"]:
    """The group of each point, -1 for none: DBSCAN on the weighted middles of voxels, so that its neighbourhoods stay small."""
    places = np.floor(points / (gap / FINER)).astype(np.int64)
    _, owners = np.unique(places, axis=0, return_inverse=True)
    owners = owners.reshape(-1)
    sums = np.bincount(owners, weights)
    middles = np.stack([np.bincount(owners, weights * side) / sums for side in points.T], -1)
    found = cluster.DBSCAN(eps=gap, min_samples=CORE).fit(middles, sample_weight=sums)
    return found.labels_[owners].astype(np.int64)
