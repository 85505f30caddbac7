"""ScanNet++: photos of the DSLR or frames of the iPhone, with labels and depth of the laser scan's mesh.

    DATA/SCAN/dslr/    resized_images/, resized_anon_masks/, colmap/, nerfstudio/transforms.json, train_test_lists.json
                       undistorted_images/ and nerfstudio/transforms_undistorted.json, where the toolbox made them
    DATA/SCAN/iphone/  rgb/, rgb_masks/ and depth/ as the toolbox extracts them, colmap/, nerfstudio/transforms.json
    DATA/SCAN/scans/   see `semgs.data.layouts.scannetpp.mesh`

COLMAP's poses are in the mesh's world, in metres. `transforms.json` has them camera to world with OpenGL axes in a world whose first two
axes change places and whose third is turned round; all that is undone here. Intrinsics count from the corner of the first pixel. The
DSLR's pictures are fisheye (OPENCV_FISHEYE): those that the toolbox undistorted are read as they are, others are undistorted here. Where a
mask hides something (faces, screens), there is neither label nor depth.
https://kaldir.vc.in.tum.de/scannetpp/documentation, https://github.com/scannetpp/scannetpp
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from semgs.data.classes import SCANNET20
from semgs.data.fisheye import FisheyeLens
from semgs.data.frames import Frame
from semgs.data.layouts.colmap.files import PARAMETERS, ColmapCamera, read_cameras, read_images
from semgs.data.layouts.parts.fields import Fields, parsed
from semgs.data.layouts.parts.poses import checked_poses
from semgs.data.layouts.scannet.labels import find_table, read_table
from semgs.data.layouts.scannetpp.labels import labels_of
from semgs.data.layouts.scannetpp.mesh import MESH, LabelledMesh, MeshDepth, MeshLabels, object_names
from semgs.data.lens import AbstractLens, Lens
from semgs.data.maps import DepthMap, MaskMap
from semgs.data.peers import READINGS, TOOLBOX_UNDISTORTION
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.pictures import read_header

LAYOUT = "ScanNet++"
"""Of `Scene.layout`, with the device behind it."""
LOOKED_FOR = "a ScanNet++ scan (dslr/ or iphone/ with colmap/ or nerfstudio/)"
APPLICABLE = (TOOLBOX_UNDISTORTION,)

LISTS = "train_test_lists.json"
TRANSFORMS, UNDISTORTED = "nerfstudio/transforms.json", "nerfstudio/transforms_undistorted.json"
CAMERAS, IMAGES = "colmap/cameras.txt", "colmap/images.txt"
NAMED = 12
"""So many unknown names are told one by one."""


@dataclass(frozen=True)
class _Device:
    """What one of the two cameras left.

    Attributes:
        folder: its folder in a scan.
        pictures: folders that pictures may be in.
        masks: likewise.
        depth: of the sensor, 16 bits, millimetres; None where the device measures none.
        advice: where there are no pictures.
    """

    folder: str
    pictures: tuple[str, ...]
    masks: tuple[str, ...]
    depth: str | None
    advice: str


DSLR = _Device(
    "dslr",
    ("resized_images", "original_images"),
    ("resized_anon_masks", "original_anon_masks"),
    None,
    "download the dslr assets of the scan",
)
DSLR_UNDISTORTED = _Device(
    "dslr",
    ("undistorted_images", "resized_undistorted_images"),
    ("undistorted_anon_masks", "resized_undistorted_masks"),
    None,
    DSLR.advice,
)
IPHONE = _Device(
    "iphone",
    ("rgb",),
    ("rgb_masks",),
    "depth",
    "extract the frames first: ffmpeg -i iphone/rgb.mkv -start_number 0 -q:v 1 iphone/rgb/frame_%06d.jpg",
)


def recognises(path: Path) -> bool:
    """Whether a path is a scan's folder, or its `dslr` or `iphone`."""
    return path.is_dir() and _found(path) is not None


