"""ScanNet++: photos of the DSLR or frames of the iPhone, with labels and depth from the mesh of the laser scan.

    DATA/SCAN/dslr/    resized_images/, resized_anon_masks/, colmap/, nerfstudio/transforms.json, train_test_lists.json
                       undistorted_images/ and nerfstudio/transforms_undistorted.json, if the toolbox made them
    DATA/SCAN/iphone/  rgb/, rgb_masks/ and depth/ as the toolbox extracts them, colmap/, nerfstudio/transforms.json
    DATA/SCAN/scans/   see `semgs.data.layouts.scannetpp.scannetpp_mesh`

Pixels hidden by a mask (faces, screens) have neither label nor depth.
https://kaldir.vc.in.tum.de/scannetpp/documentation, https://github.com/scannetpp/scannetpp
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

from semgs.data.cameras.lens import AbstractLens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.mesh_maps import MeshDepth, MeshLabels
from semgs.data.layouts.parts.usable_frames import note_lacking
from semgs.data.layouts.scannet.scannet_labels import find_table, read_table
from semgs.data.layouts.scannetpp.devices import (
    DSLR,
    DSLR_UNDISTORTED,
    IPHONE,
    Device,
    bad_pictures,
    has_cameras,
    read_posed,
)
from semgs.data.layouts.scannetpp.scannetpp_labels import labels_of
from semgs.data.layouts.scannetpp.scannetpp_mesh import MESH, LabelledMesh, object_names
from semgs.data.maps import DepthMap, MaskMap
from semgs.data.paper_variants import READINGS, TOOLBOX_UNDISTORTION
from semgs.data.scene import Scene
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_header
from semgs.files.text import counted, listed

LAYOUT = "ScanNet++"
"""`Scene.layout` is this and the name of the device."""
LOOKED_FOR = "a ScanNet++ scan (dslr/ or iphone/ with colmap/ or nerfstudio/)"
APPLICABLE = (TOOLBOX_UNDISTORTION,)

NAMED = 12
"""At most this many unknown names are listed."""


def recognises(path: Path) -> bool:
    """Whether a path is a scan's folder, or its `dslr` or `iphone`."""
    return path.is_dir() and _found(path) is not None


def open_scannetpp(path: Path, as_peers: Collection[str] = ()) -> Scene:
    """The scene of a scan: the DSLR's photos, or else the iPhone's frames.

    Args:
        path: the scan's folder, or `dslr` or `iphone` in it to choose the device.
        as_peers: readings of `APPLICABLE`.

    Raises:
        InputError: the cameras or the annotations are damaged, a camera model is not supported, there are no images, or fewer than
            two are usable.
    """
    found = _found(path)
    if found is None:
        raise InputError(path, LOOKED_FOR, "none of them")
    scan, device = found
    folder = scan / device.folder
    posed = read_posed(folder, device, TOOLBOX_UNDISTORTION in as_peers)
    pictures = _pictures(folder, posed.device, posed.names)
    scanned = _mesh(scan)
    mesh = scanned.mesh
    masks = next((folder / place for place in posed.device.masks if (folder / place).is_dir()), None)
    bad, chosen = bad_pictures(folder), posed.listed
    frames, absent = list[Frame](), list[str]()
    sensor = folder / device.depth if device.depth else None
    for name, lens, pose in zip(posed.names, posed.lenses, posed.poses, strict=True):
        base = Path(name).name
        if base in bad or (chosen and base not in chosen):
            continue
        picture = pictures / base
        if not picture.is_file():
            absent.append(name)
            continue
        if not frames:
            _check_size(picture, lens)
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
            *note_lacking(absent, len(posed.names), f"listed images are missing in {pictures}"),
            *([f"{counted(marked, 'image is', 'images are')} marked as bad and left out."] if marked else []),
            *_unmasked(frames, masks),
            *scanned.notes,
            *([] if mesh else _sensor_notes(frames, device)),
            *_other_device(scan, path, device),
            *(
                f"Read as in other papers' code: {READINGS[one]}."
                for one in as_peers
                if one in APPLICABLE and posed.device is DSLR
            ),
        ),
        splits={
            part: tuple(index for index, frame in enumerate(frames) if frame.name in names)
            for part, names in posed.splits.items()
        },
    )


