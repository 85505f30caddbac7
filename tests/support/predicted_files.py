"""Files as Depth Anything 3, VGGT, MapAnything and users of DUSt3R write them, of a room whose depth is known exactly."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from semgs.files.images.pictures import write_png

LOW, HIGH = np.array([-2.0, -1.5, -2.0]), np.array([2.0, 1.5, 3.0])
"""Two corners of the room [m]."""


def view(intrinsics: np.ndarray, size: tuple[int, int], pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Z-depths [h w] and colours [h w 3] (uint8) of the room as a camera in it sees it."""
    rows, columns = np.indices(size) + 0.5
    inside = np.stack((columns, rows, np.ones(size)), axis=-1) @ np.linalg.inv(intrinsics).T
    rays = inside @ pose[:3, :3].T
    eye = pose[:3, 3]
    with np.errstate(divide="ignore"):
        depth = np.maximum((LOW - eye) / rays, (HIGH - eye) / rays).min(axis=-1)
    x, y, z = np.moveaxis(eye + rays * depth[..., None], -1, 0)
    wave = np.stack((np.sin(3 * x + z), np.cos(4 * y + 2 * z), np.sin(2 * x - 3 * y)), axis=-1)
    return depth, np.rint(255 * (0.5 + 0.4 * wave)).astype(np.uint8)


def pose_at(index: int) -> np.ndarray:
    """A camera to world [4 4] that looks into the room, turned a little and never at the origin."""
    turn, tilt = 0.15 * index - 0.3, 0.1
    about_y = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    pose = np.eye(4)
    pose[:3, :3] = about_y @ about_x
    pose[:3, 3] = -0.8 + 0.4 * index, 0.2 - 0.1 * index, -1.3 + 0.1 * index
    return pose


@dataclass(frozen=True)
class Made:
    """What a network would predict of the room if it made no error.

    Attributes:
        photo: (height, width) of the photos.
        focal, centre: of the photos [px].
        processed: (height, width) of the processed images.
        scale, shift: from a photo to its processed image, along x and y, worked out by hand.
        count: of photos.
    """

    photo: tuple[int, int]
    processed: tuple[int, int]
    scale: tuple[float, float]
    shift: tuple[float, float] = (0.0, 0.0)
    focal: tuple[float, float] = (70.0, 72.0)
    centre: tuple[float, float] | None = None
    count: int = 3
    poses: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", np.stack([pose_at(index) for index in range(self.count)]))

    @property
    def camera(self) -> np.ndarray:
        """K [3 3] of the photos."""
        cx, cy = self.centre or (0.48 * self.photo[1], 0.53 * self.photo[0])
        return np.array([[self.focal[0], 0, cx], [0, self.focal[1], cy], [0, 0, 1]])

    @property
    def processed_camera(self) -> np.ndarray:
        """K [3 3] of the processed images."""
        (sx, sy), (tx, ty) = self.scale, self.shift
        return np.array([[sx, 0, tx], [0, sy, ty], [0, 0, 1]]) @ self.camera

    @property
    def intrinsics(self) -> np.ndarray:
        """The same [n 3 3] of all."""
        return np.tile(self.processed_camera, (self.count, 1, 1))

    @property
    def world_to_camera(self) -> np.ndarray:
        """[n 4 4]."""
        return np.linalg.inv(self.poses)

    def maps(self) -> tuple[np.ndarray, np.ndarray]:
        """Depths [n h w], float32, and images [n h w 3], uint8, at the processed size."""
        seen = [view(self.processed_camera, self.processed, pose) for pose in self.poses]
        return np.stack([depth for depth, _ in seen]).astype(np.float32), np.stack([image for _, image in seen])

    def write_photos(self, folder: Path) -> Path:
        """The photos, 000.png and so on."""
        folder.mkdir(parents=True, exist_ok=True)
        for index, pose in enumerate(self.poses):
            write_png(folder / f"{index:03d}.png", view(self.camera, self.photo, pose)[1])
        return folder


SMALL = Made((28, 42), (28, 42), (1.0, 1.0), focal=(35.0, 36.0))
"""Photos that are processed as they are: no tool makes them so small, but its file may have them."""


def confidences(made: Made) -> np.ndarray:
    """Confidences [n h w] from 1 to 9: 1.2, which is too low, in the first row."""
    sure = np.full((made.count, *made.processed), 9.0, np.float32)
    sure[:, 0] = 1.2
    return sure


def depth_anything(made: Made, *, mini: bool = True) -> dict[str, np.ndarray]:
    """The fields of `mini_npz` or `npz` of Depth Anything 3."""
    depth, images = made.maps()
    fields = {
        "depth": np.round(depth, 6),
        "conf": np.round(confidences(made), 2),
        "extrinsics": made.world_to_camera[:, :3].astype(np.float32),
        "intrinsics": made.intrinsics.astype(np.float32),
    }
    return fields if mini else {"image": images, **fields}


def vggt(made: Made) -> dict[str, np.ndarray]:
    """The fields of VGGT's `predictions.npz`, among them one that has to be unpickled."""
    depth, images = made.maps()
    return {
        "pose_enc": np.zeros((made.count, 9), np.float32),
        "pose_enc_list": np.array(None, dtype=object),
        "depth": depth[..., None],
        "depth_conf": confidences(made),
        "world_points_conf": confidences(made),
        "images": (images.transpose(0, 3, 1, 2) / 255).astype(np.float32),
        "extrinsic": made.world_to_camera[:, :3].astype(np.float32),
        "intrinsic": made.intrinsics.astype(np.float32),
    }


def map_anything_app(made: Made) -> dict[str, np.ndarray]:
    """The fields of the `predictions.npz` of MapAnything's demo: its first pixel is centred at (0, 0), so its principal points are half a pixel less."""
    depth, images = made.maps()
    mask = np.ones(depth.shape, bool)
    mask[:, 0] = False
    return {
        "extrinsic": made.poses.astype(np.float32),
        "intrinsic": (made.intrinsics - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]).astype(np.float32),
        "conf": confidences(made),
        "depth": (depth * mask)[..., None],
        "images": (images / 255).astype(np.float32),
        "final_mask": mask,
    }


def map_anything(made: Made) -> dict[str, np.ndarray]:
    """What MapAnything's `infer` returns, stacked: each photo is a batch of one."""
    fields = map_anything_app(made)
    return {
        "camera_poses": fields["extrinsic"][:, None],
        "intrinsics": fields["intrinsic"][:, None],
        "depth_z": fields["depth"][:, None],
        "conf": fields["conf"][:, None],
        "mask": fields["final_mask"][:, None, ..., None],
        "img_no_norm": fields["images"][:, None],
        "metric_scaling_factor": np.ones((made.count, 1, 1), np.float32),
    }


def dust3r(made: Made) -> dict[str, np.ndarray]:
    """DUSt3R's results: focal lengths of one number, and principal points, by the names of its functions."""
    depth, images = made.maps()
    camera = made.processed_camera
    return {
        "imgs": (images / 255).astype(np.float32),
        "im_poses": made.poses.astype(np.float32),
        "focals": np.full((made.count, 1), camera[0, 0], np.float32),
        "principal_points": np.tile(camera[:2, 2], (made.count, 1)).astype(np.float32),
        "depthmaps": depth,
        "im_conf": confidences(made),
    }


def save(path: Path, fields: dict[str, np.ndarray], *, compressed: bool = False) -> Path:
    """An `.npz` file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    (np.savez_compressed if compressed else np.savez)(path, **fields)
    return path
