from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import torch
from glb import FLOAT, Glb, read_glb

from semgs.data.tables.classes import SCANNET20
from semgs.export.gltf import save_gltf
from semgs.export.scene_objects import PlacedThing
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.harmonics import colours_from_harmonics
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.robotics.boxes import Box
from semgs.robotics.objects import Thing
from semgs.scene.scene_file import SavedScene

SPLAT = "KHR_gaussian_splatting"


def scene_of(gaussians: Gaussians) -> SavedScene:
    """A scene of these Gaussians, as if from one view of 2x3 pixels."""
    return SavedScene(
        gaussians=gaussians,
        cameras=Cameras(torch.eye(4)[None].double(), torch.tensor([[[5.0, 0, 1.2], [0, 6, 1.3], [0, 0, 1]]]), (2, 3)),
        depths=torch.ones(1, 2, 3),
        confidences=torch.linspace(0.1, 0.6, 6).reshape(1, 2, 3),
        depth_range=torch.tensor([[0.5, 8.0]], dtype=torch.float64),
        unit="metric",
        classes=None if gaussians.semantic is None else SCANNET20,
        frames=("a.jpg",),
        source="office",
        model="small",
        places=torch.arange(len(gaussians)),
    )


def some_scene(harmonics: int = 16, classes: bool = True) -> SavedScene:
    """A scene of six random Gaussians."""
    draw = torch.Generator().manual_seed(5)

    def shape(features: torch.Tensor) -> Appearance:
        quaternions = torch.nn.functional.normalize(torch.randn(6, 4, generator=draw), dim=-1)
        return Appearance(quaternions, torch.rand(6, 3, generator=draw), features)

    return scene_of(
        Gaussians(
            means=torch.randn(6, 3, generator=draw),
            opacities=torch.rand(6, generator=draw),
            colour=shape(torch.randn(6, harmonics, 3, generator=draw)),
            semantic=shape((torch.randn(6, 20, generator=draw) * 3).softmax(-1)) if classes else None,
        )
    )


def written(folder: Path, scene: SavedScene) -> Glb:
    save_gltf(folder / "a.glb", scene)
    return read_glb(folder / "a.glb")


def test_two_gaussians_worked_out_by_hand(tmp_path: Path) -> None:
    half = 0.5**0.5
    chances = torch.full((2, 20), 0.0125)  # 19 of these and 0.7625 are 1
    chances[0, 5] = chances[1, 19] = 0.7625
    quaternions = torch.tensor([[half, half, 0.0, 0.0], [0.6, 0.0, 0.0, -0.8]])
    harmonics = torch.zeros(2, 4, 3)
    harmonics[0, 0] = torch.tensor([0.0, 1.0, -1.0])
    harmonics[0, 1:] = torch.arange(1.0, 10.0).reshape(3, 3)
    harmonics[1, 0] = torch.tensor([2.0, -2.0, 0.5])
    colour = Appearance(quaternions, torch.tensor([[0.125, 0.25, 0.5], [0.0, 1.0, 2.0]]), harmonics)
    semantic = Appearance(quaternions.flip(0), torch.ones(2, 3), chances)
    means = torch.tensor([[1.0, 2.0, 3.0], [-1.0, 0.1, 5.0]])
    glb = written(tmp_path, scene_of(Gaussians(means, torch.tensor([0.25, 1.0]), colour, semantic)))

    def floats(*values: float) -> bytes:
        return struct.pack(f"<{len(values)}f", *values)

    assert glb.body == b"".join(
        (
            floats(1, 2, 3, -1, 0.1, 5),
            # 255 (0.5 + 0.282 (0, 1, -1)) and 255 / 4; the second is 1.06, -0.06 and 0.64 before it is clamped
            bytes([128, 199, 56, 64, 255, 0, 163, 255]),
            floats(half, 0, 0, half, 0, 0, -0.8, 0.6),
            floats(0.125, 0.25, 0.5, 0, 1, 2),
            floats(0.25, 1),
            floats(0, 1, -1, 2, -2, 0.5),
            *(floats(a, a + 1, a + 2, 0, 0, 0) for a in (1, 4, 7)),
            floats(5, 19),
            floats(0.7625, 0.7625),
        )
    )
    assert list(glb.primitive["attributes"].items()) == [
        ("POSITION", 0),
        ("COLOR_0", 1),
        (f"{SPLAT}:ROTATION", 2),
        (f"{SPLAT}:SCALE", 3),
        (f"{SPLAT}:OPACITY", 4),
        (f"{SPLAT}:SH_DEGREE_0_COEF_0", 5),
        (f"{SPLAT}:SH_DEGREE_1_COEF_0", 6),
        (f"{SPLAT}:SH_DEGREE_1_COEF_1", 7),
        (f"{SPLAT}:SH_DEGREE_1_COEF_2", 8),
        ("_CLASS", 9),
        ("_CONFIDENCE", 10),
    ]
    tenth = struct.unpack("<f", struct.pack("<f", 0.1))[0]
    assert glb.content["accessors"][0] == {
        "bufferView": 0,
        "componentType": FLOAT,
        "count": 2,
        "type": "VEC3",
        "min": [-1, tenth, 3],
        "max": [1, 2, 5],
    }


