from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from semgs.data.scene import Scene
from semgs.evaluation.frames.frame_plan import (
    FramePlan,
    Task,
    distinct_stems,
    frame_list,
    index_of,
    make_plan,
    read_plan,
)
from semgs.evaluation.frames.protocols import TargetSample, neighbours
from semgs.files.errors import InputError

MakeScene = Callable[..., Scene]


def told(plan: FramePlan) -> list[tuple]:
    return [(task.scene.name, task.size, task.target, task.contexts) for task in plan.tasks]


@pytest.fixture
def scenes(make_scene: MakeScene) -> tuple[Scene, Scene]:
    return make_scene("attic", frames=5), make_scene("hall", frames=4, size=(48, 36))


def test_landscape_scenes_are_compared_at_240x320_and_portrait_ones_at_320x240(scenes: tuple[Scene, Scene]):
    plan = make_plan("neighbours", neighbours, scenes, (2,))
    assert {task.scene.name: task.size for task in plan.tasks} == {"attic": (240, 320), "hall": (320, 240)}
    asked = make_plan("neighbours", neighbours, scenes, (2,), (64, 96))
    assert {task.size for task in asked.tasks} == {(64, 96)}


def test_tasks_are_in_the_order_of_views_scenes_and_frames(scenes: tuple[Scene, Scene]):
    plan = make_plan("neighbours", neighbours, scenes, (3, 2, 3))
    assert plan.views == (2, 3)
    assert [(task.views, task.stem) for task in plan.tasks] == [
        (2, "N2/attic/001"), (2, "N2/attic/002"), (2, "N2/attic/003"), (2, "N2/hall/001"), (2, "N2/hall/002"),
        (3, "N3/attic/001"), (3, "N3/attic/002"), (3, "N3/attic/003"), (3, "N3/hall/001"), (3, "N3/hall/002"),
    ]  # fmt: skip


def test_a_plan_survives_its_file_and_a_report_serves_as_one(scenes: tuple[Scene, Scene], tmp_path: Path):
    plan = make_plan("neighbours", neighbours, scenes, (2, 3), (64, 96))
    for name, content in (("frames", frame_list(plan)), ("report", {"results": [], "frames": frame_list(plan)})):
        (tmp_path / name).write_text(json.dumps(content))
        again = read_plan(tmp_path / name, scenes)
        assert told(again) == told(plan)
        assert again.protocol == "pinned: neighbours"
    assert told(read_plan(tmp_path / "frames", scenes, (3,))) == told(plan)[5:]
    assert {task.size for task in read_plan(tmp_path / "frames", scenes, size=(32, 48)).tasks} == {(32, 48)}


def test_near_and_far_are_in_the_title_of_a_plan_and_not_in_its_list_of_frames(
    scenes: tuple[Scene, Scene], tmp_path: Path
):
    """A plan that is pinned to the frames has its own near and far, so its title must not tell those of the other evaluation."""
    plan = replace(make_plan("neighbours", neighbours, scenes, (2,)), depth_range=(0.1, 10.0))
    assert plan.title == "neighbours, near 0.1 and far 10"
    (tmp_path / "frames.json").write_text(json.dumps(frame_list(plan)))
    again = read_plan(tmp_path / "frames.json", scenes)
    assert (again.title, again.depth_range) == ("pinned: neighbours", None)
    assert replace(again, depth_range=(0.2, 6.0)).title == "pinned: neighbours, near 0.2 and far 6"


def test_frames_are_pinned_by_name_whatever_else_the_scene_holds(make_scene: MakeScene, tmp_path: Path):
    plan = make_plan("neighbours", neighbours, [make_scene("attic", frames=4)], (2,))
    (tmp_path / "frames.json").write_text(json.dumps(frame_list(plan)))
    longer = make_scene("more/attic", frames=6, change=lambda file: file["frames"].reverse())
    again = read_plan(tmp_path / "frames.json", [longer])
    assert told(again) == told(plan)
    assert again.tasks[0].sample == TargetSample((5, 3), 4)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda file: file.update(format="x"), "format: expected format 'semgs.frames', version 1"),
        (lambda file: file["scenes"][0].update(scene="cellar"), "scenes[0].scene: expected one of the scenes attic, hall"),
        (lambda file: file["scenes"][0].update(scene=["attic"]), "scenes[0].scene: expected one of the scenes attic, hall, found ['attic']"),
        (lambda file: file["scenes"][1]["samples"][0].update(target="009.png"), "scenes[1].samples[0]: expected frames of hall"),
        (lambda file: file["scenes"][0]["samples"][1]["contexts"].append("images/002.png"), "expected different frames"),
        (lambda file: file["scenes"][0]["samples"][1].update(contexts=["images/000.png"]), "two or more contexts, by name"),
        (lambda file: file["scenes"][0].update(size=[64]), "scenes[0].size: expected height and width"),
        (lambda file: file.update(scenes=[]), "frames.scenes: expected a list"),
        (lambda file: file["scenes"][0]["samples"].append(file["scenes"][0]["samples"][0]), "each target once for a number of views, found N2/attic/001 again"),
    ],
)  # fmt: skip
def test_a_list_of_frames_that_cannot_be_is_refused_where_it_is_wrong(
    scenes: tuple[Scene, Scene], tmp_path: Path, change: Callable[[dict], object], told: str
):
    content = frame_list(make_plan("neighbours", neighbours, scenes, (2,)))
    change(content)
    (tmp_path / "frames.json").write_text(json.dumps(content))
    with pytest.raises(InputError) as caught:
        read_plan(tmp_path / "frames.json", scenes)
    assert told in str(caught.value)


