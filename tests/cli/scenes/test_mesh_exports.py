"""`semgs export --as mesh mujoco`: what it writes, says and refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from blocks import BLOCKS, room_of_blocks
from exports import refused

from semgs.cli.main import main
from semgs.export.mjcf import posts
from semgs.scene.scene_file import save_scene

pytest.importorskip("skimage")
pytest.importorskip("sklearn")
trimesh = pytest.importorskip("trimesh")

TABLE = ("table", (2.0, -0.4, 0.0), (2.8, 0.5, 0.7))


def export(scene: Path, out: Path, *options: object) -> dict:
    """Run the command; the content of export.json."""
    assert main(["export", str(scene), "--out", str(out), "--up", "z", "--voxel", "0.05", *map(str, options)]) == 0
    return json.loads((out / "export.json").read_text())


def fields(file: Path) -> dict[str, np.ndarray]:
    """Our properties of the vertices of a PLY."""
    return trimesh.load(file, process=False).metadata["_ply_raw"]["vertex"]["data"]


def test_a_mesh_is_upright_in_both_formats_and_leads_back_to_the_scene(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = export(scene_file, tmp_path / "out", "--as", "mesh", "objects")
    assert "faces, up is Z" in capsys.readouterr().out
    ply = trimesh.load(tmp_path / "out" / "mesh.ply", process=False)
    glb = trimesh.load(tmp_path / "out" / "mesh.glb", process=False)
    assert set(glb.geometry) == {"chair_1", "chair_2", "room"}
    matrices = {one["name"]: np.array(one["scene_from_file"]) for one in record["files"]}
    assert [(one["name"], one["up"]) for one in record["files"]][:2] == [("mesh.ply", "z"), ("mesh.glb", "y")]
    for name, vertices in (("mesh.ply", ply.vertices), ("mesh.glb", glb.geometry["room"].vertices)):
        in_scene = vertices @ matrices[name][:3, :3].T + matrices[name][:3, 3]
        assert abs(np.percentile(in_scene[:, 2], 5)) < 0.05  # the floor
        assert in_scene[:, 0].max() == pytest.approx(4.02, abs=0.06)  # the wall
    raw = fields(tmp_path / "out" / "mesh.ply")
    names = [one["name"] for one in record["classes"]]
    chairs = np.asarray(raw["scalar_label"]).reshape(-1) == names.index("chair")
    assert set(np.unique(np.asarray(raw["scalar_instance"]).reshape(-1)[chairs])) <= {0, 1, 2}
    assert ply.vertices[chairs][:, 2].max() == pytest.approx(0.78, abs=0.1)  # z = 0 is the floor
    assert np.asarray(raw["scalar_confidence"]).max() == pytest.approx(0.8, abs=0.01)
    header = (tmp_path / "out" / "mesh.ply").read_bytes().split(b"end_header")[0].decode()
    assert "comment label 4 chair\n" in header
    assert f"element face {record['files'][0]['count']}\n" in header


def test_each_thing_has_its_own_files(scene_file: Path, tmp_path: Path) -> None:
    record = export(
        scene_file, tmp_path / "out", "--as", "mesh", "--per-thing", "--mesh-format", "ply", "--frame", "upright"
    )
    names = sorted(path.name for path in (tmp_path / "out" / "things").iterdir())
    assert names == ["chair_1.ply", "chair_2.ply", "room.ply"]
    assert [one["name"] for one in record["files"]] == [f"things/{name}" for name in names]
    for name in names[:2]:
        mesh = trimesh.load(tmp_path / "out" / "things" / name)
        assert mesh.extents[2] == pytest.approx(0.78, abs=0.12)
        assert 0.3 < mesh.extents[1] < 0.6  # 0.46 m
        assert set(np.unique(fields(tmp_path / "out" / "things" / name)["scalar_instance"])) <= {0, int(name[6])}


def test_a_simplified_mesh_has_about_as_many_faces_as_wanted(scene_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("fast_simplification")
    record = export(scene_file, tmp_path / "out", "--as", "mesh", "--faces", "500")
    assert 400 <= record["files"][0]["count"] <= 510


def test_only_the_wanted_classes_have_faces(scene_file: Path, tmp_path: Path) -> None:
    export(scene_file, tmp_path / "out", "--as", "mesh", "--classes", "chair", "wall", "--min-confidence", "0.5")
    raw = fields(tmp_path / "out" / "mesh.ply")
    assert set(np.unique(raw["scalar_label"])) == {0, 4}  # wall and chair
    assert np.asarray(raw["scalar_confidence"]).min() >= 0.5


def test_usd_has_the_mesh_by_thing_and_class_with_labels(scene_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdSemantics

    export(scene_file, tmp_path / "out", "--as", "mesh", "objects", "usd")
    stage = Usd.Stage.Open(str(tmp_path / "out" / "scene.usdc"))
    prims = {prim.GetName(): prim for prim in stage.GetPrimAtPath("/World/Meshes").GetChildren()}
    assert {"chair_1", "chair_2", "wall", "floor"} <= set(prims)
    for name, label in (("chair_1", "chair"), ("floor", "floor")):
        assert list(UsdSemantics.LabelsAPI(prims[name], "class").GetLabelsAttr().Get()) == [label]
    floor = UsdGeom.Mesh(prims["floor"])
    points = np.array(floor.GetPointsAttr().Get())
    assert np.median(np.abs(points[:, 2])) < 0.03
    assert len(floor.GetFaceVertexIndicesAttr().Get()) == 3 * len(floor.GetFaceVertexCountsAttr().Get())
    assert len(floor.GetDisplayColorAttr().Get()) == len(points)


def test_posts_are_cells_of_which_those_above_one_another_are_one() -> None:
    """Cells of 0.1 m, from 0.1 m above the floor at z = 1: a post of three cells stands on the floor, and two cells side by side float."""
    column = [(0.05, 0.05, z) for z in (1.15, 1.25, 1.35)]
    vertices = np.array([*column, (0.05, 0.05, 1.05), (0.55, 0.25, 1.75), (0.65, 0.25, 1.75)])
    found = posts(vertices, 1.0)
    np.testing.assert_allclose(found, [[[0, 0, 1], [0.1, 0.1, 1.4]], [[0.5, 0.2, 1.7], [0.7, 0.3, 1.8]]], atol=1e-9)
    assert posts(np.zeros((0, 3)), 0.0).shape == (0, 2, 3)


@pytest.mark.parametrize("contact", ["box", "hull"])
def test_in_mujoco_a_ball_rests_on_the_table_and_another_on_the_floor(tmp_path: Path, contact: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    save_scene(tmp_path / "scene.safetensors", room_of_blocks((*BLOCKS[:2], TABLE)))
    out = tmp_path / "out"
    export(tmp_path / "scene.safetensors", out, "--as", "mujoco", "objects", "--frame", "upright", "--contact", contact)
    (listed,) = json.loads((out / "objects.json").read_text())["objects"]
    spec = mujoco.MjSpec.from_file(str(out / "mujoco" / "scene.xml"))
    x, y, _ = listed["centre"]
    starts = {"above": (x, y, 1.5), "beside": (x, y + 1.2, 0.5)}
    for name, start in starts.items():
        ball = spec.worldbody.add_body(name=name, pos=start)
        ball.add_freejoint()
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.05, 0, 0], condim=6, friction=[1, 0.05, 0.05])
    model = spec.compile()
    bodies = [model.body(number).name for number in range(model.nbody)]
    assert bodies[:3] == ["world", "room", f"table_{listed['instance']}"]
    np.testing.assert_allclose(model.opt.gravity, (0, 0, -9.81))
    data = mujoco.MjData(model)
    for _ in range(int(3 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    top = listed["centre"][2] + listed["size"][2] / 2
    assert top == pytest.approx(0.7, abs=0.05)
    assert data.body("above").xpos[2] == pytest.approx(0.7 + 0.05, abs=0.06)
    assert data.body("beside").xpos[2] == pytest.approx(0.05, abs=0.03)


def test_what_cannot_become_a_mesh_is_refused_in_one_line(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, unit, single, plain = (tmp_path / name for name in ("out", "a.safetensors", "b.safetensors", "c.safetensors"))
    save_scene(unit, room_of_blocks(unit="unknown"))
    said = refused(capsys, unit, out, "--as", "mujoco")
    assert "expected a scene in metres for --as mujoco, found one whose unit is unknown" in said
    save_scene(plain, room_of_blocks(classes=False))
    assert "expected a scene with classes for --per-thing" in refused(capsys, plain, out, "--as", "mesh", "--per-thing")
    scene = room_of_blocks()
    half = len(scene.gaussians) // 2
    one = replace(
        scene, cameras=scene.cameras[:1], depths=scene.depths[:1], confidences=scene.confidences[:1], frames=("a",),
        depth_range=scene.depth_range[:1], gaussians=scene.gaussians.map(lambda every: every[:half]), stride=1,
    )  # fmt: skip
    save_scene(single, one)
    assert "a mesh needs two or more views, and the scene has one" in refused(capsys, single, out, "--as", "mesh")
    faint = replace(scene.gaussians, opacities=torch.full_like(scene.gaussians.opacities, 0.001))
    save_scene(plain, replace(scene, gaussians=faint))
    assert "a mesh needs depth, and the views of the scene see nothing" in refused(capsys, plain, out, "--as", "mesh")
    assert "are too small for a scene of this size" in refused(
        capsys, scene_file, out, "--as", "mesh", "--voxel", "1e-9"
    )
    for options, told in (
        (("--voxel", "0.02"), "--voxel is for --as mesh and mujoco"),
        (("--per-thing",), "--per-thing is for --as mesh"),
        (("--as", "mesh", "--contact", "hull"), "--contact is for --as mujoco"),
        (("--as", "mesh", "--mesh-format"), "--mesh-format: expected at least one value, found none"),
        (("--as", "mesh", "--voxel", "0"), "--voxel: expected a finite number, more than 0, found '0'"),
        (("--as", "mesh", "--faces", "0"), "--faces: expected a whole number, 1 or more, found '0'"),
    ):
        assert told in refused(capsys, scene_file, out, *options)


def test_a_splat_without_cameras_cannot_become_a_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.ply").write_bytes(b"ply\n")
    said = refused(capsys, tmp_path / "a.ply", tmp_path / "out", "--as", "mesh")
    assert "--as mesh needs views with depth; give the scene that has them with --cameras" in said


def test_without_scikit_image_the_extra_is_named(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "skimage.measure", None)
    monkeypatch.setitem(__import__("sys").modules, "skimage", None)
    assert "meshes need scikit-image: pip install -e '.[mesh]'" in refused(
        capsys, scene_file, tmp_path / "out", "--as", "mesh"
    )
