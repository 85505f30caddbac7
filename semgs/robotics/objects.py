"""Things: the Gaussians of each class in clusters, one for each piece of furniture.

For each class, the Gaussians that have it as their likeliest are thinned to voxels, and DBSCAN (Ester et al., KDD 1996) on their middles, weighted by opacity, finds
the groups that are connected over gaps of at most `gap`. Groups that touch and whose class distributions are alike, such as half a table and half a desk, are one thing,
with the class that is likeliest over all of it. What is too small or too thin is no thing.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64, Integer

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import check_type
from semgs.files.strict_json import read_json
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.rendering import UNSEEN, class_numbers
from semgs.rendering.temperatures import tempered
from semgs.robotics.boxes import Box, box_of
from semgs.robotics.floor import level_from_world
from semgs.robotics.object_libraries import clustering_library

STUFF = ("wall", "floor", "ceiling")
"""Classes that are no things: ScanNet's instances leave out the first two; other tables have the third."""

CORE = 5
"""A point is inside a group if the opacities around it sum to this."""

ALIKE = 0.8
"""Groups that touch are one thing if the Bhattacharyya coefficient of their mean class distributions is at least this."""

SURE = 0.56
"""If things are named only where their class is at least so likely, nine of ten names are right, over generated rooms and the world `other`, and 68 % of the things have one."""

UNKNOWN_OBJECT = "unknown object"
"""The name of the others."""

CONFUSED = (
    ("table", "desk", "counter"),
    ("chair", "sofa"),
    ("cabinet", "bookshelf", "refrigerator", "otherfurniture"),
    ("curtain", "shower curtain"),
)
"""Classes that are often taken for each other."""

EITHER = 0.65
"""If neither of two such classes is sure, but both together are at least so likely, a thing has both names: so 73 % are named, and still nine of ten names are right."""

LIKELIEST = 3
"""So many classes of a thing are named."""

HEIGHTS = Path(__file__).with_name("heights.json")
"""How high the bottom of the things of each class is above the floor in the training rooms, from `scripts/heights_of_things.py`."""

OFF = 0.2
"""Bottoms may be this far outside of these heights: depth is not exact [m]."""

FINER = 4
"""Voxels for clustering have a side of the gap divided by this."""


@dataclass(frozen=True)
class Thing:
    """One thing.

    Attributes:
        instance: its number, from 1. `objects` gives 1 to the thing with the most Gaussians; `semgs.Ids` gives numbers that last.
        label: position of its class in the table.
        name: of its class; of two, as in "desk or table", if only both together are likely enough; `UNKNOWN_OBJECT` if that is not so, or not at that height.
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
            classes: their names; empty for all. Things with two names are among both.
            min_confidence: the least confidence.
        """
        kept = tuple(
            one
            for one in self.things
            if one.confidence >= min_confidence and (not classes or set(one.name.split(" or ")) & set(classes))
        )
        numbers = [thing.instance for thing in kept]
        return replace(self, things=kept, instances=np.where(np.isin(self.instances, numbers), self.instances, 0))


@dataclass(frozen=True)
class ThingSettings:
    """What counts as a thing.

    Attributes:
        gap: Gaussians that are further apart belong to two things [m].
        stuff: names of the classes that are no things.
        min_opacity: Gaussians that are more transparent belong to no thing.
        min_gaussians: a thing has at least this sum of opacities.
        min_size: the longest side of a thing is at least this [m].
        sure: a thing whose class has a lower mean probability is an unknown object, or has two names (`CONFUSED`); the default names all.
    """

    gap: float = 0.1
    stuff: Collection[str] = STUFF
    min_opacity: float = 0.1
    min_gaussians: float = 150.0
    min_size: float = 0.1
    sure: float = 0.0

    def __post_init__(self) -> None:
        if not (0 < self.gap < inf and self.min_size >= 0):
            raise ValueError(f"gap is {self.gap} and min_size {self.min_size}; expected a positive gap, and 0 or more")


