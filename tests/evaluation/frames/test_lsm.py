"""The test of LSM and Uni3R on a scan in ScanNet's layout, with frames and pixels worked out by hand."""

from __future__ import annotations

import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scannet_writer import long_scan, png, write_extracted

from semgs.cli.main import main
from semgs.data.layouts.scannet.scannet_labels import lsm8_labels
from semgs.data.scene import Scene
from semgs.data.scene_lists import read_list
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import IGNORE, LSM8, SCANNET20
from semgs.evaluation.frames.frame_plan import frame_list, read_plan
from semgs.evaluation.frames.protocols import lsm, read_lsm_list
from semgs.evaluation.frames.reading import read_frame
from semgs.evaluation.run import plan_targets
from semgs.files.errors import InputError
from semgs.model.encode import encode
from semgs.model.weights.load import load


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    """64 frames: the step is 2, so the 30 frames are 0, 2, ..., 58."""
    return write_extracted(tmp_path_factory.mktemp("lsm"), long_scan(64), "scene0690_00")


@pytest.fixture(scope="module")
def scene(written: Path) -> Scene:
    """The scan in eight classes."""
    return open_scene(written, as_peers=["lsm8"])


def test_the_frames_are_those_of_their_code(scene: Scene):
    """Positions 1, 4, 9, 12, 17, 20, 25 and 28 of 30; the frames beside position 1 are numbers 0 and 4."""
    samples = lsm(scene, 2)
    assert [sample.target for sample in samples] == [2, 8, 18, 24, 34, 40, 50, 56]
    assert samples[0].contexts == (0, 4)
    assert samples[-1].contexts == (54, 58)
    with pytest.raises(InputError, match="expected 2 input views for the protocol lsm, found 3"):
        lsm(scene, 3)


def test_scans_with_a_lost_frame_among_the_thirty_are_left_out(tmp_path: Path):
    """Frame 10 is one of them, frame 11 is not."""
    for number, lost in enumerate((10, 11)):
        write_extracted(tmp_path, long_scan(64, lost), f"scene069{number}_00")
    scenes = tuple(open_scene(tmp_path / f"scene069{number}_00", as_peers=["lsm8"]) for number in (0, 1))
    plan = plan_targets(("lsm",), scenes)
    assert [one.name for one in plan.scenes] == ["scene0691_00"]
    assert [task.target for task in plan.tasks[:2]] == ["color/2.jpg", "color/8.jpg"]
    assert (plan.tasks[0].size, plan.tasks[0].fit) == ((256, 256), "crop")
    short = write_extracted(tmp_path, long_scan(12), "scene0692_00")
    with pytest.raises(InputError, match="30 or more numbered frames, found 12"):
        lsm(open_scene(short), 2)


def test_the_authors_list_is_read_if_it_is_given(scene: Scene, tmp_path: Path):
    """Three frames: only position 1 has one on both sides. Names count in their order, and scene0696_02 does not count."""
    path = tmp_path / "selected_seqs_test.json"
    path.write_text(json.dumps({"scene0690_00": ["30", "10", "20"], "scene0696_02": ["1"], "scene0700_00": []}))
    (task,) = plan_targets(("lsm", str(path)), (scene,)).tasks
    assert (task.target, task.contexts) == ("color/20.jpg", ("color/10.jpg", "color/30.jpg"))
    path.write_text(json.dumps({"scene0690_00": ["00010", "00020", "00999"]}))
    with pytest.raises(InputError, match="the frame 00999 of the list, found none with a pose"):
        plan_targets(("lsm", str(path)), (scene,))
    for content, message in (
        ({"scene0700_00": ["1"]}, "scans of the data, such as scene0690_00, found scene0700_00, which is missing"),
        ({"scene0690_00": [1, 2]}, "frames of each scan"),
        (["scene0690_00"], "frames of each scan"),
    ):
        path.write_text(json.dumps(content))
        with pytest.raises(InputError, match=message):
            read_lsm_list(path, ["scene0690_00"])


def test_a_pinned_list_keeps_the_crop(scene: Scene, tmp_path: Path):
    plan = plan_targets(("lsm",), (scene,))
    path = tmp_path / "frames.json"
    path.write_text(json.dumps(frame_list(plan)))
    assert [(task.fit, task.size, task.sample) for task in read_plan(path, (scene,)).tasks] == [
        ("crop", (256, 256), task.sample) for task in plan.tasks
    ]
    path.write_text(path.read_text().replace('"crop"', '"tiles"'))
    with pytest.raises(InputError, match="crop or stretch, found 'tiles'"):
        read_plan(path, (scene,))


