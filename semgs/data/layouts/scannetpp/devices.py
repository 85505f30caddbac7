"""The cameras of ScanNet++'s two devices, from COLMAP's text files or `transforms.json`, and the splits into training and test images.

COLMAP's poses are in the world of the mesh, in metres. `transforms.json` has poses camera to world with OpenGL axes, in a world whose first two
axes are swapped and whose third is negated; both are undone here. Intrinsics count from the corner of the first pixel. The DSLR's images are
fisheye (OPENCV_FISHEYE). Images that the toolbox undistorted are read as they are; others are undistorted here.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semgs.data.cameras.fisheye import FisheyeLens
from semgs.data.cameras.lens import AbstractLens
from semgs.data.layouts.colmap.colmap_files import ColmapCamera, read_cameras, read_images
from semgs.data.layouts.parts.fields import Fields, read_fields
from semgs.data.layouts.parts.pose_files import checked_poses, listed_poses
from semgs.files.errors import input_error

LISTS = "train_test_lists.json"
TRANSFORMS, UNDISTORTED = "nerfstudio/transforms.json", "nerfstudio/transforms_undistorted.json"
CAMERAS, IMAGES = "colmap/cameras.txt", "colmap/images.txt"


@dataclass(frozen=True)
class Device:
    """The folders of one of the two cameras.

    Attributes:
        folder: of the device, in the scan.
        pictures: folders that may contain images.
        masks: folders that may contain masks.
        depth: folder of the sensor's depth, 16 bits, millimetres; None if it measures none.
        advice: what to do if there are no images.
    """

    folder: str
    pictures: tuple[str, ...]
    masks: tuple[str, ...]
    depth: str | None
    advice: str


DSLR = Device(
    "dslr",
    ("resized_images", "original_images"),
    ("resized_anon_masks", "original_anon_masks"),
    None,
    "download the dslr assets of the scan",
)
DSLR_UNDISTORTED = replace(
    DSLR,
    pictures=("undistorted_images", "resized_undistorted_images"),
    masks=("undistorted_anon_masks", "resized_undistorted_masks"),
)
IPHONE = Device(
    "iphone",
    ("rgb",),
    ("rgb_masks",),
    "depth",
    "extract the frames first: ffmpeg -i iphone/rgb.mkv -start_number 0 -q:v 1 iphone/rgb/frame_%06d.jpg",
)


@dataclass(frozen=True, eq=False)
class Posed:
    """The cameras of a device.

    Attributes:
        device: the folders of its images.
        names: of the images, as listed.
        lenses: of the images.
        poses: camera to world, in the world of the mesh [n 4 4].
        splits: names of the images in each split, "train" and "test".
        notes: what the user should know.
    """

    device: Device
    names: tuple[str, ...]
    lenses: tuple[AbstractLens, ...]
    poses: np.ndarray
    splits: Mapping[str, Collection[str]]
    notes: tuple[str, ...] = ()

    @property
    def listed(self) -> set[str]:
        """Names of the images in any split; empty if there are no splits."""
        return {name for names in self.splits.values() for name in names}


def has_cameras(folder: Path) -> bool:
    """Whether a device's folder contains cameras."""
    return (folder / CAMERAS).is_file() or any((folder / name).is_file() for name in (TRANSFORMS, UNDISTORTED))


def read_posed(folder: Path, device: Device, as_toolbox: bool) -> Posed:
    """The cameras of a device: of undistorted images, from COLMAP's text files, or from `transforms.json`, in this order."""
    notes: tuple[str, ...] = ()
    if device is DSLR and (folder / UNDISTORTED).is_file():
        if any((folder / place).is_dir() for place in DSLR_UNDISTORTED.pictures):
            return _from_transforms(folder, folder / UNDISTORTED, DSLR_UNDISTORTED, as_toolbox)
        places = ", ".join(DSLR_UNDISTORTED.pictures)
        notes = (f"{UNDISTORTED} exists, but none of {places}; the fisheye images are read.",)
    if (folder / CAMERAS).is_file():
        posed = _from_colmap(folder, device, as_toolbox)
    else:
        posed = _from_transforms(folder, folder / TRANSFORMS, device, as_toolbox)
    return replace(posed, notes=notes)


def _from_colmap(folder: Path, device: Device, as_toolbox: bool) -> Posed:
    """The cameras from COLMAP's text files."""
    cameras = read_cameras(folder / CAMERAS)
    lenses = {
        number: _lens(folder / CAMERAS, f"camera {number}", camera, as_toolbox) for number, camera in cameras.items()
    }
    images = sorted(read_images(folder / IMAGES, cameras), key=lambda image: image.name)
    poses = checked_poses(
        folder / IMAGES, [image.world_from_camera for image in images], [image.place for image in images]
    )
    splits = _splits(folder)
    if splits is None and (folder / TRANSFORMS).is_file():
        splits = _splits_of(read_fields(folder / TRANSFORMS))
    return Posed(
        device,
        tuple(image.name for image in images),
        tuple(lenses[image.camera] for image in images),
        poses,
        splits or {},
    )


