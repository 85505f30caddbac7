"""An uploaded scene, prepared and opened as the worker of the app does, reads no file outside of its zip, whichever field of whichever reader names it."""

from __future__ import annotations

import builtins
import io
import json
import os
import re
import shutil
import stat
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import predicted_files
import pytest
import scannetpp_writer
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
from semgs.app.uploads import UNPACKED, UnusableUploadError, Upload, prepare, unpack
from semgs.data.confined import EXPECTED, VARIABLE, confine_to
from semgs.data.demo_scene import demo_scene
from semgs.data.layouts.parts.fields import Fields
from semgs.data.scenes import LAYOUTS, open_scene
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_header, read_optics, read_rgb, read_upright


def predictions(folder: Path) -> Path:
    """Predictions with the names of their photos, which are beside them."""
    made = predicted_files.Made((100, 140), (364, 504), (3.6, 3.64))
    made.write_photos(folder / "scene/photos")
    names = np.array([f"photos/{index:03d}.png" for index in range(made.count)])
    fields = predicted_files.depth_anything(made, mini=False)
    predicted_files.save(folder / "scene/predictions.npz", {**fields, "names": names})
    return folder / "scene"


def scannetpp_device(write: Callable[[Path], None]) -> Callable[[Path], Path]:
    """A scan of ScanNet++ with one device and without its mesh, which takes seconds."""

    def write_scan(folder: Path) -> Path:
        (folder / "scan").mkdir(parents=True)
        write(folder / "scan")
        return folder / "scan"

    return write_scan


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
    "ScanNet++": scannetpp_device(scannetpp_writer.write_phone),
    "ScanNet++ of a camera": scannetpp_device(scannetpp_writer.write_dslr),
    "ScanNet++ with its mesh": scannetpp,
    "ROS": bag("mcap"),
    "Polycam": phone("polycam"),
    "Record3D": phone("record3d"),
    "frame files": posed("write_frames", "test_frame_files"),
    "predictions": predictions,
    "LLFF": other_cameras("llff"),
    "Metashape": other_cameras("frame"),
    "labelled images": labelled_images,
}
"""Scenes with all files that their layouts can name, as the tests' own writers write them: at least one of each layout."""

SLOW = ("ScanNet++ of a camera", "ScanNet++ with its mesh")

REFUSED = {
    ("transforms", "transforms.json", "frames.file_path"),
    ("transforms", "transforms.json", "frames.depth_file_path"),
    ("transforms", "transforms.json", "frames.label_file_path"),
    ("nerfstudio", "transforms.json", "frames.mask_path"),
    ("nerfstudio", "transforms.json", "frames.instance_file_path"),
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
        elif path.suffix == ".npz":
            with np.load(path) as arrays:
                fields = dict(arrays)
            if "names" in fields:
                yield Slot(file, "names", str(fields["names"][0]), lambda name, fields=fields: renamed(fields, name))
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


def renamed(fields: dict[str, np.ndarray], name: str) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **{**fields, "names": np.array([name, *fields["names"][1:].tolist()])})
    return buffer.getvalue()


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
    scene = prepare("archive", [Upload(archive.path, "my.zip")], work, Limits(), lambda title: None).scene
    confine_to(work / UNPACKED)
    return scene


def outcome(scene: Path) -> str:
    """How it ends to open a scene and read its first frames: the error in one line, or "read"."""
    try:
        opened = open_scene(scene, needs_cameras=False)
        opened.read(range(min(2, len(opened))), (24, 32))
    except InputError as error:
        return str(error)
    return "read"