def test_eight_classes_of_nyu40():
    """wall 1, floor 2, ceiling 22, chair 5, table 7, sofa 6, bed 4; a desk (14) is other, and so is an id that the table lacks. 0 has none."""
    labels = lsm8_labels()
    assert [LSM8.names[labels[number]] for number in (1, 2, 22, 5, 7, 6, 4, 14, 40)] == [
        "wall", "floor", "ceiling", "chair", "table", "sofa", "bed", "other", "other",
    ]  # fmt: skip
    assert labels[0] == IGNORE


def test_labels_and_things_are_read_in_the_cropped_view(written: Path, scene: Scene, tmp_path: Path):
    """162 x 121 pixels are cropped to 121 x 121, 20 columns from the left, and enlarged: pixel (128, 128) is row 60 and column 20 + 60."""
    number = 8
    ids = np.zeros((121, 162), np.uint16)
    ids[60, 80], ids[60, 81], ids[61, 80], ids[61, 81] = 9, 41, 4000, 2
    things = np.zeros((121, 162), np.uint8)
    things[60, 80] = 7
    folder = tmp_path / written.name
    shutil.copytree(written, folder)
    shutil.copy(written.parent / "scannetv2-labels.combined.tsv", tmp_path)
    (folder / "label-filt" / f"{number}.png").write_bytes(png(ids))
    with zipfile.ZipFile(folder / f"{folder.name}_2d-instance-filt.zip", "w") as archive:
        archive.writestr(f"instance-filt/{number}.png", png(things))
    found = open_scene(folder, as_peers=["lsm8"])
    task = plan_targets(("lsm",), (found,)).tasks[1]
    assert task.sample.target == number
    view = read_frame(task, number, (0.1, 10.0))
    assert view.labels is not None
    labels = view.labels[0, 128:131:2, 128:131:2].tolist()
    assert [[LSM8.names[label] for label in row] for row in labels] == [["other", "ceiling"], ["other", "chair"]]
    numbers = found.frames[number].things(view, task.fit)
    assert numbers is not None
    assert (numbers[128, 128], numbers[128, 130], numbers[0, 0]) == (7, 0, 0)
    assert found.frames[0].instances is None


def test_weights_of_twenty_classes_answer_in_eight(scene: Scene):
    """Probabilities of classes that the table does not tell apart add up: all but wall, floor, chair, table, sofa and bed are other."""
    of = SCANNET20.within(LSM8)
    assert of is not None
    assert [LSM8.names[label] for label in of[:7]] == ["wall", "floor", "other", "bed", "chair", "sofa", "table"]
    assert LSM8.within(SCANNET20) is None
    assert SCANNET20.within(replace(LSM8, name="mine")) is None, "in a table of somebody else, other may be anything"
    encoding = encode(
        load("small", "random").eval(), scene.read([0, 4], (32, 32), fit="crop").changed(labels=None, depths=None)
    ).encoding
    coarse = encoding.regrouped(LSM8)
    assert coarse.classes == LSM8
    assert encoding.gaussians.semantic is not None
    assert coarse.gaussians.semantic is not None
    before, after = encoding.gaussians.semantic.features, coarse.gaussians.semantic.features
    torch.testing.assert_close(after[:, 3], before[:, SCANNET20.index("chair")])
    torch.testing.assert_close(after[:, 7], before[:, [label for label, group in enumerate(of) if group == 7]].sum(1))
    torch.testing.assert_close(after.sum(1), torch.ones(len(after)))
    with pytest.raises(ValueError, match="not in the table scannet20"):
        coarse.regrouped(SCANNET20)


def test_the_included_list_has_the_last_fifty_scans_but_one():
    names = read_list("scannet-lsm").names
    assert (len(names), names[0], names[-1], "scene0696_02" in names) == (49, "scene0686_01", "scene0706_00", False)


def test_single_images_need_weights_of_the_labels_own_table(
    written: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Rendered classes are regrouped; those of single images are compared as they are."""
    typed = [
        "evaluate",
        "small",
        "--single",
        "--data",
        str(written),
        "--as-peers",
        "lsm8",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(typed) == 2
    assert "expected class table lsm8 (8 classes), found scannet20 (20 classes)" in capsys.readouterr().err
