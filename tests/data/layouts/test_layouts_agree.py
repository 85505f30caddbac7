"""One room in every layout: the same pictures, depths and labels come out, and the same reconstruction."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

pytest.importorskip("embreex")
pytest.importorskip("trimesh")

from cast_room import miniature, poses
from scannet_writer import RAW_OF_LABEL, Scan, jpeg, label_zip, png, sens, tsv, write_extracted
from scannetpp_writer import PHONE, PHONE_SIZE, phone_rays, transforms, write_dslr, write_phone, write_scans

from semgs.data.scenes import open_scene
from semgs.data.views import Views
from semgs.geometry.gaussians import Gaussians
from semgs.model.weights.load import load
from semgs.rendering.render import render

K = np.array([[PHONE["fl_x"], 0, PHONE["cx"]], [0, PHONE["fl_y"], PHONE["cy"]], [0, 0, 1]])
"""Of all of them; the corner of the first pixel is at (0, 0)."""
CENTRED = K - 0.5 * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
"""The same with its centre there."""


@pytest.fixture(scope="module")
def room() -> Scan:
    """The room as the phone sees it, depth and labels too."""
    photos = [miniature().photograph(pose, phone_rays()) for pose in poses()]
    labels = np.stack([photo.labels for photo in photos])
    ids = np.append(RAW_OF_LABEL, np.zeros(236, int))[labels].astype(np.uint16)
    return Scan(
        poses(), tuple(jpeg(photo.colour) for photo in photos), np.stack([p.depth for p in photos]), ids, labels
    )


def nerfstudio(folder: Path, room: Scan) -> Path:
    frames = []
    for number, pose in enumerate(room.poses):
        names = {
            "file_path": f"{number}.jpg",
            "depth_file_path": f"{number}_d.png",
            "label_file_path": f"{number}_l.png",
        }
        (folder / names["file_path"]).write_bytes(room.jpegs[number])
        (folder / names["depth_file_path"]).write_bytes(png(room.depths[number]))
        (folder / names["label_file_path"]).write_bytes(png(room.labels[number]))
        frames.append({**names, "transform_matrix": (pose @ np.diag((1, -1, -1, 1))).tolist()})
    shared = {key: PHONE[key] for key in ("fl_x", "fl_y", "cx", "cy")}
    shared |= {"w": PHONE_SIZE[1], "h": PHONE_SIZE[0], "label_set": "scannet20", "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(shared))
    return folder


def scannet_raw(folder: Path, room: Scan) -> Path:
    (folder / "scene.sens").write_bytes(sens(room, colour_size=PHONE_SIZE, colour_k=CENTRED, depth_k=CENTRED))
    label_zip(folder / "scene_2d-label-filt.zip", room)
    (folder / "scannetv2-labels.combined.tsv").write_bytes(tsv())
    return folder


def scannet_extracted(folder: Path, room: Scan) -> Path:
    return write_extracted(folder, room, colour_k=CENTRED, depth_k=CENTRED)


def scannetpp_phone(folder: Path, room: Scan) -> Path:
    write_phone(folder / "scan")
    write_scans(folder / "scan")
    shutil.rmtree(folder / "scan" / "iphone" / "rgb_masks")
    return folder / "scan"


def scannetpp_undistorted(folder: Path, room: Scan) -> Path:
    write_scans(folder / "scan")
    dslr = folder / "scan" / "dslr"
    for place in ("undistorted_images", "nerfstudio"):
        (dslr / place).mkdir(parents=True)
    named = {f"DSC{number:05d}.JPG": pose for number, pose in enumerate(room.poses)}
    for name, picture in zip(named, room.jpegs, strict=True):
        (dslr / "undistorted_images" / name).write_bytes(picture)
    camera = {key: PHONE[key] for key in ("fl_x", "fl_y", "cx", "cy")}
    (dslr / "nerfstudio" / "transforms_undistorted.json").write_text(
        json.dumps(transforms("PINHOLE", PHONE_SIZE, camera, named))
    )
    return folder / "scan"


@pytest.fixture(scope="module")
def model() -> torch.nn.Module:
    """The network that ships."""
    return load("small").eval()


@pytest.fixture(scope="module")
def expected(room, model, tmp_path_factory) -> tuple[Views, Gaussians]:
    """Two views of the room by way of `transforms.json`, and their reconstruction."""
    views = open_scene(nerfstudio(tmp_path_factory.mktemp("nerfstudio"), room)).read([1, 3])
    with torch.no_grad():
        return views, model(views).gaussians


LAYOUTS = (scannet_raw, scannet_extracted, scannetpp_phone, scannetpp_undistorted)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("SEMGS_CACHE", str(tmp_path / "cache"))


@pytest.mark.parametrize("write", LAYOUTS, ids=[write.__name__ for write in LAYOUTS])
def test_a_room_read_through_every_layout_gives_the_same_reconstruction(
    room: Scan,
    model: torch.nn.Module,
    expected: tuple[Views, Gaussians],
    tmp_path: Path,
    write: Callable[[Path, Scan], Path],
):
    truth, theirs = expected
    scene = open_scene(write(tmp_path, room))
    views = scene.read([1, 3])
    assert scene.unit == "metric"
    assert torch.equal(views.images, truth.images)
    torch.testing.assert_close(views.cameras.world_from_camera, truth.cameras.world_from_camera, atol=1e-6, rtol=0)
    torch.testing.assert_close(views.cameras.intrinsics, truth.cameras.intrinsics, atol=1e-4, rtol=0)
    same = views.labels == truth.labels
    assert (~same).float().mean() < 1e-3  # rays through edges may end on either side
    assert (views.depths - truth.depths).abs()[same & (truth.depths > 0)].max() < 0.0011
    with torch.no_grad():
        ours = model(views).gaussians
    torch.testing.assert_close(ours.means, theirs.means, atol=2e-4, rtol=1e-4)
    torch.testing.assert_close(ours.semantic.features, theirs.semantic.features, atol=1e-3, rtol=0)


def test_a_room_read_through_a_fisheye_is_reconstructed_like_that(
    model: torch.nn.Module, expected: tuple[Views, Gaussians], tmp_path: Path
):
    write_dslr(tmp_path / "scan")
    scene = open_scene(tmp_path / "scan")
    views = scene.read([scene.index(name) for name in ("DSC00002.JPG", "DSC00007.JPG")], size=(96, 144))
    with torch.no_grad():
        ours, theirs = (
            render(gaussians, expected[0].cameras, near=0.5).images.clamp(0, 1)
            for gaussians in (model(views).gaussians, expected[1])
        )
    inner = (slice(None), slice(None), slice(16, -16), slice(16, -16))
    assert -10 * ((ours - theirs)[inner] ** 2).mean().log10() > 20
