"""The data sets that are read with scenezoo, a row for each: where its principal points are counted from, which of its cameras have poses, and
what its labels mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from semgs.data.cameras.lens import HALF
from semgs.files.errors import InputError

LAYOUT = "scenezoo"
"""`Scene.layout` is this and the name of the data set."""


@dataclass(frozen=True)
class ZooCamera:
    """A camera of a data set.

    Attributes:
        name: scenezoo's; empty if the data set has only one.
        half: to add to its principal points: 0.5 if the centre of the first pixel is at 0 [px].
        from_below: whether cy is counted from the bottom row of the image upwards.
        depth: whether it has depth.
        own_depth_camera: whether depth is of another camera at the same place, with its own intrinsics.
        confidence: whether depth has a map of how reliable it is, 0 = not.
    """

    name: str
    half: float
    from_below: bool = False
    depth: bool = True
    own_depth_camera: bool = False
    confidence: bool = False


@dataclass(frozen=True)
class DataSet:
    """A data set that scenezoo reads.

    Attributes:
        name: scenezoo's.
        title: for people.
        sources: its cameras; the first is the default.
        has_rooms: whether the frames are of one room of the scene, which must be named.
        mesh: scenezoo's name of its labelled mesh; empty if there is none.
        segmentation: scenezoo's keywords for the labels of the mesh.
        label_images: whether every image has NYU40 labels.
        names_file, names_keyword: the file with the names of the labels, in the data set's folder or `metadata/`, and scenezoo's keyword for
            it; empty if it needs none.
    """

    name: str
    title: str
    sources: tuple[ZooCamera, ...]
    has_rooms: bool = False
    mesh: str = ""
    segmentation: Mapping[str, str] = field(default_factory=dict)
    label_images: bool = False
    names_file: str = ""
    names_keyword: str = ""


DATA_SETS = (
    DataSet(
        "arkitscenes",
        "ARKitScenes",
        (
            ZooCamera("lowres_wide", 0.0, confidence=True),
            ZooCamera("vga_wide", 0.0, depth=False),
            ZooCamera("wide", 0.0),
            ZooCamera("threedod", 0.0),
        ),
    ),
    DataSet(
        "matterport3d",
        "Matterport3D",
        (ZooCamera("undistorted", HALF, from_below=True), ZooCamera("raw", HALF)),
        mesh="house",
        segmentation={"segmentation_type": "semantic", "label_space": "nyu40"},
        names_file="category_mapping.tsv",
        names_keyword="label_mapping_file",
    ),
    DataSet(
        "multiscan",
        "MultiScan",
        (ZooCamera("", 0.0, confidence=True),),
        mesh="ply",
        segmentation={"segmentation_type": "object_instance"},
    ),
    DataSet(
        "3rscan",
        "3RScan",
        (ZooCamera("", HALF, own_depth_camera=True),),
        mesh="instance",
        segmentation={"segmentation_type": "instance"},
    ),
    DataSet("structured3d", "Structured3D", (ZooCamera("perspective", HALF),), has_rooms=True, label_images=True),
)
"""The data sets that are read."""

OWN = "SemGS reads it without scenezoo: give the folder of the scan"
NO_FRAMES = "scenezoo reads no images with poses of it"
REFUSED = {
    "scannetv2": OWN,
    "scannetppv2": OWN,
    "ase": "its images are of a fisheye lens that is not supported (FISHEYE624)",
    "s3dis": NO_FRAMES,
    "scenenn": NO_FRAMES,
    "3dfront": NO_FRAMES,
    "arkitscenes:mov": "its intrinsics are of images of 256x192, and scenezoo's enlargement of them is off by pixels",
    "arkitscenes:ultrawide": "it is a second lens, and the data set has poses of the first only",
    "structured3d:panorama": "panoramas are not supported, and their depth is along rays",
}
"""What scenezoo knows and this module refuses, and why."""


def choose_camera(path: Path, name: str, part: str) -> tuple[DataSet, ZooCamera]:
    """The data set and the camera that a user named.

    Args:
        path: the folder of the data set, for errors.
        name: of the data set, in lower case.
        part: a room or a camera; may be empty.

    Raises:
        InputError: the data set is not known or not supported, or has no such camera, or needs a room.
    """
    for refused in (name, f"{name}:{part}"):
        if refused in REFUSED:
            raise InputError(path, "a data set with pinhole images and poses", f"{refused}: {REFUSED[refused]}")
    data = next((one for one in DATA_SETS if one.name == name), None)
    if data is None:
        raise InputError(path, f"one of the data sets {', '.join(one.name for one in DATA_SETS)}", repr(name))
    if data.has_rooms:
        if not part:
            raise InputError(path, f"a room, as in {name}:SCENE:ROOM", f"{name}:SCENE")
        return data, data.sources[0]
    source = next((one for one in data.sources if part in ("", one.name)), None)
    if source is None:
        known = ", ".join(one.name for one in data.sources if one.name) or "none, because it has one camera only"
        raise InputError(path, f"one of the cameras of {name}: {known}", repr(part))
    return data, source
