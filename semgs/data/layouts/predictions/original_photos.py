"""The photos that a file of predictions was made from: where they are, and where they are in the processed images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import cv2
import numpy as np

from semgs.data.confined import may_read, named_file
from semgs.data.layouts.parts.usable_frames import pictures_in
from semgs.data.layouts.predictions.predicted import Predicted
from semgs.data.layouts.predictions.preprocessing import Placement, Size
from semgs.files.errors import InputError
from semgs.files.images.pictures import PictureHeader, read_grey, read_header

FOLDERS = ("images", "input_images")
"""Folders of photos beside the file: VGGT's and MapAnything's demos, and the frames that Depth Anything 3 takes from a video."""

EXPORTS = "exports"
"""Depth Anything 3 writes its files two folders further down, below this one."""

LONGEST = 160
"""Photos are compared with processed images at this size [px]."""

ALIKE = 0.5
"""Least correlation of a photo's grey values with those of its processed image."""

FLAT = 4.0
"""Images with a smaller standard deviation of grey show nothing to compare."""


@dataclass(frozen=True)
class OriginalPhotos:
    """The photos of a file of predictions.

    Attributes:
        folder: where they are.
        files: in the order of the file.
        placements: where each is in its processed image.
    """

    folder: Path
    files: tuple[Path, ...]
    placements: tuple[Placement, ...]


def base_of(file: Path) -> Path:
    """The folder that a file of predictions belongs to."""
    folder = file.absolute().parent
    return folder.parent.parent if folder.parent.name == EXPORTS else folder


def find_photos(predicted: Predicted, given: Path | None = None) -> OriginalPhotos | None:
    """The photos of a file, None if there are none.

    Args:
        predicted: what the file has.
        given: the folder with the photos; None to look beside the file.

    Raises:
        InputError: there are more or fewer photos than the file has, their size cannot have become that of the processed images, or they
            show something else.
    """
    folders = [given] if given else [base_of(predicted.path) / name for name in FOLDERS]
    folder = next((one for one in folders if may_read(one) and one.is_dir()), None)
    files = _named(predicted, folder)
    if files is None:
        if folder is None:
            return None
        files = pictures_in(folder)
        if not files and given is None:
            return None
        if len(files) != len(predicted):
            raise InputError(
                folder, f"the {len(predicted)} photos of {predicted.path}", f"{len(files)} photos",
                advice="it should have those photos and no others; their order is that of their names",
            )  # fmt: skip
    headers = [read_header(file) for file in files]
    placements = _placements(predicted, files, headers)
    photos = OriginalPhotos(folder or files[0].parent, tuple(files), placements)
    _check_content(predicted, photos)
    return photos


def _named(predicted: Predicted, folder: Path | None) -> list[Path] | None:
    """The photos by the names in the file, None if it has none or one of them is missing."""
    if predicted.names is None:
        return None
    files = []
    for name in predicted.names:
        if "\0" in name:
            return None
        last = PurePosixPath(name.replace("\\", "/")).name
        found = folder / last if folder and last else None
        if found is None or not found.is_file():
            found = _beside(predicted.path, name) if last else None
        if found is None:
            return None
        files.append(found)
    return files


def _beside(file: Path, name: str) -> Path | None:
    """The photo at a path relative to a file, None if there is none. Names may be of the machine that made the file: those that may not be read count as missing."""
    try:
        path = named_file(file, file.parent, name)
    except InputError:
        return None
    return path if path.is_file() else None


def _placements(predicted: Predicted, files: Sequence[Path], headers: Sequence[PictureHeader]) -> tuple[Placement, ...]:
    """Where each photo is in its processed image."""
    padded = predicted.images is not None and _has_white_sides(predicted.images)
    for upright in (predicted.upright, not predicted.upright):
        sizes = [_size(header, upright) for header in headers]
        for plan in predicted.preprocessing(sizes, predicted.size, padded):
            if plan.size == predicted.size:
                return plan.placements
    sizes = [_size(header, predicted.upright) for header in headers]
    (rows, columns), (height, width) = next(predicted.preprocessing(sizes, predicted.size, padded)).size, sizes[0]
    raise InputError(
        files[0], f"a photo that {predicted.tool} makes {predicted.size[1]}x{predicted.size[0]} pixels, as in {predicted.path}",
        f"one of {width}x{height}, which becomes {columns}x{rows} (width x height)",
        advice="put the photos that the file was made from in this folder, or remove it to use the images in the file",
    )  # fmt: skip


def _size(header: PictureHeader, upright: bool) -> Size:
    """The (height, width) of a photo as stored, or turned as its EXIF orientation says."""
    return header.size[::-1] if upright and header.orientation >= 5 else header.size


def _has_white_sides(images: np.ndarray) -> bool:
    """Whether the first and the last column of all images are white, as they are if a network saw padded photos."""
    return bool((images[:, :, [0, -1]] == 255).all())


def _check_content(predicted: Predicted, photos: OriginalPhotos) -> None:
    """Compare the first, the middle and the last photo with their processed images."""
    if predicted.images is None:
        return
    for index in sorted({0, len(predicted) // 2, len(predicted) - 1}):
        file, placement = photos.files[index], photos.placements[index]
        likeness = _likeness(file, placement, predicted.images[index])
        if likeness is not None and likeness < ALIKE:
            raise InputError(
                file, f"the photo of frame {index} of {predicted.path}",
                f"another one: their grey values have a correlation of {likeness:.2f}",
                advice="photos are taken in the order of their names",
            )  # fmt: skip


def _likeness(file: Path, placement: Placement, image: np.ndarray) -> float | None:
    """The correlation of the grey values of a photo and its processed image; None if one of them shows nothing."""
    photo = read_grey(file, placement.size, LONGEST)
    height, width = image.shape[:2]
    reduced = min(1.0, LONGEST / max(height, width))
    size = max(1, round(width * reduced)), max(1, round(height * reduced))
    seen = cv2.resize(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
    rows, columns = (np.arange(side) + 0.5 for side in seen.shape)
    y = (rows * height / seen.shape[0] - placement.shift[1]) / placement.scale[1] * photo.shape[0] / placement.size[0]
    x = (columns * width / seen.shape[1] - placement.shift[0]) / placement.scale[0] * photo.shape[1] / placement.size[1]
    rows_inside, columns_inside = (y >= 0) & (y < photo.shape[0]), (x >= 0) & (x < photo.shape[1])
    ours = photo[np.ix_(y[rows_inside].astype(int), x[columns_inside].astype(int))].astype(float)
    theirs = seen[np.ix_(rows_inside, columns_inside)].astype(float)
    if ours.size < 2 or min(ours.std(), theirs.std()) < FLAT:
        return None
    return float(np.corrcoef(ours.reshape(-1), theirs.reshape(-1))[0, 1])
