"""Samples: input and target views of one scene, from generated rooms or from files. Sample k depends on the seed and k alone.

Single images take turns: all scenes of a folder come equally often, and none comes twice in a batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from cachetools import LRUCache, cached
from torch import Tensor

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.choosing.choice import draw_consecutive, draw_sample
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import Views, joined
from semgs.files.errors import InputError
from semgs.training.data.augmentation import Variation, crop_to_size
from semgs.training.data.data_settings import Augmentation
from semgs.training.data.room_source import RoomSamples
from semgs.training.data.teacher import Teacher, coordinates

GOLDEN = (5**0.5 - 1) / 2
"""Multiples of it modulo 1 fill the unit interval evenly, however many there are (golden ratio)."""


@dataclass(frozen=True)
class Turn:
    """One sample.

    Attributes:
        source: the number of its source.
        scene: the number of its scene in that source.
        round: how many turns that scene has had before.
    """

    source: int
    scene: int
    round: int


class ImageSchedule:
    """Whose turn k is; it depends on the seed and k alone. Sources come in proportion to their weights, the scenes of each in rounds.

    In every round each scene of a source comes once, in a new order. Between two turns of a scene there are at least `gap` - 1 turns of
    other scenes of its source, or turns of all others if there are fewer.

    Args:
        seed: of every order.
        weights: of the sources.
        scenes: how many scenes each source has; 0 for an endless source, whose scenes are numbered by k.
        gap: scenes per step.
        length: how many turns there are.
    """

    def __init__(self, seed: int, weights: Sequence[float], scenes: Sequence[int], gap: int, length: int) -> None:
        self._seed, self._scenes, self._gap = seed, tuple(scenes), gap
        start = float(self._generator(0, 0).random())
        places = (start + GOLDEN * np.arange(length)) % 1
        ends = np.cumsum(np.array(weights, dtype=np.float64) / sum(weights))[:-1]
        self._sources = np.searchsorted(ends, places, side="right").astype(np.int32)
        self._earlier = np.zeros(length, dtype=np.int64)  # turns of the same source before this one
        for source in range(len(self._scenes)):
            own = self._sources == source
            self._earlier[own] = np.arange(own.sum())
        self._orders: dict[int, list[list[int]]] = {source: [] for source in range(len(self._scenes))}

    def __getitem__(self, k: int) -> Turn:
        """Turn k."""
        source, earlier = int(self._sources[k]), int(self._earlier[k])
        if not self._scenes[source]:
            return Turn(source, k, 0)
        done, place = divmod(earlier, self._scenes[source])
        return Turn(source, self._order(source, done)[place], done)

    def _order(self, source: int, number: int) -> list[int]:
        """The scenes of a source in the order of a round."""
        orders, count = self._orders[source], self._scenes[source]
        while len(orders) <= number:
            shuffled = self._generator(source + 1, len(orders)).permutation(count).tolist()
            orders.append(_keep_apart(orders[-1] if orders else [], shuffled, min(self._gap, count)))
        return orders[number]

    def _generator(self, *which: int) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence((self._seed, 7, *which))))


def frame_of(seed: int, turn: Turn, frames: int) -> int:
    """Which frame of a scene a turn shows: each frame once before any comes again, in an order of the scene's own."""
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, 8, turn.source, turn.scene))))
    return int(rng.permutation(frames)[turn.round % frames])


def _keep_apart(before: Sequence[int], shuffled: Sequence[int], gap: int) -> list[int]:
    """The shuffled scenes, reordered as little as possible, so that none comes again within `gap` turns of its place in the last round."""
    waiting, order = list(shuffled), []
    for place in range(gap - 1 if before else 0):
        recent = set(before[len(before) - (gap - 1 - place) :])
        order.append(waiting.pop(next(at for at, scene in enumerate(waiting) if scene not in recent)))
    return order + waiting


OPEN = 20_000
"""A process keeps scenes open until they have more frames than this in total (headers, not images)."""

TRIES = 20
"""Scenes to try for a sample before giving up."""


