"""Data sets that scenezoo reads: one room in each of their layouts comes out as it went in."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from zoo_writer import (
    ARKIT,
    CENTRED,
    HOUSE,
    RIO,
    ROOM,
    SCAN,
    SIZE,
    K,
    Written,
    photographs,
    write_3rscan,
    write_arkitscenes,
    write_matterport3d,
    write_multiscan,
    write_structured3d,
)

from semgs.cli.main import main
from semgs.data.cameras.lens import Lens
from semgs.data.layouts.parts.mesh_maps import cast_from
from semgs.data.layouts.scannet.scannet_labels import FILE_NAME, read_table
from semgs.data.layouts.zoo.data_sets import DataSet, ZooCamera
from semgs.data.layouts.zoo.shots import ZooDepth
from semgs.data.layouts.zoo.zoo_mesh import SceneMesh, label_of, mesh_files
from semgs.data.layouts.zoo.zoo_scenes import zoo_scene
from semgs.data.origin.licences import terms_of
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.geometry.cameras import Cameras

ALL = {
    f"arkitscenes:{ARKIT}": write_arkitscenes,
    f"matterport3d:{HOUSE}": write_matterport3d,
    f"multiscan:{SCAN}": write_multiscan,
    f"3rscan:{RIO}": write_3rscan,
    f"structured3d:scene_00000:{ROOM}": write_structured3d,
}


@pytest.fixture
def library() -> None:
    for name in ("open3d", "scenezoo", "embreex"):
        pytest.importorskip(name)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("name", ALL)
def test_a_room_comes_out_of_every_data_set_as_it_went_in(tmp_path: Path, library: None, name: str):
    made = ALL[name](tmp_path / "data")
    scene = open_scene(made.root, scenezoo=name)
    assert (scene.layout, scene.unit, len(scene)) == (f"scenezoo {name.split(':')[0]}", "metric", len(made.poses))
    assert scene.notes == ()
    assert terms_of(scene).own
    check(scene, made, has_labels="arkit" not in name, coarse="3rscan" in name)
    sent = pickle.loads(pickle.dumps(scene))  # as to a worker of a training
    check(sent, made, has_labels="arkit" not in name, coarse="3rscan" in name)


def check(scene: Scene, made: Written, has_labels: bool, coarse: bool = False) -> None:
    """What is read is what was written; depth is coarse if its camera has a quarter of the pixels."""
    views = scene.read(range(len(scene)), size="native")
    assert views.size == SIZE
    torch.testing.assert_close(views.cameras.world_from_camera, torch.tensor(made.poses), atol=1e-6, rtol=0)
    expected = torch.tensor(made.intrinsics).expand(len(scene), 3, 3)
    torch.testing.assert_close(views.cameras.intrinsics, expected, atol=1e-4, rtol=0)
    images = torch.tensor(np.stack([photo.colour for photo in made.photos])).permute(0, 3, 1, 2) / 255
    assert (views.images - images).abs().mean() < 0.03  # JPEG and MPEG lose some
    truth = torch.tensor(np.stack([photo.depth for photo in made.photos]).astype(np.float32) / 1000)
    known = (views.depths > 0) & (truth > 0)
    assert known.float().mean() > 0.8
    off = (views.depths - truth)[known]
    assert off.abs().median() < (0.02 if coarse else 0.003)  # half floats have steps of 2 mm
    assert off.median().abs() < 0.003
    assert scene.unread_labels is None
    assert (views.labels is not None) == has_labels
    if has_labels:
        labels = torch.tensor(np.stack([photo.labels for photo in made.photos]))
        assert len(labels.unique()) > 4
        assert (views.labels == labels).float().mean() > 0.99  # rays through edges may end on either side


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_unreliable_depth_is_unknown(tmp_path: Path, library: None):
    scene = open_scene(write_arkitscenes(tmp_path).root, scenezoo=f"arkitscenes:{ARKIT}")
    depths = scene.read([0], size="native").depths[0]
    assert not depths[:, 0].any()
    assert depths[:, 1].all()


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_camera_of_a_data_set_can_be_chosen(tmp_path: Path, library: None):
    scene = open_scene(write_arkitscenes(tmp_path / "arkit").root, scenezoo=f"arkitscenes:{ARKIT}:vga_wide")
    assert scene.read([0, 1]).depths is None
    made = write_matterport3d(tmp_path / "house")
    raw = open_scene(made.root, scenezoo=f"matterport3d:{HOUSE}:raw").frames[1]
    assert raw.lens.coefficients == pytest.approx((0.05, -0.02, 0.001, -0.002, 0.01), abs=1e-6)
    assert raw.lens.centre == pytest.approx((K[0, 2], K[1, 2]), abs=1e-4)
    np.testing.assert_allclose(raw.world_from_camera, made.poses[1], atol=1e-6)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_what_was_not_downloaded_is_left_out_with_a_note(tmp_path: Path, library: None):
    made = write_matterport3d(tmp_path)
    (made.root / "category_mapping.tsv").unlink()
    scene = open_scene(made.root, scenezoo=f"matterport3d:{HOUSE}")
    assert scene.classes is None
    assert scene.notes == ("The labels are left out: category_mapping.tsv is not in the data set's folder.",)
    for file in (made.root / "v1/scans" / HOUSE / "undistorted_depth_images").iterdir():
        file.unlink()
    (note, _) = open_scene(made.root, scenezoo=f"matterport3d:{HOUSE}").notes
    assert note.startswith("The depth is left out: ")


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("name", ALL)
def test_an_unknown_scene_is_one_line_and_nothing_is_downloaded(
    tmp_path: Path, library: None, name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def refuse(*address: object) -> None:
        raise AssertionError(f"a connection to {address}")

    monkeypatch.setattr("socket.socket.connect", refuse)
    tmp_path.joinpath("data").mkdir()
    other = ":".join((name.split(":")[0], "scene_00007", *name.split(":")[2:]))
    assert main(["doctor", str(tmp_path / "data"), "--scenezoo", other]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "Traceback" not in said


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_commands_read_and_prepare_such_a_scene(tmp_path: Path, library: None):
    made = write_structured3d(tmp_path / "data")
    option = ["--scenezoo", f"structured3d:scene_00000:{ROOM}"]
    assert main(["prepare", str(made.root), str(tmp_path / "set"), *option, "--size", "48x64"]) == 0
    prepared = open_scene(tmp_path / "set" / f"structured3d_scene_00000_{ROOM}.zip")
    assert len(prepared) == len(made.poses)
    assert terms_of(prepared).own
    assert main(["doctor", str(made.root), *option]) in (0, 3)


class Stand:
    """Stands in for scenezoo's data set: what `get_frames`, `get_mesh` and `get_segmentation` return has the same attributes."""

    def __init__(self, made: Written, intrinsics: np.ndarray, *, model: str = "PINHOLE", depth_mode: str | None = None):
        self.made, self.intrinsics, self.model, self.depth_mode = made, intrinsics, model, depth_mode

    def get_frames(self, scene, *, indices=None, items=(), rotate_to_up=True, **keywords):
        if scene != "office":
            raise KeyError(f"Unknown sample {scene}.")
        assert not rotate_to_up
        chosen = list(range(len(self.made.poses))) if indices is None else indices
        photos = [self.made.photos[one] for one in chosen]
        held = {
            "rgb": [photo.colour for photo in photos],
            "depth": [photo.depth.astype(np.float32) / 1000 for photo in photos],
            "world_to_camera": [np.linalg.inv(self.made.poses[one]).astype(np.float32) for one in chosen],
            "rgb_intrinsics": [self.intrinsics.astype(np.float32)] * len(chosen),
            "depth_intrinsics": [self.intrinsics.astype(np.float32)] * len(chosen),
        }
        rest = dict.fromkeys(("distortion", "image_sizes", "frame_keys"))
        return SimpleNamespace(
            indices=np.array(chosen), camera_model=self.model, depth_mode=self.depth_mode, **rest,
            **{name: np.stack(held[name]) for name in items},
        )  # fmt: skip

    def get_mesh(self, scene, *, mesh_type):
        vertices = self.made.poses[0, :3, 3] + np.array([[-9.0, -9, 5], [9, -9, 5], [0, 20, 5]])
        return SimpleNamespace(vertices=vertices, triangles=np.array([[0, 1, 2]]))

    def get_segmentation(self, scene, **keywords):
        return SimpleNamespace(labels=np.array([7]), id_to_name={7: "Chair"}, domain="face")


