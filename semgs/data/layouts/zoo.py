"""Data sets that scenezoo reads, as scenes. Only this module imports it. https://github.com/eamonn-zh/scenezoo

scenezoo knows where the files of a data set are. What it leaves to its caller is here, a row for each data set: where its principal points are
counted from, which of its cameras have poses, and what its labels mean. Images are not rotated upright. Nothing is downloaded.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np
from jaxtyping import Float32, UInt8
from PIL import Image

from semgs.data.asked import Asked
from semgs.data.classes import SCANNET20
from semgs.data.frames import Frame
from semgs.data.layouts.parts.poses import checked_poses
from semgs.data.layouts.scannet.labels import LabelTable, find_table, normal, read_table
from semgs.data.layouts.scannetpp.labels import NYU40_OF
from semgs.data.layouts.scannetpp.mesh import Cast
from semgs.data.lens import HALF, Lens, carried_over
from semgs.data.maps import Pixels, fitted
from semgs.data.nyu40 import NAMES, scannet20_labels
from semgs.data.raycast import Raycaster
from semgs.data.scene import Scene
from semgs.files.errors import InputError, input_error

LAYOUT = "scenezoo"
"""`Scene.layout` is this and the name of the data set."""
ASKS = ("scenezoo",)

CAMERAS = ("rgb_intrinsics", "world_to_camera")
LENSES = ("PINHOLE", "OPENCV")
"""The camera models of scenezoo that are read: without distortion, and with k1, k2, p1, p2, k3."""


@dataclass(frozen=True)
class Source:
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
    sources: tuple[Source, ...]
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
            Source("lowres_wide", 0.0, confidence=True),
            Source("vga_wide", 0.0, depth=False),
            Source("wide", 0.0),
            Source("threedod", 0.0),
        ),
    ),
    DataSet(
        "matterport3d",
        "Matterport3D",
        (Source("undistorted", HALF, from_below=True), Source("raw", HALF)),
        mesh="house",
        segmentation={"segmentation_type": "semantic", "label_space": "nyu40"},
        names_file="category_mapping.tsv",
        names_keyword="label_mapping_file",
    ),
    DataSet(
        "multiscan",
        "MultiScan",
        (Source("", 0.0, confidence=True),),
        mesh="ply",
        segmentation={"segmentation_type": "object_instance"},
    ),
    DataSet(
        "3rscan",
        "3RScan",
        (Source("", HALF, own_depth_camera=True),),
        mesh="instance",
        segmentation={"segmentation_type": "instance"},
    ),
    DataSet("structured3d", "Structured3D", (Source("perspective", HALF),), has_rooms=True, label_images=True),
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


@final
@dataclass(frozen=True, eq=False)
class Shot:
    """One frame of a data set.

    Attributes:
        opened: scenezoo's data set.
        path: the folder of the data set, for errors.
        scene: scenezoo's name of the scene.
        index: scenezoo's number of the frame.
        keywords: what else scenezoo needs to know: the camera, or the room.
    """

    opened: Any
    path: Path
    scene: str
    index: int
    keywords: Mapping[str, str]

    @property
    def name(self) -> str:
        """A name for errors."""
        return f"{self.scene} {self.index}"

    @property
    def suffix(self) -> str:
        """PNG, as which the image is passed on."""
        return ".png"

    def __str__(self) -> str:
        return f"{self.path}: {self.name}"

    def is_file(self) -> bool:
        """Whether scenezoo lists it."""
        return True

    def read_bytes(self) -> bytes:
        """The image as PNG.

        Raises:
            InputError: scenezoo cannot read it.
        """
        file = io.BytesIO()
        Image.fromarray(self.item("rgb")).save(file, "PNG", compress_level=0)
        return file.getvalue()

    def item(self, name: str) -> np.ndarray:
        """One of scenezoo's items of this frame.

        Raises:
            InputError: scenezoo cannot read it.
        """
        with scenezoo_errors(self.path):
            batch = self.opened.get_frames(
                self.scene, indices=[self.index], items=(name,), rotate_to_up=False, **self.keywords
            )
        if batch.depth_mode == "ray_distance":
            raise InputError(self.path, "depth along the optical axis", "depth along rays", self.name)
        return np.asarray(getattr(batch, name)[0])


@final
@dataclass(frozen=True, eq=False)
class ShotDepth:
    """Z-depths of a frame.

    Attributes:
        shot: the frame.
        lens: of the depth camera; None for that of the image, perhaps at another size.
        confidence: whether there is a map of how reliable it is.
    """

    shot: Shot
    lens: Lens | None = None
    confidence: bool = False
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`.
        """
        depths = self.shot.item("depth").astype(np.float32)
        if self.confidence:
            depths = np.where(self.shot.item("confidence_maps") == 0, np.float32(0), depths)
        if self.lens is not None:
            return pixels.taken(carried_over(depths, self.lens, pixels.lens))
        return pixels.taken(fitted(self.shot, depths, pixels.lens.size))


