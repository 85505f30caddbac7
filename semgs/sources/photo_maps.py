"""Maps of photos: the file that each frame has, and how its values come to the pixels of a view: through lens, crop and size, as the photo itself does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit, kept_window, resampling
from semgs.data.scene import Scene
from semgs.data.tables.classes import IGNORE
from semgs.files.archives import members
from semgs.files.arrays import read_array
from semgs.files.errors import InputError
from semgs.geometry.cameras import writable


def scene_folder(folder: Path, scene: Scene) -> Path:
    """The folder with the maps of a scene: the one of its name inside a folder, if there is one."""
    return folder / scene.name if (folder / scene.name).is_dir() else folder


def stems_of(scene: Scene) -> Counter[str]:
    """How many frames of a scene have each file name, without folders and ending.

    Raises:
        InputError: the names of two frames differ only in their endings, so one map would belong to both.
    """
    frames: dict[PurePosixPath, str] = {}
    for frame in scene.frames:
        other = frames.setdefault(place_of(frame).with_suffix(""), frame.name)
        if other != frame.name:
            expected = "frames whose names differ in more than their endings, as each has a map of its own"
            raise InputError(scene.path, expected, f"{other} and {frame.name}")
    return Counter(PurePosixPath(frame.name).stem for frame in scene.frames)


def file_of(folder: Path, frame: Frame, stems: Counter[str], endings: Sequence[str]) -> Path | None:
    """The file in a folder that belongs to a frame; None if there is none.

    Args:
        folder: has the same folders as the names of frames, or contains the files itself.
        frame: the frame.
        stems: of the scene, as from `stems_of`. Files in the folder itself count for names that are unique.
        endings: that the file may have, the preferred one first.
    """
    name = place_of(frame)
    places = [folder / name.parent / name.stem]
    if stems[name.stem] == 1:
        places.append(folder / name.stem)
    candidates = (place.parent / f"{place.name}{ending}" for place in places for ending in endings)
    return next((path for path in candidates if path.is_file()), None)


def needed_file(folder: Path, frame: Frame, stems: Counter[str], endings: Sequence[str], what: str) -> Path:
    """As `file_of`.

    Args:
        folder, frame, stems, endings: as for `file_of`.
        what: the file has, for the error.

    Raises:
        InputError: there is none.
    """
    found = file_of(folder, frame, stems, endings)
    if found is None:
        name = PurePosixPath(frame.name).with_suffix("")
        several = f"{name} with one of {', '.join(endings)}"
        wanted = several if len(endings) > 2 else " or ".join(f"{name}{ending}" for ending in endings)
        raise InputError(folder, f"{what} of frame {frame.name}: {wanted}", "none")
    return found


def place_of(frame: Frame) -> PurePosixPath:
    """The name of a frame as a path inside a folder: `_` replaces a root and each step up, as scenes may list photos outside their folder."""
    parts = PurePosixPath(frame.name).parts
    return PurePosixPath(*("_" if part == ".." or part.startswith("/") else part for part in parts))


def only_array(path: Path, expected: str) -> np.ndarray:
    """The only array of a `.npz` file, or that of a `.npy` file.

    Args:
        path: the file.
        expected: what it should be, for errors.

    Raises:
        InputError: it is missing or damaged, or has several arrays.
    """
    if path.suffix == ".npy":
        return read_array(path)
    found = list(members(path).values())
    if len(found) != 1:
        raise InputError(path, expected, f"{len(found)} arrays")
    return read_array(found[0])


def to_view(
    probabilities: Float32[np.ndarray, "class rows columns"],
    frame: Frame,
    size: tuple[int, int],
    fit: Fit = "crop",
    *,
    undistorted: bool,
) -> Float[Tensor, "class h w"]:
    """The distribution over classes of every pixel of a view: `resampled`, and normalised.

    Args:
        probabilities, frame, size, fit, undistorted: as for `resampled`.
    """
    return normalised(resampled(torch.from_numpy(writable(probabilities)), frame, size, fit, undistorted=undistorted))


def resampled(
    values: Float[Tensor, "c rows columns"],
    frame: Frame,
    size: tuple[int, int],
    fit: Fit = "crop",
    *,
    undistorted: bool,
) -> Float[Tensor, "c h w"]:
    """Maps of a photo at the pixels of a view. Areas are averaged where pixels get larger, and interpolated where they get smaller.

    Args:
        values: of the frame's photo, at any resolution.
        frame: the frame.
        size: (height, width) of the view, as for `Scene.read` [px].
        fit: what was done with a photo of another aspect, as for `Scene.read`.
        undistorted: whether the maps cover the undistorted photo; otherwise the photo as it is stored.
    """
    maps = None if undistorted or frame.lens.is_pinhole else frame.lens.maps()
    if maps is None:
        return _resized(values, frame.lens.size, size, fit)
    top, left, height, width = kept_window(frame.lens.size, size, fit)
    planes = []
    for plane in values:  # one at a time, as photos are large
        full = frame.lens.undistorted(_stretched(plane, frame.lens.size).numpy(), maps)
        planes.append(_stretched(torch.from_numpy(full)[top : top + height, left : left + width], size))
    return torch.stack(planes)


def resized_map(
    probabilities: Float[Tensor, "class rows columns"], photo: tuple[int, int], size: tuple[int, int]
) -> Float[Tensor, "class h w"]:
    """A map of a whole photo, of any resolution, at the pixels of the view that `semgs.data.resampling.reframed` makes of the photo; normalised.

    Args:
        probabilities: covers the whole photo.
        photo: (height, width) of the undistorted photo [px].
        size: (height, width) of the view [px].
    """
    return normalised(_resized(probabilities, photo, size))


def normalised(probabilities: Float[Tensor, "*batch class h w"]) -> Float[Tensor, "*batch class h w"]:
    """The same, non-negative and summing to 1 over the classes."""
    positive = probabilities.clamp(min=0)
    return positive / positive.sum(-3, keepdim=True).clamp(min=1e-12)


def one_hot(labels: UInt8[Tensor, "h w"], classes: int) -> Float[Tensor, "class h w"]:
    """Each pixel's label as a distribution; even where there is no label (255)."""
    found = torch.nn.functional.one_hot(labels.long().clamp(max=classes), classes + 1)[..., :classes].float()
    return torch.where((labels == IGNORE)[..., None], 1 / classes, found).permute(2, 0, 1)


def _resized(
    values: Float[Tensor, "c rows columns"], photo: tuple[int, int], size: tuple[int, int], fit: Fit = "crop"
) -> Float[Tensor, "c h w"]:
    """As `resized_map`, without normalising."""
    if tuple(values.shape[-2:]) == size == photo:
        return values
    top, left, height, width = kept_window(photo, size, fit)
    rows = resampling(height, size[0]) @ resampling(values.shape[-2], photo[0])[top : top + height]
    columns = resampling(width, size[1]) @ resampling(values.shape[-1], photo[1])[left : left + width]
    return rows.to(values) @ values @ columns.to(values).mT


def _stretched(plane: Float[Tensor, "rows columns"], size: tuple[int, int]) -> Float[Tensor, "h w"]:
    """A map at the size of its photo."""
    rows, columns = (resampling(old, new).to(plane) for old, new in zip(plane.shape, size, strict=True))
    return rows @ plane @ columns.mT
