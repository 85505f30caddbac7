"""An uploaded scene, prepared and opened as the worker of the app does, reads no file outside of its zip, whichever field of whichever reader names it."""

from __future__ import annotations

import builtins
import io
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import predicted_files
import pytest
from dropped_files import zipped
from fuzz.scenes import (
    bag,
    colmap,
    other_cameras,
    phone,
    posed,
    replica,
    scannet,
    scannetpp,
    transforms,
    transforms_of_nerfstudio,
    transforms_with_points,
)
from image_sets import random_numbers, write_image_set
from known_scenes import write_scene

from semgs.app.limits import Limits
from semgs.app.uploads import UNPACKED, Upload, prepare
from semgs.data.scenes import LAYOUTS, open_scene
from semgs.files.confined import EXPECTED, VARIABLE, confine_to
from semgs.files.errors import InputError


def predictions(folder: Path) -> Path:
    """Predictions with the names of their photos, which are beside them."""
    made = predicted_files.SMALL
    made.write_photos(folder / "scene/photos")
    names = np.array([f"photos/{index:03d}.png" for index in range(made.count)])
    predicted_files.save(folder / "scene/predictions.npz", {**predicted_files.vggt(made), "names": names})
    return folder / "scene"


def labelled_images(folder: Path) -> Path:
    write_image_set(folder / "set", {name: random_numbers(seed, (24, 32)) for seed, name in enumerate("ab")})
    return folder / "set"


SAMPLES: dict[str, Callable[[Path], Path]] = {
    "transforms": transforms,
    "nerfstudio": transforms_of_nerfstudio,
    "instant-ngp": transforms_with_points("ascii"),
    "COLMAP text": colmap("text", "OPENCV"),
    "COLMAP binary": colmap("binary", "PINHOLE"),
    "Replica": replica,
    "TUM": posed("write_tum", "test_tum"),
    "RGB-D": posed("pose_files"),
    "ScanNet": scannet(True),
    "ScanNet recording": scannet(False),
    "ScanNet++": scannetpp,
    "ROS": bag("mcap"),
    "ROS in SQLite": bag("sqlite3"),
    "Polycam": phone("polycam"),
    "Record3D": phone("record3d"),
    "frame files": posed("write_frames", "test_frame_files"),
    "predictions": predictions,
    "LLFF": other_cameras("llff"),
    "Metashape": other_cameras("frame"),
    "labelled images": labelled_images,
}
"""Scenes with all files that their layouts can name, as the tests' own writers write them: at least one of each layout."""

REFUSED = {
    ("transforms", "transforms.json", "frames.file_path"),
    ("transforms", "transforms.json", "frames.depth_file_path"),
    ("transforms", "transforms.json", "frames.label_file_path"),
    ("nerfstudio", "transforms.json", "frames.mask_path"),
    ("nerfstudio", "transforms.json", "frames.file_path"),
    ("nerfstudio", "transforms.json", "frames.depth_file_path"),
    ("nerfstudio", "transforms.json", "frames.label_file_path"),
    ("instant-ngp", "transforms.json", "frames.file_path"),
    ("instant-ngp", "transforms.json", "frames.depth_path"),
    ("instant-ngp", "transforms.json", "frames.label_file_path"),
    ("instant-ngp", "transforms.json", "ply_file_path"),
    ("transforms", "transforms.json", "label_set"),
    ("COLMAP text", "images.txt", ""),
    ("COLMAP binary", "images.bin", ""),
    ("TUM", "rgb.txt", ""),
    ("TUM", "depth.txt", ""),
}
"""Sample, file and key of what names a file by its path; in every other place, readers take names without their folders, or what is no name."""

NAME = re.compile(r"[\w./-]+\.[A-Za-z]\w{1,4}(?![\w.])")
"""What looks like the name of a file in a text."""


@dataclass(frozen=True)
class Slot:
    """A place in a file of a sample with the name of a file.

    Attributes:
        file: relative to the sample.
        key: in JSON, the keys on the way to it.
        name: that is there.
        put: gives the content of the file with another name.
    """

    file: str
    key: str
    name: str
    put: Callable[[str], bytes]


def slots(sample: Path) -> Iterator[Slot]:
    """The first place of each kind with a text in JSON, and with what looks like the name of a file elsewhere."""
    for path in sorted(one for one in sample.rglob("*") if one.is_file()):
        file, data = path.relative_to(sample).as_posix(), path.read_bytes()
        if path.suffix == ".json" or path.name == "metadata":
            found: dict[str, list[Any]] = {}
            tree = json.loads(data)
            texts_in(tree, (), found)
            for key, place in found.items():
                yield Slot(file, key, at(tree, place), lambda name, data=data, place=place: changed(data, place, name))
        elif path.suffix in (".txt", ".xml", ".yaml", ".tsv", ".bin", ".ply"):
            text = data.decode("latin-1")
            shown = [
                one for one in NAME.finditer(text) if not text[text.rfind("\n", 0, one.start()) + 1 :].startswith("#")
            ]
            for one in shown[:1]:
                yield Slot(
                    file, "", one[0],
                    lambda name, text=text, one=one: (text[: one.start()] + name + text[one.end() :]).encode("latin-1"),
                )  # fmt: skip


