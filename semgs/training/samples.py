"""Samples: contexts and targets of one scene, from rooms or files, as a pure function of (seed, k) and of what the files hold."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from semgs.data.choice import consecutive, drawn
from semgs.data.classes import IGNORE, ClassTable
from semgs.data.depth_range import DepthRange
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.views import Views, joined
from semgs.files.errors import InputError
from semgs.rooms.sets.pool import PooledSamples
from semgs.rooms.sets.stream import RoomSamples
from semgs.training.augmentation import Variation, window
from semgs.training.settings import Augmentation
from semgs.training.teacher import Teacher, coordinates
from semgs.training.turns import Turn, Turns, frame_of

OPEN = 20_000
"""Frames of the scenes that a process keeps open, but for the last one: their headers, not their pictures."""

TRIES = 20
"""Scenes that are tried for a sample before it is given up."""


@dataclass(frozen=True)
class Sample:
    """One scene of a batch.

    Attributes:
        context: the input views.
        target: the views to compare with.
        scene: its name.
        bad: scenes that were tried before and could not be read: path and why.
        taught: the teacher's class probabilities of the context [v k h/8 w/8], 0 where it says nothing; None without a teacher.
    """

    context: Views
    target: Views
    scene: str
    bad: tuple[tuple[str, str], ...] = ()
    taught: Tensor | None = None


@dataclass(frozen=True)
class Folder:
    """The scenes of one source.

    Attributes:
        paths: where they are.
        chances: of each to be drawn, adding up to 1; none are equal ones.
    """

    paths: tuple[Path, ...]
    chances: tuple[float, ...] = ()


class Samples:
    """The samples of a run: sample k is of one of the sources, drawn by its weight, and the same whoever asks for it.

    Args:
        seed: of every choice; rooms have one of their own, as their stream has.
        size: image (height, width) [px].
        group: samples k with equal k // group have equal counts of views.
        rooms: rooms drawn live or pooled, None for none; their counts of views are those of all samples of the group.
        folders: the scenes of every other source.
        weights: of the rooms, if there are any, then of each folder.
        counts: of views, where there are no rooms: fewest and most contexts, and targets.
        classes: the table that labels are brought to.
        augmentation: of every sample.
        frames: which frames of a scene in a folder go together.
        turns: which scene each sample is of, for samples of a single picture; None draws them.
        teacher: of single pictures, if there is one.
        halved: samples before this number have half the size.
    """

    def __init__(
        self,
        seed: int,
        size: tuple[int, int],
        group: int,
        rooms: RoomSamples | PooledSamples | None,
        folders: Sequence[Folder],
        weights: Sequence[float],
        counts: tuple[tuple[int, int], int],
        classes: ClassTable,
        augmentation: Augmentation,
        frames: Literal["covisible", "consecutive"] = "covisible",
        turns: Turns | None = None,
        teacher: Teacher | None = None,
        halved: int = 0,
    ) -> None:
        self._seed, self._size, self._group, self._halved = seed, size, group, halved
        self._rooms, self._folders, self._counts = rooms, tuple(folders), counts
        self._chances = np.array(weights, dtype=np.float64) / sum(weights)
        self._classes, self._augmentation = classes, augmentation
        self._choose = {"covisible": drawn, "consecutive": consecutive}[frames]
        self._turns, self._teacher = turns, teacher
        self._open: OrderedDict[Path, tuple[Scene, DepthRange]] = OrderedDict()
        self._open_frames = 0

    def __getitem__(self, k: int) -> Sample:
        """Sample k.

        Raises:
            InputError: twenty scenes, one after the other, could not be read.
        """
        turn = None if self._turns is None else self._turns[k]
        source = int(self._generator(k, 4).choice(len(self._chances), p=self._chances)) if turn is None else turn.source
        if self._rooms is not None and source == 0:
            context, target = self._rooms[k]
            sample = Sample(context, target, f"room {self._rooms.seed}/{k}")
        else:
            sample = self._from_files(k, self._folders[source - (self._rooms is not None)], turn)
        vary = Variation(self._augmentation, self._seed, k)
        height, width = self._size
        size = self._size if k >= self._halved else (height // 2, width // 2)
        context, target = (
            vary(completed(relabelled(views, self._classes)), size) for views in (sample.context, sample.target)
        )
        taught = None
        if self._teacher is not None:
            taught = self._teacher.followed(sample.taught, vary.placed(coordinates(sample.context), size))
        return replace(sample, context=context, target=target, taught=taught)

    def counts(self, k: int) -> tuple[int, int]:
        """How many contexts and targets sample k has."""
        if isinstance(self._rooms, RoomSamples):
            return self._rooms.counts(k)
        if self._rooms is not None:
            _, contexts, targets = self._rooms.choice(k)
            return len(contexts), len(targets)
        (fewest, most), others = self._counts
        return int(self._generator(k // self._group, 1).integers(fewest, most + 1)), others

    def _from_files(self, k: int, folder: Folder, turn: Turn | None) -> Sample:
        """Sample k from the first scene that can be read: the one whose turn it is, then those drawn for it."""
        rng = self._generator(k, 5)
        bad: dict[str, str] = {}
        for attempt in range(TRIES):
            if turn is not None and attempt == 0:
                path = folder.paths[turn.scene]
            else:
                path = folder.paths[int(rng.choice(len(folder.paths), p=folder.chances or None))]
            try:
                sample = self._drawn(path, k, rng) if turn is None else self._single(path, turn)
            except InputError as error:
                bad[str(path)] = str(error)
                continue
            return replace(sample, bad=tuple(bad.items()))
        first, why = next(iter(bad.items()))
        raise InputError(first, "a scene that can be read", why)

    def _drawn(self, path: Path, k: int, rng: np.random.Generator) -> Sample:
        """Frames of a scene that go together, drawn."""
        contexts, targets = self.counts(k)
        scene, bounds = self._opened(path)
        choice = self._choose(scene, bounds, contexts, targets, rng)
        views = self._read(scene, bounds, [*choice.context, *choice.targets])
        context, target = views.select(range(contexts)), views.select(range(contexts, contexts + targets))
        return Sample(context, target, scene.name)

    def _single(self, path: Path, turn: Turn) -> Sample:
        """One frame of a scene, the one whose turn it is, and nothing to compare with."""
        scene, bounds = self._opened(path)
        frame = frame_of(self._seed, turn, len(scene))
        views = self._read(scene, bounds, [frame], with_depths=False)
        taught = None if self._teacher is None else self._teacher.maps(scene, frame)
        return Sample(views, views.select([]), scene.name, taught=taught)

    def _opened(self, path: Path) -> tuple[Scene, DepthRange]:
        """A scene and its near and far, kept for the next time."""
        if path not in self._open:
            scene = open_scene(path)
            self._open[path] = scene, scene.depth_range()
            self._open_frames += len(scene.frames)
            while self._open_frames > OPEN and len(self._open) > 1:
                self._open_frames -= len(self._open.popitem(last=False)[1][0].frames)
        self._open.move_to_end(path)
        return self._open[path]

    def _read(self, scene: Scene, bounds: DepthRange, frames: Sequence[int], with_depths: bool = True) -> Views:
        """Frames of a scene at one size, which those of the first are brought to."""
        chosen = [scene.frames[index] for index in frames]
        if not with_depths:
            chosen = [replace(frame, depth=None) for frame in chosen]
        views = [frame.view((bounds.near, bounds.far), scene.classes) for frame in chosen]
        return scene.local(joined([window(view, views[0].size) for view in views])).checked()

    def _generator(self, k: int, purpose: int) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence((self._seed, k, purpose))))


def relabelled(views: Views, table: ClassTable) -> Views:
    """The views with their labels in another table: by the names of the classes; what the table does not have is ignored."""
    if views.classes == table:
        return views
    if views.labels is None:
        return views.changed(classes=table)
    places = [table.names.index(name) if name in table.names else IGNORE for name in views.classes.names]
    lookup = torch.tensor([*places, *[IGNORE] * (256 - len(places))], dtype=torch.uint8)
    return views.changed(labels=lookup[views.labels.long()], classes=table)


def completed(views: Views) -> Views:
    """The views with labels and depths: all ignored, all unknown, where there are none, so that unlike scenes share a batch."""

    if views.labels is not None and views.depths is not None:
        return views

    def filled(maps: Tensor | None, value: int, dtype: torch.dtype) -> Tensor:
        shape = (*views.images.shape[:-3], *views.images.shape[-2:])
        return torch.full(shape, value, dtype=dtype) if maps is None else maps

    return views.changed(
        labels=filled(views.labels, IGNORE, torch.uint8), depths=filled(views.depths, 0, torch.float32)
    )
