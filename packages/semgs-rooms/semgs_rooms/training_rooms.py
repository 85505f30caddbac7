"""Rooms as `semgs train` takes them (`semgs.training.data.room_source`); the entry point of this package names this module."""

from __future__ import annotations

from collections.abc import Sequence

from semgs_rooms.assets.asset_library import Library
from semgs_rooms.assets.lock import lock_digest as digest
from semgs_rooms.assets.lock import verify
from semgs_rooms.assets.splits import Split
from semgs_rooms.sets.pool import FRAMES as MOST_VIEWS
from semgs_rooms.sets.pool import PooledSamples as pooled
from semgs_rooms.sets.room_stream import RoomSamples

__all__ = ["MOST_VIEWS", "digest", "library", "pooled", "samples", "verify"]


def library(assets: Sequence[str], split: Split) -> Library | None:
    """The assets of one split; they were verified before. None without assets."""
    return Library(assets, split, check=False) if assets else None


def samples(
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
    """The first `length` samples of a seed, as `RoomSamples` has them; `assets` and `split` as for `library`."""
    return RoomSamples(seed, size, contexts, targets, length, group, library(assets, split))
