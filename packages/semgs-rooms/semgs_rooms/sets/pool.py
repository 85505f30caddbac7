"""A pool of scenes on disk from which samples are taken, so that each scene serves many samples.

    sample k uses one of the scenes  k // served ... k // served + WINDOW - 1  and some of its frames, chosen by a hash of (seed, k)

The window moves by one scene every `served` samples, so each scene serves that many samples on average. A worker that needs a
missing scene generates it. A sample is a pure function of (seed, k), independent of the pool's state, so workers need not
communicate. Scenes behind the windows of all samples that may still be read are removed.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from torch.utils.data import Dataset

from semgs.data.scenes import open_scene
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.files.errors import InputError
from semgs_rooms.sets.dataset import scene_name
from semgs_rooms.sets.room_scenes import ROOM, RoomSettings, write_scene
from semgs_rooms.sets.room_stream import RoomSamples

FRAMES = 12
"""Frames of a scene."""
WINDOW = 48
"""Number of scenes from which a sample is chosen."""


class PooledSamples(Dataset):
    """Samples like those of `RoomSamples`, but from scenes that each serve several: cheaper, and less varied.

    Input views are one to three frames apart, as the length of the scene allows; target views are other frames between and beside
    them.

    Args:
        folder: of the pool; created if missing. Pools of other seeds, sizes or libraries need other folders.
        rooms: the samples' seed, size, numbers of views, length, group and library.
        served: samples that a scene serves on average.
        ahead: how many samples before k some worker may still be reading while another one reads sample k.

    Raises:
        ValueError: `served` is not positive, or a sample may need more frames than a scene has.
    """

    def __init__(self, folder: str | Path, rooms: RoomSamples, served: int = 8, ahead: int = 0) -> None:
        self.folder, self.rooms, self.served, self.seed = Path(folder), rooms, served, rooms.seed
        self.ahead = ahead
        self._settings = RoomSettings(rooms.seed, rooms.size, FRAMES, library=rooms.library)
        if served < 1:
            raise ValueError(f"served is {served}; expected a positive number")
        (_, contexts), (_, targets) = rooms.ranges
        if contexts + targets > FRAMES:
            raise ValueError(
                f"up to {contexts} contexts and {targets} targets; expected at most {FRAMES} together, the frames of a scene"
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
        views = open_scene(self._scene_folder(scene)).read([*contexts, *targets], "native", INDOOR_DEPTH_RANGE)
        self._remove_before(min(k // self.served - WINDOW, (k - self.ahead) // self.served))
        return views.select(range(len(contexts))), views.select(range(len(contexts), len(views)))

    def counts(self, k: int) -> tuple[int, int]:
        """Number of input and target views of sample k."""
        _, contexts, targets = self.choice(k)
        return len(contexts), len(targets)

    def choice(self, k: int) -> tuple[int, list[int], list[int]]:
        """The scene of sample k, and which of its frames are contexts and targets."""
        shared = np.random.default_rng((self.seed, k // self.rooms.group, 2))
        count, extra = (int(shared.integers(low, high + 1)) for low, high in self.rooms.ranges)
        rng = np.random.default_rng((self.seed, k, 3))
        scene = k // self.served + int(rng.integers(WINDOW))
        if count + extra == 1:  # single images: no scene serves two samples of a group
            place = k % self.rooms.group
            scene = (k - place) // self.served + int(shared.permutation(WINDOW)[place % WINDOW])
        widest = 3 if count == 1 else min(3, (FRAMES - 1) // (count - 1))
        gap = int(rng.integers(1, widest + 1))
        start = int(rng.integers(FRAMES - gap * (count - 1)))
        contexts = [start + gap * i for i in range(count)]
        others = np.array([frame for frame in range(FRAMES) if frame not in contexts])
        # Frames closest to the middle of the contexts come first, up to some randomness.
        distance = np.abs(others - np.mean(contexts)) + rng.uniform(0, 0.5 + gap, len(others))
        targets = [int(frame) for frame in others[np.argsort(distance)][:extra]]
        return scene, contexts, targets

    def _scene_folder(self, index: int) -> Path:
        """The folder of a scene, which is generated if it is missing."""
        folder = self.folder / scene_name(index)
        if not (folder / ROOM).is_file():
            try:
                write_scene(folder, self._settings, index)
            except InputError:
                # Another worker was faster; its scene is the same.
                if not (folder / ROOM).is_file():
                    raise
        return folder

    def _remove_before(self, index: int) -> None:
        """Remove scenes that no worker can still be reading."""
        for past in range(max(0, index - 4), index):
            shutil.rmtree(self.folder / scene_name(past), ignore_errors=True)
