"""Scenes from cameras and depth that a network predicted from photos: `predictions.npz` of VGGT and MapAnything, `results.npz` of Depth Anything 3.

The frames are the original photos, if they are beside the file, with the cameras mapped back through the tool's resizing and cropping; otherwise the images
in the file. Depth is predicted; it is treated as a sensor's.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.sparse_points import points_in_view
from semgs.data.layouts.predictions.agreement import INVERSE, find_mistake
from semgs.data.layouts.predictions.npz_file import open_npz
from semgs.data.layouts.predictions.original_photos import EXPORTS, OriginalPhotos, base_of, find_photos
from semgs.data.layouts.predictions.predicted import Predicted
from semgs.data.layouts.predictions.preprocessing import Placement
from semgs.data.layouts.predictions.stored_maps import PredictedDepth, StoredImage
from semgs.data.layouts.predictions.tools import read_predicted, tool_of
from semgs.data.scene import Scene
from semgs.files.archives import MOST_BYTES
from semgs.files.errors import InputError, input_error

LOOKED_FOR = "predictions.npz, or results.npz of Depth Anything 3 (cameras and depth that a network predicted)"

ENDING, PICKLES = ".npz", (".pt", ".pth", ".pkl", ".pickle")
OWN_NAME = "predictions.npz"
PLACES = (OWN_NAME, "results.npz", f"{EXPORTS}/npz/results.npz", f"{EXPORTS}/mini_npz/results.npz")
"""Where a folder has such a file. One that is not called predictions.npz counts if its fields are those of a known tool."""

MOST_POINTS = 20_000
"""So many points of the predicted depth become the scene's sparse points."""


def recognises(path: Path) -> bool:
    """Whether a path is a file of predictions, or a folder with one."""
    if path.is_file():
        return path.suffix.lower() in (ENDING, *PICKLES)
    return _file(path) is not None


def open_predictions(path: Path, photos: Path | None = None) -> Scene:
    """The scene of a file of predictions.

    Args:
        path: the file, or a folder with one.
        photos: the folder with the original photos; None to look beside the file.

    Raises:
        InputError: the file is damaged or of an unknown tool, its parts or the photos do not fit one another, or its depths say that the cameras are not
            what they should be.
    """
    file = path if path.is_file() else _file(path) or path / OWN_NAME
    if file.suffix.lower() in PICKLES:
        raise InputError(
            file, f"arrays saved with numpy.savez ({ENDING})", "a pickle, which could run any code",
            advice="save it as " + OWN_NAME + " with numpy.savez, one array for each field",
        )  # fmt: skip
    predicted = read_predicted(open_npz(file))
    _check_agreement(predicted)
    found = find_photos(predicted, photos)
    if found is None and predicted.images is None:
        raise InputError(
            file, f"images in the file, or its {len(predicted)} photos in the folder images beside it", "neither",
            advice=f"images of more than {MOST_BYTES >> 20} MiB in all are not read from the file",
        )  # fmt: skip
    points = _points(predicted)
    frames = [_frame(predicted, index, found, points) for index in range(len(predicted))]
    base = base_of(file)
    return Scene(
        path=file,
        name=base.name if file.name in (OWN_NAME, "results.npz") else file.stem,
        layout=f"{predicted.tool} predictions",
        unit=predicted.unit,
        frames=tuple(frames),
        notes=tuple(_notes(predicted, found)),
        points=points if len(points) else None,
    )


def _file(folder: Path) -> Path | None:
    """The file of predictions in a folder, None if there is none."""
    for place in PLACES:
        file = folder / place
        if file.is_file() and (file.name == OWN_NAME or _is_of_a_tool(file)):
            return file
    return None


def _is_of_a_tool(file: Path) -> bool:
    """Whether a file has the fields of a known tool."""
    try:
        return tool_of(open_npz(file)) is not None
    except InputError:
        return False


def _check_agreement(predicted: Predicted) -> None:
    """Refuse cameras that the depth contradicts, if a common mistake explains it."""
    mistake = find_mistake(predicted.world_from_camera, predicted.intrinsics, predicted.depth)
    if mistake is None:
        return
    directions = ("world to camera", "camera to world")
    stated, other = directions[predicted.to_world], directions[not predicted.to_world]
    looks = other if mistake.name == INVERSE else mistake.name
    raise InputError(
        predicted.path, f"{stated} with axes of OpenCV, as {predicted.tool} has them, and depth in the unit of the poses",
        f"what looks like {looks}: the depth of neighbouring photos then differs by {mistake.undone:.1%}, as stored by {mistake.stated:.1%}",
        predicted.poses_key, "convert them first",
    )  # fmt: skip


def _frame(predicted: Predicted, index: int, photos: OriginalPhotos | None, points: np.ndarray) -> Frame:
    """One photo with its camera and depth."""
    matrix, pose = predicted.intrinsics[index], predicted.world_from_camera[index]
    processed = Placement(predicted.size, (1.0, 1.0), (0.0, 0.0)).lens(matrix)
    lens: Lens = processed
    if photos is not None:
        with input_error(predicted.path, "a possible camera", f"intrinsics of frame {index}"):
            lens = photos.placements[index].lens(matrix)
    depth = predicted.depth[index]
    source = PredictedDepth(depth, processed) if depth.any() else None
    if photos is None:
        assert predicted.images is not None
        picture = StoredImage(f"image_{index:04d}.png", predicted.images[index])
        frame = Frame(picture.name, picture, lens, pose, source)
    else:
        file = photos.files[index]
        frame = Frame(f"{file.parent.name}/{file.name}", file, lens, pose, source)
    return Frame(frame.name, frame.picture, lens, pose, source, points=points_in_view(frame, points))


def _points(predicted: Predicted) -> np.ndarray:
    """Some of the pixels with known depth, in the world [n 3]."""
    count, height, width = predicted.depth.shape
    step = max(1, round((count * height * width / MOST_POINTS) ** 0.5))
    rows, columns = np.arange(step // 2, height, step), np.arange(step // 2, width, step)
    x, y = np.meshgrid(columns + 0.5, rows + 0.5)
    pixels = np.stack((x, y, np.ones_like(x)), axis=-1).reshape(-1, 3)
    parts = []
    for depth, matrix, pose in zip(predicted.depth, predicted.intrinsics, predicted.world_from_camera, strict=True):
        depths = depth[np.ix_(rows, columns)].reshape(-1, 1).astype(np.float64)
        inside = (pixels @ np.linalg.inv(matrix).T * depths)[depths[:, 0] > 0]
        parts.append(inside @ pose[:3, :3].T + pose[:3, 3])
    return np.concatenate(parts)


def _notes(predicted: Predicted, photos: OriginalPhotos | None) -> list[str]:
    """What the user should know."""
    width, height = predicted.size[::-1]
    notes = [f"Cameras and depth were predicted by {predicted.tool}; no sensor measured them."]
    if predicted.unit == "metric":
        notes.append(f"Lengths are metres as {predicted.tool} predicts them, which may be off by several per cent.")
    else:
        notes.append(f"{predicted.tool}'s unit of length is arbitrary, so depths are not in metres.")
    if predicted.unsure_because:
        notes.append(f"Depth {predicted.unsure_because} counts as unknown: {predicted.unsure:.0%} of the pixels.")
    if photos is None:
        notes.append(f"The frames are the images in the file, {width}x{height}, as no photos are beside it.")
    else:
        notes.append(f"The frames are the photos in {photos.folder}; crop and resize to {width}x{height} are undone.")
    return notes
