"""Photos without cameras: what a folder contains, which of it can be used, and an upright copy of each.

What cannot be used is left out and counted: formats that are not read, damaged files, panoramas, duplicates, and black or blank pictures.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from semgs.data.other_cameras import MAP_FOLDERS, cameras_beside, stray_scanner_clip
from semgs.data.scenes import PICTURES, VIDEOS, is_scene
from semgs.files.atomic import write_bytes
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError
from semgs.files.images.pictures import MOST_PIXELS, jpeg_bytes, read_header, read_optics, read_upright
from semgs.files.text import listed, natural_order

UNREAD = (
    ".webp", ".avif", ".gif", ".bmp", ".tif", ".tiff", ".heif", ".hif", ".jxl", ".ppm", ".tga", ".psd", ".jp2", ".exr", ".hdr",
    ".dng", ".raw", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".rw2", ".raf", ".insp",
)  # fmt: skip
"""Endings of pictures that are not read."""

MOST_PHOTOS = 150
"""More are refused: the time grows with the square of the number, and a reconstruction uses two to four."""

LONGEST_SIDE = 480
"""Sharpness and brightness are judged at this size [px]."""

BLANK = 3.0
"""Pictures with a smaller standard deviation of grey are black or blank."""

BLURRED = 0.1
"""Pictures with less than this share of the median sharpness are blurred."""

WIDEST, TALLEST = 2.0, 3.0
"""Pictures with a larger ratio of their sides are panoramas; with the first one, if their left and right ends go together. Upright pictures of phones are up to
the second."""

SAME_RATIO = 0.01
"""Ratios, and sizes of photos of one camera, that differ by this share are the same."""

DCF = re.compile(r"\d{3}[A-Z0-9_]{5}")
"""Folders that cameras and phones spread photos over: 100APPLE, 101CANON."""

BEGINNINGS = {".jpg": b"\xff\xd8", ".jpeg": b"\xff\xd8", ".png": b"\x89PNG"}
"""How files begin that are what their ending says."""

QUALITY = 95
"""JPEG quality of copies that have to be encoded again."""


@dataclass(frozen=True)
class UprightPhoto:
    """An upright photo.

    Attributes:
        name: of the copy.
        size: (height, width) [px].
        focal_px: focal length in its own pixels, from EXIF or from the user; None if unknown.
        original: the photo that it is a copy of, relative to the folder that the user named; "" for frames of a clip.
    """

    name: str
    size: tuple[int, int]
    focal_px: float | None = None
    original: str = ""


@dataclass(frozen=True)
class PhotoSet:
    """Photos of a scene in a folder.

    Attributes:
        path: what the user named.
        folder: with the upright copies.
        photos: in the order of their names, or of time.
        ordered: whether neighbours overlap, as in a clip.
        notes: what was left out.
    """

    path: Path
    folder: Path
    photos: tuple[UprightPhoto, ...]
    ordered: bool = False
    notes: tuple[str, ...] = ()


def has_only_photos(path: Path) -> bool:
    """Whether a path is a video, or a folder with pictures but without a scene."""
    if path.is_file():
        return path.suffix.lower() in VIDEOS
    return bool(pictures_in(path)) and not is_scene(path)


def pictures_in(path: Path) -> list[Path]:
    """The files of a folder, or else of `images` in it, or else of the folders of a camera (100APPLE, 101APPLE), whose endings are those of pictures.

    IMG_2 comes before IMG_10.
    """
    for folders in ([path], [path / "images"], [one for one in subfolders(path) if DCF.fullmatch(one.name.upper())]):
        found = [file for folder in folders for file in _pictures_of(folder)]
        if found:
            return found
    return []


def subfolders(path: Path) -> list[Path]:
    """The folders in a folder, sorted by name."""
    return (
        sorted(one for one in path.iterdir() if one.is_dir() and not one.name.startswith(".")) if path.is_dir() else []
    )


def _pictures_of(folder: Path) -> list[Path]:
    """The files of a folder whose endings are those of pictures."""
    found = [
        file
        for file in (folder.iterdir() if folder.is_dir() else ())
        if file.suffix.lower() in (*PICTURES, *UNREAD) and not file.name.startswith(".") and file.is_file()
    ]
    return sorted(found, key=lambda file: natural_order(file.name))


def photos_below(path: Path) -> dict[str, int]:
    """The number of pictures in each folder in a folder, of those that have some, without folders of depth and confidence."""
    folders = [one for one in subfolders(path) if one.name.lower() not in MAP_FOLDERS]
    return {one.name: count for one in folders if (count := len(_pictures_of(one)))}


def check_folder_of_photos(path: Path) -> None:
    """Refuse a path that is neither a video nor a folder of photos without cameras.

    Raises:
        InputError: it is something else; says where photos are, if there are some.
    """
    if has_only_photos(path):
        return
    if (clip := stray_scanner_clip(path)) is not None:
        raise InputError(
            path, "a folder of photos without cameras, or a video", "a capture of Stray Scanner, which is not read", advice=f"give its clip, {clip}"
        )  # fmt: skip
    below = photos_below(path) if path.is_dir() else {}
    if below and not is_scene(path):
        shown = listed([f"{name} ({count})" for name, count in below.items()])
        raise InputError(
            path, "a folder of photos without cameras, or a video", f"photos only in the folders {shown}",
            advice="name one of these folders, or put the photos that show one scene into one folder",
        )  # fmt: skip
    found = "a scene, which has cameras" if path.is_dir() and is_scene(path) else "something else"
    raise InputError(path, "a folder of photos without cameras, or a video", found)


def note_on_others(path: Path, files: Sequence[Path]) -> list[str]:
    """Notes about what lies beside photos and is not used: photos in folders, and cameras of other programs."""
    used = {file.parent for file in files}
    below = {name: count for name, count in photos_below(path).items() if path / name not in used}
    notes = []
    if below:
        shown = listed([f"{name} ({count})" for name, count in below.items()])
        notes.append(f"{sum(below.values())} photos in folders beside these are not used: {shown}.")
    folders = dict.fromkeys((path, *used, *(one.parent for one in used if one.name == "images")))
    notes += [
        f"{file} has cameras of {program}, which are not read from here: cameras are estimated anew."
        for file, program in cameras_beside(folders)
    ]
    return list(dict.fromkeys(notes))


def is_panorama(pixels: np.ndarray) -> bool:
    """Whether pixels [h w 3] are those of a panorama: much wider than high, or twice as wide with ends that go together, as all around has them."""
    height, width = pixels.shape[:2]
    ratio = max(height, width) / min(height, width)
    if abs(ratio / WIDEST - 1) > SAME_RATIO:
        return ratio > (WIDEST if width > height else TALLEST)
    if width < height:
        return False
    grey = small_grey(pixels).astype(np.float64)
    ends = np.abs(grey[:, 0] - grey[:, -1]).mean()
    return bool(ends < 2 * np.abs(np.diff(grey, axis=1)).mean() + 2)


def copy_photos(path: Path, folder: Path) -> PhotoSet:
    """Copy the usable photos of a folder, upright: as they are if they are upright JPEGs or PNGs, else as JPEG.

    Args:
        path: the folder with the photos.
        folder: an existing, empty one.

    Raises:
        InputError: fewer than two photos can be used, or there are more than `MOST_PHOTOS`.
        ImportError: there is a HEIC, and pillow-heif is not installed.
        OSError: a copy cannot be written.
    """
    files = pictures_in(path)
    if len(files) > MOST_PHOTOS:
        advice = "choose some that overlap, from 2 to 30, or give the clip they are from"
        raise InputError(path, f"at most {MOST_PHOTOS} photos", f"{len(files):,}", advice=advice)
    unread = [file for file in files if file.suffix.lower() in UNREAD]
    damaged, panoramas, blank, again = list[str](), list[str](), list[str](), list[str]()
    unusable: dict[str, list[str]] = {}
    photos, sharpness, seen = list[UprightPhoto](), list[float](), set[bytes]()
    for file in (one for one in files if one.suffix.lower() in PICTURES):
        try:
            optics, pixels = read_optics(file), read_upright(file)
        except InputError as error:
            reason = _unusable(error)
            (damaged if reason is None else unusable.setdefault(reason, [])).append(file.name)
            continue
        height, width = pixels.shape[:2]
        grey = small_grey(pixels)
        key = hashlib.sha256(pixels.tobytes()).digest()
        if optics.panorama or is_panorama(pixels):
            panoramas.append(file.name)
        elif grey.std() < BLANK:
            blank.append(file.name)
        elif key in seen:
            again.append(file.name)
        else:
            name, data = upright_copy(file, pixels, files)
            if any(photo.name.lower() == name.lower() for photo in photos):  # in another folder of the camera
                name = f"{file.parent.name}_{name}"
            write_bytes(folder / name, data)
            photos.append(UprightPhoto(name, (height, width), optics.focal_px, file.relative_to(path).as_posix()))
            sharpness.append(sharpness_of(grey))
        seen.add(key)
    count, kinds = len(files), ", ".join(sorted({file.suffix.lower() for file in unread}))
    notes = [
        *counted([file.name for file in unread], count, f"photos have a format that is not read ({kinds})"),
        *(note for reason, names in unusable.items() for note in counted(names, count, reason)),
        *counted(damaged, count, "photos are damaged"),
        *counted(panoramas, count, "photos are panoramas and are left out"),
        *counted(blank, count, "photos are black or blank and are left out"),
        *counted(again, count, "photos are copies of another and are left out"),
    ]
    if len(photos) < 2:
        advice = " ".join(notes)
        page = f"fewer than two can be used. {advice}"
        raise InputError(path, "two or more photos", f"{len(photos) or 'none'}", advice=advice or None, page=page)
    soft = [
        photo.name for photo, sharp in zip(photos, sharpness, strict=True) if sharp < BLURRED * np.median(sharpness)
    ]
    notes += [
        *note_on_others(path, files),
        *counted(soft, count, "photos look blurred"),
        *_size_notes(photo.size for photo in photos),
    ]
    return PhotoSet(path, folder, tuple(photos), notes=tuple(notes))


def _unusable(error: InputError) -> str | None:
    """Why a photo that is not damaged cannot be used, and what helps, for a count; None if it is damaged."""
    if error.found.startswith("mode CMYK"):
        return "photos have the colours of printers (CMYK) and are left out; save them as sRGB"
    if error.found.startswith("mode "):
        return f"photos have colours that are not read ({error.found.removeprefix('mode ')}) and are left out; save them as sRGB"
    if error.expected.startswith("an image of at most"):
        return f"photos have more than {MOST_PIXELS / 1e6:.0f} megapixels and are left out; make them smaller"
    return None


def with_focal(photos: PhotoSet, focal_px: float) -> Sequence[UprightPhoto]:
    """The photos with a focal length that the user gave. Sizes may differ by `SAME_RATIO`, as programs that make photos smaller round them.

    Raises:
        ValueError: they differ in size, so it is unclear for which photo it is.
    """
    sizes = sorted({tuple(sorted(photo.size)) for photo in photos.photos})
    if any(max(sides) > (1 + SAME_RATIO) * min(sides) for sides in zip(*sizes, strict=True)):
        raise ValueError(
            f"--focal is for photos of one size; {photos.path} has {', '.join('x'.join(map(str, one)) for one in sizes)}"
        )
    return tuple(replace(photo, focal_px=focal_px) for photo in photos.photos)


def counted(names: Sequence[str], count: int, what: str) -> list[str]:
    """A note: how many of `count` photos something is true of, and the first of them. Empty if there are none."""
    return [f"{len(names)} of {count} {what}, the first is {names[0]}."] if names else []


def small_grey(pixels: np.ndarray) -> np.ndarray:
    """Pixels [h w 3] in grey at `LONGEST_SIDE`, uint8."""
    grey = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
    scale = min(1.0, LONGEST_SIDE / max(grey.shape))
    height, width = (max(1, round(side * scale)) for side in grey.shape)
    return np.asarray(cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA))


def sharpness_of(grey: np.ndarray) -> float:
    """The variance of the Laplacian of an image in grey."""
    return float(cv2.Laplacian(grey, cv2.CV_64F).var())


def upright_copy(file: Path, pixels: np.ndarray, files: Sequence[Path]) -> tuple[str, bytes]:
    """Name and content of the copy of a photo: the file's if it is upright and what its ending says, as COLMAP needs, or a JPEG of another
    ending, such as .jfif and .mpo, which becomes .jpg; else a JPEG of its upright pixels.

    Raises:
        InputError: the file cannot be read.
    """
    data = read_bytes(file, "an image")
    if data.startswith((*BEGINNINGS.values(),)) and read_header(file).orientation == 1:
        if data.startswith(BEGINNINGS.get(file.suffix.lower(), ())):
            return file.name, data
        if data.startswith(BEGINNINGS[".jpg"]):
            return jpeg_name(file, files), data
    return jpeg_name(file, files), jpeg_bytes(pixels, QUALITY)


def jpeg_name(file: Path, files: Sequence[Path]) -> str:
    """The name of the JPEG made of a photo. If another photo has it, the old ending becomes part of the name."""
    name = f"{file.stem}.jpg"
    taken = {other.name.lower() for other in files if other != file} | {
        f"{other.stem}.jpg".lower() for other in files if other != file
    }
    return f"{file.stem}_{file.suffix[1:]}.jpg" if name.lower() in taken else name


def _size_notes(sizes: Iterable[tuple[int, int]]) -> list[str]:
    """A note if photos have several sizes, apart from being upright or on their side."""
    counts = Counter((max(size), min(size)) for size in sizes)
    if len(counts) == 1:
        return []
    shown = listed([f"{number} of {longer}x{shorter}" for (longer, shorter), number in counts.most_common()], 3)
    return [f"The photos have {len(counts)} sizes, and each size gets a focal length of its own: {shown}."]
