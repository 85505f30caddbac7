"""Stages: the parts of the forward pass, and context managers around them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

STAGES = ("cnn", "transformer_colour", "transformer_semantic", "cost_volume", "depth", "heads")
"""The stages, in order."""

Stage = Callable[[str], AbstractContextManager[object]]
"""From a stage's name to a context manager around it."""
