"""Batches: what step k of a run sees, as a pure function of (seed, k), prepared ahead in worker processes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from torch.utils.data import DataLoader, Dataset

from semgs.data.views import Batch, stack
from semgs.data.workers import settle_worker
from semgs.rooms.assets.library import Library
from semgs.rooms.assets.splits import Split
from semgs.rooms.pool import PooledSamples
from semgs.rooms.stream import RoomSamples
from semgs.training.settings import VALIDATION_SEED, TrainingSettings


class RoomBatches(Dataset):
    """Batch k of a stream of rooms: its samples k * scenes, k * scenes + 1, ..., with equal numbers of views.

    Args:
        samples: grouped by `scenes`.
        scenes: per batch.
    """

    def __init__(self, samples: RoomSamples | PooledSamples, scenes: int) -> None:
        self._samples, self._scenes = samples, scenes

    def __len__(self) -> int:
        return len(self._samples) // self._scenes

    def __getitem__(self, step: int) -> Batch:
        """The batch of a step."""
        indices = range(step * self._scenes, (step + 1) * self._scenes)
        contexts, targets = zip(*(self._samples[index] for index in indices), strict=True)
        return Batch(stack(contexts), stack(targets), tuple(f"room {self._samples.seed}/{index}" for index in indices))


def training_batches(settings: TrainingSettings, start: int, workers: int, pool: Path) -> Iterable[Batch]:
    """The batches of steps start, start + 1, ..., in order, made by `workers` processes (0: in this one).

    Scenes that serve several samples are kept in the folder `pool`, which is made if it is needed. Assets are taken as they are;
    `semgs.rooms.assets.lock.verify` checks them.

    Raises:
        InputError: the folder of assets is none.
    """
    library = _library(settings, "training")
    length = settings.steps * settings.batch
    samples: RoomSamples | PooledSamples
    if settings.scene_reuse > 1:
        samples = PooledSamples(
            pool, settings.seed, settings.size, settings.contexts, settings.targets, length,
            served=settings.scene_reuse, group=settings.batch, library=library, style=settings.style,
        )  # fmt: skip
    else:
        samples = RoomSamples(
            settings.seed, settings.size, settings.contexts, settings.targets, length,
            group=settings.batch, library=library, style=settings.style,
        )  # fmt: skip
    rooms = RoomBatches(samples, settings.batch)
    return DataLoader(
        rooms,
        batch_size=None,
        sampler=range(start, settings.steps),
        num_workers=workers,
        # A forked process in which numba has run its threads dies at its next kernel.
        multiprocessing_context="forkserver" if workers else None,
        prefetch_factor=4 if workers else None,
        worker_init_fn=settle_worker,
    )


def validation_batches(settings: TrainingSettings) -> list[Batch]:
    """The validation rooms, one scene a batch, with the fewest input views that the training uses."""
    fewest = settings.contexts[0]
    count = settings.validation_scenes
    if not count:
        return []
    rooms = RoomBatches(
        RoomSamples(
            VALIDATION_SEED, settings.size, (fewest, fewest), settings.targets, length=count,
            library=_library(settings, "validation"),
        ),
        scenes=1,
    )  # fmt: skip
    return [rooms[index] for index in range(count)]


def _library(settings: TrainingSettings, split: Split) -> Library | None:
    """The assets of one split, not checked again."""
    return Library(settings.assets, split, check=False) if settings.assets else None
