"""The scale of estimated cameras, from a distance that the user measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from semgs.files.text import listed
from semgs.sfm.pycolmap_library import pycolmap
from semgs.sfm.solving import PosedPhoto, Solution


@dataclass(frozen=True)
class KnownDistance:
    """The distance between the cameras of two photos.

    Attributes:
        first, second: the photos, as for `named_photo`.
        metres: between their cameras [m].

    Raises:
        ValueError: the distance is not positive.
    """

    first: str
    second: str
    metres: float

    def __post_init__(self) -> None:
        if not 0 < self.metres < np.inf:
            raise ValueError(f"the distance is {self.metres:g} m; expected more than 0")


def in_metres(solution: Solution, known: KnownDistance) -> Solution:
    """The same cameras and points in metres.

    Raises:
        ValueError: a photo is not among the registered ones, or the two cameras are in one place.
    """
    first, second = (named_photo(solution.photos, name) for name in (known.first, known.second))
    distance = float(np.linalg.norm(first.world_from_camera[:3, 3] - second.world_from_camera[:3, 3]))
    if not distance > 0:
        raise ValueError(f"--scale-from: {first.name} and {second.name} were taken from one place; name two others")
    scale = known.metres / distance
    if solution.model is not None:
        solution.model.transform(pycolmap().Sim3d(np.column_stack((scale * np.eye(3), np.zeros(3)))))
    photos = tuple(
        replace(photo, world_from_camera=scaled(photo.world_from_camera, scale)) for photo in solution.photos
    )
    note = f"The scale is from the {known.metres:g} m between the cameras of {first.name} and {second.name}."
    return replace(
        solution, photos=photos, points=scale * solution.points, unit="metric", notes=(*solution.notes, note)
    )


def scaled(world_from_camera: np.ndarray, scale: float) -> np.ndarray:
    """A pose [4 4] in a world whose unit of length is 1 / `scale` of the old one."""
    pose = world_from_camera.copy()
    pose[:3, 3] *= scale
    return pose


class NotPlacedError(ValueError):
    """A photo that should give the scale, but has no camera.

    Attributes:
        on_page: the same for people who see no command line.
    """

    def __init__(self, name: str, photos: Sequence[PosedPhoto]) -> None:
        there = f"{photos[0].name} to {photos[-1].name}, or 0 to {len(photos) - 1}"
        super().__init__(f"--scale-from: no camera was estimated for {name!r}; there are {there}")
        self.on_page = f"SemGS could not work out where {name} was taken, so it cannot give the scale. Choose another photo under Options"


def named_photo(photos: Sequence[PosedPhoto], name: str) -> PosedPhoto:
    """The photo that a user named: by the name that it had or that its copy has, with or without ending, or by its position among these from 0.

    Copies have other names than photos that were converted: a photo on its side, DSC_1.JPG, becomes DSC_1.jpg.

    Raises:
        NotPlacedError: it is not among these.
        ValueError: several have the name.
    """
    for alike in (str, str.casefold):
        wanted = PurePath(alike(name))
        for called in (
            lambda one: PurePath(one.original or one.name),
            lambda one: PurePath(one.original or one.name).with_suffix(""),
            lambda one: PurePath(one.name),
            lambda one: PurePath(one.name).with_suffix(""),
        ):
            found = [photo for photo in photos if _ends_alike(PurePath(alike(str(called(photo)))), wanted)]
            if len(found) == 1:
                return found[0]
            if found:
                names = listed([photo.name for photo in found])
                raise ValueError(f"--scale-from: {len(found)} photos are called {name!r}; their copies are {names}")
    if name.isdecimal() and int(name) < len(photos):
        return photos[int(name)]
    raise NotPlacedError(name, photos)


def _ends_alike(path: PurePath, wanted: PurePath) -> bool:
    """Whether two paths have the same name and, as far as both say, the same folders."""
    pairs = list(zip(reversed(path.parts), reversed(wanted.parts), strict=False))
    return bool(pairs) and all(one == other for one, other in pairs)
