"""Preparing: what is in a prepared scene, that it is the same however it was made, and that work goes on where it was left."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes_on_disk import write_labelled, write_table

from semgs.data.demo_scene import demo_scene
from semgs.data.preparation.archive import Preparation, estimate_bytes, prepare_scene, read_prepared_view
from semgs.data.preparation.prepared_set import (
    INDEX,
    SUMS,
    PreparedSet,
    Reading,
    find_sources,
    free_space,
)
from semgs.data.resampling import cropped, resized
from semgs.data.scene_details import SceneDetails
from semgs.data.scene_lists import read_list
from semgs.data.scenes import open_scene, open_scenes
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png

SMALL = Preparation((48, 64))


@pytest.fixture
def rooms(tmp_path: Path) -> Path:
    """A folder with scenes one and two levels below, and something else."""
    for name in ("kitchen", "seq-01", "seq-02"):
        shutil.copytree(demo_scene(), tmp_path / "rooms" / name)
        file = tmp_path / "rooms" / name / "transforms.json"
        content = json.loads(file.read_text())
        file.write_text(json.dumps({**content, "frames": content["frames"][:3]}))
    (tmp_path / "rooms" / "notes").mkdir()
    return tmp_path / "rooms"


def test_a_prepared_scene_is_the_scene_resized_with_its_camera(tmp_path: Path):
    scene = open_scene(demo_scene())
    record = prepare_scene(scene, tmp_path / "room.zip", Preparation((120, 160), every=3))
    small = open_scene(tmp_path / "room.zip")
    views, same = small.read([0, 1, 2], "native"), resized(scene.read([0, 3, 6], "native"), (120, 160))
    assert torch.equal(views.labels, same.labels)
    assert (views.depths - same.depths).abs().max() <= 0.0005 + 1e-6
    assert (views.images - same.images).abs().mean() < 0.01
    torch.testing.assert_close(views.cameras.world_from_camera, same.cameras.world_from_camera, atol=1e-9, rtol=0)
    torch.testing.assert_close(views.cameras.intrinsics, same.cameras.intrinsics, atol=1e-6, rtol=0)
    assert (small.unit, small.classes, small.name) == ("metric", scene.classes, "room")
    assert [frame.name for frame in small.frames] == ["images/000.jpg", "images/003.jpg", "images/006.jpg"]
    assert record["frames"] == 3
    assert sum(record["pixels"].values()) == 3 * 120 * 160


def test_the_bytes_depend_on_source_and_settings_alone(tmp_path: Path):
    scene = open_scene(demo_scene())
    for name in ("a", "b"):
        prepare_scene(scene, tmp_path / f"{name}.zip", SMALL)
    assert sha256(tmp_path / "a.zip") == sha256(tmp_path / "b.zip")


def test_other_aspects_lose_their_margins_and_pixels_stay_square():
    scene = open_scene(demo_scene())
    wide = replace(scene.frames[0], lens=replace(scene.frames[0].lens, focal=(370.0, 370.0)))
    view = read_prepared_view(scene, wide, (100, 200))
    k = view.cameras.intrinsics[0]
    assert view.size == (100, 200)
    assert k[0, 0] == k[1, 1] == 370 * 200 / 320
    middle = resized(cropped(wide.view((0.5, 10.0), scene.classes), 40, 0, (160, 320)), (100, 200))
    assert torch.equal(view.labels, middle.labels)
    torch.testing.assert_close(view.cameras.intrinsics, middle.cameras.intrinsics)
    assert read_prepared_view(scene, scene.frames[0], (239, 320)).size == (239, 320)  # a hundredth is stretched


def test_pictures_that_are_higher_than_wide_get_the_size_turned(tmp_path: Path):
    scene = open_scene(demo_scene())

    class Turned(type(scene.frames[0])):
        """A frame whose picture lies on its side."""

        def view(self, *arguments, **named):
            return cropped(super().view(*arguments, **named), 0, 70, (240, 180))

    frame = Turned(**vars(scene.frames[0]))
    assert read_prepared_view(scene, frame, (48, 64)).size == (64, 48)


def test_scenes_without_metres_keep_their_unit_and_have_no_depth(tmp_path: Path):
    scene = replace(open_scene(demo_scene()), unit="unknown", applied_scale=0.5, applied_transform=np.eye(4)[:3])
    prepare_scene(scene, tmp_path / "a.zip", SMALL)
    small = open_scene(tmp_path / "a.zip")
    assert (small.unit, small.applied_scale) == ("unknown", 0.5)
    assert all(frame.depth is None for frame in small.frames)
    assert small.read([0, 1], "native").labels is not None


def test_a_set_is_prepared_resumed_and_the_same_for_any_number_of_workers(rooms: Path, tmp_path: Path):
    found = find_sources(rooms)
    assert [one.name for one in found] == ["kitchen", "seq-01", "seq-02"]
    counts: list[int] = []
    index = PreparedSet(tmp_path / "out", SMALL, Reading()).prepare(found, done=counts.append)
    assert counts == [0, 1, 2, 3]
    assert (index["frames"], len(index["scenes"]), index["failed"]) == (9, 3, [])
    assert index == json.loads((tmp_path / "out" / INDEX).read_text())
    sums = dict(line.split("  ")[::-1] for line in (tmp_path / "out" / SUMS).read_text().splitlines())
    assert sums == {f"{one.name}.zip": sha256(tmp_path / "out" / f"{one.name}.zip") for one in found}
    assert [scene.name for scene in open_scenes(tmp_path / "out")] == ["kitchen", "seq-01", "seq-02"]
    # Cut short: one is missing, one was half written; what is complete stays as it is.
    kept = (tmp_path / "out" / "kitchen.zip").stat().st_mtime_ns
    (tmp_path / "out" / "seq-01.zip").unlink()
    (tmp_path / "out" / ".seq-02.zip.0badf00d.part").write_bytes(b"PK")
    (tmp_path / "out" / "._kitchen.zip").write_bytes(b"\0\5\26\7Mac OS X")  # macOS writes it on disks of other systems
    assert PreparedSet(tmp_path / "out", SMALL, Reading()).prepare(found) == index
    assert (tmp_path / "out" / "kitchen.zip").stat().st_mtime_ns == kept
    assert sorted(path.name for path in (tmp_path / "out").glob(".*")) == ["._kitchen.zip", ".lock"]


def test_a_source_that_has_changed_is_made_anew(rooms: Path, tmp_path: Path):
    PreparedSet(tmp_path / "out", SMALL, Reading()).prepare(find_sources(rooms))
    (rooms / "kitchen" / "images" / "002.jpg").unlink()
    index = PreparedSet(tmp_path / "out", SMALL, Reading()).prepare(find_sources(rooms))
    assert [scene["frames"] for scene in index["scenes"]] == [2, 3, 3]
    assert "1 of 3 listed images are missing" in index["scenes"][0]["notes"][0]
    assert sha256(tmp_path / "out" / "kitchen.zip") == index["scenes"][0]["sha256"]


def test_a_scene_that_cannot_be_prepared_is_passed_over_and_listed(rooms: Path, tmp_path: Path):
    (rooms / "seq-01" / "depth" / "001.png").write_bytes(b"no picture")
    index = PreparedSet(tmp_path / "out", SMALL, Reading()).prepare(find_sources(rooms))
    assert [scene["name"] for scene in index["scenes"]] == ["kitchen", "seq-02"]
    (failed,) = index["failed"]
    assert failed["name"] == "seq-01"
    assert "depth/001.png: expected a JPEG or PNG image" in failed["error"]
    with pytest.raises(InputError, match=r"001\.png"):
        PreparedSet(tmp_path / "other", SMALL, Reading()).prepare(find_sources(rooms / "seq-01"))


def test_lists_name_scenes_as_the_data_sets_do(rooms: Path, tmp_path: Path):
    wanted = tmp_path / "split.txt"
    wanted.write_bytes(b"sequence2\r\nkitchen\r\n")
    assert [one.name for one in find_sources(rooms, read_list(wanted))] == ["seq-02", "kitchen"]
    wanted.write_text("rooms/seq-01\n")
    assert [one.name for one in find_sources(tmp_path, read_list(wanted))] == ["rooms_seq-01"]
    wanted.write_text("kitchen\nbath\nattic\n")
    with pytest.raises(
        InputError, match=r"2 of 3 names: expected names of scenes .* found bath and 1 more, which are missing"
    ):
        find_sources(rooms, read_list(wanted))


def test_the_space_is_told_beforehand_to_a_tenth(rooms: Path, tmp_path: Path):
    found, settings = find_sources(rooms), Preparation((120, 160))
    needed = PreparedSet(tmp_path / "out", settings, Reading()).needed_space(found)
    PreparedSet(tmp_path / "out", settings, Reading()).prepare(found)
    taken = sum(path.stat().st_size for path in (tmp_path / "out").glob("*.zip"))
    assert taken * 0.95 < needed < taken * 1.15
    assert PreparedSet(tmp_path / "out", settings, Reading()).needed_space(found) == 0
    assert free_space(tmp_path / "not" / "yet") == shutil.disk_usage(tmp_path).free
    assert estimate_bytes(open_scene(found[0].path), settings) == pytest.approx(taken / 3, rel=0.1)


def test_other_settings_and_other_folders_are_refused(rooms: Path, tmp_path: Path):
    PreparedSet(tmp_path / "out", SMALL, Reading()).prepare(find_sources(rooms)[:1])
    with pytest.raises(ValueError, match=r"other settings: every is 1 there, not 2"):
        PreparedSet(tmp_path / "out", Preparation((48, 64), every=2), Reading()).check()
    with pytest.raises(ValueError, match=r"told is \{\} there, not \{'depth_unit': 0\.001\}"):
        PreparedSet(tmp_path / "out", SMALL, Reading(details=SceneDetails(depth_unit=0.001))).check()
    with pytest.raises(InputError, match="a new or empty folder"):
        PreparedSet(rooms, SMALL, Reading()).check()
    (tmp_path / "out" / "settings.json").write_text("[]")
    with pytest.raises(InputError, match=r"settings\.json: expected the settings of a prepared set"):
        PreparedSet(tmp_path / "out", SMALL, Reading()).check()
    with pytest.raises(InputError, match="every: expected at least two frames to keep, found 1 of 8"):
        prepare_scene(open_scene(demo_scene()), tmp_path / "a.zip", Preparation(every=9))
    assert not (tmp_path / "a.zip").exists()


def test_frames_of_the_same_name_in_several_folders_stay_apart(tmp_path: Path):
    scene = open_scene(demo_scene())
    frames = [
        replace(frame, name=f"{side}/1.png") for frame, side in zip(scene.frames, ("left", "right"), strict=False)
    ]
    prepare_scene(replace(scene, frames=tuple(frames)), tmp_path / "a.zip", SMALL)
    assert [frame.name for frame in open_scene(tmp_path / "a.zip").frames] == [
        "images/left_1.jpg",
        "images/right_1.jpg",
    ]


@pytest.mark.long
def test_workers_write_the_same_bytes(rooms: Path, tmp_path: Path):
    one = PreparedSet(tmp_path / "one", SMALL, Reading()).prepare(find_sources(rooms))
    two = PreparedSet(tmp_path / "two", SMALL, Reading()).prepare(find_sources(rooms), workers=2)
    assert one == two


def test_a_class_table_of_your_own_is_in_the_archive(tmp_path: Path):
    """The numbers in the label images change: 5 stood for the second class, whose position is 1."""
    numbers = (0, 1, 5)
    folder = write_labelled(
        tmp_path / "own", 7, frames=3, labels=numbers, change=lambda scene: scene.update(label_set="three.json")
    )
    write_table(folder / "three.json")
    scene = open_scene(folder)
    prepare_scene(scene, tmp_path / "own.zip", Preparation((24, 32)))
    again = open_scene(tmp_path / "own.zip")
    assert (again.classes.names, again.classes.colours) == (scene.classes.names, scene.classes.colours)
    assert again.classes.names == ("wall", "seat", "floor")
    views = again.read([0, 1, 2], "native")
    assert torch.equal(views.labels, scene.read([0, 1, 2], "native").labels)
    assert views.labels.unique().tolist() == [0, 1, 2]


def test_hidden_pixels_stay_hidden_in_a_prepared_scene(tmp_path: Path):
    """A mask of the left 40 of 320 columns of frame 1 is one of the left 20 of 160; frame 0 has no mask and no file of one."""
    folder = tmp_path / "room"
    shutil.copytree(demo_scene(), folder)
    content = json.loads((folder / "transforms.json").read_text())
    mask = np.full((240, 320), 255, np.uint8)
    mask[:, :40] = 0
    write_png(folder / "mask.png", mask)
    content["frames"][1]["mask_path"] = "mask.png"
    (folder / "transforms.json").write_text(json.dumps(content))
    prepare_scene(open_scene(folder), tmp_path / "room.zip", Preparation((120, 160)))
    small = open_scene(tmp_path / "room.zip")
    assert [frame.mask is not None for frame in small.frames[:3]] == [False, True, False]
    hidden = small.read([0, 1], "native").hidden
    expected = torch.zeros(2, 120, 160, dtype=torch.bool)
    expected[1, :, :20] = True
    assert torch.equal(hidden, expected)
