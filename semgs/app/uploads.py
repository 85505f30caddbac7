"""From uploaded files to what `semgs reconstruct` takes: a folder of photos, a clip, or the folder of a scene.

Names of uploaded files are never used as paths as they are: `photo_names` makes safe ones of them. Archives are unpacked by `semgs.app.unzipping`.
"""

from __future__ import annotations

import io
import itertools
import math
import os
import re
import shutil
import time
import unicodedata
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Literal

from semgs.app.limits import MIB, Limits
from semgs.app.unzipping import UnfitZipError, unpack_zip
from semgs.files.atomic import write_bytes
from semgs.files.text import counted, listed, natural_order, printable

PICTURES = (".jpg", ".jpeg", ".jfif", ".jpe", ".mpo", ".png", ".heic")
CLIPS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")
ARCHIVES = (".zip",)
ACCEPTED = (*PICTURES, *CLIPS, *ARCHIVES)
"""Endings of files that can be dropped."""

UNPACKED = "scene"
"""The folder of an unpacked archive, beside that of reduced photos."""

PHOTOS = "photos"
"""The folder of reduced photos, whose cameras are found."""

LONGEST_SIDE = 1024
"""Photos without cameras are reduced to this [px]: their cameras are found three times as fast, and the network sees less than 76,800 pixels anyway."""

QUALITY = 95

MOST_MM = 65535
"""Longest focal length that EXIF can hold [mm]."""

LONGEST_STEM = 60
"""Longest name of a photo's copy, without its ending [letters]."""

DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
"""Names that Windows takes for devices."""

UNUSED_SECONDS = 300.0
"""Uploads that no job has taken for so long make place for others, if the folder is full."""

DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError, RuntimeError)
"""What reading a damaged zip raises."""

Kind = Literal["photos", "clip", "archive"]


GONE = "The files are no longer on the server. Drop them again."


class UnusableUploadError(Exception):
    """What was dropped cannot be used; its text is the sentence that the page shows."""


@dataclass(frozen=True)
class Upload:
    """An uploaded file.

    Attributes:
        path: where it is.
        name: as the user has it.
    """

    path: Path
    name: str

    @property
    def ending(self) -> str:
        """The ending of its name, in lower case."""
        return PurePosixPath(self.name).suffix.lower()

    @property
    def shown(self) -> str:
        """The name for messages."""
        name = " ".join(printable(PurePosixPath(self.name.replace("\\", "/")).name).split())
        return name if len(name) <= 60 else f"{name[:40]}…{name[-12:]}"


@dataclass(frozen=True)
class Prepared:
    """Uploaded files in the form that `semgs reconstruct` takes.

    Attributes:
        scene: a folder or a clip.
        notes: on what was left out.
        photos: of photos without cameras, the name of each that can be read, by its number from 1; empty for other scenes.
    """

    scene: Path
    notes: tuple[str, ...] = ()
    photos: Mapping[int, str] = field(default_factory=dict)


def photo_names(names: Sequence[str]) -> list[str]:
    """Names for the copies of photos, as close to those that the user has as every disk allows.

    They are made of ASCII letters, digits, "-", "_" and ".", no two differ in capitals alone, and their natural order is the order given. Where the
    user's names have another order, each name begins with the number of its photo.
    """
    stems = [_safe_stem(name) for name in names]
    copies: list[str] = []
    taken: set[str] = set()
    for stem in stems:
        tries = (stem if number == 1 else f"{stem}_{number}" for number in itertools.count(1))
        copies.append(next(one for one in tries if one.lower() not in taken))
        taken.add(copies[-1].lower())
    found = [f"{copy}.jpg" for copy in copies]
    if sorted(found, key=natural_order) == found:
        return found
    return [f"{number:03d}_{stem}.jpg" for number, stem in enumerate(stems, 1)]


def _safe_stem(name: str) -> str:
    """A file's name without folders, ending and accents, in letters that every disk takes."""
    stem = PurePosixPath(name.replace("\\", "/")).stem
    plain = re.sub(r"[\u0300-\u036f]", "", unicodedata.normalize("NFKD", stem))
    safe = re.sub(r"[^A-Za-z0-9._-]+", "_", plain)[:LONGEST_STEM].lstrip(".-").rstrip(".") or "photo"
    return f"_{safe}" if DEVICES.fullmatch(safe) else safe


