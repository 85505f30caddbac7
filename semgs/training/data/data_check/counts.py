"""Count how often each class occurs, for class weights and balanced sampling."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

import numpy as np

from semgs.data.scene import Scene
from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.rooms.sets.room_stream import RoomSamples
from semgs.training.data.data_check.open_sources import Opened
from semgs.training.data.samples import Folder, relabelled
from semgs.training.training_settings import TrainingSettings

FRAMES_COUNTED = 4
"""Frames of each scene in which classes are counted; of images without cameras, which all show other rooms, every one is."""

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


def count_pixels(
    settings: TrainingSettings, scenes: Sequence[Scene], rooms: Callable[[], RoomSamples], classes: ClassTable
) -> list[Pixels | None]:
    """Pixels of each class in each scene and, last, in some rooms; None if the settings do not need them."""
    if not isinstance(settings.class_weights, str) and settings.sampling == "even":
        return [None] * (len(scenes) + 1)
    pixels: list[Pixels | None] = [_counted(_some(scene), classes) if scene.classes else None for scene in scenes]
    if any(source.is_rooms for source in settings.sources):
        drawn = rooms()
        return [*pixels, _counted([drawn[k][0] for k in range(len(drawn))], classes)]
    return [*pixels, None]


def _some(scene: Scene) -> list[Views]:
    """A few frames spread over a scene; unreadable ones are skipped here, since training reports them."""
    views = []
    count = FRAMES_COUNTED if scene.posed else len(scene)
    for index in np.unique(np.linspace(0, len(scene) - 1, count).round().astype(int)):
        with contextlib.suppress(InputError):
            views.append(scene.read([int(index)], "native"))
    return views


def _counted(views: Sequence[Views], classes: ClassTable) -> Pixels:
    """Pixels of each class of the table in some views."""
    total = np.zeros(len(classes))
    for one in views:
        labels = relabelled(one, classes).labels
        if labels is not None:
            total += np.bincount(labels[labels != IGNORE].numpy(), minlength=len(classes))
    return total


def class_shares(
    settings: TrainingSettings, opened: Sequence[Opened], pixels: Sequence[Pixels | None], classes: ClassTable
) -> Pixels:
    """The share of each class in what the run sees: sources count by their weights, all scenes of a source equally."""
    total = np.zeros(len(classes))
    folders, counts = iter(opened), iter(pixels)
    for source in settings.sources:
        held = pixels[-1:] if source.is_rooms else [next(counts) for _ in next(folders).scenes]
        shares = [one / one.sum() for one in held if one is not None and one.sum() > 0]
        if shares:
            total += float(source.weight) * np.mean(shares, axis=0)
    return total


def with_chances(
    settings: TrainingSettings, opened: Sequence[Opened], pixels: Sequence[Pixels | None], shares: Pixels
) -> tuple[Folder, ...]:
    """The scenes of each folder with their chances: equal, or higher for scenes with rare classes (`BALANCE`)."""
    factors = np.array(inverse_frequency(shares, BALANCE)) if settings.sampling == "balanced" else None
    counts = iter(pixels)
    folders = []
    for folder in opened:
        chances = np.ones(len(folder.scenes))
        for index in range(len(folder.scenes)):
            held = next(counts)
            if factors is not None and held is not None and held.sum() > 0:
                chances[index] = (held * factors).sum() / held.sum()
        paths = tuple(scene.path.absolute() for scene in folder.scenes)
        folders.append(Folder(paths, tuple(float(one) for one in chances / chances.sum())))
    return tuple(folders)