def stand_in(stand: Stand, source: ZooCamera, scene: str = "office"):
    data = DataSet("multiscan", "MultiScan", (source,))
    return zoo_scene(stand, stand.made.root, scene, data, source, {}, names_known=True)


def test_half_a_pixel_is_added_where_the_first_centre_is_0(tmp_path: Path):
    made = photographs(tmp_path)
    check(stand_in(Stand(made, CENTRED), ZooCamera("", 0.5)), made, has_labels=False)
    check(stand_in(Stand(made, K), ZooCamera("", 0.0)), made, has_labels=False)


def test_rows_that_count_from_below_are_turned_round(tmp_path: Path):
    """Of 96 rows, 47.2 from the centre of the last one is 95 - 47.2 = 47.8 from that of the first, and 48.3 from the corner."""
    made = photographs(tmp_path)
    given = K.copy()
    given[:2, 2] = 62.6, 47.2
    lens = stand_in(Stand(made, given), ZooCamera("", 0.5, from_below=True)).frames[0].lens
    assert lens.centre == pytest.approx((63.1, 48.3), abs=1e-5)


def test_depth_of_a_camera_of_its_own_is_carried_over(tmp_path: Path):
    made = photographs(tmp_path)
    scene = stand_in(Stand(made, CENTRED), ZooCamera("", 0.5, own_depth_camera=True))
    depth = scene.frames[0].depth
    assert isinstance(depth, ZooDepth)
    assert isinstance(depth.lens, Lens)
    assert depth.lens.centre == pytest.approx((63.1, 48.8), abs=1e-5)
    check(scene, made, has_labels=False)