def texts_in(tree: Any, place: tuple[Any, ...], found: dict[str, list[Any]]) -> None:
    """The first place of each text by its keys, without positions in lists."""
    if isinstance(tree, str):
        found.setdefault(".".join(one for one in place if isinstance(one, str)), list(place))
    for key in tree if isinstance(tree, dict) else range(min(len(tree), 40)) if isinstance(tree, list) else ():
        texts_in(tree[key], (*place, key), found)


def at(tree: Any, place: list[Any]) -> Any:
    for key in place:
        tree = tree[key]
    return tree


def changed(data: bytes, place: list[Any], name: str) -> bytes:
    tree = json.loads(data)
    at(tree, place[:-1])[place[-1]] = name
    return json.dumps(tree).encode()


class Watch:
    """Which paths below a folder this process asks for or opens."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.seen = str(folder), list[str]()
        for holder, name in (
            (os, "stat"), (os, "lstat"), (os, "open"), (os, "scandir"), (os, "listdir"), (os, "readlink"), (builtins, "open"), (io, "open"),
        ):  # fmt: skip
            monkeypatch.setattr(holder, name, self.noting(getattr(holder, name)))

    def noting(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **more: Any) -> Any:
            path = arguments[0] if arguments else "."
            if isinstance(path, str | os.PathLike) and os.path.abspath(path).startswith(self.folder):  # noqa: PTH100
                self.seen.append(os.fspath(path))
            return function(*arguments, **more)

        return call


@pytest.fixture(autouse=True)
def unconfined(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """After a test, this process is as before; caches are in the test's folder."""
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv("SEMGS_CACHE", str(tmp_path / "cache"))


def upload(sample: Path, replaced: dict[str, bytes], work: Path) -> Path:
    """The scene from a zip of a sample with other files, as the worker prepares it and confines itself."""
    members = {one.relative_to(sample).as_posix(): one.read_bytes() for one in sample.rglob("*") if one.is_file()}
    archive = zipped(work.parent / "upload.zip", {**members, **replaced})
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir()
    scene, _ = prepare("archive", [Upload(archive.path, "my.zip")], work, Limits(), lambda title: None)
    confine_to(work / UNPACKED)
    return scene


def outcome(scene: Path) -> str:
    """How it ends to open a scene and read its first frames: the error in one line, or "read"."""
    try:
        opened = open_scene(scene, needs_cameras=False)
        opened.read(range(min(2, len(opened))), (24, 32))
    except (InputError, ImportError) as error:
        assert "\n" not in str(error)
        return str(error)
    return "read"


@pytest.mark.parametrize("name", SAMPLES)
def test_an_honest_scene_is_read_and_a_name_that_leads_outside_touches_nothing_there(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    sample = SAMPLES[name](tmp_path / "made")
    work, outside = tmp_path / "job/work", tmp_path / "outside"
    work.mkdir(parents=True)
    outside.mkdir()
    assert outcome(upload(sample, {}, work)) == "read"
    refused = set()
    watch = Watch(outside, monkeypatch)
    for slot in slots(sample):
        secret = outside / f"secret{PurePosixPath(slot.name).suffix or '.png'}"
        content = sample / PurePosixPath(slot.file).parent / slot.name
        for lead in ("/", "../" * 30):
            lines = []
            for exists in (True, False):
                if exists and content.is_file():
                    shutil.copy(content, secret)
                elif exists:
                    secret.write_bytes(b"x")
                else:
                    secret.unlink()
                scene = upload(sample, {slot.file: slot.put(lead + str(secret).lstrip("/"))}, work)
                watch.seen.clear()
                lines.append(outcome(scene))
                assert watch.seen == [], slot
            assert lines[0] == lines[1], slot
            if EXPECTED in lines[0]:
                refused.add((name, PurePosixPath(slot.file).name, slot.key))
    assert refused == {one for one in REFUSED if one[0] == name}


def test_every_reader_has_a_sample(tmp_path: Path):
    read = set()
    for name, write in SAMPLES.items():
        sample = write(tmp_path / name)
        read.add(next(place for place, layout in enumerate(LAYOUTS) if layout.recognises(sample)))
    assert read == set(range(len(LAYOUTS))), "add a sample of the new layout to SAMPLES"
