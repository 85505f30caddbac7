"""`transforms.json` of nerfstudio and instant-ngp, in a folder or a zip archive.

Poses are camera to world with OpenGL axes (x right, y up, z backward). They become OpenCV's by negating the second and third column.
Intrinsics are in pixels with the centre of the first pixel at (0.5, 0.5), shared or per frame. Sparse points (`ply_file_path`) are in the world of the poses.
https://docs.nerf.studio/quickstart/data_conventions.html, https://github.com/NVlabs/instant-ngp (docs/nerf_dataset_tips.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.confined import named_file
from semgs.data.frames import Frame
from semgs.data.layouts.parts.fields import Fields, read_fields
from semgs.data.layouts.parts.letter_forms import OTHER_FORM, in_other_form, is_in_other_form
from semgs.data.layouts.parts.pose_files import listed_poses, pose_is_lost
from semgs.data.layouts.parts.sparse_points import points_in_view, read_ply_points
from semgs.data.layouts.parts.usable_frames import note_damaged_points, note_lacking, note_transparent
from semgs.data.maps import ClassMap, DepthMap, InstanceMap, MaskMap
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.data.spread import spread
from semgs.data.tables.class_files import read_class_file
from semgs.data.tables.classes import IGNORE, ClassTable, class_table
from semgs.files.archives import Archive, Member, members
from semgs.files.errors import InputError, input_error
from semgs.files.images.pictures import TIFFS, is_float_tiff, is_turned, read_header
from semgs.files.stored import Stored
from semgs.runtime.notes import Kind, Note

DETAILS = ("depth_unit",)
FILE_NAMES = ("transforms.json", "transforms_train.json")

ENDINGS = (".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG")
"""Endings to try for a `file_path` without one, as in instant-ngp and the synthetic NeRF scenes."""

CAMERA_MODELS = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL", "RADIAL")
"""Camera models covered by OpenCV's k1, k2, p1, p2, k3. Only these coefficients matter, not the name of the model."""

DISTORTION = ("k1", "k2", "p1", "p2", "k3")
OTHER_DISTORTION = ("k4", "k5", "k6")
OTHER_LENSES = ("is_fisheye", "ftheta_p0", "ftheta_p1", "ftheta_p2", "ftheta_p3", "ftheta_p4", "latlong", "equirect")
"""instant-ngp's keys of lenses that are not pinholes."""

DEPTH_UNIT = 0.001
"""Default of nerfstudio's `depth_unit_scale_factor`: millimetres. Floating-point TIFF is in the unit of the poses, as we write it, unless the file has that key."""

JUDGED, DENSE, ROOM_DEPTH = 3, 0.2, (0.4, 15.0)
"""If the file does not say its unit, so many depth maps are judged: lengths are metres if this share of their pixels is known, with a median between these [m]."""

OF_COLMAP = "colmap_im_id"
"""nerfstudio's key of frames that COLMAP solved."""

TAKEN_FOR_METRES = Kind(
    'Assumed: lengths are metres, because the depth maps look like a sensor\'s. Add "metric": true to the file to confirm it, or use --unit unknown.',
    "Assumed: lengths are metres, because the depth maps look like a sensor's.",
)
NOT_METRES = Kind(
    'The unit of lengths is unknown: the file does not say it, and {doubt}. If they are metres, use --unit metric, or add "metric": true to the file.',
    'The unit of lengths is unknown: the file does not say it, and {doubt}. If they are metres, add "metric": true to the file.',
)

DEPTHS = (".png", ".npy", ".pgm", *TIFFS)
LOSSY = (".jpg", ".jpeg")
DEPTH_OF_NGP, SCALE_OF_NGP, ENABLED_OF_NGP = "depth_path", "integer_depth_scale", "enable_depth_loading"
"""instant-ngp's keys of depth, which NeRFCapture and SplaTAM use, too: z-depth in counts of so many units of the poses."""

MAPS = ("depth_file_path", DEPTH_OF_NGP, "label_file_path", "mask_path", "instance_file_path")
"""Keys of the files with maps of a frame."""

LIKE_MAPS = {
    "mask": "mask_path",
    "depth": MAPS[0],
    "label": MAPS[2],
    "semantic": MAPS[2],
    "segment": MAPS[2],
    "instance": MAPS[4],
}
"""Words in keys of other programs, and the key that we read for what they mean."""


