"""transforms.json in a zip archive: however it was packed, it is read as the folder is."""

from __future__ import annotations

import pickle
import zipfile
from pathlib import Path

import pytest
import torch

from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene, open_scenes
from semgs.files.errors import InputError


def packed(path: Path, below: str = "", method: int = zipfile.ZIP_STORED) -> Path:
    """The embedded scene in an archive."""
    with zipfile.ZipFile(path, "w", method) as archive:
        for file in sorted(demo_scene().rglob("*")):
            archive.write(file, below + file.relative_to(demo_scene()).as_posix())
        archive.writestr("__MACOSX/transforms.json", b"\0")
    return path


@pytest.mark.parametrize(("below", "method"), [("", zipfile.ZIP_STORED), ("my room/", zipfile.ZIP_DEFLATED)])
def test_an_archive_reads_as_its_folder(tmp_path: Path, below: str, method: int):
    scene, folder = open_scene(packed(tmp_path / "bed room.zip", below, method)), open_scene(demo_scene())
    assert (scene.name, scene.unit, scene.classes, len(scene)) == ("bed room", folder.unit, folder.classes, len(folder))
    assert [frame.name for frame in scene.frames] == [frame.name for frame in folder.frames]
    views, same = pickle.loads(pickle.dumps(scene)).read([5, 1]), folder.read([5, 1])
    assert torch.equal(views.images, same.images)
    assert torch.equal(views.labels, same.labels)
    assert torch.equal(views.depths, same.depths)
    assert torch.equal(views.cameras.world_from_camera, same.cameras.world_from_camera)


def test_archives_in_a_folder_are_its_scenes_and_others_are_passed_over(tmp_path: Path):
    packed(tmp_path / "b.zip")
    packed(tmp_path / "a.zip")
    with zipfile.ZipFile(tmp_path / "labels.zip", "w") as archive:
        archive.writestr("label-filt/0.png", b"")
    assert [scene.name for scene in open_scenes(tmp_path)] == ["a", "b"]


def test_a_damaged_archive_is_told_of_with_its_member(tmp_path: Path):
    path = packed(tmp_path / "a.zip")
    scene = open_scene(path)
    data = bytearray(path.read_bytes())
    data[1000] ^= 255
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.zip/depth/000\.png: .* its bytes differ from what the archive lists"):
        scene.read([0, 1])
    path.write_bytes(data[:5000])
    with pytest.raises(InputError, match=r"a\.zip: expected a zip archive"):
        open_scene(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", b"hello")
    with pytest.raises(InputError, match=r"a\.zip: expected a scene, found no known layout"):
        open_scene(path)
