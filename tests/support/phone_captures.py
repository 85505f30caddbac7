"""A room as phone apps export it. Written from the descriptions of their formats, by code that the readers do not share."""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from miniatures import Miniature, quaternion, write_picture

FLIPPED = np.diag((1.0, -1.0, -1.0, 1.0))
"""From OpenCV's camera axes to ARKit's."""
TIMES = 638443502000 + 266643 * np.arange(12)
"""Names of Polycam's files: microseconds."""


def as_jpegs(room: Miniature) -> tuple[list[bytes], Miniature]:
    """The room's images as JPEG, and the room with these images."""
    files = [cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])[1] for image in room.images]
    images = np.stack([cv2.imdecode(file, cv2.IMREAD_COLOR)[..., ::-1] for file in files])
    return [file.tobytes() for file in files], replace(room, images=images)


def polycam_camera(pose: np.ndarray, k: tuple[float, ...], size: tuple[int, int], **more: object) -> str:
    """A camera file; `k` is fx, fy, cx, cy."""
    rows = {f"t_{i}{j}": (pose @ FLIPPED)[i, j] for i in range(3) for j in range(4)}
    named = dict(zip(("fx", "fy", "cx", "cy"), k, strict=True))
    return json.dumps(
        {**rows, **named, "width": size[1], "height": size[0], "blur_score": 115.28, "neighbors": [], **more}
    )


def write_polycam(
    folder: Path, room: Miniature, k: tuple[float, ...] = (40.0, 38.0, 33.0, 22.0), *, kind: str = ""
) -> Miniature:
    """A raw export of the room in `cameras` and `images`, or with `kind` "corrected_" in those, and how the room is with JPEG images."""
    files, same = as_jpegs(room)
    frames = folder / "keyframes"
    for name in (f"{kind}cameras", f"{kind}images"):
        (frames / name).mkdir(parents=True)
    for time, pose, file, depths in zip(TIMES, room.poses, files, room.depths, strict=False):
        (frames / f"{kind}cameras/{time}.json").write_text(polycam_camera(pose, k, room.size))
        (frames / f"{kind}images/{time}.jpg").write_bytes(file)
        if not kind:
            write_picture(frames / f"depth/{time}.png", depths)
    (folder / "mesh_info.json").write_text("{}")
    return same


def record3d_metadata(room: Miniature, k: tuple[float, ...], **more: object) -> str:
    """The metadata of a recording; `k` is fx, fy, cx, cy."""
    fx, fy, cx, cy = k
    poses = [[*quaternion((pose @ FLIPPED)[:3, :3]), *pose[:3, 3]] for pose in room.poses]
    height, width = room.size
    said = {
        "w": width,
        "h": height,
        "dw": width,
        "dh": height,
        "fps": 60,
        "K": [fx, 0, 0, 0, fy, 0, cx, cy, 1],
        "poses": poses,
    }
    return json.dumps({key: value for key, value in {**said, **more}.items() if value is not None})


def write_record3d(
    folder: Path, room: Miniature, k: tuple[float, ...] = (52.0, 50.0, 25.0, 30.5), **more: object
) -> Miniature:
    """The content of an `.r3d` file in a folder, and how the room is with JPEG images; `more` changes the metadata."""
    import lzfse

    files, same = as_jpegs(room)
    (folder / "rgbd").mkdir(parents=True)
    (folder / "metadata").write_text(record3d_metadata(room, k, **more))
    (folder / "icon").write_bytes(files[0])
    for index, (file, depths) in enumerate(zip(files, room.depths, strict=True)):
        metres = (depths / 1000).astype("<f4")
        (folder / f"rgbd/{index}.jpg").write_bytes(file)
        (folder / f"rgbd/{index}.depth").write_bytes(lzfse.compress(metres.tobytes()))
        (folder / f"rgbd/{index}.conf").write_bytes(lzfse.compress(np.full(depths.shape, 2, "u1").tobytes()))
    return same


def zipped(folder: Path, archive: Path, inside: str = "") -> Path:
    """A folder as an archive with its files in the folder `inside` ("capture/")."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as written:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                written.write(file, inside + file.relative_to(folder).as_posix())
    return archive
