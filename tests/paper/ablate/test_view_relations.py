"""How input views lie to one another, in a scene made by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from paper.ablate.view_relations import thirds, view_relations
from semgs.data.scenes import open_scene
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.protocols import neighbours
from semgs.files.images.pictures import write_png


def wall(folder: Path, shifts: tuple[float, ...], turns: tuple[float, ...]) -> Path:
    """Views of a wall 2 m away, 2 m wide in each image: moved sideways [m], then turned about the upright axis [degrees]."""
    frames = []
    for number, (shift, turn) in enumerate(zip(shifts, turns, strict=True)):
        write_png(folder / f"{number}.png", np.full((20, 20, 3), 90, np.uint8))
        write_png(folder / f"{number}_depth.png", np.full((20, 20), 2000, np.uint16))
        c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        pose = [[c, 0, s, shift], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]]
        frames.append(
            {"file_path": f"{number}.png", "depth_file_path": f"{number}_depth.png", "transform_matrix": pose}
        )
    lens = {"w": 20, "h": 20, "fl_x": 20, "fl_y": 20, "cx": 10, "cy": 10}
    (folder / "transforms.json").write_text(json.dumps({**lens, "depth_unit_scale_factor": 0.001, "frames": frames}))
    return folder


def test_overlap_is_the_share_of_the_wall_that_both_see_and_the_angle_that_between_their_axes(tmp_path: Path):
    """Two views 0.4 m to both sides of the target are 0.8 m apart, and share 1.2 m of 2 m; the second is turned by 10 degrees."""
    scene = open_scene(wall(tmp_path, (-0.4, 0.0, 0.4), (0, 0, 0)))
    (relation,) = view_relations(make_plan("neighbours", neighbours, (scene,), (2,), (20, 20)), 2)
    assert relation.overlap == pytest.approx(0.6)
    assert relation.angle == pytest.approx(0, abs=1e-4)


def test_of_three_views_the_pair_with_the_least_in_common_counts(tmp_path: Path):
    scene = open_scene(wall(tmp_path, (0.0, 0.2, 0.4, 0.8), (0, 0, 10, -15)))
    plan = make_plan("neighbours", neighbours, (scene,), (3,), (20, 20))
    assert [task.sample.contexts for task in plan.tasks] == [(0, 2, 3), (1, 3, 0)]
    relations = view_relations(plan, 3)
    assert [relation.angle for relation in relations] == pytest.approx([25, 15], abs=1e-3)
    assert relations[1].overlap < 0.61  # of the views at 0 and 0.8 m


def test_thirds_are_equal_parts_in_the_order_of_the_values():
    assert thirds([5.0, 1.0, 4.0, 2.0, 3.0, 6.0]) == [[1, 3], [2, 4], [0, 5]]
    assert thirds([1.0, 1.0, 1.0, 1.0]) == [[0, 1], [2], [3]]
    assert thirds([7.0]) == [[0], [], []]