def _found(path: Path) -> tuple[Path, Device] | None:
    """The scan's folder and the device for a path, None if it is not a scan."""
    for device in (DSLR, IPHONE):
        if path.absolute().name == device.folder and has_cameras(path):
            return path.absolute().parent, device
    there = [device for device in (DSLR, IPHONE) if has_cameras(path / device.folder)]

    def lacks_pictures(device: Device) -> bool:
        places = (*device.pictures, *DSLR_UNDISTORTED.pictures) if device is DSLR else device.pictures
        return not any((path / device.folder / place).is_dir() for place in places)

    return (path, min(there, key=lacks_pictures)) if there else None


def _pictures(folder: Path, device: Device, names: Iterable[str]) -> Path:
    """The folder of a device's images: the first that contains one of them."""
    for place in device.pictures:
        if any((folder / place / Path(name).name).is_file() for name in names):
            return folder / place
    raise InputError(
        folder, "images in " + " or ".join(f"{place}/" for place in device.pictures), "none", advice=device.advice
    )


def _check_size(picture: Path, lens: AbstractLens) -> None:
    """Check that an image has the size of its camera."""
    size = read_header(picture).size
    if size != lens.size:
        raise InputError(
            picture,
            f"{lens.size[1]}x{lens.size[0]} pixels (width x height), the size of its camera",
            f"{size[1]}x{size[0]}",
        )


@dataclass(frozen=True)
class _Scanned:
    """The mesh of a laser scan, notes for the user, and why labels cannot be read, if so."""

    mesh: LabelledMesh | None
    notes: tuple[str, ...] = ()
    unread: InputError | None = None


def _mesh(scan: Path) -> _Scanned:
    """The mesh of a scan, if it exists and the libraries are installed."""
    folder = scan / "scans"
    if not (folder / MESH).is_file():
        return _Scanned(None, (f"There is no scans/{MESH}, so there are no labels.",))
    if not all(find_spec(library) for library in ("embreex", "trimesh")):
        needed = "Labels and depth of the mesh need embreex and trimesh, which are not installed"
        return _Scanned(None, (f"{needed}; pip install -e '.[raycast]' in SemGS's folder.",))
    bare = LabelledMesh(folder, scan.absolute().name, ())
    if bare.annotations is None:
        sentence = (
            f"There is no {bare.folder / 'segments_anno.json'}: depth comes from the mesh, and there are no labels."
        )
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
        shown = listed([f"{name or '(no name)'} ({count})" for name, count in missed], NAMED)
        notes.append(f"{len(missed)} of {len(names)} object names are in no table and get no label: {shown}.")
    if table is None:
        notes.append("Without ScanNet's scannetv2-labels.combined.tsv next to the data, fewer names are known.")
    return _Scanned(replace(bare, labels=known), tuple(notes))


def _unmasked(frames: Sequence[Frame], masks: Path | None) -> list[str]:
    """Notes about images without a mask."""
    if masks is None:
        return ["There are no masks, so anonymised areas count like the rest."]
    without = [frame.name for frame in frames if frame.mask is None]
    return note_lacking(without, len(frames), f"images have no mask in {masks.name}")


def _sensor_notes(frames: Sequence[Frame], device: Device) -> list[str]:
    """Notes about depth if there is no mesh."""
    with_depth = sum(frame.depth is not None for frame in frames)
    if not with_depth:
        return ["There is no depth."]
    if with_depth < len(frames):
        return [f"{len(frames) - with_depth} of {len(frames)} images have no depth in {device.depth}/."]
    return [f"Depth is from the {device.folder}'s sensor."]


def _other_device(scan: Path, path: Path, device: Device) -> list[str]:
    """A note if the scan also has images of the other device, and the user chose none."""
    other = IPHONE if device is DSLR else DSLR
    if path.absolute().name == device.folder or not has_cameras(scan / other.folder):
        return []
    return [f"There is also {other.folder}/; to read it, open {scan / other.folder}."]
