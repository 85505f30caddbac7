"""Batches: what each step of a run sees, prepared ahead in worker processes. Batch k depends on the seed and k alone."""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch.utils.data import DataLoader, Dataset

from semgs.data.scenes import scene_paths
from semgs.data.tables.classes import ClassTable
from semgs.data.views import Batch, stack
from semgs.files.errors import InputError
from semgs.runtime.workers import settle_worker
from semgs.training.data.data_check.data_check import RunData
from semgs.training.data.data_settings import VALIDATION_SEED, DataSettings, Source, view_counts
from semgs.training.data.room_source import RoomSamples, room_source
from semgs.training.data.samples import Folder, Form, ImageSchedule, Mixture, Samples, TrainingSample
from semgs.training.data.teacher import Teacher
from semgs.training.run.execution import Share

AHEAD = 4
"""Steps that each worker prepares ahead, because steps differ in cost."""


@dataclass(frozen=True)
class Portion:
    """What one process sees of a step.

    Attributes:
        pieces: batches of equal size, whose gradients are averaged.
        bad: scenes that were skipped because they could not be read: path and reason.
        failure: the error, if there are no pieces. As a value, because a loader only passes on an error's type and text.
    """

    pieces: tuple[Batch, ...]
    bad: tuple[tuple[str, str], ...] = ()
    failure: Exception | None = None


class Portions(Dataset):
    """The portion of each step, made on request.

    Args:
        samples: by number; step k takes the next `batch` of them.
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
            error.add_note(f"while preparing step {step}:\n{traceback.format_exc()}")
            return Portion((), failure=error)
        bad = dict(scene for piece in pieces for sample in piece for scene in sample.bad)
        return Portion(tuple(map(_stack_samples, pieces)), tuple(bad.items()))


def training_batches(
    settings: DataSettings,
    data: RunData,
    steps: int,
    start: int = 0,
    *,
    pool: Path,
    workers: int = 0,
    cache: int = 0,
    share: Share | None = None,
    single_images: bool = False,
    teacher: Teacher | None = None,
) -> Iterable[Portion]:
    """The portions of steps start, start + 1, ..., in order.

    It has its own loader instead of `semgs.runtime.workers.outcomes`, because its workers prepare `AHEAD` steps ahead.
    Assets are not checked here; `RoomSource.verify` does that.

    Args:
        settings: of the data.
        data: from `check_data`.
        steps: of the run.
        start: the first step.
        pool: folder for rooms that several samples share.
        workers: processes that prepare portions; 0 prepares them in this one.
        cache: how much memory each of them may use for decoded views of scenes in folders [bytes].
        share: of this process; None is all scenes of each step in one piece.
        single_images: each sample is a single image of another scene.
        teacher: of single images, if there is one.

    Raises:
        ValueError: a step cannot be shared equally.
        InputError: the asset folder is not one, or a sample needs more views than a room that several samples share has.
    """
    length = steps * settings.batch
    contexts, targets = view_counts(settings, single_images)
    weights = [float(source.weight) for source in settings.sources if not source.is_rooms]
    rooms: RoomSamples | None = None
    live = [source for source in settings.sources if source.is_rooms]
    if live:
        weights.insert(0, float(sum(source.weight for source in live)))
        generator = room_source()
        rooms = generator.samples(
            settings.seed, settings.size, contexts, targets, length=length, group=settings.batch, assets=settings.assets
        )
        if settings.scene_reuse > 1:
            if (most := contexts[1] + targets) > generator.MOST_VIEWS:
                raise InputError(
                    "--scene-reuse", f"at most {generator.MOST_VIEWS} input and target views, which is what a room has", f"{most}",
                    advice="give fewer --contexts or --targets, or leave it out",
                )  # fmt: skip
            # Only some of the samples show rooms, so a room stays in the pool for that many more.
            served = max(1, round(settings.scene_reuse * sum(weights) / weights[0]))
            rooms = generator.pooled(pool, rooms, served, ahead=(AHEAD * workers + 2) * settings.batch)
    mixture = Mixture(rooms, data.folders, tuple(weights))
    form = Form(
        settings.size, contexts, targets, data.classes, settings.frames, settings.augmentation,
        halved=settings.batch * round(settings.half_size * steps),
    )  # fmt: skip
    schedule = _schedule_images(settings.seed, mixture, settings.batch, length) if single_images else None
    samples = Samples(settings.seed, mixture, form, settings.batch, schedule, teacher, cache)
    return DataLoader(
        Portions(samples, settings.batch, share or Share(), steps),
        batch_size=None,
        sampler=range(start, steps),
        num_workers=workers,
        # A forked process in which numba has run its threads dies at its next kernel.
        multiprocessing_context="forkserver" if workers else None,
        prefetch_factor=AHEAD if workers else None,
        worker_init_fn=settle_worker,
    )


def validation_batches(settings: DataSettings, classes: ClassTable, single_images: bool = False) -> list[Batch]:
    """The validation samples, one scene per batch, with the fewest input views that the training uses.

    Raises:
        InputError: the validation scenes cannot be used.
    """
    count = settings.validation_scenes
    if not count:
        return []
    (fewest, _), targets = view_counts(settings, single_images)
    form = Form(settings.size, (fewest, fewest), targets, classes, settings.frames)
    source = Source.parsed(settings.validation)
    if source.is_rooms:
        rooms = room_source().samples(
            VALIDATION_SEED,
            form.size,
            form.contexts,
            form.targets,
            length=count,
            assets=settings.assets,
            split="validation",
        )
        mixture = Mixture(rooms, (), (1.0,))
    else:
        mixture = Mixture(None, (Folder(scene_paths(source.path)),), (1.0,))
    schedule = _schedule_images(VALIDATION_SEED, mixture, 1, count) if single_images else None
    samples = Samples(VALIDATION_SEED, mixture, form, 1, schedule)
    return [_stack_samples([samples[k]]) for k in range(count)]


def _schedule_images(seed: int, mixture: Mixture, gap: int, length: int) -> ImageSchedule:
    """Which scene each sample of a single image shows."""
    scenes = [*([] if mixture.rooms is None else [0]), *(len(folder.paths) for folder in mixture.folders)]
    return ImageSchedule(seed, mixture.weights, scenes, gap, length)


def _stack_samples(samples: Sequence[TrainingSample]) -> Batch:
    """Samples as one batch."""
    taught = [sample.taught for sample in samples if sample.taught is not None]
    return Batch(
        stack([sample.context for sample in samples]),
        stack([sample.target for sample in samples]),
        tuple(sample.scene for sample in samples),
        torch.stack(taught) if taught else None,
    )
