"""What the comparison figures show: whose frames, and how noisy a map is."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from known_scenes import write_scene
from paper_commands import main

from paper.figure.compared_targets import choose_tasks, label_noise
from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.evaluation.frames.frame_plan import FramePlan, make_plan
from semgs.evaluation.frames.protocols import neighbours


@pytest.fixture(scope="module")
def plan() -> FramePlan:
    """The six targets of the embedded room."""
    return make_plan("neighbours", neighbours, [open_scene(demo_scene())], [2])


def test_frames_are_spread_over_all_targets_or_named(plan: FramePlan):
    assert [task.sample.target for task in choose_tasks(plan, 3)] == [1, 3, 6]
    assert choose_tasks(plan, 99) == plan.tasks
    assert choose_tasks(plan, 1) == plan.tasks[:1]
    names = [plan.tasks[4].truth_stem, plan.tasks[0].truth_stem]
    assert choose_tasks(plan, 3, names) == (plan.tasks[4], plan.tasks[0])
    with pytest.raises(ValueError, match=r"there is no target 'demo/009'; the first one is 'demo/001'"):
        choose_tasks(plan, 3, ["demo/009"])


def test_a_map_is_torn_where_neighbours_of_one_true_class_differ():
    truth = torch.tensor([[0, 0, 1], [0, 0, 1], [255, 255, 1]], dtype=torch.uint8)
    assert label_noise(truth, truth) == 0
    predicted = truth.clone()
    predicted[0, 0] = 7  # differs from the pixel at its right and the one below, of 4 + 2 pairs of one true class
    assert label_noise(predicted, truth) == 2 / 6
    everywhere = torch.full_like(truth, 3)
    assert label_noise(everywhere, truth) == 0, "wrong, but smooth"
    assert label_noise(predicted, torch.full_like(truth, 255)) is None


def test_borders_between_true_regions_do_not_count():
    truth = torch.tensor([[0, 1, 0, 1]], dtype=torch.uint8)
    assert label_noise(truth, truth) is None


def test_a_target_of_no_folder_is_refused_and_not_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """With several folders each shows the targets of its own scenes; the second name belongs to none."""
    for name in ("attic", "hall"):
        write_scene(tmp_path / name, 3)
    line = ["figure", "qualitative", "--weights", "small", "--data", str(tmp_path / "attic"), str(tmp_path / "hall")]
    line += ["--views", "2", "--size", "36x48", "--out", str(tmp_path / "figure")]
    assert main([*line, "--targets", "attic/001", "cellar/001"]) == 2
    assert "--targets cellar/001: no --data folder has this scene" in capsys.readouterr().err
    assert not (tmp_path / "figure").exists()