Beside = Callable[[str], Stored | None]
"""Gives the file at a path relative to the transforms file, None if there is none."""


def recognises(path: Path) -> bool:
    """Whether a path is a transforms file, or a folder or a zip archive with one.

    Raises:
        InputError: it has the ending of a zip archive, but is not one, or is damaged.
    """
    if path.suffix.lower() == ".zip" and path.is_file():
        return _member(members(path)) is not None
    return path.suffix.lower() == ".json" if path.is_file() else _file(path) is not None


def open_transforms(path: Path, details: SceneDetails | None = None) -> Scene:
    """The scene of a transforms file, or of a folder or a zip archive with one.

    Args:
        path: the file, folder or archive.
        details: `depth_unit` overrides the file's.

    Raises:
        InputError: it is not JSON, a key is missing or invalid, there are fewer than two images, or one has another size than its
            camera. The error names the file and key.
    """
    depth_unit = None if details is None else details.depth_unit
    if path.suffix.lower() == ".zip" and path.is_file():
        archive = Archive(path, members(path))
        member = _member(archive.members)
        if member is None:
            raise InputError(path, FILE_NAMES[0], "none in the archive")
        return _scene(path, member, path.stem, lambda name: archive.beside(member, name), depth_unit)
    file = path if path.is_file() else _file(path) or path / FILE_NAMES[0]
    return _scene(file, file, file.absolute().parent.name, lambda name: _on_disk(file, name), depth_unit)


def _scene(path: Path, file: Stored, name_of_scene: str, beside: Beside, depth_unit: float | None) -> Scene:
    """The scene that a transforms file describes.

    Args:
        path: the path of the scene: the file, or its archive.
        file: the transforms file.
        name_of_scene: the name of the scene.
        beside: finds the files that it lists.
        depth_unit: metres per count of the depth maps; None for what the file says.
    """
    shared = read_fields(file)
    listed = shared.objects("frames")
    names = _names(listed)
    lost = [name for fields, name in zip(listed, names, strict=True) if pose_is_lost(fields)]
    if len(lost) < len(listed):
        kept = set(names) - set(lost)
        listed = [fields for fields, name in zip(listed, names, strict=True) if name in kept]
        names = [name for name in names if name in kept]
    poses = listed_poses(listed)
    poses[:, :3, 1:3] *= -1
    lenses: dict[Lens, Lens] = {}
    frames, labels, absent, notes = list[Frame](), dict[int, Stored](), [], _Notes()
    for fields, name, pose in zip(listed, names, poses, strict=True):
        picture = _found(beside, name, ENDINGS)
        if picture is None:
            absent.append(name)
            continue
        notes.reformed += [name] if is_in_other_form(name, picture) else []
        lens = _lens(fields, picture, notes)
        depth = _depth(fields, notes, beside, depth_unit)
        label = _map(fields, "label_file_path", (".png",), notes, beside)
        if label is not None:
            labels[len(frames)] = label
        mask = _map(fields, "mask_path", (".png",), notes, beside)
        things = _map(fields, "instance_file_path", (".png",), notes, beside)
        frames.append(
            Frame(
                name,
                picture,
                lenses.setdefault(lens, lens),
                pose,
                depth,
                mask=MaskMap(mask) if mask else None,
                instances=InstanceMap(things) if things else None,
            )
        )
    unread, classes = None, None
    try:
        if labels:
            classes, meaning = _classes(shared, beside)
            for index, label in labels.items():
                source = ClassMap(label, classes, meaning, f"frame {frames[index].name}")
                frames[index] = replace(frames[index], labels=source)
    except InputError as error:
        unread = error
    points, about_points = _points(shared, beside)
    unit, unit_source, about_unit = _unit(shared, listed, frames)
    if points is not None:
        frames = [replace(frame, points=points_in_view(frame, points)) for frame in frames]
    return Scene(
        path=path,
        name=name_of_scene,
        layout="transforms.json",
        unit=unit,
        frames=tuple(frames),
        classes=classes,
        unread_labels=unread,
        absent=tuple(absent),
        notes=(
            *notes.sentences(absent, len(listed)),
            *_note_unread_keys(listed, names),
            *note_lacking(lost, len(listed) + len(lost), "frames have no finite pose and are left out"),
            *_note_other_splits(file),
            *about_points,
            *about_unit,
        ),
        points=points if points is not None and len(points) else None,
        applied_transform=_applied_transform(shared),
        applied_scale=shared.positive("applied_scale"),
        unit_source=unit_source,
    )