@pytest.mark.parametrize("name", [pytest.param(one, marks=pytest.mark.long) if one in SLOW else one for one in SAMPLES])
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
        lines = []
        for lead, exists in (("/", True), ("../" * 30, True), ("/", False)):
            if not exists:
                secret.unlink()
            elif content.is_file():
                shutil.copy(content, secret)
            else:
                secret.write_bytes(b"x")
            scene = upload(sample, {slot.file: slot.put(lead + str(secret).lstrip("/"))}, work)
            watch.seen.clear()
            lines.append(outcome(scene))
            assert watch.seen == [], slot
        assert lines[0] == lines[2], slot
        refused |= {(name, PurePosixPath(slot.file).name, slot.key) for line in lines[:2] if EXPECTED in line}
    assert refused == {one for one in REFUSED if one[0] == name}


def test_every_reader_and_every_text_that_it_asks_for_is_in_a_sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    asked, ask = set[str](), Fields.text
    monkeypatch.setattr(Fields, "text", lambda fields, key: asked.add(key) or ask(fields, key))
    layouts, keys = set[int](), set[str]()
    for name, write in SAMPLES.items():
        if name not in SLOW:
            sample = write(tmp_path / name)
            layouts.add(next(place for place, layout in enumerate(LAYOUTS) if layout.recognises(sample)))
            keys |= {slot.key.rpartition(".")[2] for slot in slots(sample)}
            open_scene(sample, needs_cameras=False)
    assert layouts == set(range(len(LAYOUTS))), "add a sample of the new layout to SAMPLES"
    assert asked - keys == set(), "add a scene with these keys to SAMPLES, so that the test above replaces their values"


KINDS = {
    "absolute": lambda secret, scene: str(secret),
    "climbing": lambda secret, scene: os.path.relpath(secret, scene),
    "climbing as on Windows": lambda secret, scene: os.path.relpath(secret, scene).replace("/", "\\"),
    "climbing far": lambda secret, scene: "../" * 40 + str(secret).lstrip("/"),
    "through a folder": lambda secret, scene: "images/" + "../" + os.path.relpath(secret, scene),
    "through the process": lambda secret, scene: f"/proc/self/root{secret}",
    "an address": lambda secret, scene: f"file://{secret}",
    "a home": lambda secret, scene: "~/secret.png",
    "a device": lambda secret, scene: "/dev/zero",
    "a name of many letters": lambda secret, scene: "a" * 5000,
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_real_photo_outside_is_refused_in_the_same_words_as_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
):
    sample, work, secret = tmp_path / "room", tmp_path / "job/work", tmp_path / "home/secret.png"
    work.mkdir(parents=True)
    secret.parent.mkdir()
    monkeypatch.setenv("HOME", str(secret.parent))
    write_scene(sample, 3, (24, 32))
    described = json.loads((sample / "transforms.json").read_text())
    described["frames"][1]["file_path"] = KINDS[kind](secret, work / UNPACKED)
    lines = []
    for exists in (True, False):
        if exists:
            shutil.copy(sample / "images/001.png", secret)
        else:
            secret.unlink()
        lines.append(outcome(upload(sample, {"transforms.json": json.dumps(described).encode()}, work)))
    assert EXPECTED in lines[0]
    assert lines[0] == lines[1]
    if kind in ("absolute", "climbing"):  # as on the command line, where the photo would be read
        monkeypatch.setenv(VARIABLE, "")
        shutil.copy(sample / "images/001.png", secret)
        assert outcome(work / UNPACKED) == "read"


@pytest.mark.parametrize("lead", ["images/", "./images/", "images/../images/", "../images/", "../deep/../images/"])
def test_a_zip_whose_names_climb_inside_of_it_is_read(tmp_path: Path, lead: str):
    work, sample = tmp_path / "job/work", tmp_path / "room"
    work.mkdir(parents=True)
    write_scene(sample, 3, (24, 32))
    text = (sample / "transforms.json").read_text().replace('"images/', f'"{lead}')
    file = "deep/transforms.json" if lead.startswith("..") else "transforms.json"
    text = text.replace('"labels/', '"../labels/').replace('"depth/', '"../depth/') if "deep" in file else text
    (sample / "transforms.json").unlink()
    scene = upload(sample, {file: text.encode()}, work)
    assert outcome((scene / file).parent) == "read"


