"""Errors planted in `semgs/preparation`."""

from __future__ import annotations

from planted.mutant import Mutant

PREPARATION = (
    Mutant(
        "prepared poses keep OpenCV's axes", "semgs/data/preparation/archive.py",
        "pose[:3, 1:3] *= -1", "pose[:3, 1:3] *= 1",
        ("tests/data/preparation/test_preparation.py::test_a_prepared_scene_is_the_scene_resized_with_its_camera",),
    ),
)  # fmt: skip