@pytest.mark.parametrize("classes", [True, False])
@pytest.mark.parametrize("harmonics", [1, 4, 9, 16])
def test_a_file_keeps_the_rules_of_the_specification(tmp_path: Path, harmonics: int, classes: bool) -> None:
    glb = written(tmp_path, some_scene(harmonics, classes))
    content, primitive = glb.content, glb.primitive
    assert content["asset"]["version"] == "2.0"
    assert content["extensionsUsed"] == [SPLAT]
    assert "extensionsRequired" not in content  # viewers without the extension show points
    assert content["nodes"][content["scenes"][content["scene"]]["nodes"][0]] == {"mesh": 0}
    assert primitive["mode"] == 0
    assert primitive["extensions"] == {SPLAT: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}}

    complete = {f"{SPLAT}:SH_DEGREE_{d}_COEF_{n}" for d in range(round(harmonics**0.5)) for n in range(2 * d + 1)}
    splat = {f"{SPLAT}:ROTATION": "VEC4", f"{SPLAT}:SCALE": "VEC3", f"{SPLAT}:OPACITY": "SCALAR"}
    types = {"POSITION": "VEC3", **splat, **dict.fromkeys(complete, "VEC3"), "_CONFIDENCE": "SCALAR"}
    types |= {"_CLASS": "SCALAR"} if classes else {}
    found = {name: content["accessors"][index] for name, index in primitive["attributes"].items()}
    fallback = found.pop("COLOR_0")
    assert {name: accessor["type"] for name, accessor in found.items()} == types
    assert all(accessor["componentType"] == FLOAT and accessor["count"] == 6 for accessor in found.values())
    assert (fallback["type"], fallback["normalized"], fallback["count"]) == ("VEC4", True, 6)

    # The views lie one after the other, each with the values of one accessor.
    ends = [view["byteOffset"] + view["byteLength"] for view in content["bufferViews"]]
    assert [view["byteOffset"] for view in content["bufferViews"]] == [0, *ends[:-1]]
    assert ends[-1] == content["buffers"][0]["byteLength"]
    assert [accessor["bufferView"] for accessor in content["accessors"]] == list(range(len(ends)))
    assert all(view["target"] == 34962 for view in content["bufferViews"])

    np.testing.assert_array_equal(found["POSITION"]["min"], glb.attribute("POSITION").min(0))
    np.testing.assert_array_equal(found["POSITION"]["max"], glb.attribute("POSITION").max(0))
    np.testing.assert_allclose(np.linalg.norm(glb.attribute(f"{SPLAT}:ROTATION"), axis=1), 1, atol=1e-6)
    assert (glb.attribute(f"{SPLAT}:SCALE") >= 0).all()
    assert ((glb.attribute(f"{SPLAT}:OPACITY") >= 0) & (glb.attribute(f"{SPLAT}:OPACITY") <= 1)).all()


def test_the_matrix_of_the_specification_turns_as_our_quaternions_do(tmp_path: Path) -> None:
    scene = some_scene()
    x, y, z, w = written(tmp_path, scene).attribute(f"{SPLAT}:ROTATION").astype(float).T
    matrix = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    ours = matrix_from_quaternion(scene.gaussians.colour.quaternions.double()).numpy()
    np.testing.assert_allclose(matrix.transpose(2, 0, 1), ours, atol=1e-6)


