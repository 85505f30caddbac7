"""Old name of `semgs.rooms.sets.demo`; removed in the next release."""

from semgs.rooms.sets.demo import demo_scene

__all__ = ["demo_scene"]
