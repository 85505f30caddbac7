"""Protocols: which frames of a scene are targets, and the input views of each.

A protocol is a function from a scene and a number of views to a list of samples. The chosen frames are saved by name
(`semgs.evaluation.frames.frame_plan`), so that others can use the same frames without this code.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

import numpy as np

from semgs.data.choosing.choice import frames_around
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json

PEERS_SPAN = 700
"""S-Ray and GSNeRF use only this many frames of a scene."""
PEERS_SOURCE_STEP = 5
PEERS_FIRST_TARGET = 2
PEERS_TARGET_STEP = 20
PEERS_TARGETS = 10


LSM_VIEWS, LSM_FRAMES, LSM_HOLD, LSM_TARGETS = 2, 30, 8, (1, 4)
LSM_IGNORED = "scene0696_02"
LSM_SIZE = (256, 256)
"""The protocol of LSM and Uni3R; images are cropped to this (height, width) [px]."""

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
        others: other input frames, from which it is predicted a second time, to see what changes; empty for none.
    """

    contexts: tuple[int, ...]
    target: int
    others: tuple[int, ...] = ()

    @property
    def frames(self) -> tuple[int, ...]:
        """All of them."""
        return (*self.contexts, *self.others, self.target)


def neighbours(scene: Scene, views: int) -> list[TargetSample]:
    """Each inner frame of a scene (all but the first and the last), with the `views` nearest frames in file order as contexts.

    Contexts alternate between before and after: t-1, t+1, t-2, t+2, ...; if one side ends, the rest comes from the other.

    Raises:
        InputError: the scene has fewer than three usable frames, or too few for `views` contexts.
    """
    _check(scene, views, sources=len(scene) - 1, least=3)
    return [TargetSample(frames_around(target, len(scene), views), target) for target in range(1, len(scene) - 1)]


def pairs(scene: Scene, views: int) -> list[TargetSample]:
    """The targets of `neighbours` that can be predicted a second time, from the same number of further frames: t-1 and t+1, then t-2 and t+2.

    Raises:
        InputError: the scene has too few usable frames.
    """
    _check(scene, views, sources=(len(scene) - 1) // 2, least=5)
    found = []
    for target in range(1, len(scene) - 1):
        around = frames_around(target, len(scene), 2 * views)
        found.append(TargetSample(around[:views], target, around[views:]))
    return found


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
        raise InputError(
            scene.path, "a scene with views aside", "none", advice="semgs rooms --out OUT --aside draws them"
        )
    if len(contexts) != views:
        raise InputError(scene.path, f"{views} input views", f"{len(contexts)}", advice=f"use --views {len(contexts)}")
    return [TargetSample(contexts, target) for target in targets]


def lsm(scene: Scene, views: int, listed: Mapping[str, Sequence[str]] | None = None) -> list[TargetSample]:
    """The frames of LSM, Uni3R, C3G and EPS3D: of 30 frames of a scan, those at positions 1, 4, 9, 12, ... are targets, each with the two beside it as contexts.

    https://github.com/HorizonRobotics/Uni3R: data_process/data.md, uni3r/datasets/testdata.py. The text says "30 frames at regular intervals"; without
    the authors' list, ours are those numbered 0, s, 2 s, ..., with s = the number of frames // 30. A scan of which one of the 30 has no pose is left out, as theirs.

    Args:
        scene: a scan of ScanNet.
        views: 2.
        listed: names of the frames of each scan, in order; by default those of the rule.

    Returns:
        The samples; none for a scan that is left out.

    Raises:
        InputError: another number of views, or the scene has fewer than 30 frames, or lacks one that is listed.
    """
    if views != LSM_VIEWS:
        raise InputError(scene.path, f"{LSM_VIEWS} input views for the protocol lsm", f"{views}")
    positions = {PurePosixPath(frame.name).stem: position for position, frame in enumerate(scene.frames)}
    numbers = {int(stem): position for stem, position in positions.items() if stem.isdecimal()}
    if listed is not None:
        frames = listed[scene.name]
        named = [positions.get(name, numbers.get(int(name)) if name.isdecimal() else None) for name in frames]
        if None in named:
            raise InputError(scene.path, f"the frame {frames[named.index(None)]} of the list", "none with a pose")
        chosen = [position for position in named if position is not None]
    else:
        step = (max(numbers, default=0) + 1) // LSM_FRAMES
        if not step:
            raise InputError(scene.path, f"{LSM_FRAMES} or more numbered frames", f"{len(numbers)}")
        if any(step * index not in numbers for index in range(LSM_FRAMES)):
            return []
        chosen = [numbers[step * index] for index in range(LSM_FRAMES)]
    last = len(chosen) - 1
    return [
        TargetSample((chosen[max(index - 1, 0)], chosen[min(index + 1, last)]), chosen[index])
        for index in range(len(chosen))
        if index % LSM_HOLD in LSM_TARGETS and 0 < index < last
    ]


def read_lsm_list(path: str | Path, scans: Collection[str]) -> dict[str, tuple[str, ...]]:
    """The frames of each scan in a list as LSM's `selected_seqs_test.json`: {"scene0686_01": ["0", "40", ...]}, in the order of their names.

    Args:
        path: of the file.
        scans: the names of the scans that there are.

    Raises:
        InputError: the file has another form, or names a scan that is missing.
    """
    content = read_json(path, "a list of the frames of each scan")
    expected = 'frames of each scan, {"scene0686_01": ["0", "40", ...]}'
    if not isinstance(content, dict) or not all(isinstance(frames, list) for frames in content.values()):
        raise InputError(path, expected, "something else")
    found = {}
    for scan, frames in content.items():
        if any(not isinstance(name, str) for name in frames):
            raise InputError(path, expected, f"{frames!r:.60}", key=scan)
        if frames and scan != LSM_IGNORED:
            if scan not in scans:
                raise InputError(path, f"scans of the data, such as {next(iter(scans))}", f"{scan}, which is missing")
            found[scan] = tuple(sorted(frames))
    return found


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
