"""Protocols: which frames of a scene are targets, and the input views of each.

A protocol is a function from a scene and a number of views to a list of samples. The chosen frames are saved by name
(`semgs.evaluation.frames.frame_plan`), so that others can use the same frames without this code.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Literal

import numpy as np

from semgs.data.choosing.choice import frames_around
from semgs.data.scene import Scene
from semgs.files.errors import InputError

PEERS_SPAN = 700
"""S-Ray and GSNeRF use only this many frames of a scene."""
PEERS_SOURCE_STEP = 5
PEERS_FIRST_TARGET = 2
PEERS_TARGET_STEP = 20
PEERS_TARGETS = 10


ASIDE = re.compile(r"aside_\d+_(\d+)(cm|deg)")
"""Stems of targets that `semgs rooms --aside` draws, such as aside_0_20cm."""

INPUT = re.compile(r"input_\d+")
"""Stems of their input views."""


@dataclass(frozen=True)
class TargetSample:
    """A target view and its input views, as positions among the usable frames of a scene.

    Attributes:
        contexts: the input frames, in order.
        target: the frame to predict.
    """

    contexts: tuple[int, ...]
    target: int


def neighbours(scene: Scene, views: int) -> list[TargetSample]:
    """Each inner frame of a scene (all but the first and the last), with the `views` nearest frames in file order as contexts.

    Contexts alternate between before and after: t-1, t+1, t-2, t+2, ...; if one side ends, the rest comes from the other.

    Raises:
        InputError: the scene has fewer than three usable frames, or too few for `views` contexts.
    """
    _check(scene, views, sources=len(scene) - 1, least=3)
    return [TargetSample(frames_around(target, len(scene), views), target) for target in range(1, len(scene) - 1)]


def kind_aside(frame: str) -> str:
    """How far a frame is aside of the input views, by its name: "20 cm", "15°"; empty for others."""
    found = ASIDE.fullmatch(PurePosixPath(frame).stem)
    return "" if found is None else f"{found[1]} cm" if found[2] == "cm" else f"{found[1]}°"


def aside(scene: Scene, views: int) -> list[TargetSample]:
    """Views beside those that a network gets, in scenes drawn for it: each frame called aside, from the input views.

    Raises:
        InputError: the scene was not drawn for it, or with another number of input views.
    """
    stems = [PurePosixPath(frame.name).stem for frame in scene.frames]
    contexts = tuple(index for index, stem in enumerate(stems) if INPUT.fullmatch(stem))
    targets = [index for index, frame in enumerate(scene.frames) if kind_aside(frame.name)]
    if not contexts or not targets:
        raise InputError(scene.path, "a scene with views aside", "none", advice="semgs rooms OUT --aside draws them")
    if len(contexts) != views:
        raise InputError(scene.path, f"{views} input views", f"{len(contexts)}", advice=f"use --views {len(contexts)}")
    return [TargetSample(contexts, target) for target in targets]


def peers(scene: Scene, views: int, distance: Literal["sray", "gsnerf"] = "sray") -> list[TargetSample]:
    """The test frames of S-Ray and GSNeRF: targets 2, 22, ..., 182, each with the nearest of the frames 0, 5, ..., 695 as contexts.

    Args:
        scene: its usable frames, in file order, are those that their code counts (frames with a finite pose).
        views: number of contexts, the nearest first.
        distance: how near is measured. "sray": distance of the camera centres. "gsnerf": as in GSNeRF's code, which passes
            camera-to-world poses to a formula for world-to-camera ones. The distance is then that between the translations
            of the world-to-camera poses, and depends on the world's origin.

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
        samples.append(TargetSample(tuple(int(source) for source in nearest), target))
    return samples


def nearest_first(scene: Scene, sample: TargetSample) -> tuple[int, ...]:
    """The contexts of a sample, sorted by the distance of their camera centres to the target's; equal ones keep their order."""
    centres = np.stack([scene.frames[index].world_from_camera[:3, 3] for index in (*sample.contexts, sample.target)])
    order = np.argsort(np.linalg.norm(centres[:-1] - centres[-1], axis=1), kind="stable")
    return tuple(sample.contexts[index] for index in order)


def _check(scene: Scene, views: int, sources: int, least: int) -> None:
    """Refuse a scene with fewer than `least` usable frames, or with fewer than `views` frames to choose contexts from."""
    if len(scene) < least:
        raise InputError(scene.path, f"at least {least} usable frames", f"{len(scene)}")
    if views > sources:
        raise InputError(
            scene.path,
            f"at least {views} frames to render a target from",
            f"{sources} ({len(scene)} usable frames)",
            advice=f"use at most {sources} views",
        )