def check_uploads(uploads: Sequence[Upload], limits: Limits) -> Kind:
    """What files are together, from their names and sizes.

    Raises:
        UnusableUploadError: they cannot be used, or are too many or too large.
    """
    if not uploads:
        raise UnusableUploadError("Nothing was dropped. Add two or more photos, a clip, or a zip of a scene.")
    if not all(one.path.is_file() for one in uploads):
        raise UnusableUploadError(GONE)
    for one in uploads:
        size = one.path.stat().st_size
        if one.ending not in ACCEPTED:
            what = f"{one.ending} files" if one.ending else "files without an ending"
            raise UnusableUploadError(
                f"{one.shown}: {what} cannot be read. Use JPEG, PNG or HEIC photos, a clip (MP4, MOV), or a zip of a scene."
            )
        if size == 0:
            raise UnusableUploadError(f"{one.shown} is empty. It may not have been copied completely.")
        if size > limits.file_bytes:
            raise UnusableUploadError(
                f"{one.shown} has {size // MIB:,} MB; at most {limits.file_bytes // MIB:,} MB are accepted."
            )
    total = size_of(uploads)
    if total > limits.total_bytes:
        raise UnusableUploadError(
            f"The files have {total // MIB:,} MB together; at most {limits.total_bytes // MIB:,} MB are accepted."
        )
    special = [one for one in uploads if one.ending not in PICTURES]
    if special:
        if len(uploads) > 1:
            raise UnusableUploadError(
                f"Drop {special[0].shown} alone: one clip, one zip, or several photos, but not a mixture."
            )
        return "clip" if special[0].ending in CLIPS else "archive"
    if len(uploads) == 1:
        raise UnusableUploadError("One photo is not enough. Take at least two that overlap, a step to the side apart.")
    if len(uploads) > limits.photos:
        raise UnusableUploadError(
            f"{len(uploads)} photos are too many; use at most {limits.photos}. Two to twelve that overlap are best."
        )
    return "photos"


def prepare(
    kind: Kind, uploads: Sequence[Upload], folder: Path, limits: Limits, say: Callable[[str], object]
) -> Prepared:
    """Write uploaded files in the form that `semgs reconstruct` takes.

    Args:
        kind, uploads: as checked by `check_uploads`.
        folder: an existing, empty one.
        limits: of photos and archives.
        say: takes the title of each stage.

    Raises:
        UnusableUploadError: a file cannot be used.
    """
    if kind == "photos":
        return _photos(uploads, folder / PHOTOS, limits, say)
    if kind == "clip":
        _check_clip(uploads[0], limits)
        clip = folder / f"clip{uploads[0].ending}"
        link_or_copy(uploads[0].path, clip)
        return Prepared(clip)
    say("Unpacking the zip")
    unpacked = folder / UNPACKED
    unpack(uploads[0], unpacked, limits)
    scene = _inner(unpacked)
    pictures = sorted(path for path in scene.rglob("*") if path.suffix.lower() in PICTURES)
    for path in pictures:
        _check_pixels(Upload(path, path.name), limits)
    from semgs.sfm.photos import has_only_photos, pictures_in

    if pictures and has_only_photos(scene):
        photos = [Upload(path, path.name) for path in pictures_in(scene) if path.suffix.lower() in PICTURES]
        if len(photos) > limits.photos:
            raise UnusableUploadError(f"The zip has {len(photos)} photos without cameras; use at most {limits.photos}.")
        return _photos(photos, folder / PHOTOS, limits, say)
    return Prepared(scene)