def test_numbers_of_views_that_are_not_pinned_are_refused(scenes: tuple[Scene, Scene], tmp_path: Path):
    (tmp_path / "frames.json").write_text(json.dumps(frame_list(make_plan("n", neighbours, scenes, (2, 3)))))
    with pytest.raises(InputError, match="expected samples with 4 views, found only with 2, 3"):
        read_plan(tmp_path / "frames.json", scenes, (2, 4))


def test_targets_with_one_file_name_as_in_a_rig_get_their_positions_before_it(make_scene: MakeScene):
    def twice(file: dict) -> None:
        file["frames"][2]["file_path"] = "labels/001.png"

    scene = make_scene("attic", frames=5, change=twice, size=(36, 48))
    plan = make_plan("neighbours", neighbours, [scene], (2, 3))
    assert [task.target for task in plan.of(2)] == ["images/001.png", "labels/001.png", "images/003.png"]
    assert [task.stem for task in plan.of(2)] == ["N2/attic/001_001", "N2/attic/002_001", "N2/attic/003"]
    assert {task.truth_stem for task in plan.of(3)} == {task.truth_stem for task in plan.of(2)}


def test_a_file_name_that_another_one_would_get_gives_all_their_positions():
    names = {0: "cam0/1.jpg", 1: "cam1/1.jpg", 4: "cam0/2.jpg"}
    assert distinct_stems(names) == {0: "000_1", 1: "001_1", 4: "2"}
    assert distinct_stems({**names, 4: "cam0/001_1.jpg"}) == {0: "000_1", 1: "001_1", 4: "004_001_1"}


def test_a_name_with_dots_keeps_them_in_its_files(make_scene: MakeScene):
    scene = make_scene("attic", frames=3)
    task = Task(scene, (36, 48), TargetSample((0, 2), 1))
    object.__setattr__(scene.frames[1], "name", "images/IMG.2024.01.png")
    assert task.stem == "N2/attic/IMG.2024.01"


def test_an_index_as_pixelsplat_has_them_is_read_by_positions_and_written_again(make_scene: MakeScene, tmp_path: Path):
    scenes = [make_scene("hall", frames=12), make_scene("attic", frames=12)]
    index = {
        "hall": {"context": [2, 6], "target": [3, 5]},
        "attic": [{"context": [0, 4], "target": [1]}, {"context": [4, 8, 11], "target": [6]}],
        "gone": None,
    }
    (tmp_path / "index.json").write_text(json.dumps(index))
    plan = read_plan(tmp_path / "index.json", scenes)
    samples = [(task.scene.name, task.sample.contexts, task.sample.target) for task in plan.tasks]
    assert samples == [
        ("hall", (2, 6), 3),
        ("hall", (2, 6), 5),
        ("attic", (0, 4), 1),
        ("attic", (4, 8, 11), 6),
    ]
    assert plan.protocol == "pinned: the index index.json"
    assert index_of(plan) == {name: index[name] for name in ("hall", "attic")}


@pytest.mark.parametrize(
    ("index", "said"),
    [
        ({"hall": {"context": [2, 60], "target": [3]}}, "frames of hall"),
        ({"hall": {"context": [2, 6], "target": [6]}}, "different frames"),
        ({"hall": {"context": [2], "target": [6]}}, "a target and two or more contexts"),
        ({"hall": {"context": [2, 6], "target": 3}}, "lists of frames, context and target"),
        ({"cellar": {"context": [2, 6], "target": [3]}}, "one of the scenes hall"),
    ],
)
def test_an_index_that_does_not_fit_is_refused_in_one_line(
    index: dict, said: str, make_scene: MakeScene, tmp_path: Path
):
    (tmp_path / "index.json").write_text(json.dumps(index))
    with pytest.raises(InputError, match=re.escape(said)):
        read_plan(tmp_path / "index.json", [make_scene("hall", frames=12)])
