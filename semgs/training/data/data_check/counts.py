"""Count how often each class occurs, for class weights and balanced sampling."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.files.errors import InputError
from semgs.training.data.data_check.open_sources import OpenSource
from semgs.training.data.data_settings import DataSettings
from semgs.training.data.room_source import room_source
from semgs.training.data.samples import Folder, convert_labels

FRAMES_COUNTED = 4
"""Frames of each scene in which classes are counted; of images without cameras, which all show other rooms, every one is."""

COUNTED_ROOMS, COUNTED_SIZE = 64, (48, 64)
"""Rooms in which classes are counted, in two small views each."""

BALANCE = 0.5
"""Balanced sampling chooses a scene in proportion to the mean `inverse_frequency` of its pixels, with this power."""

Pixels = np.ndarray
"""Pixels of each class [class], float64."""


def inverse_frequency(shares: Pixels, power: float) -> tuple[float, ...]:
    """Factors 1 / share**power of each class, scaled so that labelled pixels have a mean of 1. A class that never occurs has the factor
    of the rarest.

    Raises:
        ValueError: no class occurs.
    """
    if not shares.sum() > 0:
        raise ValueError("no class of the table occurs in the data, so classes cannot be weighted by frequency")
    shares = shares / shares.sum()
    weights = np.where(shares > 0, shares, shares[shares > 0].min()) ** -power
    return tuple(float(weight) for weight in np.round(weights / (weights * shares).sum(), 4))


def count_pixels(settings: DataSettings, scenes: Sequence[Scene]) -> list[Pixels | None]:
    """Pixels of each class in each scene and, last, in some rooms; None for what has no labels."""
    classes = settings.table
    pixels: list[Pixels | None] = [
        _count_labels(_read_some(scene), classes) if scene.classes else None for scene in scenes
    ]
    if not any(source.is_rooms for source in settings.sources):
        return [*pixels, None]
    rooms = room_source().samples(settings.seed, COUNTED_SIZE, (2, 2), 0, length=COUNTED_ROOMS, assets=settings.assets)
    return [*pixels, _count_labels([rooms[k][0] for k in range(COUNTED_ROOMS)], classes)]


def any_labelled(settings: DataSettings, scenes: Sequence[Scene]) -> bool:
    """Whether a pixel of the frames in which classes are counted has a label of the table.

    Raises:
        InputError: none has, and a frame cannot be read, such as labels as colours.
    """
    unread = list[InputError]()
    labelled = (views for scene in scenes if scene.classes for views in _read_some(scene, unread))
    if any(_count_labels([views], settings.table).any() for views in labelled):
        return True
    if unread:
        raise unread[0]
    return False


def _read_some(scene: Scene, unread: list[InputError] | None = None) -> Iterator[Views]:
    """A few frames spread over a scene; errors of unreadable ones are added to `unread`, since training reports them."""
    count = FRAMES_COUNTED if scene.posed else len(scene)
    for index in spread(range(len(scene)), count):
        try:
            yield scene.read([index], "native", INDOOR_DEPTH_RANGE)  # labels need no depth range of their own
        except InputError as error:
            if unread is not None:
                unread.append(error)


def _count_labels(samples: Iterable[Views], classes: ClassTable) -> Pixels:
    """Pixels of each class of the table in some views."""
    total = np.zeros(len(classes))
    for views in samples:
        labels = convert_labels(views, classes).labels
        if labels is not None:
            total += np.bincount(labels[labels != IGNORE].numpy(), minlength=len(classes))
    return total


def class_shares(settings: DataSettings, opened: Sequence[OpenSource], pixels: Sequence[Pixels | None]) -> Pixels:
    """The share of each class in what the run sees: sources count by their weights, all scenes of a source equally."""
    total = np.zeros(len(settings.table))
    folders, counts = iter(opened), iter(pixels)
    for source in settings.sources:
        own = pixels[-1:] if source.is_rooms else [next(counts) for _ in next(folders).scenes]
        shares = [count / count.sum() for count in own if count is not None and count.sum() > 0]
        if shares:
            total += float(source.weight) * np.mean(shares, axis=0)
    return total


def make_folders(
    opened: Sequence[OpenSource], pixels: Sequence[Pixels | None], shares: Pixels | None
) -> tuple[Folder, ...]:
    """The scenes of each folder with their chances: equal, or with the shares of the classes higher for scenes with rare classes (`BALANCE`)."""
    factors = None if shares is None else np.array(inverse_frequency(shares, BALANCE))
    counts = iter(pixels)
    folders = []
    for source in opened:
        chances = np.ones(len(source.scenes))
        for index in range(len(source.scenes)):
            count = next(counts)
            if factors is not None and count is not None and count.sum() > 0:
                chances[index] = (count * factors).sum() / count.sum()
        paths = tuple(scene.path.absolute() for scene in source.scenes)
        folders.append(Folder(paths, tuple(float(chance) for chance in chances / chances.sum())))
    return tuple(folders)