def open_scan(path: Path, as_peers: Collection[str] = ()) -> Scene:
    """The scene of a scan: its DSLR's photos, or where they are not there its iPhone's frames.

    Args:
        path: the scan's folder, or `dslr` or `iphone` in it to name the device.
        as_peers: readings of `APPLICABLE`.

    Raises:
        InputError: a list of cameras or the annotations are broken, a camera has a model that is not read, there are no pictures, or
            fewer than two can be used.
    """
    found = _found(path)
    if found is None:
        raise InputError(path, LOOKED_FOR, "none of them")
    scan, device = found
    folder = scan / device.folder
    posed = _posed(folder, device, TOOLBOX_UNDISTORTION in as_peers)
    pictures = _pictures(folder, posed.device, posed.names)
    scanned = _mesh(scan)
    mesh = scanned.mesh
    masks = next((folder / place for place in posed.device.masks if (folder / place).is_dir()), None)
    bad = _bad(folder)
    frames, absent, used = [], [], set[str]()
    sensor = folder / device.depth if device.depth else None
    for name, lens, pose in zip(posed.names, posed.lenses, posed.poses, strict=True):
        base = Path(name).name
        if base in bad or (posed.listed and base not in posed.listed):
            continue
        picture = pictures / base
        if not picture.is_file():
            absent.append(name)
            continue
        if not used:
            _check_size(picture, lens)
        used.add(base)
        mask = masks / f"{Path(name).stem}.png" if masks else None
        depth = sensor / f"{Path(name).stem}.png" if sensor else None
        frames.append(
            Frame(
                name=base,
                picture=picture,
                lens=lens,
                world_from_camera=pose,
                depth=MeshDepth(mesh) if mesh else DepthMap(depth) if depth and depth.is_file() else None,
                labels=MeshLabels(mesh) if mesh and mesh.annotations else None,
                mask=MaskMap(mask) if mask and mask.is_file() else None,
            )
        )
    marked = sum(Path(name).name in bad for name in posed.names)
    return Scene(
        path=folder,
        name=scan.absolute().name,
        layout=f"{LAYOUT} {device.folder}",
        unit="metric",
        frames=tuple(frames),
        classes=SCANNET20 if mesh and mesh.annotations and scanned.unread is None else None,
        unread_labels=scanned.unread,
        absent=tuple(absent),
        notes=(
            *posed.notes,
            *(
                [f"{len(absent)} of the listed pictures are absent in {pictures}, the first is {absent[0]}."]
                if absent
                else []
            ),
            *([f"{marked} pictures are marked as bad and left out."] if marked else []),
            *_unmasked(frames, masks),
            *scanned.notes,
            *([] if mesh else _sensor_notes(frames, device)),
            *_other_device(scan, path, device),
            *(f"Read as peers do: {READINGS[one]}." for one in as_peers if one in APPLICABLE and posed.device is DSLR),
        ),
        splits={
            part: tuple(index for index, frame in enumerate(frames) if frame.name in names)
            for part, names in posed.splits.items()
        },
    )


@dataclass(frozen=True, eq=False)
class _Posed:
    """The cameras of a device.

    Attributes:
        device: where its pictures are.
        names: of the pictures, as listed.
        lenses: of each.
        poses: camera to world in the mesh's world [n 4 4].
        splits: names of the pictures of each part, "train" and "test".
        notes: what the user should be told.
    """

    device: _Device
    names: tuple[str, ...]
    lenses: tuple[AbstractLens, ...]
    poses: np.ndarray
    splits: Mapping[str, Collection[str]]
    notes: tuple[str, ...] = ()

    @property
    def listed(self) -> set[str]:
        """Names of the pictures that are in a part; none where nobody made any."""
        return {name for names in self.splits.values() for name in names}


def _found(path: Path) -> tuple[Path, _Device] | None:
    """The scan's folder and the device that a path means."""
    for device in (DSLR, IPHONE):
        if path.absolute().name == device.folder and _has_cameras(path):
            return path.absolute().parent, device
    there = [device for device in (DSLR, IPHONE) if _has_cameras(path / device.folder)]
    with_pictures = [
        device
        for device in there
        if any(
            (path / device.folder / place).is_dir()
            for place in (*device.pictures, *(DSLR_UNDISTORTED.pictures if device is DSLR else ()))
        )
    ]
    return next(((path, device) for device in (*with_pictures, *there)), None)


def _has_cameras(folder: Path) -> bool:
    """Whether a device's folder tells where its pictures were taken."""
    return (folder / CAMERAS).is_file() or any((folder / name).is_file() for name in (TRANSFORMS, UNDISTORTED))


def _posed(folder: Path, device: _Device, as_toolbox: bool) -> _Posed:
    """The cameras of a device: what the toolbox undistorted, COLMAP's text, or `transforms.json`, whichever is there first."""
    notes: tuple[str, ...] = ()
    if device is DSLR and (folder / UNDISTORTED).is_file():
        if any((folder / place).is_dir() for place in DSLR_UNDISTORTED.pictures):
            return _from_transforms(folder, folder / UNDISTORTED, DSLR_UNDISTORTED, as_toolbox)
        places = ", ".join(DSLR_UNDISTORTED.pictures)
        notes = (f"{UNDISTORTED} is there, but none of {places}: the fisheye pictures are read.",)
    if (folder / CAMERAS).is_file():
        posed = _from_colmap(folder, device, as_toolbox)
    else:
        posed = _from_transforms(folder, folder / TRANSFORMS, device, as_toolbox)
    return replace(posed, notes=notes)


