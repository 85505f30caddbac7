"""A room in small, to be written in the layouts of others: eight frames of the embedded scene with a camera of the layout's choice.

The writers here follow each format's own description, in numbers of their own; none of them calls what reads it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from semgs.data.demo_scene import demo_scene
from semgs.data.resampling import resized
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene

SIZE = (48, 64)


@dataclass(frozen=True)
class Miniature:
    """A room as arrays.

    Attributes:
        images: uint8 [n h w 3], RGB.
        depths: whole millimetres, uint16 [n h w], 0 where unknown.
        labels: uint8 [n h w], 255 where there is none.
        poses: world from camera, OpenCV axes, float64 [n 4 4].
    """

    images: np.ndarray
    depths: np.ndarray
    labels: np.ndarray
    poses: np.ndarray

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def size(self) -> tuple[int, int]:
        return self.images.shape[1:3]

    def first(self, count: int) -> Miniature:
        return replace(self, **{name: getattr(self, name)[:count] for name in ("images", "depths", "labels", "poses")})


@cache
def miniature(size: tuple[int, int] = SIZE, frames: int = 8) -> Miniature:
    """The embedded room at a size, with holes in its depth."""
    views = resized(open_scene(demo_scene()).read(range(frames), "native"), size)
    depths = np.rint(1000 * views.depths.numpy()).astype(np.uint16)
    depths[:, : size[0] // 6, : size[1] // 5] = 0
    return Miniature(
        np.rint(255 * views.images.permute(0, 2, 3, 1).numpy()).astype(np.uint8),
        depths,
        views.labels.numpy(),
        views.cameras.world_from_camera.numpy(),
    )


def write_picture(path: Path, array: np.ndarray) -> None:
    """A PNG of RGB or of one channel, by OpenCV."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cv2.imencode(".png", array[..., ::-1] if array.ndim == 3 else array)[1].tobytes())


def text(rows: np.ndarray, end: str = "\n") -> str:
    """Rows of numbers as text, 12 digits."""
    return "".join(" ".join(f"{value:.12g}" for value in row) + end for row in np.atleast_2d(rows))


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """(x, y, z, w) of a rotation matrix: the eigenvector that rotates into itself (Bar-Itzhack's form)."""
    r = rotation
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
        ]
    )
    return np.linalg.eigh(k)[1][:, -1]


def check_read(
    scene: Scene, room: Miniature, frames: list[int] | None = None, *, labels: bool = False, depths: bool = True
) -> None:
    """See that what is read equals what was written: poses to 1e-6, pictures and labels exactly, depth to 1 mm."""
    frames = list(range(len(room))) if frames is None else frames
    assert len(scene) == len(frames)
    views = scene.read(range(len(scene)), "native")
    np.testing.assert_allclose(views.cameras.world_from_camera.numpy(), room.poses[frames], atol=1e-6)
    np.testing.assert_array_equal(np.rint(255 * views.images.permute(0, 2, 3, 1).numpy()), room.images[frames])
    if depths:
        np.testing.assert_allclose(views.depths.numpy(), room.depths[frames] / 1000, atol=1e-3)
        assert ((views.depths.numpy() == 0) == (room.depths[frames] == 0)).all()
    if labels:
        np.testing.assert_array_equal(views.labels.numpy(), room.labels[frames])


def check_projection(scene: Scene, frame: int, world: np.ndarray, pixel: tuple[int, int], depth: float) -> None:
    """See that a world point [3] lies on the centre of a pixel (row, column), at a depth [m]."""
    cameras = scene.frames[frame].camera
    x = np.linalg.inv(cameras.world_from_camera.numpy()) @ [*world, 1]
    u, v, w = cameras.intrinsics.numpy() @ x[:3]
    np.testing.assert_allclose((v / w, u / w, w), (pixel[0] + 0.5, pixel[1] + 0.5, depth), atol=1e-6)


def back_projected(
    pose: np.ndarray, focal: tuple[float, float], centre: tuple[float, float], pixel: tuple[int, int], depth: float
) -> np.ndarray:
    """The world point of a pixel (row, column) in the formula of those who count from the centre of the first pixel."""
    row, column = pixel
    x, y = (column - centre[0]) / focal[0] * depth, (row - centre[1]) / focal[1] * depth
    return (pose @ [x, y, depth, 1])[:3]
