import json
from pathlib import Path

import numpy as np
import pytest
import torch

pytest.importorskip("embreex")

from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.geometry.cameras import back_project, project
from semgs_rooms.plans.style import Style
from semgs_rooms.sets.room_scenes import RoomSettings, draw_scene, write_scene

SETTINGS = RoomSettings(7, (48, 64), frames=4)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("rooms") / "room"
    write_scene(path, SETTINGS, 2)
    return path


def test_a_written_room_reads_back_as_it_was_drawn(folder):
    drawn = draw_scene(SETTINGS, 2).views
    scene = open_scene(folder)
    read = scene.read(range(4))
    assert scene.unit == "metric"
    assert read.classes.name == "scannet20"
    assert torch.equal(read.labels, drawn.labels)
    assert (read.depths - drawn.depths).abs().max() <= 0.00051
    torch.testing.assert_close(read.cameras.world_from_camera, drawn.cameras.world_from_camera, atol=1e-8, rtol=0)
    torch.testing.assert_close(read.cameras.intrinsics, drawn.cameras.intrinsics, atol=1e-5, rtol=0)
    assert (read.images - drawn.images).abs().mean() < 0.03  # what JPEG costs on noisy pictures of 48x64


def test_poses_are_written_with_opengl_axes(folder):
    """The camera looks along its -z, and its y goes up."""
    for frame in json.loads((folder / "transforms.json").read_text())["frames"]:
        pose = np.array(frame["transform_matrix"])
        assert pose[2, 1] > 0.5
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_the_same_seed_writes_the_same_bytes(folder, tmp_path):
    write_scene(tmp_path / "again", SETTINGS, 2)
    names = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    assert len(names) == 4 * 4 + 3
    for name in names:
        assert (folder / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_a_folder_that_is_there_is_never_replaced(folder, tmp_path):
    foreign = tmp_path / "photos"
    foreign.mkdir()
    (foreign / "mine.jpg").write_bytes(b"1")
    with pytest.raises(InputError):
        write_scene(foreign, RoomSettings(1, (8, 12), 2))
    with pytest.raises(InputError):
        write_scene(folder, SETTINGS, 2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["photos"]


def test_one_frame_is_no_scene(tmp_path):
    with pytest.raises(ValueError, match="frames is 1; expected 2 or more"):
        write_scene(tmp_path / "room", RoomSettings(1, (8, 12), 1))
    assert not (tmp_path / "room").exists()


def test_the_embedded_scene_is_small_and_complete():
    folder = demo_scene()
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) <= 1_000_000
    scene = open_scene(folder)
    assert len(scene) == 8
    assert not scene.absent
    assert scene.unit == "metric"
    views = scene.read(range(len(scene)))
    assert views.size == (240, 320)
    shares = torch.bincount(views.labels.flatten().long(), minlength=256)[:20] / views.labels.numel()
    assert (shares > 0.01).sum() >= 6


def test_the_embedded_scenes_frames_agree_on_where_things_are():
    """Points of one frame fall on pixels of the next that have their label and, to a few millimetres, their depth."""
    views = open_scene(demo_scene()).read(range(8))
    height, width = views.size
    for i in range(7):
        points = back_project(views.depths.double(), views.cameras)[i].reshape(-1, 3)
        x, y, z = project(points, views.cameras[i + 1]).unbind(-1)
        inside = (z > 0) & (x > 0) & (y > 0) & (x < width) & (y < height)
        assert inside.double().mean() > 0.6
        column, row = x[inside].long(), y[inside].long()
        same = views.labels[i].flatten()[inside] == views.labels[i + 1][row, column]
        gap = (views.depths[i + 1][row, column] - z[inside]).abs()
        assert same.double().mean() > 0.93
        assert (gap < 0.02).double().mean() > 0.85


@pytest.mark.parametrize("style", ["home", "other", "closeup"])
def test_every_pixel_of_a_thing_has_a_number_and_the_room_itself_has_none(style: Style):
    """Of wall and floor none has one; of all other classes every pixel has, and a thing of one piece keeps it in the next view."""
    drawn = draw_scene(RoomSettings(5, (48, 64), frames=2, style=style), 1)
    assert drawn.views.labels is not None
    labels, numbers = drawn.views.labels.numpy(), np.stack(drawn.things)
    assert (numbers[labels < 2] == 0).all()
    assert (numbers[(labels >= 2) & (labels != 255)] > 0).all()
    assert (labels[(labels >= 2) & (labels != 255)]).size > 100
    one, other = (
        {pair for pair in zip(each[shown != 255].tolist(), shown[shown != 255].tolist(), strict=True) if pair[0]}
        for each, shown in zip(numbers, labels, strict=True)
    )
    assert one & other


def test_numbers_of_things_are_read_back(folder: Path):
    scene = open_scene(folder)
    view = scene.read([1], "native")
    numbers = scene.frames[1].things(view)
    assert numbers is not None
    np.testing.assert_array_equal(numbers, draw_scene(SETTINGS, 2).things[1])
