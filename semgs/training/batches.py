"""Batches: what step k of a run sees, as a pure function of (seed, k), prepared ahead in worker processes."""

from __future__ import annotations

from collections.abc import Iterable

from torch.utils.data import DataLoader, Dataset

from semgs.data.views import Batch, stack
from semgs.rooms.stream import RoomSamples
from semgs.rooms.style import Style
from semgs.rooms.workers import settle_worker
from semgs.training.settings import VALIDATION_SEED, TrainingSettings


class RoomBatches(Dataset):
    """Batch k of a stream of rooms: its samples k * scenes, k * scenes + 1, ..., with equal numbers of views.

    Args:
        seed: the stream.
        size: of the pictures, (height, width) [px].
        contexts: fewest and most input views.
        targets: views to render per scene.
        scenes: per batch.
        length: number of batches.
        style: the world that the rooms are of.
    """

    def __init__(
        self,
        seed: int,
        size: tuple[int, int],
        contexts: tuple[int, int],
        targets: int,
        scenes: int,
        length: int,
        style: Style = "home",
    ) -> None:
        self._seed, self._scenes, self._length = seed, scenes, length
        self._samples = RoomSamples(seed, size, contexts, targets, length=length * scenes, group=scenes, style=style)

    def __len__(self) -> int:
        return self._length

    def __getitem__(self, step: int) -> Batch:
        """The batch of a step."""
        indices = range(step * self._scenes, (step + 1) * self._scenes)
        contexts, targets = zip(*(self._samples[index] for index in indices), strict=True)
        return Batch(stack(contexts), stack(targets), tuple(f"room {self._seed}/{index}" for index in indices))


def training_batches(settings: TrainingSettings, start: int, workers: int) -> Iterable[Batch]:
    """The batches of steps start, start + 1, ..., in order, made by `workers` processes (0: in this one)."""
    rooms = RoomBatches(
        settings.seed,
        settings.size,
        settings.contexts,
        settings.targets,
        settings.batch,
        settings.steps,
        settings.style,
    )
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
    rooms = RoomBatches(VALIDATION_SEED, settings.size, (fewest, fewest), settings.targets, scenes=1, length=count)
    return [rooms[index] for index in range(count)]