class _Notes:
    """Counts for the notes of a scene."""

    def __init__(self) -> None:
        self.transparent = self.maps = 0
        self.reformed: list[str] = []
        self.missing_maps: list[str] = []
        self.unread_maps: list[str] = []
        self.lossy_maps: list[str] = []
        self.unscaled_maps: list[str] = []
        self.disabled_maps: list[str] = []

    def sentences(self, absent: Sequence[str], listed: int) -> list[str]:
        """The notes on a scene with so many listed frames."""
        return [
            *note_lacking(absent, listed, "listed images are missing"),
            *note_lacking(self.reformed, listed, f"listed images have names with {OTHER_FORM}"),
            *note_transparent(self.transparent, "mask_path of its frame"),
            *note_lacking(self.missing_maps, self.maps, "listed depth, label and mask files are missing"),
            *note_lacking(self.unread_maps, self.maps, "listed depth, label and mask files have an unsupported format"),
            *note_lacking(
                self.lossy_maps,
                self.maps,
                "listed depth, label and mask files are left out, as JPEG changes numbers (make them again, as PNG)",
            ),
            *note_lacking(
                self.unscaled_maps,
                self.maps,
                f"files in {DEPTH_OF_NGP} are left out, as {SCALE_OF_NGP} is missing or 0",
            ),
            *note_lacking(
                self.disabled_maps, self.maps, f"files in {DEPTH_OF_NGP} are left out, as {ENABLED_OF_NGP} is false"
            ),
        ]


def _file(folder: Path) -> Path | None:
    """The transforms file of a folder, None if there is none."""
    return next((folder / name for name in FILE_NAMES if (folder / name).is_file()), None)


def _note_other_splits(file: Stored) -> list[str]:
    """A note about the files of other splits (transforms_val.json) beside that of the training split."""
    if not isinstance(file, Path) or file.name != FILE_NAMES[1]:
        return []
    others = sorted(one.name for one in file.parent.glob("transforms_*.json") if one.name != file.name)
    if not others:
        return []
    return [
        f"Only the frames of {file.name} are read, not those of {', '.join(others)}; give a file's own path to read it."
    ]


def _note_unread_keys(listed: Sequence[Fields], names: Sequence[str]) -> list[str]:
    """Notes about keys of frames that name a file with a mask, depth or labels, but are not among `MAPS`."""
    found: dict[str, list[str]] = {}
    for fields, name in zip(listed, names, strict=True):
        for key, value in fields.values.items():
            if key not in MAPS and isinstance(value, str) and "." in value and _read_as(key):
                found.setdefault(key, []).append(name)
    return [
        sentence
        for key, of_frames in found.items()
        for sentence in note_lacking(
            of_frames, len(listed), f"frames list {key}, which is not read (the key is {_read_as(key)})"
        )
    ]


def _read_as(key: str) -> str | None:
    """The key that we read for what a key of another program seems to name, None if it names no map."""
    return next((known for word, known in LIKE_MAPS.items() if word in key.lower()), None)


def _names(listed: Sequence[Fields]) -> list[str]:
    """The names of the frames: their `file_path` with slashes, without a leading `./`. Each may appear once."""
    places: dict[str, str] = {}
    for frame in listed:
        name = Fields(frame.path, frame.values, frame.place).text("file_path")
        if name is None:
            raise frame.refused("file_path", "the path of an image", "nothing")
        name = name.replace("\\", "/").removeprefix("./")
        if name in places:
            raise frame.refused("file_path", "each image once", f"{name}, as in {places[name]}file_path")
        places[name] = frame.place
    return list(places)


def _member(held: Mapping[str, Member]) -> Member | None:
    """The transforms file of an archive: the one in the fewest folders. None if there is none."""
    found = [one for name, one in held.items() if name.rpartition("/")[2] in FILE_NAMES and "__MACOSX" not in name]
    return min(found, key=lambda one: (one.inside.count("/"), one.inside != FILE_NAMES[0], one.inside), default=None)