@final
@dataclass(frozen=True, eq=False)
class ShotLabels:
    """NYU40 labels of a frame.

    Attributes:
        shot: the frame.
    """

    shot: Shot
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `MapSource.read`.
        """
        ids = self.shot.item("semantic_maps").astype(np.int64)
        labels = scannet20_labels()[np.where((ids < 0) | (ids > len(NAMES)), 0, ids)]
        return pixels.taken(fitted(self.shot, labels, pixels.lens.size))


@final
@dataclass(frozen=True, eq=False)
class SceneMesh:
    """The labelled mesh of a scene, read on first use.

    Attributes:
        opened: scenezoo's data set.
        path: its folder.
        scene: scenezoo's name of the scene.
        data: what is known of the data set.
        table: ScanNet's, if it is with the data; it knows more names.
    """

    opened: Any
    path: Path
    scene: str
    data: DataSet
    table: LabelTable | None = None

    @cached_property
    def cast(self) -> Cast:
        """The mesh, ready for rays.

        Raises:
            InputError: scenezoo cannot read it, or it has another number of faces or vertices than labels.
            ImportError: embreex is not installed.
        """
        with scenezoo_errors(self.path):
            mesh = self.opened.get_mesh(self.scene, mesh_type=self.data.mesh)
            found = self.opened.get_segmentation(self.scene, **self.data.segmentation)
        faces, ids = np.asarray(mesh.triangles), np.asarray(found.labels)
        expected = len(faces) if found.domain == "face" else len(mesh.vertices)
        if ids.shape != (expected,):
            raise InputError(
                self.path, f"a label for each {found.domain} of the mesh ({expected})", f"{len(ids)}", self.scene
            )
        known = np.array([label_of(found.id_to_name.get(int(one)), self.table) for one in np.unique(ids)], np.uint8)
        labels = known[np.unique(ids, return_inverse=True)[1]]
        with input_error(self.path, "a mesh for ray casting", self.scene):
            caster = Raycaster(np.asarray(mesh.vertices), faces)
        return Cast(caster, labels if found.domain == "face" else labels[faces[:, 0]], np.zeros(len(faces), bool))


@final
@dataclass(frozen=True, eq=False)
class CastLabels:
    """Labels of a frame from the mesh of its scene, exact at the centres of the pixels.

    Attributes:
        mesh: of the scene.
    """

    mesh: SceneMesh
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError, ImportError: as `SceneMesh.cast`.
        """
        camera = pixels.camera
        return self.mesh.cast.cast(camera.world_from_camera.numpy(), camera.intrinsics.numpy(), camera.size)[0]


def label_of(name: str | None, table: LabelTable | None) -> int:
    """The label in `scannet20` of an object's name; 255 if it has none."""
    key = normal(name or "")
    nyu40 = (table.by_name.get(key) if table else None) or NYU40_OF.get(key)
    if nyu40 is None:
        nyu40 = NAMES.index(key) + 1 if key in NAMES else 0
    return int(scannet20_labels()[nyu40])


def open_zoo(path: Path, asked: Asked) -> Scene:
    """A scene of a data set that scenezoo reads.

    Args:
        path: the folder of the data set.
        asked: `scenezoo` says which data set it is, and which of its scenes.

    Raises:
        InputError: the data set is not known or not supported, or scenezoo cannot read the scene.
        ImportError: scenezoo is not installed.
    """
    name, scene, part = (*str(asked.scenezoo).split(":"), "")[:3]
    data, source = _chosen(path, name.lower(), part)
    named = [
        one for place in (path, path / "metadata") if data.names_file and (one := place / data.names_file).is_file()
    ]
    with scenezoo_errors(path):
        library = _scenezoo()
        opened = library.get_dataset(data.name, path, offline=True, **({data.names_keyword: named[0]} if named else {}))
    keywords = {"room_id": part} if data.has_rooms else {}
    if source.name:
        keywords["source"] = source.name
    return zoo_scene(opened, path, scene, data, source, keywords, bool(named) or not data.names_file)


def _chosen(path: Path, name: str, part: str) -> tuple[DataSet, Source]:
    """The data set and the camera."""
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


