"""Batches: what step k of a run sees, as a pure function of (seed, k), prepared ahead in worker processes."""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch.utils.data import DataLoader, Dataset

from semgs.data.scenes import scene_paths
from semgs.data.views import Batch, stack
from semgs.data.workers import settle_worker
from semgs.rooms.assets.library import Library
from semgs.rooms.assets.splits import Split
from semgs.rooms.sets.pool import PooledSamples
from semgs.rooms.sets.stream import RoomSamples
from semgs.training.samples import Folder, Sample, Samples
from semgs.training.settings import VALIDATION_SEED, Augmentation, TrainingSettings
from semgs.training.source import Source
from semgs.training.survey.survey import Survey, survey
from semgs.training.teacher import teacher_of
from semgs.training.turns import Turns

COUNTED_ROOMS = 64
"""Rooms in which classes are counted, two small views of each."""

COUNTED_SIZE = (48, 64)


@dataclass(frozen=True)
class Share:
    """Which of the scenes of a step one process takes, and in how many pieces one after the other.

    Attributes:
        rank: number of the process.
        world: how many there are.
        accumulate: pieces, whose gradients are added.
    """

    rank: int = 0
    world: int = 1
    accumulate: int = 1

    def check(self, batch: int) -> None:
        """Refuse a batch that cannot be shared equally.

        Raises:
            ValueError: it cannot.
        """
        parts = self.world * self.accumulate
        if self.accumulate < 1 or batch % parts:
            raise ValueError(
                f"a step of {batch} scenes cannot be shared by {self.world} processes in {self.accumulate} pieces each; "
                f"expected a --batch that {parts} divides"
            )

    def pieces(self, step: int, batch: int) -> list[range]:
        """The numbers of the samples of each piece."""
        each = batch // (self.world * self.accumulate)
        first = step * batch + self.rank * self.accumulate * each
        return [range(first + piece * each, first + (piece + 1) * each) for piece in range(self.accumulate)]


@dataclass(frozen=True)
class Portion:
    """What one process sees of a step.

    Attributes:
        pieces: batches of equal size, whose gradients are averaged.
        bad: scenes that could not be read and were passed over: path and why.
        failure: what went wrong, if there is nothing to see. A loader would keep no more of an error than its type and text.
    """

    pieces: tuple[Batch, ...]
    bad: tuple[tuple[str, str], ...] = ()
    failure: Exception | None = None


class Portions(Dataset):
    """The portion of each step, made when it is asked for.

    Args:
        samples: by number, grouped by `batch`.
        batch: scenes per step.
        share: of this process.
        steps: of the run.
    """

    def __init__(self, samples: Samples, batch: int, share: Share, steps: int) -> None:
        share.check(batch)
        self._samples, self._batch, self._share, self._steps = samples, batch, share, steps

    def __len__(self) -> int:
        return self._steps

    def __getitem__(self, step: int) -> Portion:
        """The portion of a step."""
        try:
            pieces = [[self._samples[k] for k in piece] for piece in self._share.pieces(step, self._batch)]
        except Exception as error:
            error.add_note(f"while step {step} was prepared:\n{traceback.format_exc()}")
            return Portion((), failure=error)
        bad = dict(one for piece in pieces for sample in piece for one in sample.bad)
        return Portion(tuple(map(_batch, pieces)), tuple(bad.items()))


