"""USD files of Gaussians with semantic labels, for Isaac Sim, usdview and other programs of OpenUSD.

One binary file, `.usdc`: a scene has no textures or other files that a `.usdz` would bundle, and programs cannot edit a `.usdz` in place.

    /World                       Xform, the default prim; z is up, one unit is a metre if the scene is metric
    /World/Gaussians/chair       ParticleField3DGaussianSplat, the Gaussians whose likeliest class is chair; one such prim for each class
    /World/Gaussians/unseen      those whose classes are all equally likely, without a label; `all` in a scene without classes
    /World/Objects/chair_1       Xform, a thing with its label; below it `box`, a unit cube that is scaled, as a guide that renderers leave out
    /World/Meshes/chair          Mesh of a class, with its label; chair_1 if things were searched; only if a mesh is written too

Attributes by the schemas of OpenUSD 26.03 and newer (`UsdVol`, https://openusd.org/release/user_guides/schemas/usdVol/ParticleField3DGaussianSplat.html):

    positions, scales                           scales are standard deviations, linear
    orientations                                unit quaternions; NumPy passes them as (x, y, z, w), USD's text form is (w, x, y, z)
    opacities                                   0..1
    radiance:sphericalHarmonicsCoefficients     Gaussian by Gaussian, (degree + 1)^2 each in our order; colours are sRGB as displayed
    semantics:labels:class                      of `SemanticsLabelsAPI`, which Isaac Sim reads from version 5.0 on; one label, so there is a prim for each class

Ours are the primvars `class`, the position in the class table or 255 for none, `confidence` and, if things were searched, `instance`, 0 for none. The layer's custom data
contain the unit and the classes. No time and no machine is written: equal scenes give equal files.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Int64
from torch import Tensor

from semgs._version import __version__
from semgs.export.mesh_files import MeshPart, normals_of
from semgs.export.scene_objects import PlacedThing, prim_names
from semgs.files.errors import needs_extra
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.rendering.rendering import UNSEEN
from semgs.scene.confidence import class_confidences, class_labels
from semgs.scene.scene_file import SavedScene

FILE = "scene.usdc"
"""The name of the file in a folder of exports."""

ROOT, GAUSSIANS, OBJECTS, MESHES = "/World", "/World/Gaussians", "/World/Objects", "/World/Meshes"
"""Paths of the prims."""

TAXONOMY = "class"
"""The name of our labels among the labels of a prim, as Isaac Sim has it."""

REACH = 3.0
"""The bounds of Gaussians end this many standard deviations from their centres."""


def check_usd_library() -> None:
    """Check that OpenUSD's library is there, before long work starts.

    Raises:
        ImportError: it is not installed; the message names the extra.
    """
    with needs_extra("usd", "USD files need usd-core 26.3 or newer", "pxr"):
        from pxr import UsdSemantics, UsdVol

        if not hasattr(UsdVol, "ParticleField3DGaussianSplat") or not hasattr(UsdSemantics, "LabelsAPI"):
            raise ImportError("an older usd-core, which has no Gaussians")


def save_usd(
    path: str | Path,
    scene: SavedScene,
    keep: Bool[Tensor, " g"] | None = None,
    things: Sequence[PlacedThing] = (),
    instances: Int64[np.ndarray, " g"] | None = None,
    parts: Sequence[MeshPart] = (),
) -> None:
    """Write the colour Gaussians as a USD file: a prim for each class, with its label. Within a prim they keep their order.

    Args:
        path: the file, *.usdc.
        scene: upright, with z up, as `semgs.scene.upright.upright(scene, "z").scene`.
        keep: the Gaussians to write; all by default.
        things: in the same frame.
        instances: the number of the thing that each Gaussian belongs to.
        parts: of the mesh, in the same frame.

    Raises:
        ValueError: the path has another ending.
        ImportError: usd-core is not installed.
        OSError: the file cannot be written.
    """
    path = Path(path)
    if path.suffix != ".usdc":
        raise ValueError(f"{path} ends with {path.suffix or 'nothing'}; expected .usdc")
    check_usd_library()
    from pxr import Sdf, Usd, UsdGeom

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    about = {"software": f"SemGS {__version__}", "source": scene.source, "unit": scene.unit}
    if scene.unit == "metric":
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    else:
        about["metersPerUnit"] = "unknown, so it is not stated; programs then assume centimetres"
    if scene.classes is not None:
        about["classes"] = ", ".join(scene.classes.names)
    layer.customLayerData = {"semgs": about}
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT).GetPrim())
    UsdGeom.Scope.Define(stage, GAUSSIANS)
    columns = _columns(scene, instances)
    kept = np.ones(len(scene.gaussians), bool) if keep is None else keep.numpy()
    for name, label, own in _groups(scene):
        chosen = kept & own
        if chosen.any():
            prim = _add_gaussians(stage, f"{GAUSSIANS}/{name}", {key: one[chosen] for key, one in columns.items()})
            _add_label(prim, label)
    if things:
        UsdGeom.Scope.Define(stage, OBJECTS)
        _add_things(stage, things)
    if parts:
        UsdGeom.Scope.Define(stage, MESHES)
        for part in parts:
            _add_label(_add_mesh(stage, f"{MESHES}/{part.name}", part), part.label)
    _write(layer, path)


def _write(layer: Any, path: Path) -> None:
    """Write a layer, atomically."""
    with TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
        file = Path(folder) / path.name
        try:
            done = layer.Export(str(file))
        except RuntimeError as error:  # what OpenUSD makes of a full disk
            raise OSError(f"{path} could not be written: {str(error).strip().splitlines()[-1]}") from error
        if not done:
            raise OSError(f"{path} could not be written")
        file.replace(path)


def _groups(scene: SavedScene) -> list[tuple[str, str | None, np.ndarray]]:
    """The Gaussians of each prim: its name, its label and which Gaussians [g]."""
    if scene.classes is None:
        return [("all", None, np.ones(len(scene.gaussians), bool))]
    labels = class_labels(scene).numpy()
    prims = prim_names([*scene.classes.names, "unseen"])
    numbers = [*range(len(scene.classes)), UNSEEN]
    wanted = [*scene.classes.names, None]
    return [(prim, label, labels == number) for prim, label, number in zip(prims, wanted, numbers, strict=True)]


def _columns(scene: SavedScene, instances: Int64[np.ndarray, " g"] | None) -> dict[str, np.ndarray]:
    """What is written of each Gaussian, [g ...] each."""
    gaussians = scene.gaussians.with_footprints()
    quaternions = torch.nn.functional.normalize(gaussians.colour.quaternions.double(), dim=-1)
    axes = matrix_from_quaternion(quaternions) * gaussians.colour.scales.double()[:, None]
    found = {
        "positions": gaussians.means,
        "scales": gaussians.colour.scales,
        "quaternions": quaternions.roll(-1, dims=-1),
        "opacities": gaussians.opacities,
        "harmonics": gaussians.colour.features,
        "reach": REACH * axes.norm(dim=-1),
        "confidence": class_confidences(scene),
    }
    columns = {name: tensor.detach().cpu().numpy().astype(np.float32) for name, tensor in found.items()}
    if scene.classes is not None:
        columns["class"] = class_labels(scene).numpy().astype(np.int32)
    if instances is not None:
        columns["instance"] = instances.astype(np.int32)
    return columns


def _add_gaussians(stage: Any, path: str, columns: dict[str, np.ndarray]) -> Any:
    """Add a prim of Gaussians."""
    from pxr import UsdVol, Vt

    field = UsdVol.ParticleField3DGaussianSplat.Define(stage, path)
    field.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(columns["positions"]))
    field.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(columns["scales"]))
    field.CreateOrientationsAttr(Vt.QuatfArray.FromNumpy(columns["quaternions"]))
    field.CreateOpacitiesAttr(Vt.FloatArray.FromNumpy(columns["opacities"]))
    harmonics = columns["harmonics"]
    field.CreateRadianceSphericalHarmonicsDegreeAttr(round(harmonics.shape[1] ** 0.5) - 1)
    field.CreateRadianceSphericalHarmonicsCoefficientsAttr(
        Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(harmonics.reshape(-1, 3)))
    )
    low = (columns["positions"] - columns["reach"]).min(0)
    high = (columns["positions"] + columns["reach"]).max(0)
    field.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack((low, high))))
    return _with_primvars(field, columns)


def _with_primvars(shape: Any, columns: dict[str, np.ndarray]) -> Any:
    """The prim of a shape, to which class, confidence and instance are added as far as they are known."""
    from pxr import Sdf, UsdGeom, Vt

    primvars = UsdGeom.PrimvarsAPI(shape)
    for name in ("class", "confidence", "instance"):
        if name in columns:
            whole = columns[name].dtype == np.int32
            kind = Sdf.ValueTypeNames.IntArray if whole else Sdf.ValueTypeNames.FloatArray
            values = (Vt.IntArray if whole else Vt.FloatArray).FromNumpy(columns[name])
            primvars.CreatePrimvar(name, kind, UsdGeom.Tokens.vertex).Set(values)
    return shape.GetPrim()


def _add_mesh(stage: Any, path: str, part: MeshPart) -> Any:
    """Add a prim with a part of the mesh."""
    from pxr import UsdGeom, Vt

    mesh, shape = part.mesh, UsdGeom.Mesh.Define(stage, path)
    points, colours = mesh.vertices.astype(np.float32), (mesh.colours / 255).astype(np.float32)
    shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    shape.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    shape.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.astype(np.int32).reshape(-1)))
    shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    shape.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack((points.min(0), points.max(0)))))
    shape.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals_of(mesh).astype(np.float32)))
    shape.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(Vt.Vec3fArray.FromNumpy(colours))
    found = {"class": mesh.labels, "confidence": mesh.confidences, "instance": mesh.instances}
    kinds = {"class": np.int32, "confidence": np.float32, "instance": np.int32}
    return _with_primvars(shape, {name: one.astype(kinds[name]) for name, one in found.items() if one is not None})


def _add_label(prim: Any, label: str | None) -> None:
    """Label a prim with its class."""
    from pxr import UsdSemantics

    if label is not None:
        UsdSemantics.LabelsAPI.Apply(prim, TAXONOMY).CreateLabelsAttr([label])


def _add_things(stage: Any, things: Sequence[PlacedThing]) -> None:
    """Add a prim for each thing, with its box."""
    from pxr import Gf, UsdGeom

    names = prim_names([f"{one.thing.name}_{one.thing.instance}" for one in things])
    for name, one in zip(names, things, strict=True):
        placed = UsdGeom.Xform.Define(stage, f"{OBJECTS}/{name}")
        placed.AddTranslateOp().Set(Gf.Vec3d(*one.centre.tolist()))
        w, x, y, z = one.quaternion
        placed.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))
        prim = placed.GetPrim()
        thing = one.thing
        prim.SetCustomData(
            {"semgs": {"instance": thing.instance, "confidence": thing.confidence, "distance": thing.distance}}
        )
        _add_label(prim, thing.name)
        box = UsdGeom.Cube.Define(stage, f"{OBJECTS}/{name}/box")
        box.CreateSizeAttr(1.0)
        box.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
        box.CreatePurposeAttr(UsdGeom.Tokens.guide)
        box.AddScaleOp().Set(Gf.Vec3f(*map(float, thing.box.size)))
