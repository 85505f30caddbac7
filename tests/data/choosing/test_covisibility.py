"""Covisibility: what frames share, by hand in front of walls."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from semgs.data.cameras.lens import Lens
from semgs.data.choosing.covisibility import Covisibility, DepthGrids, flat_grid
from semgs.data.frames import Frame
from semgs.data.maps import DepthMap
from semgs.data.scene import Scene

LENS = Lens((120, 170), (150.0, 140.0), (91.3, 55.2))
POSE = np.array([[0.0, 0, 1, 3], [1, 0, 0, -2], [0, 1, 0, 1], [0, 0, 0, 1]])
"""A camera at (3, -2, 1) that looks along the world's x."""


def posed(right: float = 0.0) -> np.ndarray:
    """The camera moved to its right [m]."""
    pose = POSE.copy()
    pose[:3, 3] += right * pose[:3, 0]
    return pose


def scene(folder: Path, maps: Sequence[np.ndarray | None], rights: Sequence[float], lens: Lens = LENS) -> Scene:
    """Frames side by side with these depth maps [m]; None leaves a frame without one."""
    frames = []
    for number, (depths, right) in enumerate(zip(maps, rights, strict=True)):
        path = folder / f"{number}.png"
        if depths is not None:
            cv2.imwrite(str(path), np.rint(1000 * depths).astype(np.uint16))
        source = None if depths is None else DepthMap(path)
        frames.append(Frame(f"{number}.jpg", Path("nowhere"), lens, posed(right), source))
    return Scene(folder, "scene", "transforms.json", "metric", tuple(frames))


def wall(depth: float) -> np.ndarray:
    return np.full(LENS.size, depth)


def covisibility(opened: Scene) -> Covisibility:
    every = range(len(opened))
    return Covisibility.of(opened, every, DepthGrids(opened).of(every, 2.0))


def test_frames_side_by_side_before_a_wall_share_what_the_shift_leaves(tmp_path):
    """A picture is 170 / 150 z wide: 1.13 m at 1 m, so 0.34 m to the side leaves 70 %, and at 2 m 85 % (8 or 9 of 10 columns)."""
    near = covisibility(scene(tmp_path, [wall(1.0)] * 2, [0, 0.34]))
    assert near.overlaps()[0, 1] == pytest.approx(0.7)
    assert near.medians.tolist() == [1, 1]
    assert near.baselines[0, 1] == pytest.approx(0.34)
    assert covisibility(scene(tmp_path, [None] * 2, [0, 0.34])).overlaps()[0, 1] == pytest.approx(0.85, abs=0.051)


def test_a_frame_between_two_others_is_covered_by_both_together(tmp_path):
    between = covisibility(scene(tmp_path, [wall(1.0)] * 3, [0, 0.34, 0.68]))
    assert between.covered([0])[1] == pytest.approx(0.7)
    assert between.covered([0, 2])[1] == 1
    assert between.covered([0])[2] == pytest.approx(0.4)


def test_what_is_behind_all_that_a_frame_measured_is_hidden_from_it(tmp_path):
    """One frame sees a wall at 3 m, the other, from the same place, a board before its left half at 1 m."""
    board = wall(3.0)
    board[:, :85] = 1.0
    both = covisibility(scene(tmp_path, [wall(3.0), board], [0, 0]))
    assert both.covered([1])[0] == pytest.approx(0.5)
    assert both.covered([0])[1] == 1
    assert both.overlaps()[0, 1] == pytest.approx(0.5)
    assert covisibility(scene(tmp_path, [wall(3.0), wall(2.8)], [0, 0])).overlaps()[0, 1] == 1


def test_parts_are_of_what_is_known(tmp_path):
    """The left half was not measured: the other frame sees all that is known of the picture."""
    half = wall(1.0)
    half[:, :85] = 0
    opened = scene(tmp_path, [half, wall(1.0)], [0, 0])
    known = DepthGrids(opened).of([0], 9.0)[0]
    assert np.isfinite(known.depths).sum() == 50
    assert known.median == 1
    assert covisibility(opened).covered([1])[0] == 1


@pytest.mark.parametrize("content", ["absent", "damaged", "nearly empty"])
def test_a_map_that_tells_nothing_leaves_the_assumed_depth(tmp_path, content):
    depths = wall(0.0)
    depths[:12, :17] = 4.0  # one cell
    opened = scene(tmp_path, [None if content == "absent" else depths, wall(1.0)], [0, 0])
    if content == "damaged":
        (tmp_path / "0.png").write_bytes(b"no picture")
    assumed, measured = DepthGrids(opened).of([0, 1], 2.5)
    assert (assumed.median, assumed.source) == (2.5, "")
    assert (assumed.depths == flat_grid(2.5).depths).all()
    assert measured.source == "measured depth"


def test_sparse_points_give_each_cell_the_depth_of_the_nearest(tmp_path):
    """Twenty points on the left at 4 m, twenty on the right at 2 m; others are behind the camera or beside the picture."""
    rng = np.random.default_rng(0)
    u, v = np.concatenate((rng.uniform(0, 60, 20), rng.uniform(110, 170, 20))), rng.uniform(0, 120, 40)
    z = np.repeat([4.0, 2.0], 20)
    ours = np.stack(((u - 91.3) / 150 * z, (v - 55.2) / 140 * z, z), axis=1)
    outside = np.array([[0.0, 0, -1], [5, 0, 1]])
    points = np.concatenate((ours, outside)) @ POSE[:3, :3].T + POSE[:3, 3]
    opened = scene(tmp_path, [None, None], [0, 0])
    sparse = Scene(opened.path, "scene", "COLMAP", "unknown", opened.frames, points=points)
    grid = DepthGrids(sparse).of([0], 9.0)[0]
    columns = grid.depths.reshape(10, 10)
    assert columns[:, :3] == pytest.approx(4.0)
    assert columns[:, 7:] == pytest.approx(2.0)
    assert grid.source == "sparse points"
    few = Scene(opened.path, "scene", "COLMAP", "unknown", opened.frames, points=points[:9])
    assert DepthGrids(few).of([0], 9.0)[0].median == 9
