"""Cameras in float32, as only the network in ONNX has them; everywhere else, type checks of tests insist on float64."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import jaxtyping


@contextmanager
def float32_cameras() -> Iterator[None]:
    """No checks of arrays' types and shapes within this block."""
    jaxtyping.config.update("jaxtyping_disable", True)
    try:
        yield
    finally:
        jaxtyping.config.update("jaxtyping_disable", False)
