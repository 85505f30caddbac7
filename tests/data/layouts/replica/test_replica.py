"""Replica as Semantic-NeRF rendered it: numbers, pixels, and what its 101 classes become."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from miniatures import Miniature, back_projected, check_projection, check_read, miniature, text, write_picture
from replicas import ID_OF, write_replica

from semgs.data.layouts.replica.sequence import IDS, NYU40
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.files.errors import InputError


def known(room: Miniature) -> Miniature:
    """The room without the classes that Replica lacks."""
    has = np.isin(room.labels, [SCANNET20.index(name) for name in ID_OF])
    return Miniature(room.images, room.depths, np.where(has, room.labels, IGNORE).astype(np.uint8), room.poses)


def test_what_is_read_equals_what_was_written_and_2_comes_before_10(tmp_path: Path):
    room = miniature()
    scene = open_scene(write_replica(tmp_path / "office_0" / "Sequence_1", room, start=5))
    check_read(scene, known(room), labels=True)
    assert [frame.name for frame in scene.frames][4:6] == ["rgb/rgb_9.png", "rgb/rgb_10.png"]
    assert scene.name == "office_0_Sequence_1"
    assert scene.classes is SCANNET20


def test_a_point_is_where_the_renderer_puts_it(tmp_path: Path):
    room = miniature()
    scene = open_scene(write_replica(tmp_path, room))
    depth = room.depths[6, 21, 40] / 1000
    world = back_projected(
        room.poses[6], (32, 32), (31.5, 23.5), (21, 40), depth
    )  # 90 degrees, (W - 1) / 2, (H - 1) / 2
    check_projection(scene, 6, world, (21, 40), depth)


def test_the_principal_point_is_320_240_and_the_peers_a_choice(tmp_path: Path):
    folder = write_replica(tmp_path, miniature((480, 640), 2))
    lens = open_scene(folder).frames[0].lens
    assert (*lens.focal, *lens.centre) == (320, 320, 320, 240)
    theirs = open_scene(folder, ["row-229.5"])
    assert theirs.frames[0].lens.centre == (320, 230)
    assert "row 229.5" in theirs.notes[0]
    assert open_scene(folder, intrinsics=(300.0, 301.0, 310.0, 250.0)).frames[0].lens.focal == (300, 301)
    with pytest.raises(InputError, match=r"a scene for the reading rows-972 .* found Replica"):
        open_scene(folder, ["rows-972"])


def test_an_image_too_narrow_for_a_focal_length_of_half_its_width_is_refused_by_name(tmp_path: Path):
    folder = write_replica(tmp_path, miniature((48, 64), 2))
    write_picture(folder / "rgb/rgb_1.png", np.zeros((801, 16, 3), np.uint8))  # 8 px are less than 801 / 100
    with pytest.raises(InputError, match=r"rgb_1\.png: expected an image that the renderer .* longer side of 801 px"):
        open_scene(folder)


def test_each_of_replicas_101_ids_is_one_of_the_20_classes_or_ignored(tmp_path: Path):
    assert list(IDS) == list(range(1, 102))
    assert {1: "backpack", 40: "floor", 47: "lamp", 93: "wall", 101: "set-of-clothing"}.items() <= IDS.items()
    assert set(NYU40.values()) <= set(range(41))
    room = miniature((48, 64), 2)
    folder = write_replica(tmp_path, room)
    ids = np.resize(np.arange(102, dtype=np.uint8), (48, 64))
    write_picture(folder / "semantic_class/semantic_class_1.png", ids)
    labels = open_scene(folder).read([0, 1]).labels[1].numpy()
    by_id = {int(number): {int(label) for label in labels[ids == number]} for number in range(102)}
    assert all(len(found) == 1 for found in by_id.values())
    named = {IDS[number]: SCANNET20.names[label] for number, (label,) in by_id.items() if label != IGNORE}
    assert named == {
        "wall": "wall", "floor": "floor", "cabinet": "cabinet", "base-cabinet": "cabinet", "wall-cabinet": "cabinet", "bed": "bed",
        "chair": "chair", "sofa": "sofa", "table": "table", "door": "door", "window": "window", "picture": "picture",
        "countertop": "counter", "desk": "desk", "curtain": "curtain", "refrigerator": "refrigerator", "toilet": "toilet",
        "sink": "sink", "bathtub": "bathtub", "bench": "otherfurniture", "beanbag": "otherfurniture", "rack": "otherfurniture",
        "plant-stand": "otherfurniture", "tv-stand": "otherfurniture", "wardrobe": "otherfurniture",
    }  # fmt: skip


def test_names_count_where_they_are_told(tmp_path: Path):
    room = miniature(frames=2)
    folder = write_replica(tmp_path / "room_1" / "Sequence_2", room)
    classes = [{"id": number, "name": name} for number, name in IDS.items()]
    classes[92]["name"], classes[39]["name"] = "floor", "wall"
    classes.append({"id": 102, "name": "flying-saucer"})
    info = tmp_path / "semantic_info" / "room_1" / "info_semantic.json"
    info.parent.mkdir(parents=True)
    info.write_text(json.dumps({"classes": classes, "objects": []}))
    scene = open_scene(folder)
    swapped = known(room).labels.copy()
    swapped[known(room).labels == 0], swapped[known(room).labels == 1] = 1, 0
    np.testing.assert_array_equal(scene.read([0, 1]).labels, swapped)
    assert "1 of 102 classes of" in scene.notes[0]
    assert "flying-saucer" in scene.notes[0]
    info.write_text(json.dumps({"classes": [{"id": "x", "name": "wall"}]}))
    with pytest.raises(InputError, match=r"info_semantic\.json: classes\[0\]\.id"):
        open_scene(folder)
    assert open_scene(folder, needs_labels=False).read([0, 1]).labels is None


def test_missing_labels_poses_and_pictures_are_counted(tmp_path: Path):
    room = miniature()
    folder = write_replica(tmp_path, room)
    (folder / "semantic_class/semantic_class_2.png").unlink()
    (folder / "rgb/rgb_4.png").unlink()
    lines = (folder / "traj_w_c.txt").read_text().splitlines()
    lines[1] = " ".join(["nan"] * 16)
    (folder / "traj_w_c.txt").write_bytes("\r\n".join(lines[:7]).encode())
    scene = open_scene(folder)
    assert [note.split(",")[0] for note in scene.notes] == [
        "1 of 8 frames have no finite pose and are left out",
        "1 of 8 frames have no pose and are left out",
        "1 of 8 frames have no image",
        "1 of 8 frames have no class map",
    ]
    check_read(scene, room, [0, 2, 3, 5, 6])
    np.testing.assert_array_equal(scene.read([2]).labels, known(room).labels[[3]])
    assert scene.absent == ("rgb/rgb_4.png",)


def test_the_sequence_is_pointed_to_and_a_broken_trajectory_refused(tmp_path: Path):
    folder = write_replica(tmp_path / "Sequence_1", miniature(frames=3))
    with pytest.raises(InputError, match=f"there is one in {folder}"):
        open_scene(tmp_path)
    (folder / "traj_w_c.txt").write_text("1 2 3\n")
    with pytest.raises(InputError, match=r"traj_w_c\.txt: line 1: expected poses"):
        open_scene(folder)
    (folder / "traj_w_c.txt").write_text(text(np.eye(4).reshape(1, 16)))
    with pytest.raises(InputError, match=r"at least two usable frames, found 1; 2 of 3 frames have no pose"):
        open_scene(folder)
