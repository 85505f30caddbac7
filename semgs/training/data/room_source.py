"""Where generated rooms come from: a package of its own, `semgs-rooms`, which names itself by an entry point. Nothing here needs it until a training asks for rooms."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Literal, Protocol, runtime_checkable

from semgs.data.views import Views

GROUP = "semgs.rooms"
"""The group of the entry point."""

PACKAGE = "semgs_rooms"
MISSING = "generated rooms need the package semgs-rooms: pip install -e packages/semgs-rooms in SemGS's folder"

Split = Literal["training", "validation"]


@runtime_checkable
class RoomSamples(Protocol):
    """Samples of generated rooms: sample k is (input views, target views), a pure function of the seed and k."""

    @property
    def seed(self) -> int:
        """Of the samples."""

    def __getitem__(self, k: int) -> tuple[Views, Views]:
        """Sample k."""

    def counts(self, k: int) -> tuple[int, int]:
        """Number of input and target views of sample k."""


@runtime_checkable
class RoomSource(Protocol):
    """What generates rooms."""

    MOST_VIEWS: int
    """Input and target views together of a pooled sample."""

    def samples(
        self,
        seed: int,
        size: tuple[int, int],
        contexts: tuple[int, int],
        targets: int,
        *,
        length: int,
        group: int = 1,
        assets: Sequence[str] = (),
        split: Split = "training",
    ) -> RoomSamples:
        """The first `length` samples of a seed.

        Args:
            seed: of the samples.
            size: image (height, width) [px].
            contexts: fewest and most input views.
            targets: number of target views.
            length: number of samples.
            group: samples k with equal k // group have equal numbers of views.
            assets: folders of meshes and images, which were verified; none for built-in furniture.
            split: which of their pieces.
        """

    def pooled(self, folder: Path, rooms: RoomSamples, served: int, ahead: int) -> RoomSamples:
        """Samples like `rooms`, from scenes in a folder each of which serves several; `ahead` samples before k may still be read while k is."""

    def verify(self, folder: Path) -> None:
        """Check a folder of assets against its lock.

        Raises:
            InputError: a file is missing or another one.
        """

    def digest(self, folder: Path) -> str:
        """The SHA-256 of the lock of a folder of assets."""


@cache
def room_source() -> RoomSource:
    """The installed generator of rooms.

    Raises:
        ImportError: there is none; the message says how to install it.
    """
    found = list(entry_points(group=GROUP))
    if not found:
        raise ImportError(MISSING, name=PACKAGE)
    try:
        source: RoomSource = found[0].load()
    except ModuleNotFoundError as error:
        if error.name != PACKAGE:
            raise
        raise ImportError(MISSING, name=PACKAGE) from error  # installed from a folder that has moved
    return source