def objects(
    gaussians: Gaussians,
    classes: ClassTable = SCANNET20,
    *,
    up: Sequence[float] = (0.0, 0.0, 1.0),
    seen_from: Sequence[float] = (0.0, 0.0, 0.0),
    temperature: float | None = None,
    floor: float | None = None,
    **settings: Any,
) -> Objects:
    """Find the things of a scene: connected groups of Gaussians, each with a class and a box that is turned about gravity only.

    One scene has one numbering: in a merged walk a thing has the same number in every view. `semgs.Ids` keeps numbers from one scene to the next.

    Args:
        gaussians: of one scene in metres, with classes.
        classes: the table of the classes.
        up: the direction that is up.
        seen_from: the point from which distances are measured, such as the first camera's centre.
        temperature: calibrates the class distributions; None leaves them as they are.
        floor: the height of the floor along `up`. With it, a thing is an unknown object if none of its class stands or hangs so high (`HEIGHTS`): nothing 1.8 m up is
            a table. None leaves heights out.
        settings: those of `ThingSettings` by name: gap, stuff, min_opacity, min_gaussians, min_size, sure.

    Raises:
        ValueError: the Gaussians have no classes or another number than the table, have a batch axis, or an argument is out of range.
        ImportError: scikit-learn or trimesh is not installed.
    """
    features = _checked_features(gaussians, classes)
    chosen = ThingSettings(**settings)
    eye = np.asarray(seen_from, np.float64)
    if eye.shape != (3,) or not np.isfinite(eye).all():
        raise ValueError(f"seen_from is {seen_from}; expected a point of three finite numbers")
    level = level_from_world(up)
    points = gaussians.means.detach().cpu().double().numpy() @ level.T
    weights = gaussians.opacities.detach().cpu().double().numpy()
    raw = features.double().numpy()
    chances = raw if temperature is None else tempered(features, temperature).double().numpy()
    solid = torch.from_numpy((weights >= chosen.min_opacity) & (weights > 0))
    labels = torch.where(solid, class_numbers(features), UNSEEN).numpy()
    eye = level @ eye
    of_things = [label for label, name in enumerate(classes.names) if name not in chosen.stuff]
    groups = connected(np.where(np.isin(labels, of_things), labels, -1), points, weights, chosen.gap)
    groups = joined(groups, points, weights, raw, chosen.gap)
    found = []
    for number in np.unique(groups[groups > 0]).tolist():
        members = np.flatnonzero(groups == number)
        if weights[members].sum() >= chosen.min_gaussians:
            box = box_of(points[members])
            if max(box.size) >= chosen.min_size:
                found.append((members, np.average(chances[members], axis=0, weights=weights[members])[of_things], box))
    found.sort(key=lambda one: (-len(one[0]), one[1].argmax(), one[0][0]))
    instances = np.zeros(len(points), np.int64)
    things = []
    for instance, (members, means, box) in enumerate(found, 1):
        instances[members] = instance
        ranked = np.argsort(-means, kind="stable")[:LIKELIEST]
        likeliest = tuple((classes.names[of_things[place]], float(means[place])) for place in ranked)
        name = _name(likeliest, chosen.sure, None if floor is None else box.bottom - floor)
        label, confidence = of_things[int(ranked[0])], likeliest[0][1]
        things.append(Thing(instance, label, name, confidence, box, box.distance(eye), len(members), likeliest))
    return Objects(tuple(things), instances, level)


def _checked_features(gaussians: Gaussians, classes: ClassTable) -> Float[torch.Tensor, "g class"]:
    """The class distributions of Gaussians.

    Raises:
        ValueError: there are none, or they are not over this table, or have a batch axis.
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
    return features


def _name(likeliest: Sequence[tuple[str, float]], sure: float, bottom: float | None) -> str:
    """The name of a thing with these likeliest classes, whose bottom is so high above the floor [m]; None if that does not matter."""
    (first, chance), *others = likeliest
    names = [first] if chance >= sure else []
    for second, other in others[:1] if not names else ():
        if chance + other >= max(sure, EITHER) and any({first, second} <= set(confused) for confused in CONFUSED):
            names = [first, second]
    fits = bottom is None or any(_may_be(bottoms_of_things().get(name), bottom) for name in names)
    return " or ".join(names) if names and fits else UNKNOWN_OBJECT


@cache
def bottoms_of_things() -> Mapping[str, tuple[float, float]]:
    """The lowest and highest bottom above the floor of the things of each class in `HEIGHTS` [m]."""
    return {name: (low, high) for name, (low, high) in read_json(HEIGHTS)["bottoms"].items()}


def _may_be(limits: tuple[float, float] | None, bottom: float) -> bool:
    """Whether a thing may have its bottom so high, if these are the limits of its class; None for none."""
    return limits is None or limits[0] - OFF <= bottom <= limits[1] + OFF


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
    from scipy.spatial import cKDTree  # takes seconds to import

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