def test_a_triangle_has_the_label_of_its_name(tmp_path: Path):
    """Nine metres to each side of a wall above all cameras: chair is 4 of 20."""
    data = DataSet("multiscan", "MultiScan", (ZooCamera("", 0.0),), mesh="ply")
    mesh = SceneMesh(Stand(photographs(tmp_path), K), tmp_path, "office", data)
    assert mesh.triangles().labels.tolist() == [4]
    assert [label_of(name, None) for name in ("Chair", "refrigerator", "otherfurniture", "ceiling", "hat", None)] == [
        4, 14, 19, 255, 255, 255,
    ]  # fmt: skip


def test_a_mesh_that_was_looked_at_can_be_sent_to_a_worker(tmp_path: Path):
    data = DataSet("multiscan", "MultiScan", (ZooCamera("", 0.0),), mesh="ply")
    mesh = SceneMesh(Stand(photographs(tmp_path), K), tmp_path, "office", data)
    first = mesh.triangles()
    assert mesh.triangles() is first
    sent = pickle.loads(pickle.dumps(mesh))
    assert sent.triangles() is not first
    assert sent.triangles().labels.tolist() == [4]


def test_what_was_seen_of_a_mesh_is_kept_until_one_of_its_files_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("SEMGS_CACHE", str(tmp_path / "cache"))
    made = photographs(tmp_path / "data")
    ply = tmp_path / "data" / "v1" / "scans" / "office" / "house" / "office.ply"
    ply.parent.mkdir(parents=True)
    ply.write_bytes(b"ply")

    def mesh() -> SceneMesh:
        data = DataSet("matterport3d", "Matterport3D", (ZooCamera("", 0.0),), mesh="house")
        return SceneMesh(Stand(made, K), made.root, "office", data, mesh_files(made.root, "office"))

    assert ("v1/scans/office/house/office.ply", 3, ply.stat().st_mtime_ns) in mesh().files
    ahead = np.eye(4)  # the triangle of the stand-in is 5 m ahead of the first camera, along z
    ahead[:3, 3] = made.poses[0, :3, 3]
    camera = Cameras(ahead, K, SIZE)
    labels, depths = cast_from(mesh(), camera)
    assert (labels == 4).all()
    assert (depths == 5).all()
    assert len(list((tmp_path / "cache" / "casts" / "matterport3d").glob("*.npz"))) == 1

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("read again")

    monkeypatch.setattr(Stand, "get_mesh", refused)
    assert (cast_from(mesh(), camera)[0] == labels).all()
    ply.write_bytes(b"ply of another time")
    with pytest.raises(InputError, match="read again"):
        cast_from(mesh(), camera)


