"""Writes the miniature room as ScanNet++ stores it: fisheye photos, frames of a phone, and the mesh with its annotations."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from cast_room import miniature, poses
from scannet_writer import RAW_OF_LABEL, TSV_ROWS, jpeg, png, tsv

DSLR_SIZE, PHONE_SIZE, PHONE_DEPTH = (116, 174), (96, 128), (24, 32)
DSLR = {"fl_x": 78.3, "fl_y": 78.6, "cx": 88.1, "cy": 57.2, "k1": -0.0304, "k2": -0.0052, "k3": 0.0014, "k4": -0.0003}
PHONE = {"fl_x": 101.0, "fl_y": 101.5, "cx": 63.1, "cy": 48.8, "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0}
"""With the corner of the first pixel at (0, 0), as COLMAP has it."""
NAMES = ("DSC00010.JPG", "DSC00002.JPG", "DSC00003.JPG", "DSC00007.JPG", "DSC00008.JPG", "DSC00009.JPG")
TEST = ("DSC00003.JPG", "DSC00009.JPG")
UNKNOWN = "thing of no table"


def fisheye_rays(size: tuple[int, int], camera: dict[str, float]) -> np.ndarray:
    """Rays [h w 3], z = 1, of the pixels of a fisheye: the angle whose polynomial is the distance from the principal point, by Newton."""
    rows, columns = np.mgrid[: size[0], : size[1]] + 0.5
    x, y = (columns - camera["cx"]) / camera["fl_x"], (rows - camera["cy"]) / camera["fl_y"]
    distance = np.hypot(x, y)
    angle = distance.copy()
    k = [camera[f"k{n}"] for n in range(1, 5)]
    for _ in range(50):
        off = angle * (1 + sum(c * angle ** (2 * n) for n, c in enumerate(k, 1))) - distance
        angle -= off / (1 + sum((2 * n + 1) * c * angle ** (2 * n) for n, c in enumerate(k, 1)))
    scale = np.tan(angle) / np.maximum(distance, 1e-12)
    return np.stack((x * scale, y * scale, np.ones(size)), axis=-1)


def fisheye_pixels(points: np.ndarray, pose: np.ndarray, camera: dict[str, float]) -> np.ndarray:
    """Where a fisheye sees points [n 3] of the world, by COLMAP's formula [n 2]."""
    inside = (points - pose[:3, 3]) @ pose[:3, :3]
    x, y = inside[:, 0] / inside[:, 2], inside[:, 1] / inside[:, 2]
    r = np.hypot(x, y)
    angle = np.arctan(r)
    bent = angle * (1 + sum(camera[f"k{n}"] * angle ** (2 * n) for n in range(1, 5)))
    return np.stack(
        (camera["fl_x"] * x * bent / r + camera["cx"], camera["fl_y"] * y * bent / r + camera["cy"]), axis=1
    )


def phone_rays(size: tuple[int, int] = PHONE_SIZE) -> np.ndarray:
    """Rays [h w 3], z = 1, of the pixels of the phone."""
    rows, columns = (np.mgrid[: size[0], : size[1]] + 0.5) * (PHONE_SIZE[0] / size[0])
    return np.stack(
        ((columns - PHONE["cx"]) / PHONE["fl_x"], (rows - PHONE["cy"]) / PHONE["fl_y"], np.ones(size)), axis=-1
    )


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """(w, x, y, z) of a rotation matrix, from its eigenvector of eigenvalue 1 and its trace."""
    values, vectors = np.linalg.eig(rotation)
    axis = np.real(vectors[:, np.argmin(np.abs(values - 1))])
    cosine = (np.trace(rotation) - 1) / 2
    skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    angle = np.arctan2(skew @ axis / 2, cosine)
    return np.append(np.cos(angle / 2), np.sin(angle / 2) * axis)


def colmap(
    folder: Path, model: str, size: tuple[int, int], camera: dict[str, float], named: dict[str, np.ndarray], end: str
) -> None:
    """`cameras.txt` and `images.txt`; some images have points behind them, some none."""
    folder.mkdir(parents=True)
    numbers = " ".join(repr(value) for value in camera.values())
    lines = [
        "# Camera list",
        "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]",
        f"1 {model} {size[1]} {size[0]} {numbers}",
    ]
    (folder / "cameras.txt").write_bytes((end.join(lines) + end).encode())
    lines = ["# Image list", "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME"]
    for index, (name, pose) in enumerate(named.items(), 1):
        rotation, place = pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3]
        numbers = " ".join(repr(float(value)) for value in (*quaternion(rotation), *place))
        lines += [f"{index} {numbers} 1 {name}", "10.5 20.25 7 30.0 40.0 -1" if index % 2 else ""]
    (folder / "images.txt").write_bytes((end.join(lines) + end).encode())
    (folder / "points3D.txt").write_bytes(b"# nobody needs them\n")