def training_batches(
    settings: TrainingSettings, data: Survey, start: int, workers: int, pool: Path, share: Share | None = None
) -> Iterable[Portion]:
    """The portions of steps start, start + 1, ..., in order, made by `workers` processes (0: in this one).

    Scenes that serve several samples are kept in the folder `pool`, which is made if it is needed. Assets are taken as they are;
    `semgs.rooms.assets.lock.verify` checks them.

    Raises:
        ValueError: a step cannot be shared equally.
        InputError: the folder of assets is none.
    """
    length = settings.steps * settings.batch
    weights = [float(source.weight) for source in settings.sources if not source.is_rooms]
    rooms: RoomSamples | PooledSamples | None = None
    live = [source for source in settings.sources if source.is_rooms]
    if live:
        weights.insert(0, float(sum(source.weight for source in live)))
        library = _library(settings, "training")
        rooms = RoomSamples(
            settings.seed, settings.size, settings.contexts, settings.targets, length,
            group=settings.batch, library=library,
        )  # fmt: skip
        if settings.scene_reuse > 1:
            # Only a part of the samples is of rooms: so many more have to pass until a scene has served its number.
            served = max(1, round(settings.scene_reuse * sum(weights) / weights[0]))
            rooms = PooledSamples(pool, rooms, served)
    samples = Samples(
        settings.seed, settings.size, settings.batch, rooms, data.folders, weights,
        (settings.contexts, settings.targets), data.classes, settings.augmentation, settings.frames,
        _turns(settings, settings.seed, weights, rooms, data.folders, settings.batch, length), teacher_of(settings),
        settings.batch * round(settings.half_size * settings.steps),
    )  # fmt: skip
    return DataLoader(
        Portions(samples, settings.batch, share or Share(), settings.steps),
        batch_size=None,
        sampler=range(start, settings.steps),
        num_workers=workers,
        # A forked process in which numba has run its threads dies at its next kernel.
        multiprocessing_context="forkserver" if workers else None,
        prefetch_factor=4 if workers else None,
        worker_init_fn=settle_worker,
    )


def surveyed(settings: TrainingSettings, out: Path) -> Survey:
    """What the data of a run are; see `semgs.training.survey.survey.survey`."""

    def rooms() -> RoomSamples:
        library = _library(settings, "training")
        return RoomSamples(settings.seed, COUNTED_SIZE, 2, 0, COUNTED_ROOMS, library=library)

    return survey(settings, out, rooms)


def validation_batches(settings: TrainingSettings, data: Survey) -> list[Batch]:
    """The validation samples, one scene a batch, with the fewest input views that the training uses.

    Raises:
        InputError: the scenes to validate with cannot be used.
    """
    count = settings.validation_scenes
    if not count:
        return []
    fewest = settings.contexts[0]
    rooms = folders = None
    source = Source.parsed(settings.validation)
    if source.is_rooms:
        rooms = RoomSamples(
            VALIDATION_SEED, settings.size, (fewest, fewest), settings.targets, length=count,
            library=_library(settings, "validation"),
        )  # fmt: skip
    else:
        folders = Folder(scene_paths(source.path))
    samples = Samples(
        VALIDATION_SEED, settings.size, 1, rooms, [folders] if folders else [], [1.0],
        ((fewest, fewest), settings.targets), data.classes, Augmentation(), settings.frames,
        _turns(settings, VALIDATION_SEED, [1.0], rooms, [folders] if folders else [], 1, count),
    )  # fmt: skip
    return [_batch([samples[k]]) for k in range(count)]


def _turns(
    settings: TrainingSettings,
    seed: int,
    weights: Sequence[float],
    rooms: object,
    folders: Sequence[Folder],
    gap: int,
    length: int,
) -> Turns | None:
    """Whose turn it is in samples of single pictures; None for samples of several views, whose scenes are drawn."""
    if not settings.single_pictures:
        return None
    scenes = [*([] if rooms is None else [0]), *(len(folder.paths) for folder in folders)]
    return Turns(seed, weights, scenes, gap, length)


def _batch(samples: Sequence[Sample]) -> Batch:
    """Samples as one batch."""
    taught = [sample.taught for sample in samples if sample.taught is not None]
    return Batch(
        stack([sample.context for sample in samples]),
        stack([sample.target for sample in samples]),
        tuple(sample.scene for sample in samples),
        torch.stack(taught) if taught else None,
    )


def _library(settings: TrainingSettings, split: Split) -> Library | None:
    """The assets of one split, not checked again."""
    return Library(settings.assets, split, check=False) if settings.assets else None