@dataclass(frozen=True)
class TrainingSample:
    """One scene of a batch.

    Attributes:
        context: the input views.
        target: the target views.
        scene: its name.
        bad: scenes that were tried before and could not be read: path and reason.
        taught: the teacher's class probabilities for the input views [v k h/8 w/8], 0 where it has none; None without a teacher.
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
        chances: probability of each, adding up to 1; empty if all are equally likely.
    """

    paths: tuple[Path, ...]
    chances: tuple[float, ...] = ()


@dataclass(frozen=True)
class Mixture:
    """Where scenes come from.

    Attributes:
        rooms: generated live or pooled, None for none; their counts of views are those of all samples of the group.
        folders: the scenes of every other source.
        weights: of the rooms, if there are any, then of each folder.
    """

    rooms: RoomSamples | None
    folders: tuple[Folder, ...]
    weights: tuple[float, ...]


@dataclass(frozen=True)
class Form:
    """What every sample is made to be.

    Attributes:
        size: image (height, width) [px].
        contexts: fewest and most input views; rooms have counts of their own.
        targets: views to compare with.
        classes: the table that labels are converted to.
        frames: which frames of a scene in a folder go together.
        augmentation: random changes.
        halved: samples before this number have half the size.
    """

    size: tuple[int, int]
    contexts: tuple[int, int]
    targets: int
    classes: ClassTable
    frames: Literal["covisible", "consecutive"] = "covisible"
    augmentation: Augmentation = field(default_factory=Augmentation)
    halved: int = 0


