"""One room in every layout: what is read is the same, and so is what the network makes of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from bags import COLOUR, DEPTH, Bag, add_tree, times
from miniatures import SIZE, Miniature, miniature, text, write_picture
from phone_captures import TIMES, write_polycam, write_record3d
from replicas import write_replica
from test_frame_files import write_frames
from test_tum import write_tum

from semgs import load
from semgs.data.preparation.archive import Preparation, prepare_scene
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene

ROOM = miniature().first(3)
FOCAL, CENTRE = 32.0, (31.5, 23.5)
"""Of Replica's renderer for 64x48 pixels, counted from the centre of the first one; the other layouts say it in their own words."""


def transforms(folder: Path, room: Miniature) -> Scene:
    """nerfstudio's, whose pixels and axes are other ones."""
    frames = []
    for index in range(len(room)):
        write_picture(folder / f"images/{index}.png", room.images[index])
        write_picture(folder / f"depth/{index}.png", room.depths[index])
        frames.append(
            {
                "file_path": f"images/{index}.png",
                "depth_file_path": f"depth/{index}.png",
                "transform_matrix": (room.poses[index] * (1, -1, -1, 1)).tolist(),
            }
        )
    shared = {"fl_x": FOCAL, "fl_y": FOCAL, "cx": CENTRE[0] + 0.5, "cy": CENTRE[1] + 0.5, "metric": True}
    (folder / "transforms.json").write_text(json.dumps({**shared, "frames": frames}))
    return open_scene(folder)


def three_files(folder: Path, room: Miniature) -> Scene:
    """3DMatch's."""
    write_frames(folder, room)
    (folder / "camera-intrinsics.txt").write_text(f"{FOCAL} 0 {CENTRE[0]}\n0 {FOCAL} {CENTRE[1]}\n0 0 1\n")
    return open_scene(folder)


def folders(folder: Path, room: Miniature) -> Scene:
    """color/, depth/, and a trajectory."""
    for index in range(len(room)):
        write_picture(folder / f"color/{index}.png", room.images[index])
        write_picture(folder / f"depth/{index}.png", room.depths[index])
    (folder / "traj.txt").write_text("".join(text(pose.reshape(1, 16)) for pose in room.poses))
    return open_scene(folder, intrinsics=(FOCAL, FOCAL, CENTRE[0] + 0.5, CENTRE[1] + 0.5), depth_unit=0.001)


def recorded(folder: Path, room: Miniature) -> Scene:
    """A robot's."""
    bag = Bag()
    bag.info(k=np.array([[FOCAL, 0, CENTRE[0]], [0, FOCAL, CENTRE[1]], [0, 0, 1]]))
    add_tree(bag, room)
    for time, image, depths in zip(times(room), room.images, room.depths, strict=True):
        bag.image(time, COLOUR, image, "bgr8")
        bag.image(time, DEPTH, depths, "16UC1")
    for index, one in enumerate(bag.messages):  # as a driver writes them that gives colours in the other order
        if one[1] == COLOUR:
            one[3].data = one[3].data.reshape(-1, 3)[:, ::-1].ravel()
            bag.messages[index] = one
    return open_scene(bag.write(folder), world="map")


PHONE = (FOCAL, FOCAL, CENTRE[0] + 0.5, CENTRE[1] + 0.5)


def polycam(folder: Path, room: Miniature) -> Scene:
    """A phone's, with images that lose nothing."""
    write_polycam(folder, room, PHONE)
    for time, image in zip(TIMES, room.images, strict=False):
        (folder / f"keyframes/images/{time}.jpg").unlink()
        write_picture(folder / f"keyframes/images/{time}.png", image)
    return open_scene(folder)


def record3d(folder: Path, room: Miniature) -> Scene:
    """Another phone's."""
    pytest.importorskip("lzfse")
    write_record3d(folder, room, PHONE)
    for index, image in enumerate(room.images):
        (folder / f"rgbd/{index}.jpg").unlink()
        write_picture(folder / f"rgbd/{index}.png", image)
    return open_scene(folder)


LAYOUTS: dict[str, Callable[[Path, Miniature], Scene]] = {
    "Replica": lambda folder, room: open_scene(write_replica(folder, room)),
    "TUM RGB-D": lambda folder, room: open_scene(
        write_tum(folder, room, calibration=f"{FOCAL} {FOCAL} {CENTRE[0]} {CENTRE[1]}")
    ),
    "frame files": three_files,
    "RGB-D folders": folders,
    "ROS bag": recorded,
    "Polycam": polycam,
    "Record3D": record3d,
}


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[torch.nn.Module, Scene, torch.Tensor]:
    """A network, the room as transforms.json, and where the network puts its Gaussians."""
    model = load("small", weights="random").eval()
    scene = transforms(tmp_path_factory.mktemp("room"), ROOM)
    with torch.no_grad():
        return model, scene, model(scene.read([0, 2])).gaussians.means


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_same_views_and_the_same_reconstruction(
    tmp_path: Path, told: tuple[torch.nn.Module, Scene, torch.Tensor], layout: str
):
    model, same, means = told
    scene = LAYOUTS[layout](tmp_path / "room", ROOM)
    assert (scene.layout, scene.unit) == (layout, same.unit)
    views, expected = scene.read([0, 1, 2]), same.read([0, 1, 2])
    assert views.size == SIZE
    assert torch.equal(views.images, expected.images)
    torch.testing.assert_close(views.cameras.intrinsics, expected.cameras.intrinsics, atol=1e-9, rtol=0)
    torch.testing.assert_close(views.cameras.world_from_camera, expected.cameras.world_from_camera, atol=1e-6, rtol=0)
    torch.testing.assert_close(views.depths, expected.depths, atol=1e-3, rtol=0)
    torch.testing.assert_close(views.depth_range, expected.depth_range)
    with torch.no_grad():
        found = model(scene.read([0, 2])).gaussians.means
    torch.testing.assert_close(found, means, atol=1e-4, rtol=1e-4)


@pytest.mark.parametrize("layout", ["TUM RGB-D", "ROS bag"])
def test_a_layout_prepared_is_the_same_scene(tmp_path: Path, told: tuple, layout: str):
    scene = LAYOUTS[layout](tmp_path / "room", ROOM)
    prepare_scene(scene, tmp_path / "a.zip", Preparation((24, 32)))
    prepare_scene(told[1], tmp_path / "b.zip", Preparation((24, 32)))
    views, expected = (open_scene(tmp_path / name).read([0, 1, 2]) for name in ("a.zip", "b.zip"))
    assert torch.equal(views.images, expected.images)
    torch.testing.assert_close(views.depths, expected.depths, atol=1e-3, rtol=0)
    torch.testing.assert_close(views.cameras.world_from_camera, expected.cameras.world_from_camera, atol=1e-6, rtol=0)
