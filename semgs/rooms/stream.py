"""Old name of `semgs.rooms.sets.stream`; removed in the next release."""

from semgs.rooms.sets.stream import RoomSamples, sample

__all__ = ["RoomSamples", "sample"]