def _from_colmap(folder: Path, device: _Device, as_toolbox: bool) -> _Posed:
    """The cameras of COLMAP's text files."""
    cameras = read_cameras(folder / CAMERAS, PARAMETERS)
    lenses = {
        number: _lens(folder / CAMERAS, f"camera {number}", camera, as_toolbox) for number, camera in cameras.items()
    }
    images = sorted(read_images(folder / IMAGES, cameras), key=lambda image: image.name)
    poses = checked_poses(
        folder / IMAGES, [image.world_from_camera for image in images], [image.place for image in images]
    )
    splits = _splits(folder)
    if splits is None and (folder / TRANSFORMS).is_file():
        splits = _splits_of(parsed(folder / TRANSFORMS))
    return _Posed(
        device,
        tuple(image.name for image in images),
        tuple(lenses[image.camera] for image in images),
        poses,
        splits or {},
    )


def _from_transforms(folder: Path, path: Path, device: _Device, as_toolbox: bool) -> _Posed:
    """The cameras of a `transforms.json`, in the mesh's world."""
    shared = parsed(path)
    listed = shared.objects("frames")
    if shared.values.get("test_frames"):
        listed += shared.objects("test_frames")
    names = [frame.text("file_path") for frame in listed]
    for frame, name in zip(listed, names, strict=True):
        if name is None:
            raise frame.refused("file_path", "the name of a picture", "nothing")
    keys = [f"{frame.place}transform_matrix" for frame in listed]
    poses = checked_poses(path, [frame.values.get("transform_matrix") for frame in listed], keys)
    order = sorted(range(len(listed)), key=lambda index: names[index] or "")
    return _Posed(
        device,
        tuple(names[index] or "" for index in order),
        tuple(_shared_lens(listed[index], as_toolbox) for index in order),
        in_mesh_world(poses)[order],
        _splits(folder) or _splits_of(shared),
    )


def in_mesh_world(poses: np.ndarray) -> np.ndarray:
    """Camera to world with OpenCV axes in the mesh's world, from the matrices [n 4 4] of ScanNet++'s `transforms.json`.

    From COLMAP's those came about by turning the camera's second and third axis round, exchanging the first two rows, and turning the
    third row round.
    """
    back = poses.copy()
    back[:, 2] *= -1
    back = back[:, [1, 0, 2, 3]]
    back[:, :, 1:3] *= -1
    return back


def _shared_lens(fields: Fields, as_toolbox: bool) -> AbstractLens:
    """The lens of a frame of `transforms.json`, mostly that of all frames.

    Raises:
        InputError: a key is missing or cannot be used.
    """
    model = fields.text("camera_model") or "PINHOLE"
    names = {
        "PINHOLE": (),
        "OPENCV": ("k1", "k2", "p1", "p2"),
        "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4"),
    }.get(model)
    if names is None:
        raise fields.refused("camera_model", "PINHOLE, OPENCV or OPENCV_FISHEYE", model)
    values = {}
    for key, name in (("fl_x", "fx"), ("fl_y", "fy"), ("cx", "cx"), ("cy", "cy")):
        number = fields.number(key)
        if number is None:
            raise fields.refused(key, "a number of pixels", "nothing")
        values[name] = number
    width, height = fields.whole("w"), fields.whole("h")
    if width is None or height is None:
        raise fields.refused("w" if width is None else "h", "a number of pixels", "nothing")
    values.update({name: fields.number(name) or 0.0 for name in names})
    return _lens(
        Path(str(fields.path)), fields.place + "camera_model", ColmapCamera(model, (height, width), values), as_toolbox
    )


def _lens(path: Path, key: str, camera: ColmapCamera, as_toolbox: bool) -> AbstractLens:
    """The lens of a camera.

    Raises:
        InputError: its numbers make no camera.
    """
    values = camera.values
    focal = values.get("fx", values.get("f", 0.0)), values.get("fy", values.get("f", 0.0))
    centre = values["cx"], values["cy"]
    try:
        if camera.model == "OPENCV_FISHEYE":
            k1, k2, k3, k4 = (values[name] for name in ("k1", "k2", "k3", "k4"))
            return FisheyeLens(camera.size, focal, centre, fisheye=(k1, k2, k3, k4), as_toolbox=as_toolbox)
        k1, k2, p1, p2 = (values.get(name, 0.0) for name in ("k1", "k2", "p1", "p2"))
        return Lens(camera.size, focal, centre, (k1, k2, p1, p2, 0.0))
    except ValueError as error:
        raise InputError(path, "a camera that can be", str(error), key=key) from error


def _splits(folder: Path) -> dict[str, set[str]] | None:
    """Names of the pictures for training and for test, None where the list is not there.

    Raises:
        InputError: it is broken.
    """
    path = folder / LISTS
    if not path.is_file():
        return None
    fields = parsed(path)
    splits = {}
    for part in ("train", "test"):
        names = fields.values.get(part, [])
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise fields.refused(part, "a list of names", f"{names!r:.40}")
        splits[part] = {Path(name).name for name in names}
    return splits


