"""Old name of `semgs.rooms.sets.dataset`; removed in the next release."""

from semgs.rooms.sets.dataset import Recipe, write_dataset

__all__ = ["Recipe", "write_dataset"]
