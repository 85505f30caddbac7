"""The old name of `semgs.rooms.sets.demo`; it goes with the next release."""

from semgs.rooms.sets.demo import demo_scene

__all__ = ["demo_scene"]