def link_or_copy(source: Path, target: Path) -> None:
    """Make a file available under another name too, without a copy if both are on one disk."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def size_of(uploads: Iterable[Upload]) -> int:
    """The size of those uploads that are still there [bytes]."""
    return sum(one.path.stat().st_size for one in uploads if one.path.is_file())


def content_of(folder: Path) -> tuple[int, int]:
    """The number of files in a folder and in the folders in it, and their size [bytes]."""
    sizes = [status.st_size for _, status in _files_in(folder)]
    return len(sizes), sum(sizes)


def delete_oldest(folder: Path, files: int, size: int) -> bool:
    """Delete uploads that no job has taken for some minutes, the oldest first, until no more than some stay. Returns whether that was possible.

    Args:
        folder: with the uploads.
        files, size: how many may stay, and their size [bytes].
    """
    found = sorted((status.st_mtime, status.st_size, path) for path, status in _files_in(folder))
    count, total = len(found), sum(length for _, length, _ in found)
    before = time.time() - UNUSED_SECONDS
    for changed, length, path in found:
        if (count <= files and total <= size) or changed > before:
            break
        with suppress(OSError):
            path.unlink()
            count, total = count - 1, total - length
            path.parent.rmdir()  # gradio makes a folder for each file
    return count <= files and total <= size


def unpack(upload: Upload, folder: Path, limits: Limits) -> None:
    """Unpack a zip archive into a new folder.

    Raises:
        UnusableUploadError: it is damaged, too large, or has members that an honest archive does not have.
    """
    folder.mkdir()
    try:
        unpack_zip(upload.path, folder, limits)
    except UnfitZipError as error:
        raise UnusableUploadError(f"{upload.shown} {error}") from error
    except DAMAGED as error:
        raise UnusableUploadError(
            f"{upload.shown} is not a zip that can be read. It may be damaged; make it again."
        ) from error
    except OSError as error:
        raise UnusableUploadError(f"{upload.shown} cannot be unpacked: {error.strerror or error}.") from error


def _files_in(folder: Path) -> Iterator[tuple[Path, os.stat_result]]:
    """The files in a folder and in the folders in it, with what the file system says of each."""
    for place, _, names in os.walk(folder):
        for name in names:
            path = Path(place, name)
            with suppress(OSError):  # deleted just now
                yield path, path.lstat()


def _inner(folder: Path) -> Path:
    """The folder with the content, where an archive has it in one folder."""
    while len(inside := list(folder.iterdir())) == 1 and inside[0].is_dir() and inside[0].name != "images":
        folder = inside[0]
    return folder


def _photos(uploads: Sequence[Upload], folder: Path, limits: Limits, say: Callable[[str], object]) -> Prepared:
    """Write photos upright and reduced."""
    folder.mkdir()
    say(f"Reading {counted(len(uploads), 'photo')}")
    damaged: list[str] = []
    photos: dict[int, str] = {}
    for number, (one, name) in enumerate(zip(uploads, photo_names([one.name for one in uploads]), strict=True), 1):
        _check_pixels(one, limits)
        data = _reduced(one)
        if data is None:
            damaged.append(one.shown)
            continue
        write_bytes(folder / name, data)
        photos[number] = name
    if len(photos) < 2:
        names = f" Damaged: {listed(damaged, 3)}." if damaged else ""
        raise UnusableUploadError(f"Fewer than two photos can be read.{names}")
    return Prepared(folder, tuple(f"{name} is damaged and was left out." for name in damaged), photos)


def _check_pixels(upload: Upload, limits: Limits) -> None:
    """Check the size in a picture's header, before it is decoded.

    Raises:
        UnusableUploadError: it is too large.
    """
    from semgs.files.errors import InputError
    from semgs.files.images.pictures import read_header

    try:
        height, width = read_header(upload.path).size
    except InputError:
        return  # a damaged one is left out when it is decoded
    if height * width > limits.pixels:
        raise UnusableUploadError(
            f"{upload.shown} has {width}x{height} pixels; at most {limits.pixels // 1_000_000} megapixels are accepted."
        )


def _check_clip(upload: Upload, limits: Limits) -> None:
    """Check the size in a clip's header, before anything opens it.

    Raises:
        UnusableUploadError: its frames are too large.
    """
    from semgs.files.errors import InputError
    from semgs.sfm.clip_headers import check_clip_size

    try:
        check_clip_size(upload.path, limits.pixels)
    except InputError as error:
        raise UnusableUploadError(
            f"{upload.shown} has {error.found} pixels; frames of at most {limits.pixels // 1_000_000} megapixels are accepted."
        ) from error


def _reduced(upload: Upload) -> bytes | None:
    """A photo as an upright JPEG of at most `LONGEST_SIDE`, with its focal length; None if it is damaged."""
    from PIL import Image
    from PIL.ExifTags import IFD, Base

    from semgs.files.errors import InputError
    from semgs.files.images.pictures import read_optics, read_upright

    try:
        optics, pixels = read_optics(upload.path), read_upright(upload.path)
    except InputError:
        return None
    height, width = pixels.shape[:2]
    image = Image.fromarray(pixels)
    exif = Image.Exif()
    if optics.focal_px is not None:
        focal_mm = optics.focal_px * math.hypot(36, 24) / math.hypot(height, width)
        exif.get_ifd(IFD.Exif)[Base.FocalLengthIn35mmFilm] = min(max(1, round(focal_mm)), MOST_MM)
    if optics.panorama:
        exif.get_ifd(IFD.Exif)[Base.CustomRendered] = 6
    image.thumbnail((LONGEST_SIDE, LONGEST_SIDE), Image.Resampling.LANCZOS, reducing_gap=3.0)
    buffer = io.BytesIO()
    image.save(buffer, "JPEG", quality=QUALITY, exif=exif)
    return buffer.getvalue()