def _on_disk(file: Path, name: str) -> Path | None:
    """The file at a path relative to the transforms file, perhaps in another form of its letters; None if there is none."""
    path = named_file(file, file.parent, name)
    return path if path.is_file() else in_other_form(file, file.parent, name)


def _found(beside: Beside, name: str, endings: Sequence[str] = ()) -> Stored | None:
    """The file with a name, or else the first that exists with one of the endings added."""
    return next((found for ending in ("", *endings) if (found := beside(name + ending)) is not None), None)


def _map(fields: Fields, key: str, kinds: Sequence[str], notes: _Notes, beside: Beside) -> Stored | None:
    """The depth, label or mask file of a frame, None if it has none of a supported kind."""
    name = Fields(fields.path, fields.values, fields.place).text(key)
    if name is None:
        return None
    notes.maps += 1
    path = _found(beside, name.replace("\\", "/"))
    if path is None:
        notes.missing_maps.append(name)
    elif path.suffix.lower() not in kinds:
        (notes.lossy_maps if path.suffix.lower() in LOSSY else notes.unread_maps).append(name)
        return None
    return path


def _depth(fields: Fields, notes: _Notes, beside: Beside, given: float | None) -> DepthMap | None:
    """The depth of a frame, by nerfstudio's keys or by instant-ngp's; the given unit overrides theirs."""
    unit = given or fields.positive("depth_unit_scale_factor")
    stored = _map(fields, "depth_file_path", DEPTHS, notes, beside)
    if stored is not None:
        return DepthMap(stored, unit or (1.0 if is_float_tiff(stored) else DEPTH_UNIT))
    stored = _map(fields, DEPTH_OF_NGP, DEPTHS, notes, beside)
    if stored is None:
        return None
    scale = given or fields.number(SCALE_OF_NGP)
    enabled = fields.value(ENABLED_OF_NGP)
    if enabled is not None and not fields.flag(ENABLED_OF_NGP):
        notes.disabled_maps.append(stored.name)
    elif scale is None or scale <= 0:  # instant-ngp's own default is -1: no depth
        notes.unscaled_maps.append(stored.name)
    else:
        return DepthMap(stored, scale)
    return None


def _points(shared: Fields, beside: Beside) -> tuple[np.ndarray | None, list[str]]:
    """The sparse points, and a note if they cannot be read: a scene does not need them."""
    name = shared.text("ply_file_path")
    if name is None:
        return None, []
    file = beside(name.replace("\\", "/"))
    if file is None:
        return None, [f"The sparse points are left out: {name} is missing."]
    try:
        return read_ply_points(file), []
    except InputError as error:
        return None, note_damaged_points(error)


def _lens(fields: Fields, picture: Stored, notes: _Notes) -> Lens:
    """The lens of a frame, from its own keys or the shared ones."""
    model = fields.text("camera_model")
    if model is not None and model.upper() not in CAMERA_MODELS:
        raise fields.refused(
            "camera_model", "one of " + ", ".join(CAMERA_MODELS), model, "undistort the images to pinholes first"
        )
    for key in (*OTHER_LENSES, *OTHER_DISTORTION):
        if fields.flag(key):
            raise fields.refused(
                key, "a pinhole with " + " ".join(DISTORTION), f"{fields.value(key)!r}", "undistort the images first"
            )
    header = read_header(picture)
    notes.transparent += header.transparent
    width, height = fields.whole("w"), fields.whole("h")
    stated = None if width is None or height is None else (height, width)
    is_turned(picture, header, stated)  # refuses an image of another size
    if stated is None and (width or header.size[1], height or header.size[0]) != header.size[::-1]:
        key = "w" if width else "h"
        raise fields.refused(key, f"{header.size[::-1]} (width, height) of {picture}", f"{fields.value(key)}")
    size = stated or header.size
    fx, fy = _focal(fields, "x", size[1]), _focal(fields, "y", size[0])
    focal = (fx or fy, fy or fx)
    if focal[0] is None or focal[1] is None:
        raise fields.refused("fl_x", "a focal length in pixels, or camera_angle_x", "neither")
    cx, cy = fields.number("cx"), fields.number("cy")
    k1, k2, p1, p2, k3 = (fields.number(key) or 0.0 for key in DISTORTION)
    centre = (size[1] / 2 if cx is None else cx, size[0] / 2 if cy is None else cy)
    key = "k1" if any((k1, k2, p1, p2, k3)) else "fl_x" if fields.value("fl_x") else "camera_angle_x"
    with input_error(fields.path, "a possible camera", fields.key(key)):
        return Lens(size, (focal[0], focal[1]), centre, (k1, k2, p1, p2, k3))


