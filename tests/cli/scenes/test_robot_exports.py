"""`semgs export --as objects occupancy`: what it writes, says and refuses."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from blocks import room_of_blocks
from exports import refused
from glb import read_glb
from PIL import Image

from semgs.cli.main import main
from semgs.scene.scene_file import save_scene

pytest.importorskip("sklearn")
pytest.importorskip("trimesh")


def test_things_have_boxes_in_json_and_gltf_and_numbers_in_every_file(scene_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    formats = ("objects", "ply", "points", "gltf")
    assert main(["export", str(scene_file), "--out", str(out), "--as", *formats, "--up", "z"]) == 0
    content = json.loads((out / "objects.json").read_text())
    assert [(one["instance"], one["class"]) for one in content["objects"]] == [(1, "chair"), (2, "chair")]
    record = json.loads((out / "export.json").read_text())
    matrices = {file["name"]: np.array(file["scene_from_file"]) for file in record["files"]}
    glb = read_glb(out / "gaussians.glb")
    assert [node.get("name") for node in glb.content["nodes"]] == [None, "chair 1", "chair 2"]
    assert glb.content["scenes"][0]["nodes"] == [0, 1, 2]
    assert set(np.unique(glb.attribute("_INSTANCE"))) == {0, 1, 2}
    for one, node in zip(content["objects"], glb.content["nodes"][1:], strict=True):
        world = matrices["objects.json"] @ [*one["centre"], 1.0]
        assert world[2] == pytest.approx(0.39, abs=0.06)  # half of 0.78 m
        assert abs(world[1]) == pytest.approx(0.65, abs=0.15)
        np.testing.assert_allclose(matrices["gaussians.glb"] @ [*node["translation"], 1.0], world, atol=2e-4)
        assert node["scale"] == pytest.approx(one["size"], abs=1e-4)
        assert 1.9 < one["distance"] < 2.3
        assert one["confidence"] == pytest.approx(0.8, abs=1e-4)
        assert -90 <= one["yaw_degrees"] <= 90
    header = (out / "gaussians.ply").read_bytes().split(b"end_header\n")[0].decode().split()
    assert header[-1] == "instance"
    trimesh = pytest.importorskip("trimesh")
    numbers = trimesh.load(out / "points.ply").metadata["_ply_raw"]["vertex"]["data"]["scalar_instance"]
    np.testing.assert_array_equal(np.asarray(numbers).reshape(-1), glb.attribute("_INSTANCE")[:, 0])


def test_things_are_prims_of_usd_with_their_boxes_where_the_list_has_them(scene_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdSemantics

    out = tmp_path / "out"
    assert main(["export", str(scene_file), "--out", str(out), "--as", "objects", "usd", "--up", "z"]) == 0
    listed = json.loads((out / "objects.json").read_text())["objects"]
    stage = Usd.Stage.Open(str(out / "scene.usdc"))
    things = stage.GetPrimAtPath("/World/Objects").GetChildren()
    assert [thing.GetName() for thing in things] == ["chair_1", "chair_2"]
    guides = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["guide"])
    for one, thing in zip(listed, things, strict=True):
        assert list(UsdSemantics.LabelsAPI(thing, "class").GetLabelsAttr().Get()) == ["chair"]
        # Both files have z up.
        bounds = guides.ComputeWorldBound(thing)
        np.testing.assert_allclose(bounds.ComputeCentroid(), one["centre"], atol=1e-4)
        assert bounds.ComputeAlignedRange().GetSize()[2] == pytest.approx(one["size"][2], abs=2e-4)
    chairs = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/World/Gaussians/chair")).GetPrimvar("instance")
    assert set(chairs.Get()) >= {1, 2}


def test_a_robots_map_is_in_the_coordinates_of_its_poses(scene_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "map"
    assert main(["export", str(scene_file), "--out", str(out), "--as", "occupancy", "--frame", "scene"]) == 0
    settings = dict(line.split(": ", 1) for line in (out / "map.yaml").read_text().splitlines())
    x, y, _ = json.loads(settings["origin"])
    image = np.asarray(Image.open(out / "map.pgm"))

    def pixel(at: tuple[float, float]) -> int:
        return int(image[image.shape[0] - 1 - int((at[1] - y) / 0.05), int((at[0] - x) / 0.05)])

    assert [pixel(at) for at in ((1.6, -0.1), (2.03, 0.5), (4.03, -0.1), (2.9, 0.75))] == [254, 0, 0, 205]
    with np.load(out / "voxels.npz") as voxels:
        assert voxels["voxels"].shape[1:] == image.shape


def test_what_robots_cannot_use_is_refused_in_one_line(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, room = tmp_path / "out", room_of_blocks()
    unknown, colour, ceiling = (tmp_path / f"{name}.safetensors" for name in ("unknown", "colour", "ceiling"))
    save_scene(unknown, replace(room, unit="unknown"))
    save_scene(colour, room_of_blocks(classes=False))
    save_scene(ceiling, room_of_blocks(blocks=(("wall", (3.0, -9.0, -5.0), (4.0, 9.0, 9.0)),)))
    for name in ("objects", "occupancy"):
        assert "with --scale-from if its cameras were estimated, or with --unit metric if" in refused(
            capsys, unknown, out, "--as", name
        )
    assert "a scene with classes for --as objects" in refused(capsys, colour, out, "--as", "objects")
    assert "a scene that shows the floor, found no clear floor (" in refused(
        capsys, ceiling, out, "--as", "occupancy", "--up", "z"
    )
    assert "expected a smaller step" in refused(capsys, scene_file, out, "--as", "occupancy", "--step-height", 2)
    assert "expected a finite number, more than 0, found '0'" in refused(
        capsys, scene_file, out, "--as", "occupancy", "--resolution", 0
    )
    assert "larger resolution" in refused(capsys, scene_file, out, "--as", "occupancy", "--resolution", 0.001)
    side = tmp_path / "side.safetensors"
    save_scene(side, _on_its_side())
    assert "needs poses with z up" in refused(capsys, side, out, "--as", "occupancy", "--frame", "scene")


def _on_its_side():
    """The room in a world with y up."""
    import torch
    from blocks import turned

    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3, :3] = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    return turned(room_of_blocks(), matrix)


@pytest.mark.parametrize("library", ["sklearn.cluster", "trimesh.bounds"])
def test_without_the_extra_its_name_is_the_answer(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    assert "pip install -e '.[objects]'" in refused(capsys, scene_file, tmp_path / "out", "--as", "objects")


def test_a_scene_without_things_gives_an_empty_list(tmp_path: Path) -> None:
    save_scene(tmp_path / "bare.safetensors", room_of_blocks(blocks=room_of_blocks.__defaults__[0][:2]))
    out = tmp_path / "out"
    assert (
        main(["export", str(tmp_path / "bare.safetensors"), "--out", str(out), "--as", "objects", "gltf", "--up", "z"])
        == 0
    )
    assert json.loads((out / "objects.json").read_text())["objects"] == []
    assert len(read_glb(out / "gaussians.glb").content["nodes"]) == 1


def test_the_viewers_page_has_the_boxes(scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser")
    page = tmp_path / "page.html"
    assert main(["view", str(scene_file), "--objects", "--up", "z", "--html", str(page)]) == 0
    save_scene(tmp_path / "unknown.safetensors", replace(room_of_blocks(), unit="unknown"))
    capsys.readouterr()
    assert main(["view", str(tmp_path / "unknown.safetensors"), "--objects", "--html", str(tmp_path / "b.html")]) == 2
    assert "--scale-from" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("scene", "formats", "written", "said"),
    [
        ("no floor", ("objects", "occupancy"), {"objects.json"}, "--as occupancy is not written: .* no clear floor"),
        ("no classes", ("ply", "objects"), {"gaussians.ply"}, "--as objects is not written: .* a scene with classes"),
        (
            "no metres",
            ("points", "objects", "occupancy"),
            {"points.ply"},
            "--as objects is not written: .* a scene in metres",
        ),
    ],
)
def test_what_can_be_written_is_and_what_cannot_is_named(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    scene: str,
    formats: tuple[str, ...],
    written: set[str],
    said: str,
) -> None:
    room = {
        "no floor": room_of_blocks(blocks=(("wall", (3.0, -9.0, -5.0), (4.0, 9.0, 9.0)),)),
        "no classes": room_of_blocks(classes=False),
        "no metres": replace(room_of_blocks(), unit="unknown"),
    }[scene]
    save_scene(tmp_path / "a.safetensors", room)
    out = tmp_path / "out"
    assert main(["export", str(tmp_path / "a.safetensors"), "--out", str(out), "--as", *formats, "--up", "z"]) == 3
    assert {path.name for path in out.iterdir()} == {*written, "export.json", ".semgs"}
    shown = capsys.readouterr().err.splitlines()
    assert len(shown) == len(formats) - 1
    assert re.search(said, shown[0])
