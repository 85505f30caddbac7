"""How well things keep their numbers: rooms that are walked twice, with `semgs.Ids` after each update of the map.

    python scripts/ids_over_time.py small ROOMS [ROOMS ...] --rooms 12

The rooms need true classes and things, as `semgs rooms` draws them. Each is walked forward and back through all frames in one map, and forward through every second frame and back
through the others with a new map for the way back. The true thing of a Gaussian is that of the first pixel of its block: a class and a number, as for `semgs evaluate --panoptic`.
The true thing of an id is that of most of its Gaussians. Prints a Markdown table for each folder.

Columns: updates; true things that were found in three updates or more; how many of them had one id in all of these, where of two ids at once that with more Gaussians counts;
all ids; those that were of two true things; ids in the last map; those of no true thing; and those of a true thing that another id has more of.

Rows: the numbers of `semgs.objects` alone, ids by voxels alone, and ids by Gaussians and voxels.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

import semgs
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene, scene_paths
from semgs.files.errors import InputError
from semgs.mapping.stream import StreamedScene
from semgs.model.encode import Network
from semgs.robotics.objects import Objects

SIZE = (240, 320)
CLASSES = 256
"""A true thing is its number times this plus its class; 0 is none."""

OFTEN = 3
"""True things that were found in fewer updates do not count."""

HEAD = ("updates", "things", "one id", "ids", "of two things", "at the end", "of none", "second")


class Tally:
    """What the ids of one walk did.

    Args:
        number: gives things numbers that last.
    """

    def __init__(self, number: Callable[[Objects, StreamedScene], Objects]) -> None:
        self._number, self._updates = number, 0
        self._ids_of: dict[int, list[int]] = defaultdict(list)
        self._things_of: dict[int, set[int]] = defaultdict(set)
        self._last: list[int] = []

    def add(self, found: Objects, scene: StreamedScene, true: np.ndarray) -> None:
        """One update: its things before they are numbered, the map, and the true thing of each Gaussian [g]."""
        found, self._updates, shares = self._number(found, scene), self._updates + 1, []
        for thing in found.things:
            names, counts = np.unique(true[found.instances == thing.instance], return_counts=True)
            shares.append((int(counts.max()), int(names[counts.argmax()]), thing.instance))
        self._last = [name for _, name, _ in shares]
        for name, instance in {name: instance for _, name, instance in sorted(shares)}.items():
            self._ids_of[name].append(instance)
        for _, name, instance in shares:
            self._things_of[instance].add(name)

    @property
    def row(self) -> np.ndarray:
        """The columns of `HEAD`."""
        often = [len(set(ids)) for name, ids in self._ids_of.items() if name and len(ids) >= OFTEN]
        two = sum(len(names - {0}) > 1 for names in self._things_of.values())
        known = [name for name in self._last if name]
        ids = (len(self._things_of), two, len(self._last), len(self._last) - len(known), len(known) - len(set(known)))
        return np.array([self._updates, len(often), often.count(1), *ids])


def updates(
    network: Network, scene: Scene, ways: Sequence[Sequence[int]]
) -> Iterator[tuple[StreamedScene, np.ndarray]]:
    """The maps of a walk, and the true thing of each Gaussian [g]. Each way is some frames, with a map of its own."""
    for way in ways:
        frames, truth = [], []
        for at in way:
            view = scene.read([at], SIZE, fit="stretch")
            numbers = scene.frames[at].things(view)
            if view.labels is None or numbers is None:
                raise InputError(scene.path, "a scene with true classes and things", "one without")
            truth.append(np.where(numbers > 0, numbers.astype(np.int64) * CLASSES + view.labels[0].numpy(), 0))
            frames.append((view.images[0], view.cameras.world_from_camera[0], view.cameras.intrinsics[0]))
        for now in semgs.stream(frames, network, size=SIZE):
            stride = now.encoding.stride
            of_blocks = np.stack([truth[int(name)][::stride, ::stride] for name in now.names]).ravel()
            yield now, of_blocks[now.encoding.blocks.numpy()]


def tallies() -> dict[str, Tally]:
    """The ways to number things, without any yet."""
    by_voxels, by_both = semgs.Ids(), semgs.Ids()
    return {
        "objects alone": Tally(lambda found, _: found),
        "voxels": Tally(lambda found, scene: by_voxels.update(found, scene.gaussians)),
        "Gaussians and voxels": Tally(lambda found, scene: by_both.update(found, scene.gaussians, scene.sources)),
    }


def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights")
    parser.add_argument("data", nargs="+", type=Path)
    parser.add_argument("--rooms", type=int, default=12, help="at most this many of each folder")
    arguments = parser.parse_args()
    network = semgs.load(arguments.weights)
    for data in arguments.data:
        rows: dict[str, np.ndarray] = defaultdict(lambda: np.zeros(len(HEAD), np.int64))
        paths = scene_paths(data)[: arguments.rooms]
        for path in paths:
            scene = open_scene(path)
            every = range(len(scene))
            for walk, ways in (("one map", [[*every, *every[::-1]]]), ("new map", [every[::2], every[1::2][::-1]])):
                numbered = tallies()
                for now, true in updates(network, scene, ways):
                    found = semgs.objects(now.gaussians)
                    for tally in numbered.values():
                        tally.add(found, now, true)
                for name, tally in numbered.items():
                    rows[f"{walk} | {name}"] += tally.row
        print(f"\n{data.name}, {len(paths)} rooms\n\n| map | numbers | {' | '.join(HEAD)} |")
        print("|" + " --- |" * (len(HEAD) + 2))
        for name, row in rows.items():
            print(f"| {name} | {' | '.join(map(str, row))} |", flush=True)


if __name__ == "__main__":
    try:
        main()
    except (InputError, ImportError) as error:
        sys.exit(f"error: {error}")