def test_what_a_mesh_shows_depends_on_the_names_in_scannets_table(tmp_path: Path):
    made, table = photographs(tmp_path), tmp_path / FILE_NAME

    def key(nyu40: int) -> tuple:
        table.write_text(f"id\traw_category\tnyu40id\n1\tchair\t{nyu40}\n")
        data = DataSet("multiscan", "MultiScan", (ZooCamera("", 0.0),), mesh="ply")
        return SceneMesh(Stand(made, K), made.root, "office", data, table=read_table(table)).key()

    assert key(5) == key(5) != key(6)
    assert (("chair", 5),) in key(5)


@pytest.mark.parametrize(
    ("stand", "scene", "said"),
    [
        ({"model": "FISHEYE624"}, "office", "expected a camera of PINHOLE or OPENCV, found FISHEYE624"),
        ({"depth_mode": "ray_distance"}, "office", "expected depth along the optical axis, found depth along rays"),
        ({}, "kitchen", "expected a data set that scenezoo can read, found Unknown sample kitchen."),
    ],
)
def test_what_is_not_supported_is_refused(tmp_path: Path, stand: dict, scene: str, said: str):
    with pytest.raises(InputError, match=said):
        stand_in(Stand(photographs(tmp_path), K, **stand), ZooCamera("", 0.0), scene)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("ase:1", "fisheye"),
        ("scannetv2:scene0000_00", "SemGS reads it without scenezoo"),
        ("s3dis:Area_1", "no images with poses"),
        ("arkitscenes:1:ultrawide", "has poses of the first only"),
        ("arkitscenes:1:far", "one of the cameras of arkitscenes: lowres_wide, vga_wide, wide, threedod"),
        ("structured3d:scene_00000", "expected a room, as in structured3d:SCENE:ROOM"),
        ("kitti:1", "expected one of the data sets arkitscenes, "),
    ],
)
def test_a_data_set_that_cannot_be_read_is_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, said: str
):
    assert main(["reconstruct", str(tmp_path), "--out", str(tmp_path / "out"), "--scenezoo", name]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_without_scenezoo_the_error_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "scenezoo", None)
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(ImportError, match=r"pip install -e '\.\[scenezoo\]'"):
        open_scene(tmp_path, scenezoo="3rscan:scan")


@pytest.mark.parametrize("name", ["3rscan", "3rscan:", "a:b:c:d"])
def test_a_name_of_another_form_is_refused(name: str):
    with pytest.raises(ValueError, match="expected DATASET:SCENE or DATASET:SCENE:PART"):
        open_scene(Path(), scenezoo=name)


def test_other_details_are_refused_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made = photographs(tmp_path)
    monkeypatch.setattr(
        "semgs.data.layouts.zoo.zoo_scenes.scenezoo_library",
        lambda: SimpleNamespace(get_dataset=opening(Stand(made, K))),
    )
    assert len(open_scene(tmp_path, scenezoo="arkitscenes:office:vga_wide")) == len(made.poses)
    with pytest.raises(InputError, match="leave it out"):
        open_scene(tmp_path, scenezoo="arkitscenes:office:vga_wide", depth_unit=0.001)


def opening(stand: Stand) -> Callable[..., Stand]:
    def get_dataset(name: str, root: Path, *, offline: bool) -> Stand:
        assert offline
        return stand

    return get_dataset
