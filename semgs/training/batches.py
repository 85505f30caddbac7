"""Batches: what step k of a run sees, as a pure function of (seed, k), prepared ahead in worker processes."""

from __future__ import annotations

import signal
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from semgs.data.views import Batch, stack
from semgs.rooms.stream import sample
from semgs.training.settings import TrainingSettings

VALIDATION_SEED = 2**31 - 1
"""Seed of the validation rooms, the same for every run; a training may not use it."""


@dataclass(frozen=True)
class RoomBatches(Dataset):
    """Batches of rooms drawn from their seed.

    Attributes:
        seed: of the rooms.
        batch: scenes per batch.
        size: of the pictures, (height, width) [px].
        contexts: fewest and most input views.
        targets: views to render per scene.
    """

    seed: int
    batch: int
    size: tuple[int, int]
    contexts: tuple[int, int]
    targets: int

    def __getitem__(self, step: int) -> Batch:
        """The batch of a step. Its scenes are samples step * batch, step * batch + 1, ..."""
        fewest, most = self.contexts
        contexts = int(np.random.default_rng((self.seed, step)).integers(fewest, most + 1))
        indices = range(step * self.batch, (step + 1) * self.batch)
        pairs = [sample(self.seed, index, size=self.size, contexts=contexts, targets=self.targets) for index in indices]
        return Batch(
            context=stack([context for context, _ in pairs]),
            target=stack([target for _, target in pairs]),
            scenes=tuple(f"room {self.seed}/{index}" for index in indices),
        )


def training_batches(settings: TrainingSettings, start: int, workers: int) -> Iterable[Batch]:
    """The batches of steps start, start + 1, ..., in order, made by `workers` processes (0: in this one).

    Raises:
        ValueError: the seed is that of the validation rooms.
    """
    if settings.seed == VALIDATION_SEED:
        raise ValueError(f"seed is {settings.seed}, which is kept for the validation rooms; take another")
    rooms = RoomBatches(settings.seed, settings.batch, settings.size, settings.contexts, settings.targets)
    return DataLoader(
        rooms,
        batch_size=None,
        sampler=range(start, settings.steps),
        num_workers=workers,
        # A forked process in which numba has run its threads dies at its next kernel.
        multiprocessing_context="forkserver" if workers else None,
        prefetch_factor=4 if workers else None,
        worker_init_fn=_be_a_quiet_worker,
    )


def validation_batches(settings: TrainingSettings) -> list[Batch]:
    """The validation rooms, one scene a batch, with the fewest input views that the training uses."""
    fewest = settings.contexts[0]
    rooms = RoomBatches(VALIDATION_SEED, 1, settings.size, (fewest, fewest), settings.targets)
    return [rooms[index] for index in range(settings.validation_scenes)]


def _be_a_quiet_worker(index: int) -> None:
    """Settle a worker process: one thread, and signals meant for the run are left to the process that trains."""
    torch.set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