def zoo_scene(
    opened: Any, path: Path, scene: str, data: DataSet, source: Source, keywords: Mapping[str, str], names_known: bool
) -> Scene:
    """The scene of an opened data set.

    Args:
        opened: scenezoo's data set.
        path: its folder.
        scene: scenezoo's name of the scene.
        data, source: the data set, and the camera.
        keywords: what else scenezoo needs to know: the camera, or the room.
        names_known: whether the names of the labels can be read.

    Raises:
        InputError: scenezoo cannot read it, or a camera is not supported.
    """
    items = (*CAMERAS, *(("depth_intrinsics",) if source.own_depth_camera else ()))
    with scenezoo_errors(path):
        batch = opened.get_frames(scene, items=items, rotate_to_up=False, **keywords)
    if batch.camera_model not in LENSES:
        raise InputError(path, f"a camera of {' or '.join(LENSES)}", f"{batch.camera_model}", scene)
    shots = [Shot(opened, path, scene, int(index), keywords) for index in batch.indices]
    names = batch.frame_keys or [f"{shot.index:06d}" for shot in shots]
    if not shots:
        raise InputError(path, "at least two frames with a pose", "none", scene)
    first = shots[0].item("rgb").shape[:2]
    sizes = [first] * len(shots)
    if batch.image_sizes is not None:
        sizes = [(int(height), int(width)) for width, height in batch.image_sizes]
    notes: list[str] = []
    depth = source.depth and _readable(shots[0], "depth", "depth", notes)
    confidence = depth and source.confidence and _readable(shots[0], "confidence_maps", "confidence of depth", notes)
    depth_size = shots[0].item("depth").shape if depth and source.own_depth_camera else None
    mesh = _mesh(opened, path, scene, data, names_known, notes)
    has_labels = mesh is not None or data.label_images
    with np.errstate(all="ignore"):
        poses = [np.linalg.inv(np.asarray(matrix, np.float64)) for matrix in batch.world_to_camera]
    frames = []
    for index, (shot, pose) in enumerate(
        zip(shots, checked_poses(path, poses, [one.name for one in shots]), strict=True)
    ):
        lens = _lens(shot, sizes[index], batch.rgb_intrinsics[index], source, _distortion(batch, index))
        of_depth = _lens(shot, depth_size, batch.depth_intrinsics[index], source) if depth_size else None
        frames.append(
            Frame(
                name=names[index],
                picture=shot,
                lens=lens,
                world_from_camera=pose,
                depth=ShotDepth(shot, of_depth, confidence) if depth else None,
                labels=CastLabels(mesh) if mesh else ShotLabels(shot) if data.label_images else None,
            )
        )
    return Scene(
        path=path,
        name="_".join((scene, *([keywords["room_id"]] if "room_id" in keywords else []))),
        layout=f"{LAYOUT} {data.name}",
        unit="metric",
        frames=tuple(frames),
        classes=SCANNET20 if has_labels else None,
        notes=tuple(notes),
    )


def _lens(
    shot: Shot, size: tuple[int, ...], intrinsics: np.ndarray, source: Source, distortion: tuple[float, ...] = ()
) -> Lens:
    """A camera of a frame, its principal point counted from the corner of the first pixel."""
    height, width = size
    fx, fy, cx, cy = (float(intrinsics[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    cy = cy + source.half
    with input_error(shot, "a camera"):
        k1, k2, p1, p2, k3 = distortion or (0.0,) * 5
        centre = (cx + source.half, height - cy if source.from_below else cy)
        return Lens((height, width), (fx, fy), centre, (k1, k2, p1, p2, k3))


def _distortion(batch: Any, index: int) -> tuple[float, ...]:
    """The distortion of a frame, empty for a pinhole."""
    if batch.camera_model == "PINHOLE" or batch.distortion is None:
        return ()
    return tuple(float(one) for one in batch.distortion[index])


def _readable(shot: Shot, item: str, what: str, notes: list[str]) -> bool:
    """Whether an item was downloaded with the data set, judged by one frame; a note if not."""
    try:
        shot.item(item)
    except InputError as error:
        notes.append(f"The {what} is left out: {error.found}")
        return False
    return True


def _mesh(opened: Any, path: Path, scene: str, data: DataSet, names_known: bool, notes: list[str]) -> SceneMesh | None:
    """The labelled mesh, None with a note if the scene has none."""
    if not data.mesh:
        return None
    if not names_known:
        notes.append(f"The labels are left out: {data.names_file} is not in the data set's folder.")
        return None
    found = find_table(path)
    mesh = SceneMesh(opened, path, scene, data, read_table(found) if found else None)
    try:
        _ = mesh.cast
    except (InputError, ImportError) as error:
        notes.append(f"The labels are left out: {error.found if isinstance(error, InputError) else error}")
        return None
    return mesh


@contextmanager
def scenezoo_errors(path: Path) -> Iterator[None]:
    """Turn what scenezoo raises into an InputError that names the data set's folder."""
    try:
        yield
    except (InputError, ImportError):
        raise
    except Exception as error:  # SceneZooError, KeyError, ValueError, OSError, ...
        said = error.args[0] if error.args and isinstance(error.args[0], str) else str(error)
        raise InputError(path, "a data set that scenezoo can read", said or type(error).__name__) from error


def _scenezoo() -> Any:
    """The library, with what it needs."""
    try:
        import open3d  # noqa: F401
        import scenezoo
    except ImportError as error:
        raise ImportError(
            "reading this data set needs scenezoo, which is not installed; pip install '.[scenezoo]' in SemGS's folder"
        ) from error
    return scenezoo
