"""A pool of scenes on disk that samples are taken from, so that one drawn scene serves many samples.

    sample k  takes one of the scenes  k // served ... k // served + window - 1,  and some of its frames, by a hash of (seed, k)

The window moves on by one scene every `served` samples, so each scene serves that many on average. A scene that is not there is drawn when it
is asked for, by whichever worker asks: a sample is a pure function of (seed, k), whatever the pool holds, and nothing needs to be
told between processes. Scenes that the window has passed are removed.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from torch.utils.data import Dataset

from semgs.data.scenes import open_scene
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.rooms.sets.dataset import scene_name
from semgs.rooms.sets.scenes import ROOM, Recipe, write_scene
from semgs.rooms.sets.stream import RoomSamples

FRAMES = 12
"""Frames of a scene."""
WINDOW = 48
"""Scenes that samples are mixed from."""


class PooledSamples(Dataset):
    """Samples as `RoomSamples` gives them, from scenes that each serve several: cheaper, and less varied.

    Contexts are one to three frames apart, as many as the scene has room for; targets are other frames between them and
    beside them.

    Args:
        folder: of the pool; made if it is not there. Two pools of other seeds, sizes or libraries need two folders.
        rooms: the samples' seed, size, numbers of views, length, group and library.
        served: samples that a scene serves on average.

    Raises:
        ValueError: `served` is not positive, or a scene has fewer frames than a sample needs.
    """

    def __init__(self, folder: str | Path, rooms: RoomSamples, served: int = 8) -> None:
        self.folder, self.rooms, self.served, self.seed = Path(folder), rooms, served, rooms.seed
        self._recipe = Recipe(rooms.seed, rooms.size, FRAMES, library=rooms.library)
        if served < 1:
            raise ValueError(f"served is {served}; expected a positive number")
        (_, contexts), (_, targets) = rooms.ranges
        if contexts + targets > FRAMES:
            raise ValueError(
                f"up to {contexts} contexts and {targets} targets; expected at most the {FRAMES} frames of a scene"
            )

    def __len__(self) -> int:
        return len(self.rooms)

    def __getitem__(self, k: int) -> tuple[Views, Views]:
        """Context and target views of sample k.

        Raises:
            IndexError: k is not in 0 .. length - 1.
            OSError: the disk is full.
        """
        if not 0 <= k < len(self):
            raise IndexError(f"sample {k} of {len(self)}")
        scene, contexts, targets = self.choice(k)
        views = open_scene(self._drawn(scene)).read([*contexts, *targets], "native")
        self._remove_before(k // self.served - WINDOW)
        return views.select(range(len(contexts))), views.select(range(len(contexts), len(views)))

    def choice(self, k: int) -> tuple[int, list[int], list[int]]:
        """Which scene sample k is of, and which of its frames are its contexts and targets."""
        shared = np.random.default_rng((self.seed, k // self.rooms.group, 2))
        count, extra = (int(shared.integers(low, high + 1)) for low, high in self.rooms.ranges)
        rng = np.random.default_rng((self.seed, k, 3))
        scene = k // self.served + int(rng.integers(WINDOW))
        if count + extra == 1:  # single pictures: no scene serves two samples of a group
            place = k % self.rooms.group
            scene = (k - place) // self.served + int(shared.permutation(WINDOW)[place % WINDOW])
        widest = 3 if count == 1 else min(3, (FRAMES - 1) // (count - 1))
        gap = int(rng.integers(1, widest + 1))
        start = int(rng.integers(FRAMES - gap * (count - 1)))
        contexts = [start + gap * i for i in range(count)]
        others = np.array([frame for frame in range(FRAMES) if frame not in contexts])
        # Nearest to the contexts' middle first, but for a random half frame: between them, then beside them.
        distance = np.abs(others - np.mean(contexts)) + rng.uniform(0, 0.5 + gap, len(others))
        targets = [int(frame) for frame in others[np.argsort(distance)][:extra]]
        return scene, contexts, targets

    def _drawn(self, index: int) -> Path:
        """The folder of a scene, drawn now if it is not there."""
        folder = self.folder / scene_name(index)
        if not (folder / ROOM).is_file():
            try:
                write_scene(folder, self._recipe, index)
            except InputError:
                # Another worker was quicker; what is there now is the same.
                if not (folder / ROOM).is_file():
                    raise
        return folder

    def _remove_before(self, index: int) -> None:
        """Remove scenes that no worker can be reading any more."""
        for past in range(max(0, index - 4), index):
            shutil.rmtree(self.folder / scene_name(past), ignore_errors=True)