def _splits_of(shared: Fields) -> dict[str, set[str]]:
    """The same from a `transforms.json`."""
    splits = {}
    for part, key in (("train", "frames"), ("test", "test_frames")):
        listed = shared.objects(key) if shared.values.get(key) else []
        splits[part] = {Path(frame.text("file_path") or "").name for frame in listed}
    return splits


def _bad(folder: Path) -> set[str]:
    """Names of the pictures that `transforms.json` marks as bad."""
    if not (folder / TRANSFORMS).is_file():
        return set()
    shared = parsed(folder / TRANSFORMS)
    listed = [frame for key in ("frames", "test_frames") if shared.values.get(key) for frame in shared.objects(key)]
    return {Path(frame.text("file_path") or "").name for frame in listed if frame.values.get("is_bad") is True}


def _pictures(folder: Path, device: _Device, names: Iterable[str]) -> Path:
    """The folder of a device's pictures: the first that holds one.

    Raises:
        InputError: none does.
    """
    for place in device.pictures:
        if any((folder / place / Path(name).name).is_file() for name in names):
            return folder / place
    raise InputError(
        folder, "pictures in " + " or ".join(f"{place}/" for place in device.pictures), "none", advice=device.advice
    )


def _check_size(picture: Path, lens: AbstractLens) -> None:
    """See that pictures are those that the cameras are for.

    Raises:
        InputError: they have another size.
    """
    size = read_header(picture).size
    if size != lens.size:
        raise InputError(
            picture,
            f"{lens.size[1]}x{lens.size[0]} pixels (width x height), as its camera says",
            f"{size[1]}x{size[0]}",
        )


@dataclass(frozen=True)
class _Scanned:
    """What a laser scan left: its mesh with what its objects' names mean, what the user should be told, and why not if they mean nothing."""

    mesh: LabelledMesh | None
    notes: tuple[str, ...] = ()
    unread: InputError | None = None


def _mesh(scan: Path) -> _Scanned:
    """The mesh of a scan, if it is there and can be read.

    Raises:
        InputError: the annotations are broken.
    """
    folder = scan / "scans"
    if not (folder / MESH).is_file():
        return _Scanned(None, (f"There is no scans/{MESH}, so there are no labels.",))
    if not all(find_spec(library) for library in ("embreex", "trimesh")):
        needed = "Labels and depth of the mesh need embreex and trimesh, which are not installed"
        return _Scanned(None, (f"{needed}; pip install '.[raycast]' in SemGS's folder.",))
    bare = LabelledMesh(folder, scan.absolute().name, ())
    if bare.annotations is None:
        sentence = f"There is no {bare.folder / 'segments_anno.json'}: depth is the mesh's, and there are no labels."
        return _Scanned(bare, (sentence,))
    names = object_names(bare.annotations)
    place = find_table(scan)
    try:
        table = read_table(place) if place else None
    except InputError as error:
        return _Scanned(bare, unread=error)
    known, missed = labels_of(names, table)
    notes = []
    if missed:
        told = ", ".join(f"{name or '(no name)'} ({count})" for name, count in missed[:NAMED])
        more = f", and {len(missed) - NAMED} more" if len(missed) > NAMED else ""
        notes.append(
            f"{len(missed)} of {len(names)} object names are in no table and are labelled as nothing: {told}{more}."
        )
    if table is None:
        notes.append(
            "ScanNet's scannetv2-labels.combined.tsv is not with the data; with it, more names would be known."
        )
    return _Scanned(replace(bare, labels=known), tuple(notes))


def _unmasked(frames: Sequence[Frame], masks: Path | None) -> list[str]:
    """What to say of pictures without a mask."""
    without = [frame.name for frame in frames if frame.mask is None]
    if not without:
        return []
    if masks is None:
        return ["There are no masks: what was made unrecognisable counts as the rest does."]
    return [f"{len(without)} of {len(frames)} pictures have no mask in {masks.name}, the first is {without[0]}."]


def _sensor_notes(frames: Sequence[Frame], device: _Device) -> list[str]:
    """What to say of depth where there is no mesh."""
    with_depth = sum(frame.depth is not None for frame in frames)
    if not with_depth:
        return ["There is no depth."]
    if with_depth < len(frames):
        return [f"{len(frames) - with_depth} of {len(frames)} pictures have no depth in {device.depth}/."]
    return [f"Depth is that of the {device.folder}'s sensor."]


def _other_device(scan: Path, path: Path, device: _Device) -> list[str]:
    """That the scan has another device's pictures too, where none was named."""
    other = IPHONE if device is DSLR else DSLR
    if path.absolute().name == device.folder or not _has_cameras(scan / other.folder):
        return []
    return [f"{other.folder}/ is there too; name {scan / other.folder} to read it."]
