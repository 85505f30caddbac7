"""The wall of the tests of reconstructions, and the network that knows its depth."""

from run.conftest import colour_oracle, oracle, wall_scene

__all__ = ["colour_oracle", "oracle", "wall_scene"]