def test_the_harmonics_of_the_specification_give_our_colours(tmp_path: Path) -> None:
    scene = some_scene()
    glb = written(tmp_path, scene)
    x, y, z = direction = np.array([0.48, -0.6, 0.64])
    factors = (
        (0.2820947917738781,),
        (-0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x),
        (
            1.092548430592079 * x * y,
            -1.092548430592079 * y * z,
            0.3153915652525200 * (2 * z * z - x * x - y * y),
            -1.092548430592079 * x * z,
            0.5462742152960395 * (x * x - y * y),
        ),
        (
            -0.5900435899266435 * y * (3 * x * x - y * y),
            2.890611442640554 * x * y * z,
            -0.4570457994644657 * y * (4 * z * z - x * x - y * y),
            0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y),
            -0.4570457994644657 * x * (4 * z * z - x * x - y * y),
            1.445305721320277 * z * (x * x - y * y),
            -0.5900435899266435 * x * (x * x - 3 * y * y),
        ),
    )
    seen = 0.5 + sum(
        factor * glb.attribute(f"{SPLAT}:SH_DEGREE_{degree}_COEF_{n}").astype(float)
        for degree, row in enumerate(factors)
        for n, factor in enumerate(row)
    )
    ours = colours_from_harmonics(scene.gaussians.colour.features, torch.tensor(direction).float().expand(6, 3))
    np.testing.assert_allclose(seen.clip(min=0), ours, atol=1e-5)


def test_classes_have_names_colours_and_a_confidence(tmp_path: Path) -> None:
    scene = some_scene()
    glb = written(tmp_path, scene)
    assert scene.gaussians.semantic is not None
    chances = scene.gaussians.semantic.features
    extras = glb.content["meshes"][0]["extras"]
    assert extras["unit"] == "metric"
    assert len(extras["classes"]) == 20
    assert extras["classes"][0] == {"name": "wall", "colour": [174, 199, 232]}
    assert extras["classes"][19] == {"name": "otherfurniture", "colour": [82, 84, 163]}
    np.testing.assert_array_equal(glb.attribute("_CLASS")[:, 0], chances.argmax(-1))
    np.testing.assert_array_equal(glb.attribute("_CONFIDENCE")[:, 0], chances.max(-1).values)


def test_without_classes_the_confidence_is_that_of_the_depth(tmp_path: Path) -> None:
    glb = written(tmp_path, some_scene(classes=False))
    assert glb.content["meshes"][0]["extras"] == {"unit": "metric"}
    np.testing.assert_allclose(glb.attribute("_CONFIDENCE")[:, 0], [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], rtol=1e-6)


def test_a_program_without_the_extension_reads_coloured_points(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    scene = some_scene()
    save_gltf(tmp_path / "a.glb", scene)
    (points,) = trimesh.load_scene(tmp_path / "a.glb").geometry.values()
    np.testing.assert_allclose(points.vertices, scene.gaussians.means, rtol=1e-6)
    np.testing.assert_array_equal(points.colors, read_glb(tmp_path / "a.glb").attribute("COLOR_0"))
    assert points.metadata["classes"][1]["name"] == "floor"


def test_some_gaussians_are_written_as_they_are_among_all(tmp_path: Path) -> None:
    scene = some_scene(classes=False)
    keep = torch.tensor([False, True, False, False, True, True])
    save_gltf(tmp_path / "some.glb", scene, keep)
    some, every = read_glb(tmp_path / "some.glb"), written(tmp_path, scene)
    for name in every.primitive["attributes"]:
        np.testing.assert_array_equal(some.attribute(name), every.attribute(name)[[1, 4, 5]])
    bounds = some.content["accessors"][0]
    np.testing.assert_array_equal([bounds["min"], bounds["max"]], scene.gaussians.means[[1, 4, 5]].aminmax(dim=0))


def test_a_file_without_gaussians_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="needs at least one"):
        save_gltf(tmp_path / "a.glb", some_scene(), torch.zeros(6, dtype=torch.bool))
    assert list(tmp_path.iterdir()) == []


def test_the_colour_of_a_box_is_linear(tmp_path: Path) -> None:
    """ScanNet's table is (255, 152, 150) in sRGB: 1, 0.596^2.2 = 0.3204 and 0.588^2.2 = 0.3112 of the light."""
    table = Thing(1, SCANNET20.index("table"), "table", 0.9, Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0), 1.5, 40)
    save_gltf(tmp_path / "a.glb", some_scene(), boxes=[PlacedThing(table, np.zeros(3), np.eye(3))])
    (material,) = read_glb(tmp_path / "a.glb").content["materials"]
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([1, 0.3204, 0.3112, 1], abs=1e-4)
