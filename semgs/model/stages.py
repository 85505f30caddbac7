"""Stages: the parts of the network that take time, and what may stand around them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

STAGES = ("cnn", "transformer_colour", "transformer_semantic", "cost_volume", "depth", "heads")
"""In their order."""

Stage = Callable[[str], AbstractContextManager[object]]
"""What stands around each stage, given its name."""
