"""`semgs reconstruct --all` on a recording of each layout that the tests can write."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType

import bags
import pytest
import scannet_writer
import scannetpp_writer
from miniatures import Miniature, miniature
from phone_captures import write_polycam, write_record3d, zipped
from replicas import write_replica

from semgs.cli.main import main
from semgs.data.demo_scene import demo_scene
from semgs.scene.scene_file import load_scene

TESTS = Path(__file__).parents[2] / "data" / "layouts"


def written_by(module: str) -> ModuleType:
    """Tests of a reader, whose writers are used here."""
    path = next(TESTS.rglob(f"{module}.py"))
    sys.path.append(str(path.parent))
    try:
        return import_module(module)
    finally:
        sys.path.pop()


def scannet(folder: Path, _: Miniature) -> Path:
    """As it is downloaded."""
    return scannet_writer.write_raw(folder, scannet_writer.scan(lost=()))


def extracted(folder: Path, _: Miniature) -> Path:
    """As ScanNet's own script extracts it."""
    return scannet_writer.write_extracted(folder, scannet_writer.scan(lost=()))


def frame_files(folder: Path, room: Miniature) -> Path:
    """As 3DMatch has them: an image, its depth and its pose for each frame."""
    written_by("test_frame_files").write_frames(folder, room)
    (folder / "camera-intrinsics.txt").write_text("32 0 31.5\n0 32 23.5\n0 0 1\n")
    return folder


def colmap(folder: Path, _: Miniature) -> Path:
    """A binary model."""
    writers = written_by("test_colmap")
    writers.write_pictures(folder / "images", "PINHOLE")
    writers.WRITERS["binary"](folder / "sparse/0", "PINHOLE")
    return folder


def ros1(folder: Path, room: Miniature) -> Path:
    """A robot's, of ROS 1."""
    bag = bags.Bag(bags.ROS1)
    bags.add_camera(bag, room)
    bags.add_tree(bag, room)
    return bag.write(folder / "room.bag")


def polycam(folder: Path, room: Miniature) -> Path:
    """A phone's, as the zip file that it exports."""
    write_polycam(folder / "capture", room)
    return zipped(folder / "capture", folder / "capture.zip")


def record3d(folder: Path, room: Miniature) -> Path:
    """Another phone's."""
    pytest.importorskip("lzfse")
    write_record3d(folder / "capture", room)
    return zipped(folder / "capture", folder / "capture.r3d")


LAYOUTS: dict[str, Callable[[Path, Miniature], Path]] = {
    "ScanNet": scannet,
    "ScanNet, extracted": extracted,
    "ScanNet++": lambda folder, _: scannetpp_writer.write_scan(folder),
    "Replica": write_replica,
    "TUM RGB-D": lambda folder, room: written_by("test_tum").write_tum(folder, room),
    "frame files": frame_files,
    "COLMAP": colmap,
    "ROS 2": lambda folder, room: bags.robot(room).write(folder / "room"),
    "ROS 1": ros1,
    "Polycam": polycam,
    "Record3D": record3d,
}


def reconstructed(scene: Path, out: Path, *options: str) -> None:
    """Run the command; the folder has a merged scene of at least two keyframes, with at least one Gaussian from each."""
    assert main(["reconstruct", str(scene), "--all", "--out", str(out), "--weights", "random", *options]) == 0
    merged = load_scene(out)
    assert merged.places is not None
    assert len(merged.frames) >= 2
    assert merged.own_views.unique().tolist() == list(range(len(merged.frames)))


def test_the_included_room_is_reconstructed_from_all_its_frames(tmp_path: Path) -> None:
    reconstructed(demo_scene(), tmp_path / "out", "--size", "48x64")


@pytest.mark.long
@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_recording_of_each_layout_runs_by_one_command(tmp_path: Path, layout: str) -> None:
    reconstructed(LAYOUTS[layout](tmp_path / "room", miniature()), tmp_path / "out")