def test_a_link_out_of_the_scene_is_refused_wherever_it_comes_from(tmp_path: Path):
    """No link comes out of a zip; the files of an opened scene are checked again."""
    sample, work, outside = tmp_path / "room", tmp_path / "job/work", tmp_path / "outside"
    work.mkdir(parents=True)
    sample.mkdir()
    outside.mkdir()
    write_image_set(sample / "set", {one: random_numbers(seed, (24, 32)) for seed, one in enumerate("ab")})
    scene = upload(sample / "set", {}, work)
    shutil.move(scene / "images/a.png", outside / "a.png")
    (scene / "images/a.png").symlink_to(outside / "a.png")
    assert outcome(scene).endswith(f"expected {EXPECTED}, found one that leads out of it")


def test_the_included_scene_opens_wherever_a_process_is_confined(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    (tmp_path / "included_room").symlink_to(demo_scene())
    for scene in (demo_scene(), tmp_path / "included_room"):
        assert open_scene(scene).read([0]).labels is not None
    shutil.copytree(demo_scene(), tmp_path.parent / f"{tmp_path.name}_copy")
    with pytest.raises(InputError, match=EXPECTED):
        open_scene(tmp_path.parent / f"{tmp_path.name}_copy")


def test_a_mesh_opens_no_texture_that_its_header_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("trimesh")
    from semgs.data.layouts.scannetpp.scannetpp_mesh import read_mesh

    (tmp_path / "outside").mkdir()
    write_scene(tmp_path / "room", 2, (24, 32))
    shutil.copy(tmp_path / "room/images/000.png", tmp_path / "outside/a.png")
    head = "ply\nformat ascii 1.0\ncomment TextureFile {}\nelement vertex 3\n" + "".join(
        f"property float {axis}\n" for axis in "xyz"
    )
    body = "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    (tmp_path / "mesh.ply").write_text(head.format(tmp_path / "outside/a.png") + body)
    watch = Watch(tmp_path / "outside", monkeypatch)
    vertices, faces = read_mesh(tmp_path / "mesh.ply")
    assert (len(vertices), len(faces), watch.seen) == (3, 1, [])


@pytest.mark.parametrize(
    "kind", [stat.S_IFIFO, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFSOCK, stat.S_IFDIR, stat.S_IFREG | stat.S_ISUID]
)
def test_only_files_and_folders_come_out_of_a_zip(tmp_path: Path, kind: int):
    member = zipfile.ZipInfo("images/0.jpg")
    member.external_attr = (kind | 0o777) << 16
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr(member, b"x")
    with suppress(UnusableUploadError):
        unpack(Upload(tmp_path / "a.zip", "a.zip"), tmp_path / "out", Limits())
    for path in (tmp_path / "out").rglob("*"):
        mode = path.lstat().st_mode
        assert stat.S_ISREG(mode) or stat.S_ISDIR(mode), path
        assert not mode & (stat.S_ISUID | stat.S_ISGID)


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "a.heic"])
@pytest.mark.parametrize(
    "content",
    [
        "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n({secret}) run\n",
        '<svg xmlns="http://www.w3.org/2000/svg"><image href="{secret}"/></svg>',
        "push graphic-context\nimage over 0,0 9,9 '{secret}'\npop graphic-context\n",
        "GIF89a",
        "P3 {secret}",
        "#EXTM3U\n{secret}\n",
    ],
)  # fmt: skip
def test_a_photo_that_is_a_program_or_a_list_is_not_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content: str
):
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside/secret").write_bytes(b"x")
    (tmp_path / name).write_text(content.format(secret=tmp_path / "outside/secret"))
    watch = Watch(tmp_path / "outside", monkeypatch)
    for read in (read_header, read_rgb, read_upright, read_optics):
        with pytest.raises(InputError):
            read(tmp_path / name)
    assert watch.seen == []