def transforms(
    model: str, size: tuple[int, int], camera: dict[str, float], named: dict[str, np.ndarray], bad: str = ""
) -> dict:
    """`transforms.json`: OpenGL axes, in a world whose axes are exchanged."""

    def exchanged(pose: np.ndarray) -> list:
        moved = pose.copy()
        moved[0:3, 1:3] *= -1
        moved = moved[np.array([1, 0, 2, 3]), :]
        moved[2, :] *= -1
        return moved.tolist()

    def frames(test: bool) -> list:
        return [
            {
                "file_path": name,
                "mask_path": f"{Path(name).stem}.png",
                "transform_matrix": exchanged(pose),
                "is_bad": name == bad,
            }
            for name, pose in named.items()
            if (name in TEST) == test
        ]

    return {
        **camera, "w": size[1], "h": size[0], "camera_model": model, "has_mask": True,
        "frames": frames(False), "test_frames": frames(True),
    }  # fmt: skip


def mask(size: tuple[int, int]) -> np.ndarray:
    """A mask that hides a corner."""
    values = np.full(size, 255, np.uint8)
    values[: size[0] // 3, : size[1] // 4] = 0
    return values


def write_dslr(scan: Path, *, with_colmap: bool = True, end: str = "\n", bad: str = "") -> None:
    """The photos of the DSLR."""
    folder, named = scan / "dslr", dict(zip(NAMES, poses(), strict=True))
    for place in ("resized_images", "resized_anon_masks", "nerfstudio"):
        (folder / place).mkdir(parents=True)
    rays = fisheye_rays(DSLR_SIZE, DSLR)
    for name, pose in named.items():
        (folder / "resized_images" / name).write_bytes(jpeg(miniature().photograph(pose, rays).colour))
        (folder / "resized_anon_masks" / f"{Path(name).stem}.png").write_bytes(png(mask(DSLR_SIZE)))
    if with_colmap:
        colmap(folder / "colmap", "OPENCV_FISHEYE", DSLR_SIZE, DSLR, named, end)
    told = transforms("OPENCV_FISHEYE", DSLR_SIZE, DSLR, named, bad)
    (folder / "nerfstudio" / "transforms.json").write_text(json.dumps(told))
    lists = {"train": [name for name in NAMES if name not in TEST], "test": list(TEST), "has_masks": True}
    (folder / "train_test_lists.json").write_text(json.dumps(lists))


def write_phone(scan: Path, *, with_colmap: bool = True) -> None:
    """Frames of the phone as the toolbox extracts them."""
    folder = scan / "iphone"
    named = {f"frame_{10 * index:06d}.jpg": pose for index, pose in enumerate(poses())}
    for place in ("rgb", "rgb_masks", "depth", "nerfstudio"):
        (folder / place).mkdir(parents=True)
    for name, pose in named.items():
        (folder / "rgb" / name).write_bytes(jpeg(miniature().photograph(pose, phone_rays()).colour))
        (folder / "rgb_masks" / f"{Path(name).stem}.png").write_bytes(png(mask(PHONE_SIZE)))
        depth = miniature().photograph(pose, phone_rays(PHONE_DEPTH)).depth
        (folder / "depth" / f"{Path(name).stem}.png").write_bytes(png(depth))
    if with_colmap:
        listed = {f"video/{name}": pose for name, pose in named.items()}
        colmap(folder / "colmap", "OPENCV", PHONE_SIZE, PHONE, listed, "\n")
    (folder / "nerfstudio" / "transforms.json").write_text(json.dumps(transforms("OPENCV", PHONE_SIZE, PHONE, named)))


def object_name(label: int) -> str:
    """What an object of a label is called."""
    names = {raw: name for raw, name, _ in TSV_ROWS}
    return "ceiling" if label == 255 else "Storage  Cabinet " if label == 2 else names[RAW_OF_LABEL[label]]


def write_scans(scan: Path) -> None:
    """The mesh, its segments and its objects; one object has a name of no table, and one as large as the room shares all vertices."""
    folder, room = scan / "scans", miniature()
    folder.mkdir(parents=True)
    vertices = room.corners.reshape(-1, 3)
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment a scan\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        f"element face {len(vertices) // 3}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    points = np.zeros(len(vertices), [("place", "<f4", 3), ("colour", "u1", 3)])
    points["place"] = vertices
    faces = np.zeros(len(vertices) // 3, [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, np.arange(len(vertices)).reshape(-1, 3)
    (folder / "mesh_aligned_0.05.ply").write_bytes(header.encode() + points.tobytes() + faces.tobytes())
    segments = 3 * np.repeat(room.owners, 3) + np.repeat(np.arange(len(room.owners)) % 2, 3)
    (folder / "segments.json").write_text(json.dumps({"sceneId": scan.name, "segIndices": segments.tolist()}))
    groups = [{"id": 0, "objectId": 1, "label": "wall", "segments": np.unique(segments).tolist()}]
    for owner in np.unique(room.owners):
        label = int(room.labels[room.owners == owner][0])
        parts = np.unique(segments[np.repeat(room.owners, 3) == owner]).tolist()
        name = UNKNOWN if owner == np.unique(room.owners[room.labels == 255])[0] else object_name(label)
        groups.append({"id": len(groups), "objectId": len(groups) + 1, "label": name, "segments": parts})
    (folder / "segments_anno.json").write_text(json.dumps({"segGroups": groups}))


def write_scan(root: Path, name: str = "0a76e06478") -> Path:
    """A scan with all it has, and ScanNet's table above it; returns its folder."""
    scan = root / "data" / name
    scan.mkdir(parents=True)
    (root / "scannetv2-labels.combined.tsv").write_bytes(tsv())
    write_dslr(scan)
    write_phone(scan)
    write_scans(scan)
    return scan
