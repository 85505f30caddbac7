"""Protocols: which frames of a scene are compared, and from which others each of them is drawn.

A protocol is a function from a scene and a number of views to a list of samples. What it chose is saved by frame names
(`semgs.evaluation.frames.plan`), so that others can take the same frames without its code.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from semgs.data.choice import around
from semgs.data.scene import Scene
from semgs.files.errors import InputError

PEERS_SPAN = 700
"""The peers look at no frame behind this one."""
PEERS_SOURCE_STEP = 5
PEERS_FIRST_TARGET = 2
PEERS_TARGET_STEP = 20
PEERS_TARGETS = 10


@dataclass(frozen=True)
class Sample:
    """A view to compare and those that a method is given; positions among the usable frames of a scene.

    Attributes:
        contexts: the input frames, in the order in which they are given.
        target: the frame to draw and compare.
    """

    contexts: tuple[int, ...]
    target: int


def neighbours(scene: Scene, views: int) -> list[Sample]:
    """Each inner frame of a scene (all but the first and the last) from the `views` nearest in file order.

    Contexts are taken alternately before and after: t-1, t+1, t-2, t+2, ...; where one side ends, the other fills.

    Raises:
        InputError: the scene has fewer than three usable frames, or fewer than `views` beside a target.
    """
    _check(scene, views, sources=len(scene) - 1, least=3)
    return [Sample(around(target, len(scene), views), target) for target in range(1, len(scene) - 1)]


def peers(scene: Scene, views: int, distance: Literal["sray", "gsnerf"] = "sray") -> list[Sample]:
    """The test frames of S-Ray and GSNeRF: targets 2, 22, ..., 182, each from the nearest of the frames 0, 5, ..., 695.

    Args:
        scene: whose usable frames are, in file order, those that the peers' code counts (frames with a finite pose).
        views: number of contexts, the nearest first.
        distance: what is near. "sray" is the distance of camera centres. "gsnerf" is what GSNeRF's code ranks by: it
            hands camera-to-world poses to a formula made for world-to-camera ones, so that the distance is that of the
            translations of the world-to-camera poses, and depends on where the world's origin is.

    Raises:
        InputError: the scene has fewer than three usable frames, or fewer than `views` source frames.
    """
    span = range(len(scene))[:PEERS_SPAN]
    sources = np.array(span[::PEERS_SOURCE_STEP])
    _check(scene, views, sources=len(sources), least=PEERS_FIRST_TARGET + 1)
    poses = np.stack([frame.world_from_camera for frame in scene.frames[:PEERS_SPAN]])
    places = poses[:, :3, 3]
    if distance == "gsnerf":
        places = -np.einsum("nji,nj->ni", poses[:, :3, :3], places)
    samples = []
    for target in span[PEERS_FIRST_TARGET::PEERS_TARGET_STEP][:PEERS_TARGETS]:
        distances = np.linalg.norm(places[sources] - places[target], axis=1)
        nearest = sources[np.argsort(distances, kind="stable")[:views]]
        samples.append(Sample(tuple(int(source) for source in nearest), target))
    return samples


def nearest_first(scene: Scene, sample: Sample) -> tuple[int, ...]:
    """The contexts of a sample by the distance of their camera centres to the target's; of equal ones the first given."""
    centres = np.stack([scene.frames[index].world_from_camera[:3, 3] for index in (*sample.contexts, sample.target)])
    order = np.argsort(np.linalg.norm(centres[:-1] - centres[-1], axis=1), kind="stable")
    return tuple(sample.contexts[index] for index in order)


def _check(scene: Scene, views: int, sources: int, least: int) -> None:
    """Refuse a scene that is too small.

    Raises:
        InputError: it has fewer than `least` usable frames, or fewer than `views` that a target can be drawn from.
    """
    if len(scene) < least:
        raise InputError(scene.path, f"at least {least} usable frames", f"{len(scene)}")
    if views > sources:
        raise InputError(
            scene.path,
            f"at least {views} frames to draw a target from",
            f"{sources} ({len(scene)} usable frames)",
            advice=f"ask for at most {sources} views",
        )