def _focal(fields: Fields, axis: str, side: int) -> float | None:
    """The focal length along an axis: `fl_x`, or from the angle `camera_angle_x` over `side` pixels."""
    length, angle = f"fl_{axis}", f"camera_angle_{axis}"
    holder = fields.holder(length, angle)
    if holder is None:
        return None
    if holder.values.get(length) is not None:
        return holder.positive(length)
    radians = holder.positive(angle)
    if radians is None or radians >= math.pi:
        raise holder.refused(angle, "an angle between 0 and pi", f"{radians}")
    return 0.5 * side / math.tan(0.5 * radians)


def _unit(shared: Fields, listed: Sequence[Fields], frames: Sequence[Frame]) -> tuple[str, str, list[Note]]:
    """Metric if the file says so, or if it does not say and a sensor seems to have measured a room in metres. With the reason, and a note if it is a guess."""
    metric = shared.value("metric")
    if isinstance(metric, str) and metric.strip().lower() in ("true", "false"):
        metric = shared.flag("metric")
    if metric is None:
        maps = [frame.depth for frame in frames if isinstance(frame.depth, DepthMap)]
        from_colmap = any(fields.value(OF_COLMAP) is not None for fields in listed)
        doubt = "its cameras are COLMAP's, whose unit is arbitrary" if maps and from_colmap else _doubt(maps)
        if doubt is None:
            return "metric", "its depth maps look like a sensor's in a room, but no file says so", [TAKEN_FOR_METRES()]
        return "unknown", "", [NOT_METRES(doubt=doubt)] if doubt else []
    if not isinstance(metric, bool):
        raise shared.refused("metric", "true or false", repr(metric))
    return ("metric", "the file says so", []) if metric else ("unknown", "", [])


def _doubt(maps: Sequence[DepthMap]) -> str | None:
    """Why depth maps do not show that lengths are metres: sparse ones are no sensor's, and those of COLMAP have any unit. "" if there are none, None if they do."""
    if not maps:
        return ""
    shares, depths = [], [np.zeros(0, np.float32)]
    for one in spread(maps, JUDGED):
        try:
            metres = one.metres()
        except InputError:
            continue  # it is refused when it is read
        shares.append(float((metres > 0).mean()))
        depths.append(metres[metres > 0])
    if not shares:
        return "none of its depth maps can be read"
    if np.median(shares) < DENSE:
        return "its depth maps are too sparse to be a sensor's"
    median = float(np.median(np.concatenate(depths)))
    low, high = ROOM_DEPTH
    return None if low <= median <= high else f"the median of its depth maps, {median:.2g}, is none of a room in metres"


def _classes(shared: Fields, beside: Beside) -> tuple[ClassTable, tuple[int | None, ...] | None]:
    """The class table of the labels, by name or from a file (`*.json`, relative to the transforms file), and the numbers' meaning."""
    name, ignore = shared.text("label_set"), shared.number("label_ignore")
    if ignore not in (None, IGNORE):
        raise shared.refused("label_ignore", f"{IGNORE}", f"{ignore:g}")
    if name is not None and name.endswith(".json"):
        file = beside(name)
        if file is None:
            raise shared.refused("label_set", "a file with a class table", f"{name}, which is missing")
        labels = read_class_file(file)
        return labels.table, labels.meaning
    try:
        return class_table(name or ""), None
    except ValueError as error:
        raise shared.refused("label_set", "the class table of the label files", str(error)) from error


def _applied_transform(shared: Fields) -> np.ndarray | None:
    """nerfstudio's transform from the original world to that of the poses, [3 4]."""
    value, matrix = shared.value("applied_transform"), shared.array("applied_transform")
    if value is None:
        return None
    if matrix is None or matrix.shape not in ((3, 4), (4, 4)) or not np.isfinite(matrix).all():
        raise shared.refused("applied_transform", "a 3x4 matrix of finite numbers", f"{value!r:.40}")
    return matrix[:3]
