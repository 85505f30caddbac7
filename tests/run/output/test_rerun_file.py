"""Boxes and free floor in a recording of Rerun."""

from __future__ import annotations

import subprocess
import sys
from math import cos, radians, sin
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from semgs import ros
from semgs.files.bags import write_message
from semgs.robotics.boxes import Box
from semgs.robotics.floor import level_from_world
from semgs.robotics.objects import Objects, Thing
from semgs.robotics.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy
from semgs.run.output.rerun_file import _boxes, _grid

rr = pytest.importorskip("rerun")


def read(file: Path, component: str) -> list:
    """The one thing with a component that a file has."""
    from rerun.chunk import RrdReader

    batches = [chunk.to_record_batch() for chunk in RrdReader(file).stream()]
    (found,) = [batch.column(component).to_pylist()[0] for batch in batches if component in batch.schema.names]
    return found


def logged(file: Path, what: object) -> Path:
    """A file with one thing in it."""
    with rr.RecordingStream("test") as recording:
        recording.save(file)
        recording.log("thing", what, static=True)
    return file


def test_the_plan_is_what_rerun_makes_of_the_same_plan_from_ros(tmp_path: Path) -> None:
    cells = np.array([[FREE, OCCUPIED, UNKNOWN, FREE], [OCCUPIED, OCCUPIED, FREE, UNKNOWN]], np.int8)
    level = level_from_world((0.2, -0.9, 0.3))
    plan = Occupancy(cells, cells[None], np.full((1, 2, 4), 255, np.uint8), (-1.25, 2.5, -0.1), 0.05, 0.02, level)
    header = SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=2), frame_id="map")
    write_message(tmp_path / "plan.mcap", "/plan", 3, lambda _: ros.occupancy_grid(plan, header))
    subprocess.run(
        [sys.executable, "-m", "rerun", "mcap", "convert", tmp_path / "plan.mcap", "-o", tmp_path / "theirs.rrd"],
        check=True, capture_output=True, timeout=250,
    )  # fmt: skip
    ours = logged(tmp_path / "ours.rrd", _grid(rr, plan))
    for component in ("data", "format", "cell_size", "colormap"):
        assert read(ours, f"GridMap:{component}") == read(tmp_path / "theirs.rrd", f"GridMap:{component}")
    for component in ("translation", "quaternion"):
        theirs = read(tmp_path / "theirs.rrd", f"GridMap:{component}")
        np.testing.assert_allclose(read(ours, f"GridMap:{component}"), theirs, atol=1e-6)
    assert read(ours, "GridMap:data") == [[100, 100, 0, 255, 0, 100, 255, 0]]  # the row with the largest y first


def test_boxes_have_half_sizes_turns_and_names(tmp_path: Path) -> None:
    chair = Thing(3, 4, "chair", 0.75, Box((1.5, -0.25, 0.45), (0.6, 0.5, 0.9), radians(30)), 1.1, 3)
    file = logged(tmp_path / "boxes.rrd", _boxes(rr, Objects((chair,), np.array([3, 0, 3]), np.eye(3))))
    np.testing.assert_allclose(read(file, "Boxes3D:centers"), [[1.5, -0.25, 0.45]], rtol=1e-6)
    np.testing.assert_allclose(read(file, "Boxes3D:half_sizes"), [[0.3, 0.25, 0.45]], rtol=1e-6)
    np.testing.assert_allclose(
        read(file, "Boxes3D:quaternions"), [[0, 0, sin(radians(15)), cos(radians(15))]], atol=1e-7
    )
    assert read(file, "Boxes3D:labels") == ["chair 3 (75%)"]
    assert read(file, "Boxes3D:class_ids") == [4]