class Samples:
    """The samples of a run: the source of sample k is chosen at random by its weight; sample k depends on the seed and k alone.

    Args:
        seed: of every choice; rooms have one of their own, as their stream has.
        mixture: where scenes come from.
        form: what every sample is made to be.
        group: samples k with equal k // group have equal counts of views.
        schedule: which scene each sample shows, for samples of a single image; None chooses scenes at random.
        teacher: of single images, if there is one.
        cache: how much memory decoded views of scenes in folders may take [bytes].
    """

    def __init__(
        self,
        seed: int,
        mixture: Mixture,
        form: Form,
        group: int,
        schedule: ImageSchedule | None = None,
        teacher: Teacher | None = None,
        cache: int = 0,
    ) -> None:
        self._seed, self._form, self._group = seed, form, group
        self._views: LRUCache[tuple[Path, int, bool], Views] = LRUCache(cache, _tensor_bytes)
        self._rooms, self._folders = mixture.rooms, mixture.folders
        self._chances = np.array(mixture.weights, dtype=np.float64) / sum(mixture.weights)
        self._choose = {"covisible": draw_sample, "consecutive": draw_consecutive}[form.frames]
        self._schedule, self._teacher = schedule, teacher
        self._open: LRUCache[Path, tuple[Scene, DepthRange]] = LRUCache(OPEN, _frame_count)

    def __getitem__(self, k: int) -> TrainingSample:
        """Sample k.

        Raises:
            InputError: twenty scenes in a row could not be read.
        """
        turn = None if self._schedule is None else self._schedule[k]
        source = int(self._generator(k, 4).choice(len(self._chances), p=self._chances)) if turn is None else turn.source
        if self._rooms is not None and source == 0:
            context, target = self._rooms[k]
            sample = TrainingSample(context, target, f"room {self._rooms.seed}/{k}")
        else:
            sample = self._from_files(k, self._folders[source - (self._rooms is not None)], turn)
        form, vary = self._form, Variation(self._form.augmentation, self._seed, k)
        size = form.size if k >= form.halved else (form.size[0] // 2, form.size[1] // 2)
        context, target = (
            vary(fill_missing_maps(convert_labels(views, form.classes)), size)
            for views in (sample.context, sample.target)
        )
        taught = None
        if self._teacher is not None:
            taught = self._teacher.augmented_maps(sample.taught, vary.move(coordinates(sample.context), size))
        return replace(sample, context=context, target=target, taught=taught)

    def counts(self, k: int) -> tuple[int, int]:
        """How many input and target views sample k has."""
        if self._rooms is not None:
            return self._rooms.counts(k)
        fewest, most = self._form.contexts
        return int(self._generator(k // self._group, 1).integers(fewest, most + 1)), self._form.targets

    def _from_files(self, k: int, folder: Folder, turn: Turn | None) -> TrainingSample:
        """Sample k from the first readable scene: the one whose turn it is, then scenes at random."""
        rng = self._generator(k, 5)
        bad: dict[str, str] = {}
        for attempt in range(TRIES):
            if turn is not None and attempt == 0:
                path = folder.paths[turn.scene]
            else:
                path = folder.paths[int(rng.choice(len(folder.paths), p=folder.chances or None))]
            try:
                sample = self._choose_views(path, k, rng) if turn is None else self._read_image(path, turn)
            except InputError as error:
                bad[str(path)] = str(error)
                continue
            return replace(sample, bad=tuple(bad.items()))
        first, why = next(iter(bad.items()))
        raise InputError(first, "a scene that can be read", why)

    def _choose_views(self, path: Path, k: int, rng: np.random.Generator) -> TrainingSample:
        """Frames of a scene that go together, chosen at random."""
        contexts, targets = self.counts(k)
        scene, bounds = self._open_scene(path)
        choice = self._choose(scene, bounds, contexts, targets, rng)
        views = self._read(path, [*choice.context, *choice.targets])
        context, target = views.select(range(contexts)), views.select(range(contexts, contexts + targets))
        return TrainingSample(context, target, scene.name)

    def _read_image(self, path: Path, turn: Turn) -> TrainingSample:
        """The frame of a scene whose turn it is, without target views."""
        scene, _ = self._open_scene(path)
        frame = frame_of(self._seed, turn, len(scene))
        views = self._read(path, [frame], with_depths=False)
        taught = None if self._teacher is None else self._teacher.maps(scene, frame)
        return TrainingSample(views, views.select([]), scene.name, taught=taught)

    def _open_scene(self, path: Path) -> tuple[Scene, DepthRange]:
        """A scene and its near and far; it stays open for the next time."""
        if path not in self._open:
            scene = open_scene(path, needs_cameras=False)
            self._open[path] = scene, scene.depth_range(stated=True)
        return self._open[path]

    def _read(self, path: Path, frames: Sequence[int], with_depths: bool = True) -> Views:
        """Frames of a scene, all at the size of the first."""
        scene, bounds = self._open_scene(path)

        @cached(self._views, key=lambda index: (path, index, with_depths))
        def read(index: int) -> Views:
            frame = scene.frames[index] if with_depths else replace(scene.frames[index], depth=None)
            return frame.view((bounds.near, bounds.far), scene.classes)

        views = [read(index) for index in frames]
        return scene.local(joined([crop_to_size(view, views[0].size) for view in views])).checked()

    def _generator(self, k: int, purpose: int) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence((self._seed, k, purpose))))


def _tensor_bytes(view: Views) -> int:
    """The memory of a view's pixels [bytes]; the few numbers of its camera do not count."""
    maps = (view.images, view.labels, view.depths, view.hidden)
    return sum(each.nbytes for each in maps if each is not None)


def _frame_count(opened: tuple[Scene, DepthRange]) -> int:
    """What an open scene takes of OPEN; one with more frames than that stays open alone."""
    return min(len(opened[0].frames), OPEN)


def convert_labels(views: Views, table: ClassTable) -> Views:
    """The views with their labels converted to another table by class name; classes that the table lacks are ignored."""
    if views.classes == table:
        return views
    if views.labels is None:
        return views.changed(classes=table)
    places = [table.names.index(name) if name in table.names else IGNORE for name in views.classes.names]
    lookup = torch.tensor([*places, *[IGNORE] * (256 - len(places))], dtype=torch.uint8)
    return views.changed(labels=lookup[views.labels.long()], classes=table)


def fill_missing_maps(views: Views) -> Views:
    """The views with labels and depths: 255 and 0 everywhere if they had none, so that different scenes fit in one batch."""

    if views.labels is not None and views.depths is not None:
        return views

    def fill(maps: Tensor | None, value: int, dtype: torch.dtype) -> Tensor:
        shape = (*views.images.shape[:-3], *views.images.shape[-2:])
        return torch.full(shape, value, dtype=dtype) if maps is None else maps

    return views.changed(labels=fill(views.labels, IGNORE, torch.uint8), depths=fill(views.depths, 0, torch.float32))