def _from_transforms(folder: Path, path: Path, device: Device, as_toolbox: bool) -> Posed:
    """The cameras from a `transforms.json`, in the world of the mesh."""
    shared = read_fields(path)
    listed = [*shared.objects("frames"), *_frames(shared, "test_frames")]
    names = [frame.text("file_path") for frame in listed]
    for frame, name in zip(listed, names, strict=True):
        if name is None:
            raise frame.refused("file_path", "the name of an image", "nothing")
    poses = listed_poses(listed)
    order = sorted(range(len(listed)), key=lambda index: names[index] or "")
    return Posed(
        device,
        tuple(names[index] or "" for index in order),
        tuple(_shared_lens(listed[index], as_toolbox) for index in order),
        in_mesh_world(poses)[order],
        _splits(folder) or _splits_of(shared),
    )


def in_mesh_world(poses: np.ndarray) -> np.ndarray:
    """Camera to world with OpenCV axes, in the world of the mesh, from the matrices [n 4 4] of ScanNet++'s `transforms.json`.

    These were made from COLMAP's by negating the camera's second and third axis, swapping the first two rows, and negating the third row.
    """
    back = poses.copy()
    back[:, 2] *= -1
    back = back[:, [1, 0, 2, 3]]
    back[:, :, 1:3] *= -1
    return back


def _shared_lens(fields: Fields, as_toolbox: bool) -> AbstractLens:
    """The lens of a frame of `transforms.json`, usually shared by all frames."""
    model = fields.text("camera_model") or "PINHOLE"
    names = {
        "PINHOLE": (),
        "OPENCV": ("k1", "k2", "p1", "p2"),
        "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4"),
    }.get(model)
    if names is None:
        raise fields.refused("camera_model", "PINHOLE, OPENCV or OPENCV_FISHEYE", model)
    keys = {"fx": "fl_x", "fy": "fl_y", "cx": "cx", "cy": "cy"}
    values = {name: fields.required(key, "a number of pixels") for name, key in keys.items()}
    size = fields.size("w", "h")
    if size is None:
        raise fields.refused("h" if fields.value("w") else "w", "a number of pixels", "nothing")
    values.update({name: fields.number(name) or 0.0 for name in names})
    camera = ColmapCamera(model, size, values)
    return _lens(Path(str(fields.path)), fields.place + "camera_model", camera, as_toolbox)


def _lens(path: Path, key: str, camera: ColmapCamera, as_toolbox: bool) -> AbstractLens:
    """The lens of a camera, fisheye or not."""
    if camera.model != "OPENCV_FISHEYE":
        return camera.lens(path, key)
    k1, k2, k3, k4 = (camera.values[name] for name in ("k1", "k2", "k3", "k4"))
    with input_error(path, "a possible camera", key):
        return FisheyeLens(camera.size, camera.focal, camera.centre, (k1, k2, k3, k4), as_toolbox)


def _splits(folder: Path) -> dict[str, set[str]] | None:
    """Names of the training and test images, None if there is no list."""
    path = folder / LISTS
    if not path.is_file():
        return None
    fields = read_fields(path)
    splits = {}
    for part in ("train", "test"):
        names = fields.values.get(part, [])
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise fields.refused(part, "a list of names", f"{names!r:.40}")
        splits[part] = {Path(name).name for name in names}
    return splits


def _splits_of(shared: Fields) -> dict[str, set[str]]:
    """Names of the training and test images in a `transforms.json`."""
    parts = {"train": "frames", "test": "test_frames"}
    return {part: {_file_name(frame) for frame in _frames(shared, key)} for part, key in parts.items()}


def _frames(shared: Fields, *keys: str) -> list[Fields]:
    """The frames of a `transforms.json` in the lists with these keys, which may be missing or empty."""
    return [frame for key in keys if shared.values.get(key) for frame in shared.objects(key)]


def _file_name(frame: Fields) -> str:
    """The file name of a frame's image."""
    return Path(frame.text("file_path") or "").name


def bad_pictures(folder: Path) -> set[str]:
    """Names of the images that `transforms.json` marks as bad."""
    if not (folder / TRANSFORMS).is_file():
        return set()
    listed = _frames(read_fields(folder / TRANSFORMS), "frames", "test_frames")
    return {_file_name(frame) for frame in listed if frame.values.get("is_bad") is True}
