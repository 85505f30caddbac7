"""USD files, opened again with OpenUSD's own library."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from test_gltf import scene_of, some_scene

from semgs.export.scene_objects import PlacedThing
from semgs.export.usd import GAUSSIANS, check_usd_library, prim_names, save_usd
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.robotics.boxes import Box
from semgs.robotics.objects import Thing
from semgs.scene.scene_file import SavedScene

pytest.importorskip("pxr")
from pxr import Usd, UsdGeom, UsdSemantics, UsdVol

HALF = 0.5**0.5


def written(folder: Path, scene: SavedScene, **options: Any) -> Usd.Stage:
    save_usd(folder / "a.usdc", scene, **options)
    return Usd.Stage.Open(str(folder / "a.usdc"))


def fields(stage: Usd.Stage) -> dict[str, UsdVol.ParticleField3DGaussianSplat]:
    """The Gaussians of a stage, which must stay open, by the names of their prims."""
    prims = stage.GetPrimAtPath(GAUSSIANS).GetChildren()
    assert all(prim.GetTypeName() == "ParticleField3DGaussianSplat" for prim in prims)
    return {prim.GetName(): UsdVol.ParticleField3DGaussianSplat(prim) for prim in prims}


def labels_of(prim: Usd.Prim) -> list[str] | None:
    """The labels that a prim has itself."""
    if not prim.HasAPI(UsdSemantics.LabelsAPI, "class"):
        return None
    return list(UsdSemantics.LabelsAPI(prim, "class").GetLabelsAttr().Get())


def primvar(field: UsdVol.ParticleField3DGaussianSplat, name: str) -> np.ndarray | None:
    found = UsdGeom.PrimvarsAPI(field).GetPrimvar(name)
    assert not found or found.GetInterpolation() == "vertex"
    return np.array(found.Get()) if found else None


def two_gaussians() -> SavedScene:
    chances = torch.full((2, 20), 0.0125)  # 19 of these and 0.7625 are 1
    chances[0, 15] = chances[1, 4] = 0.7625
    quaternions = torch.tensor([[HALF, HALF, 0.0, 0.0], [0.6, 0.0, 0.0, -0.8]])
    harmonics = torch.arange(24.0).reshape(2, 4, 3)
    colour = Appearance(quaternions, torch.tensor([[0.125, 0.25, 0.5], [0.0, 1.0, 2.0]]), harmonics)
    semantic = Appearance(quaternions.flip(0), torch.ones(2, 3), chances)
    means = torch.tensor([[1.0, 2.0, 3.0], [-1.0, 0.5, 5.0]])
    return scene_of(Gaussians(means, torch.tensor([0.25, 1.0]), colour, semantic))


def test_two_gaussians_worked_out_by_hand(tmp_path: Path) -> None:
    stage = written(tmp_path, two_gaussians())
    found = fields(stage)
    assert list(found) == ["chair", "shower_curtain"]  # in the order of the table
    one, other = found["shower_curtain"], found["chair"]
    assert list(one.GetPositionsAttr().Get()) == [(1, 2, 3)]
    assert list(other.GetPositionsAttr().Get()) == [(-1, 0.5, 5)]
    assert list(one.GetScalesAttr().Get()) == [(0.125, 0.25, 0.5)]  # no logarithms
    assert list(one.GetOpacitiesAttr().Get()) == [0.25]  # no logits
    (turn,) = other.GetOrientationsAttr().Get()
    assert turn.GetReal() == pytest.approx(0.6)
    assert tuple(turn.GetImaginary()) == pytest.approx((0, 0, -0.8))
    assert one.GetRadianceSphericalHarmonicsDegreeAttr().Get() == 1
    assert list(one.GetRadianceSphericalHarmonicsCoefficientsAttr().Get()) == [(0, 1, 2), (3, 4, 5), (6, 7, 8), (9, 10, 11)]  # fmt: skip
    assert tuple(other.GetRadianceSphericalHarmonicsCoefficientsAttr().Get()[0]) == (12, 13, 14)
    # A quarter turn about x swaps y and z: three standard deviations are 0.375 along x, 1.5 along y and 0.75 along z.
    low, high = one.GetExtentAttr().Get()
    assert tuple(low) == pytest.approx((0.625, 0.5, 2.25))
    assert tuple(high) == pytest.approx((1.375, 3.5, 3.75))
    assert primvar(one, "class").tolist() == [15]
    assert primvar(one, "confidence") == pytest.approx([0.7625])
    assert primvar(one, "instance") is None
    assert (labels_of(one.GetPrim()), labels_of(other.GetPrim())) == (["shower curtain"], ["chair"])


def test_the_stage_says_what_is_up_and_what_a_metre_is(tmp_path: Path) -> None:
    stage = written(tmp_path, two_gaussians())
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.StageHasAuthoredMetersPerUnit(stage)
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert stage.GetDefaultPrim().GetPath() == "/World"
    about = stage.GetRootLayer().customLayerData["semgs"]
    assert (about["unit"], about["source"]) == ("metric", "office")
    assert about["classes"].split(", ")[15] == "shower curtain"
    assert "metersPerUnit" not in about


def test_without_metres_no_unit_is_stated_and_the_data_say_why(tmp_path: Path) -> None:
    stage = written(tmp_path, replace(two_gaussians(), unit="unknown"))
    assert not UsdGeom.StageHasAuthoredMetersPerUnit(stage)
    assert "unknown" in stage.GetRootLayer().customLayerData["semgs"]["metersPerUnit"]


@pytest.mark.parametrize("harmonics", [1, 4, 9, 16])
def test_every_gaussian_is_written_once_and_as_it_is(tmp_path: Path, harmonics: int) -> None:
    scene = some_scene(harmonics)
    stage = written(tmp_path, scene)
    found = fields(stage)
    gaussians, labels = scene.gaussians, scene.gaussians.semantic.features.argmax(-1).numpy()
    assert {name.replace("_", " ") for name in found} == {scene.classes.names[label] for label in labels}
    for name, field in found.items():
        own = labels == scene.classes.index(name.replace("_", " "))
        np.testing.assert_array_equal(field.GetPositionsAttr().Get(), gaussians.means[own])
        np.testing.assert_array_equal(field.GetScalesAttr().Get(), gaussians.colour.scales[own])
        np.testing.assert_array_equal(field.GetOpacitiesAttr().Get(), gaussians.opacities[own])
        assert field.GetRadianceSphericalHarmonicsDegreeAttr().Get() == {1: 0, 4: 1, 9: 2, 16: 3}[harmonics]
        coefficients = np.array(field.GetRadianceSphericalHarmonicsCoefficientsAttr().Get())
        np.testing.assert_array_equal(coefficients, gaussians.colour.features[own].flatten(0, 1))


def test_the_matrix_of_openusd_turns_as_our_quaternions_do(tmp_path: Path) -> None:
    from pxr import Gf

    scene = some_scene(classes=False)
    stage = written(tmp_path, scene)
    (field,) = fields(stage).values()
    # Gf has rows as vectors, so its matrix is the transpose of ours.
    theirs = [np.array(Gf.Matrix3d(Gf.Quatd(one))).T for one in field.GetOrientationsAttr().Get()]
    ours = matrix_from_quaternion(scene.gaussians.colour.quaternions.double()).numpy()
    np.testing.assert_allclose(theirs, ours, atol=1e-6)


def test_without_classes_there_is_one_prim_and_no_label(tmp_path: Path) -> None:
    stage = written(tmp_path, some_scene(classes=False))
    found = fields(stage)
    assert list(found) == ["all"]
    assert labels_of(found["all"].GetPrim()) is None
    assert primvar(found["all"], "class") is None
    assert len(primvar(found["all"], "confidence")) == 6


def test_gaussians_that_no_photo_shows_have_no_label(tmp_path: Path) -> None:
    scene = two_gaussians()
    chances = torch.stack((torch.full((20,), 0.05), scene.gaussians.semantic.features[1]))
    semantic = replace(scene.gaussians.semantic, features=chances)
    stage = written(tmp_path, replace(scene, gaussians=replace(scene.gaussians, semantic=semantic)))
    found = fields(stage)
    assert list(found) == ["chair", "unseen"]
    assert labels_of(found["unseen"].GetPrim()) is None
    assert primvar(found["unseen"], "class").tolist() == [255]


def test_only_what_is_kept_is_written_with_its_numbers(tmp_path: Path) -> None:
    keep = torch.tensor([False, True])
    stage = written(tmp_path, two_gaussians(), keep=keep, instances=np.array([1, 2]))
    (field,) = fields(stage).values()
    assert list(field.GetPositionsAttr().Get()) == [(-1, 0.5, 5)]
    assert primvar(field, "instance").tolist() == [2]


def test_a_thing_has_a_label_and_a_box(tmp_path: Path) -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # a quarter turn about z
    box = Box((0.0, 0.0, 0.0), (2.0, 1.0, 0.5), 0.0)
    thing = Thing(3, 15, "shower curtain", 0.75, box, 1.5, 40)
    stage = written(tmp_path, two_gaussians(), things=[PlacedThing(thing, np.array([1.0, 2.0, 3.0]), turn)])
    (prim,) = stage.GetPrimAtPath("/World/Objects").GetChildren()
    assert (prim.GetName(), labels_of(prim)) == ("shower_curtain_3", ["shower curtain"])
    assert prim.GetCustomData()["semgs"] == {"instance": 3, "confidence": 0.75, "distance": 1.5}
    cube = stage.GetPrimAtPath(f"{prim.GetPath()}/box")
    assert UsdGeom.Cube(cube).GetPurposeAttr().Get() == "guide"
    bounds = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["guide"]).ComputeWorldBound(cube).ComputeAlignedRange()
    # Two metres long along y after the turn, about (1, 2, 3).
    assert tuple(bounds.GetMin()) == pytest.approx((0.5, 1, 2.75))
    assert tuple(bounds.GetMax()) == pytest.approx((1.5, 3, 3.25))


def test_the_validators_of_openusd_find_nothing(tmp_path: Path) -> None:
    validation = pytest.importorskip("pxr.UsdValidation")
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) >= 20
    stage = written(tmp_path, some_scene())
    errors = validation.ValidationContext(validators).Validate(stage)
    assert [error.GetMessage() for error in errors] == []


def test_names_of_prims_are_valid_and_differ() -> None:
    names = ["shower curtain", "shower_curtain", "Shower Curtain", "3d print", "stühle", "", "chair"]
    found = prim_names(names)
    assert found == ["shower_curtain", "shower_curtain_2", "Shower_Curtain_3", "_3d_print", "st_hle", "_", "chair"]
    from pxr import Sdf

    assert all(Sdf.Path.IsValidIdentifier(name) for name in found)


def test_equal_scenes_give_equal_files_and_nothing_else_is_left(tmp_path: Path) -> None:
    for name in ("a.usdc", "b.usdc"):
        save_usd(tmp_path / name, some_scene())
    assert (tmp_path / "a.usdc").read_bytes() == (tmp_path / "b.usdc").read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"a.usdc", "b.usdc"}


def test_other_endings_and_missing_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"a\.usdz ends with \.usdz; expected \.usdc"):
        save_usd(tmp_path / "a.usdz", some_scene())
    with pytest.raises(OSError, match="nowhere"):
        save_usd(tmp_path / "nowhere" / "a.usdc", some_scene())


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from semgs.export import usd

    (tmp_path / "a.usdc").write_text("old")

    def fail(path: str) -> bool:
        raise RuntimeError("\n\tError in 'x': disk is full")

    with pytest.raises(OSError, match="could not be written: Error in 'x': disk is full"):
        usd._write(SimpleNamespace(Export=fail), tmp_path / "a.usdc")
    with pytest.raises(OSError, match="could not be written"):
        usd._write(SimpleNamespace(Export=lambda path: False), tmp_path / "a.usdc")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.usdc": "old"}


def test_without_the_library_or_with_an_old_one_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", SimpleNamespace(UsdVol=object, UsdSemantics=UsdSemantics))
    with pytest.raises(ImportError, match=r"usd-core 26\.3 or newer: pip install -e '\.\[usd\]'"):
        check_usd_library()
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ImportError, match=r"pip install -e '\.\[usd\]'"):
        check_usd_library()
