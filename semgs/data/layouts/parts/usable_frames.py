"""Recordings: scenes of many frames, some of which lack a pose, a map or an image. These are left out and counted, and notes say so."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.confined import may_read
from semgs.data.frames import Frame
from semgs.data.layouts.parts.pose_files import checked_poses
from semgs.data.layouts.parts.trajectories import FoundPose
from semgs.data.maps import MapSource
from semgs.data.scene import Scene
from semgs.data.tables.classes import ClassTable
from semgs.files.errors import InputError
from semgs.files.images.pictures import is_turned, read_header
from semgs.files.stored import Stored
from semgs.files.text import counted

PICTURES = (".png", ".jpg", ".jpeg", ".jfif", ".jpe", ".mpo", ".heic")
"""Endings of images, in lower case."""

GENERIC = ("seq", "sequence", "data", "imap", "exr_rgbd", "")
"""Names of folders, without numbers, that are the same in every scene."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A frame as a recording lists it; nothing has been opened.

    Attributes:
        name: of the frame.
        picture: its image, which may be missing.
        pose: NaN if tracking was lost; None if there is no pose.
        depth: source of its z-depths, or None.
        labels: source of its labels, or None.
    """

    name: str
    picture: Stored
    pose: FoundPose | None
    depth: MapSource | None = None
    labels: MapSource | None = None


@dataclass(frozen=True, eq=False)
class ShotList:
    """A recording as its files list it.

    Attributes:
        path: the recording.
        layout: its name.
        name: of the scene.
        unit: "metric" or "unknown".
        shots: in order.
        lens: gives the lens of an image (its file, size).
        classes: the class table of its labels, if it has any.
        notes: what else the user should know.
        left_out: notes about frames that are not among the shots.
    """

    path: Path
    layout: str
    name: str
    unit: str
    shots: Sequence[Shot]
    lens: Callable[[Stored, tuple[int, int]], Lens]
    classes: ClassTable | None = None
    notes: Sequence[str] = ()
    left_out: Sequence[str] = ()

    def scene(self) -> Scene:
        """The scene from the shots that have an image and a pose.

        Raises:
            InputError: a pose is not a rigid motion, an image has another size than its camera, or fewer than two frames are left.
        """
        posed = [(shot, shot.pose) for shot in self.shots if shot.pose is not None and shot.pose.finite]
        lost = [shot.name for shot in self.shots if shot.pose is not None and not shot.pose.finite]
        unposed = [shot.name for shot in self.shots if shot.pose is None]
        poses = _checked([pose for _, pose in posed])
        lenses: dict[Lens, Lens] = {}
        frames, absent, mapless, unlabelled = [], [], [], []
        for (shot, _), pose in zip(posed, poses, strict=True):
            if not shot.picture.is_file():
                absent.append(shot.name)
                continue
            header = read_header(shot.picture)
            is_turned(
                shot.picture, header, header.size
            )  # refuses an EXIF rotation, as no file says whether to apply it
            lens = self.lens(shot.picture, header.size)
            if shot.depth is None:
                mapless.append(shot.name)
            if shot.labels is None:
                unlabelled.append(shot.name)
            frames.append(Frame(shot.name, shot.picture, lenses.setdefault(lens, lens), pose, shot.depth, shot.labels))
        count = len(self.shots)
        left_out = [
            *self.left_out,
            *note_lacking(lost, count, "frames have no finite pose and are left out"),
            *note_lacking(unposed, count, "frames have no pose and are left out"),
            *note_lacking(absent, count, "frames have no image"),
        ]
        if len(frames) < 2:
            raise InputError(
                self.path, "at least two usable frames", f"{len(frames)}", self.layout, " ".join(left_out) or None
            )
        return Scene(
            path=self.path,
            name=self.name,
            layout=self.layout,
            unit=self.unit,
            frames=tuple(frames),
            classes=self.classes if len(unlabelled) < len(frames) else None,
            absent=tuple(absent),
            notes=(
                *self.notes,
                *left_out,
                *(note_lacking(mapless, count, "frames have no depth map") if len(mapless) < len(frames) else []),
                *(note_lacking(unlabelled, count, "frames have no class map") if len(unlabelled) < len(frames) else []),
            ),
        )


def numbered_files(folder: Path, start: str = "", endings: Sequence[str] = PICTURES) -> dict[int, Path]:
    """The files of a folder named `start`, a number and one of the endings, sorted by number.

    If a number has several endings, the first ending counts.

    Raises:
        InputError: two files have the same number and ending, such as 1.jpg and 01.jpg.
    """
    found: dict[int, tuple[int, Path]] = {}
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        for rank, ending in enumerate(endings):
            digits = path.name.lower().removeprefix(start.lower()).removesuffix(ending)
            if path.name.lower() == f"{start.lower()}{digits}{ending}" and digits.isdecimal():
                held = found.setdefault(int(digits), (rank, path))
                if held[0] == rank and held[1] != path:
                    raise InputError(folder, "one file of each number", f"{held[1].name} and {path.name}")
                found[int(digits)] = min(held, (rank, path))
    return {number: found[number][1] for number in sorted(found)}


def pictures_in(folder: Path) -> list[Path]:
    """The images of a folder that are not hidden, sorted by name."""
    return sorted(one for one in folder.iterdir() if one.suffix.lower() in PICTURES and not one.name.startswith("."))


def first_file(folders: Iterable[Path], names: Sequence[str]) -> Path | None:
    """The first existing file with one of these names, looking through the folders in order; None if there is none."""
    places = (folder / name for folder in folders if may_read(folder) for name in names)
    return next((one for one in places if one.is_file()), None)


def sequence_name(path: Path) -> str:
    """The name of a scene. If its folder has a generic name (seq-01), the names of the folders above are put before it."""
    path = path.absolute()
    parts = [path.name]
    while parts[0].lower().rstrip("0123456789").rstrip("-_") in GENERIC and path.parent.name:
        path = path.parent
        parts.insert(0, path.name)
    return "_".join(parts)


def _checked(poses: Sequence[FoundPose]) -> np.ndarray:
    """Poses as rigid motions [n 4 4]."""
    checked = np.zeros((len(poses), 4, 4))
    by_file: dict[Stored, list[int]] = {}
    for index, pose in enumerate(poses):
        by_file.setdefault(pose.path, []).append(index)
    for file, indices in by_file.items():
        some = [poses[index] for index in indices]
        checked[indices] = checked_poses(file, [pose.matrix for pose in some], [pose.place for pose in some])
    return checked


def note_lacking(names: Sequence[str], count: int, what: str) -> list[str]:
    """A note: how many of `count` frames lack something, and the first of them. Empty if there are none.

    Args:
        names: of those frames.
        count: of all frames.
        what: what they lack ("frames have no depth").
    """
    return [f"{len(names)} of {count} {what}, the first is {names[0]}."] if names else []


def note_transparent(count: int, masks: str) -> list[str]:
    """A note about images with transparent areas, if there are any.

    Args:
        count: how many.
        masks: where the layout has masks ("mask_path of its frame").
    """
    if not count:
        return []
    images = counted(count, "image has", "images have")
    return [
        f"{images} an alpha channel; transparent areas become white. To hide them, write a mask of each image (black = hidden): {masks}."
    ]


def note_damaged_points(error: InputError | None) -> list[str]:
    """A note about sparse points that cannot be read, if so; a scene does not need them."""
    return [f"The sparse points are left out: {error}."] if error else []
