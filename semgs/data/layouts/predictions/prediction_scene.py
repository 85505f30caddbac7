"""Scenes from cameras and depth that a network predicted from photos: `predictions.npz` of VGGT and MapAnything, `results.npz` of Depth Anything 3.

The frames are the original photos, if they are beside the file, with the cameras mapped back through the tool's resizing and cropping; otherwise the images
in the file. Depth is predicted; it is treated as a sensor's. Cameras that it contradicts are refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, final

import numpy as np
from jaxtyping import Float32

from semgs.data.cameras.lens import AbstractLens, Lens, carry_over
from semgs.data.frames import Frame
from semgs.data.layouts.parts.sparse_points import points_in_view
from semgs.data.layouts.predictions.npz_file import open_npz
from semgs.data.layouts.predictions.original_photos import EXPORTS, OriginalPhotos, base_of, find_photos
from semgs.data.layouts.predictions.predicted import Predicted
from semgs.data.layouts.predictions.preprocessing import Placement
from semgs.data.layouts.predictions.tools import read_predicted, tool_of
from semgs.data.maps import Pixels
from semgs.data.scene import Scene
from semgs.files.archives import MOST_BYTES
from semgs.files.errors import InputError, input_error
from semgs.files.images.pictures import png_bytes

LOOKED_FOR = "predictions.npz, or results.npz of Depth Anything 3 (cameras and depth that a network predicted)"

ENDING, PICKLES = ".npz", (".pt", ".pth", ".pkl", ".pickle")
OWN_NAME = "predictions.npz"
PLACES = (OWN_NAME, "results.npz", f"{EXPORTS}/npz/results.npz", f"{EXPORTS}/mini_npz/results.npz")
"""Where a folder has such a file. One that is not called predictions.npz counts if its fields are those of a known tool."""

MOST_POINTS = 20_000
"""So many points of the predicted depth become the scene's sparse points."""

PAIRS, SAMPLES = 12, 24
"""At most so many pairs of neighbouring photos, and points along each side of a photo, are compared."""

BETTER = 3.0
"""A mistake is reported if undoing it makes the median disagreement smaller by this factor."""

WRONG = 0.03
"""Nothing is reported below this median disagreement: networks err by as much, and a camera that hardly moves fits any unit."""

CLOSE = 0.15
"""What remains has to be below this, or undoing the mistake explains nothing."""

INVERSE = "inverse"

FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


@final
@dataclass(frozen=True, eq=False)
class StoredImage:
    """A processed image as a PNG.

    Attributes:
        name: of the image, with its ending.
        pixels: uint8 [h w 3].
    """

    name: str
    pixels: np.ndarray = field(repr=False)
    suffix: ClassVar[str] = ".png"

    def is_file(self) -> bool:
        """True."""
        return True

    def read_bytes(self) -> bytes:
        """The PNG."""
        return png_bytes(self.pixels)

    def __str__(self) -> str:
        return self.name


@final
@dataclass(frozen=True, eq=False)
class PredictedDepth:
    """Predicted z-depths at the processed size: each pixel of the photo gets the depth that its ray hits, 0 where the photo was cropped.

    Attributes:
        values: z-depths [h w], 0 where unknown.
        lens: the camera of the processed image.
    """

    values: np.ndarray = field(repr=False)
    lens: AbstractLens
    stored: ClassVar[bool] = True

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`."""
        return pixels.taken(carry_over(self.values, self.lens, pixels.lens))


@dataclass(frozen=True)
class Mistake:
    """What a file looks like instead of what it should be.

    Attributes:
        name: "inverse" for poses of the other direction, or a sentence.
        stated: median disagreement of the depth as stored.
        undone: the same if the mistake is undone.
    """

    name: str
    stated: float
    undone: float


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


def find_mistake(world_from_camera: np.ndarray, intrinsics: np.ndarray, depth: np.ndarray) -> Mistake | None:
    """What the cameras and depths look like instead of what they should be; None if nothing explains them better.

    Predicted depth and cameras belong together if points of one photo, moved to the next, are at the depth that was predicted there. Errors of the
    file, such as poses of the other direction or depth in millimetres, are found because the same numbers agree much better when they are undone.
    Nothing is corrected: a guess could be wrong without a sign.

    Args:
        world_from_camera: poses [n 4 4], OpenCV axes.
        intrinsics: [n 3 3].
        depth: [n h w], 0 where unknown.
    """
    stated = disagreement(world_from_camera, intrinsics, depth)
    inverse = np.linalg.inv(world_from_camera)
    alternatives = {
        INVERSE: (inverse, 1.0),
        "axes of OpenGL (y up, z backward)": (world_from_camera @ FLIP, 1.0),
        "depth in millimetres of poses in metres": (world_from_camera, 1e-3),
        "depth in metres of poses in millimetres": (world_from_camera, 1e3),
    }
    found = {name: disagreement(poses, intrinsics, depth * scale) for name, (poses, scale) in alternatives.items()}
    best = min(found, key=lambda name: found[name])
    return Mistake(best, stated, found[best]) if stated > WRONG and found[best] < min(CLOSE, stated / BETTER) else None


def disagreement(world_from_camera: np.ndarray, intrinsics: np.ndarray, depth: np.ndarray) -> float:
    """The median relative difference of depth between neighbouring photos; a point that is outside or behind the other differs by 1."""
    count, height, width = depth.shape
    rows = np.linspace(0, height - 1, min(SAMPLES, height)).astype(int)
    columns = np.linspace(0, width - 1, min(SAMPLES, width)).astype(int)
    grid = np.stack(np.meshgrid(columns + 0.5, rows + 0.5), axis=-1).reshape(-1, 2)
    differences = []
    for one in np.unique(np.linspace(0, count - 2, PAIRS).astype(int)):
        for source, target in ((one, one + 1), (one + 1, one)):
            known = depth[source][np.ix_(rows, columns)].reshape(-1).astype(np.float64)
            inside = np.column_stack((grid, np.ones(len(grid)))) @ np.linalg.inv(intrinsics[source]).T * known[:, None]
            inside = inside[known > 0]
            world = inside @ world_from_camera[source, :3, :3].T + world_from_camera[source, :3, 3]
            seen = (world - world_from_camera[target, :3, 3]) @ world_from_camera[target, :3, :3]
            differences.append(_differences(seen, intrinsics[target], depth[target]))
    joined = np.concatenate(differences)
    return float(np.median(joined)) if len(joined) else 0.0


def _differences(points: np.ndarray, intrinsics: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """How far points [n 3] of a camera are from its depth map, relative to it. Points at unknown depth are left out."""
    height, width = depth.shape
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        places = points @ intrinsics.T
        column, row = (
            np.nan_to_num(places[:, axis] / points[:, 2], nan=-1.0).clip(-1, 1e9).astype(int) for axis in (0, 1)
        )
    visible = (points[:, 2] > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    visible &= (places[:, 0] >= 0) & (places[:, 1] >= 0)
    met = depth[row[visible], column[visible]].astype(np.float64)
    known = met > 0
    off = np.abs(points[visible, 2][known] / met[known] - 1)
    return np.concatenate((np.minimum(off, 1.0), np.ones(int((~visible).sum()))))


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
