"""The old name of `semgs.rooms.sets.dataset`; it goes with the next release."""

from semgs.rooms.sets.dataset import Recipe, write_dataset

__all__ = ["Recipe", "write_dataset"]
