"""The old name of `semgs.rooms.sets.stream`; it goes with the next release."""

from semgs.rooms.sets.stream import RoomSamples, sample

__all__ = ["RoomSamples", "sample"]
