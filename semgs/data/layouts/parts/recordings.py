"""Recordings: scenes of many frames of which some lack a pose, a map or their picture. Work goes on without them, and they are counted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgs.data.classes import ClassTable
from semgs.data.frames import Frame
from semgs.data.layouts.parts.poses import checked_poses
from semgs.data.lens import Lens
from semgs.data.maps import MapSource
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.pictures import is_turned, read_header

PICTURES = (".png", ".jpg", ".jpeg")
"""Endings of pictures, in lower case."""

GENERIC = ("seq", "sequence", "data", "imap", "")
"""What folders are called in every scene, but for a number."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A frame as a recording lists it, before anything of it is opened.

    Attributes:
        name: to call it by.
        picture: where its picture should be.
        pose: world from camera [4 4], NaN in it where tracking was lost, or None where there is no pose at all.
        posed_by: the file with the pose, and the place in it.
        depth: where its z-depths come from, or None.
        labels: where its labels come from, or None.
    """

    name: str
    picture: Path
    pose: np.ndarray | None
    posed_by: tuple[Path, str]
    depth: MapSource | None = None
    labels: MapSource | None = None


@dataclass(frozen=True, eq=False)
class ShotList:
    """A recording as its files list it.

    Attributes:
        path: the recording.
        layout: what it is.
        name: of the scene.
        unit: "metric" or "unknown".
        shots: in their order.
        lens: the lens of a picture (path, size).
        classes: the table of its labels, where it has any.
        notes: what else the user should be told.
    """

    path: Path
    layout: str
    name: str
    unit: str
    shots: Sequence[Shot]
    lens: Callable[[Path, tuple[int, int]], Lens]
    classes: ClassTable | None = None
    notes: Sequence[str] = ()

    def scene(self) -> Scene:
        """The scene of the shots that have a picture and a pose.

        Raises:
            InputError: a pose is no rigid motion, a picture has another size than its camera, or fewer than two frames are left.
        """
        posed = [shot for shot in self.shots if shot.pose is not None and np.isfinite(shot.pose).all()]
        lost = [shot.name for shot in self.shots if shot.pose is not None and not np.isfinite(shot.pose).all()]
        unposed = [shot.name for shot in self.shots if shot.pose is None]
        poses = _poses(posed)
        lenses: dict[tuple[int, int], Lens] = {}
        frames, absent, mapless, unlabelled = [], [], [], []
        for shot, pose in zip(posed, poses, strict=True):
            if not shot.picture.is_file():
                absent.append(shot.name)
                continue
            header = read_header(shot.picture)
            is_turned(shot.picture, header, header.size)  # refuses an EXIF rotation, which nobody says whether to apply
            if header.size not in lenses:
                lenses[header.size] = self.lens(shot.picture, header.size)
            if shot.depth is None:
                mapless.append(shot.name)
            if shot.labels is None:
                unlabelled.append(shot.name)
            frames.append(Frame(shot.name, shot.picture, lenses[header.size], pose, shot.depth, shot.labels))
        counted = [
            (lost, "have a pose that is no number and are left out"),
            (unposed, "have no pose and are left out"),
            (absent, "have no picture"),
            (mapless if 0 < len(mapless) < len(frames) else [], "have no depth map"),
            (unlabelled if 0 < len(unlabelled) < len(frames) else [], "have no class map"),
        ]
        told = [
            f"{len(names)} of {len(self.shots)} frames {what}, the first is {names[0]}."
            for names, what in counted
            if names
        ]
        if len(frames) < 2:
            raise InputError(
                self.path,
                "at least two usable frames",
                f"{len(frames)}",
                self.layout,
                advice=" ".join(told[:3]) or None,
            )
        return Scene(
            path=self.path,
            name=self.name,
            layout=self.layout,
            unit=self.unit,
            frames=tuple(frames),
            classes=self.classes if len(unlabelled) < len(frames) else None,
            absent=tuple(absent),
            notes=(*self.notes, *told),
        )


def numbered(folder: Path, start: str = "", endings: Sequence[str] = PICTURES) -> dict[int, Path]:
    """The files of a folder whose names are `start`, a number and one of the endings, by their number, ascending.

    Where one number comes with several endings the first ending counts.
    """
    found: dict[int, tuple[int, Path]] = {}
    for path in folder.iterdir() if folder.is_dir() else ():
        for rank, ending in enumerate(endings):
            digits = path.name.lower().removeprefix(start.lower()).removesuffix(ending)
            if path.name.lower() == f"{start.lower()}{digits}{ending}" and digits.isdecimal():
                found[int(digits)] = min(found.get(int(digits), (rank, path)), (rank, path))
    return {number: found[number][1] for number in sorted(found)}


def sequence_name(path: Path) -> str:
    """The name of a scene whose folder may be called as those of all scenes are (seq-01): with the folders above before it."""
    path = path.absolute()
    parts = [path.name]
    while parts[0].lower().rstrip("0123456789").rstrip("-_") in GENERIC and path.parent.name:
        path = path.parent
        parts.insert(0, path.name)
    return "_".join(parts)


def _poses(shots: Sequence[Shot]) -> np.ndarray:
    """The poses of shots, checked, each with its file and place.

    Raises:
        InputError: one is no rigid motion.
    """
    checked = np.zeros((len(shots), 4, 4))
    by_file: dict[Path, list[int]] = {}
    for index, shot in enumerate(shots):
        by_file.setdefault(shot.posed_by[0], []).append(index)
    for file, indices in by_file.items():
        checked[indices] = checked_poses(
            file, [shots[index].pose for index in indices], [shots[index].posed_by[1] for index in indices]
        )
    return checked
