"""One small room in the layouts of data sets that scenezoo reads, as their own documents describe the files. It uses none of their readers."""

from __future__ import annotations

import csv
import io
import json
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from cast_room import Photo, miniature, pinhole_rays, poses
from scipy.spatial.transform import Rotation

from semgs.data.tables.classes import SCANNET20

SIZE = (96, 128)
K = np.array([[101.0, 0, 63.1], [0, 101.5, 48.8], [0, 0, 1]])
"""The corner of the first pixel is at (0, 0)."""
CENTRED = K - 0.5 * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
"""The same with its centre there."""
MIDDLE = np.array([[101.0, 0, 64.0], [0, 101.5, 48.0], [0, 0, 1]])
"""Of Structured3D, whose axis is in the middle."""
OPENGL = np.diag((1.0, -1, -1, 1))
COUNT = 3
LABELS = range(len(SCANNET20))

ARKIT, HOUSE, SCAN, RIO, ROOM = "41069021", "1pXnuDYAj8r", "scene_00000_00", "0a4b8ef6-a83a", "485142"


@dataclass(frozen=True)
class Written:
    """What a data set was written from.

    Attributes:
        root: its folder.
        poses: camera to world, OpenCV axes.
        intrinsics: K of the images, the corner of the first pixel at (0, 0).
        photos: what the cameras see.
    """

    root: Path
    poses: np.ndarray
    intrinsics: np.ndarray
    photos: tuple[Photo, ...]


def photographs(root: Path, k: np.ndarray = K) -> Written:
    """The room, seen by the first cameras of `cast_room`."""
    rays = pinhole_rays(SIZE, k, 0.5)
    return Written(root, poses(COUNT), k, tuple(miniature().photograph(pose, rays) for pose in poses(COUNT)))


def picture(path: Path, pixels: np.ndarray) -> None:
    """Write an image, RGB or a map."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(encoded(path.suffix, pixels))


def encoded(ending: str, pixels: np.ndarray) -> bytes:
    """The file of an image."""
    options = [cv2.IMWRITE_JPEG_QUALITY, 98] if ending == ".jpg" else []
    return cv2.imencode(ending, pixels[..., ::-1] if pixels.ndim == 3 else pixels, options)[1].tobytes()


def text(path: Path, content: str) -> None:
    """Write a text file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)


def numbers(values: np.ndarray) -> str:
    """Numbers, separated by spaces."""
    return " ".join(f"{value:.9g}" for value in np.ravel(values))


def write_arkitscenes(root: Path) -> Written:
    """`raw/`: poses as world to camera, three times smaller depth, the depth of the first column unreliable."""
    made = photographs(root)
    fields = {
        "video_id": ARKIT, "visit_id": "421254", "fold": "Training", "sky_direction": "Left", "is_in_upsampling": "False",
        "is_in_threedod": "True", "has_laser_scanner_point_clouds": "False",
    }  # fmt: skip
    text(root / "raw/metadata.csv", f"{','.join(fields)}\n{','.join(fields.values())}\n")
    folder = root / "raw/Training" / ARKIT
    rows = []
    for index, (pose, photo) in enumerate(zip(made.poses, made.photos, strict=True)):
        time = f"{3112.5 + 0.1 * index:.3f}"
        inverse = np.linalg.inv(pose)
        rows.append(f"{time} {numbers(Rotation.from_matrix(inverse[:3, :3]).as_rotvec())} {numbers(inverse[:3, 3])}\n")
        for source in ("lowres_wide", "vga_wide"):
            picture(folder / source / f"{ARKIT}_{time}.png", photo.colour)
            camera = f"{SIZE[1]} {SIZE[0]} {numbers(K[[0, 1, 0, 1], [0, 1, 2, 2]])}"
            text(folder / f"{source}_intrinsics" / f"{ARKIT}_{time}.pincam", camera)
        confidence = np.full(SIZE, 2, np.uint8)
        confidence[:, 0] = 0
        picture(folder / "lowres_depth" / f"{ARKIT}_{time}.png", photo.depth)
        picture(folder / "confidence" / f"{ARKIT}_{time}.png", confidence)
    text(folder / "lowres_wide.traj", "".join(rows))
    return made


def mesh(path: Path, faces: dict[str, np.ndarray], corners: dict[str, np.ndarray]) -> None:
    """A binary PLY of the room with more properties of its triangles and corners, each 32 bits."""
    room = miniature()
    count = len(room.corners)
    vertices = np.zeros(3 * count, [("place", "<f4", 3), *((name, "<i4") for name in corners)])
    vertices["place"] = room.corners.reshape(-1, 3)
    triangles = np.zeros(count, [("n", "u1"), ("v", "<i4", 3), *((name, "<i4") for name in faces)])
    triangles["n"], triangles["v"] = 3, np.arange(3 * count).reshape(-1, 3)
    for records, values in ((vertices, corners), (triangles, faces)):
        for name, value in values.items():
            records[name] = value
    head = [
        "ply", "format binary_little_endian 1.0", f"element vertex {3 * count}",
        *(f"property float {axis}" for axis in "xyz"), *(f"property int {name}" for name in corners),
        f"element face {count}", "property list uchar int vertex_indices", *(f"property int {name}" for name in faces), "end_header",
    ]  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes("\n".join(head).encode() + b"\n" + vertices.tobytes() + triangles.tobytes())


def ids() -> np.ndarray:
    """The label of each triangle plus 1, 0 for none."""
    labels = miniature().labels.astype(np.int64)
    return np.where(labels == 255, 0, labels + 1)


def write_matterport3d(root: Path) -> Written:
    """Undistorted images, whose rows count from below; raw ones; the house's mesh; and the categories beside it."""
    made = photographs(root)
    folder = root / "v1/scans" / HOUSE
    from_below = (SIZE[0] - 1) - CENTRED[1, 2]
    lines = [
        f"dataset matterport\nn_images {COUNT}\nintrinsics_matrix 101 0 {CENTRED[0, 2]}  0 101.5 {from_below} 0 0 1"
    ]
    for index, (pose, photo) in enumerate(zip(made.poses, made.photos, strict=True)):
        colour, depth = f"0f37bd07_i1_{index}.jpg", f"0f37bd07_d1_{index}.png"
        for kind in ("undistorted", "matterport"):
            picture(folder / f"{kind}_color_images" / colour, photo.colour)
            picture(folder / f"{kind}_depth_images" / depth, photo.depth * 4)
        lines.append(f"scan {depth} {colour} {numbers(pose @ OPENGL)}")
        text(folder / f"matterport_camera_poses/0f37bd07_pose_1_{index}.txt", numbers(pose))
    lens = numbers([*CENTRED[[0, 1, 0, 1], [0, 1, 2, 2]], 0.05, -0.02, 0.001, -0.002, 0.01])
    text(folder / "matterport_camera_intrinsics/0f37bd07_intrinsics_1.txt", f"{SIZE[1]} {SIZE[0]} {lens}")
    text(folder / f"undistorted_camera_parameters/{HOUSE}.conf", "\n".join(lines))
    mesh(
        folder / f"house_segmentations/{HOUSE}.ply",
        {"face_material": ids(), "face_segment": ids(), "face_category": ids()},
        {},
    )
    columns = ("index", "raw_category", "nyu40id", "nyu40class", "eigen13id", "eigen13class", "mpcat40index", "mpcat40")
    file = io.StringIO()
    table = csv.writer(file, delimiter="\t")
    table.writerow(columns)
    for label in LABELS:
        name, nyu40 = SCANNET20.names[label], SCANNET20.raw_ids[label]
        table.writerow((label + 1, f"some {name}", nyu40, name, label + 1, name, label + 1, name))
    text(root / "category_mapping.tsv", file.getvalue())
    return made


def write_multiscan(root: Path) -> Written:
    """An iPhone's capture: a video, one stream of depth, and poses in a world that is turned from the mesh's."""
    import av

    made = photographs(root)
    folder = root / SCAN
    folder.mkdir(parents=True)
    aligned = np.eye(4)
    aligned[:3, :3] = Rotation.from_euler("xyz", (-90, 20, 5), degrees=True).as_matrix()
    aligned[:3, 3] = 0.3, -0.2, 0.7
    with av.open(str(folder / f"{SCAN}.mp4"), "w") as file:
        stream = file.add_stream("mpeg4", rate=30)
        stream.height, stream.width, stream.pix_fmt, stream.bit_rate = *SIZE, "yuv420p", 20_000_000
        for photo in made.photos:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(photo.colour, format="rgb24")))
        file.mux(stream.encode())
    lines = []
    for index, pose in enumerate(made.poses):
        camera = {"timestamp": index, "exposure_duration": 1, "quaternion": [1, 0, 0, 0], "euler_angles": [0, 0, 0]}
        matrices = {"intrinsics": K.T.ravel().tolist(), "transform": (aligned @ pose @ OPENGL).T.ravel().tolist()}
        lines.append(json.dumps(camera | matrices))
    text(folder / f"{SCAN}.jsonl", "\n".join(lines))
    text(folder / f"{SCAN}.align.json", json.dumps({"coordinate_transform": aligned.T.ravel().tolist()}))
    every = {"number_of_frames": COUNT, "resolution": list(SIZE)}
    streams = [
        {"type": "color_camera", **every},
        {"type": "lidar_sensor", "encoding": "float16_zlib", **every},
        {"type": "confidence_map", "encoding": "uint8_zlib", **every},
    ]
    text(folder / f"{SCAN}.json", json.dumps({"depth_unit": "m", "streams": streams}))
    depths = np.stack([photo.depth for photo in made.photos]) / 1000
    confidence = np.full(depths.shape, 2, np.uint8)
    confidence[:, :, 0] = 0
    for name, values in (("depth", depths.astype("<f2")), ("confidence", confidence)):
        packed = zlib.compressobj(wbits=-zlib.MAX_WBITS)
        (folder / f"{SCAN}.{name}.zlib").write_bytes(packed.compress(values.tobytes()) + packed.flush())
    mesh(folder / f"{SCAN}.ply", {"objectId": ids(), "partId": ids()}, {})
    objects = [
        {"objectId": one + 1, "label": f"{SCANNET20.names[one].replace(' ', '_')}.1", "partIds": [one + 1]}
        for one in LABELS
    ]
    text(folder / f"{SCAN}.annotations.json", json.dumps({"objects": objects, "parts": []}))
    return made


def write_3rscan(root: Path) -> Written:
    """A Tango phone's: `sequence.zip`, whose depth camera is another one at the same place, and a mesh with objects."""
    made = photographs(root)
    folder = root / RIO
    folder.mkdir(parents=True)
    depth_size = (48, 60)
    depth_k = np.array([[50.0, 0, 28.3], [0, 51.0, 23.1], [0, 0, 1]])
    rays = pinhole_rays(depth_size, depth_k, 0.0)
    square = np.eye(4)
    lines = ["m_sensorName = Tango", f"m_frames.size = {COUNT}", "m_depthShift = 1000"]
    for camera, (height, width), k in (("Color", SIZE, CENTRED), ("Depth", depth_size, depth_k)):
        square[:3, :3] = k
        lines += [
            f"m_{camera.lower()}Width = {width}", f"m_{camera.lower()}Height = {height}",
            f"m_calibration{camera}Intrinsic = {numbers(square)}", f"m_calibration{camera}Extrinsic = {numbers(np.eye(4))}",
        ]  # fmt: skip
    with zipfile.ZipFile(folder / "sequence.zip", "w") as archive:
        archive.writestr("_info.txt", "\n".join(lines))
        for index, (pose, photo) in enumerate(zip(made.poses, made.photos, strict=True)):
            depth = miniature().photograph(pose, rays).depth
            archive.writestr(f"frame-{index:06d}.color.jpg", encoded(".jpg", photo.colour))
            archive.writestr(f"frame-{index:06d}.depth.pgm", encoded(".pgm", depth))
            archive.writestr(f"frame-{index:06d}.pose.txt", "\n".join(numbers(row) for row in pose))
    mesh(folder / "labels.instances.annotated.v2.ply", {}, {"objectId": np.repeat(ids(), 3)})
    groups = [{"objectId": one + 1, "label": SCANNET20.names[one], "segments": [one]} for one in LABELS]
    text(folder / "semseg.v2.json", json.dumps({"segGroups": groups}))
    return made


def write_structured3d(root: Path) -> Written:
    """Rendered views of one room, in millimetres, with NYU40 labels."""
    made = photographs(root, MIDDLE)
    folder = root / "Structured3D/scene_00000/2D_rendering" / ROOM / "perspective/full"
    nyu40 = np.zeros(256, np.uint8)
    nyu40[: len(SCANNET20)] = SCANNET20.raw_ids
    half = np.arctan(np.array(SIZE[::-1]) / 2 / MIDDLE[[0, 1], [0, 1]])
    for index, (pose, photo) in enumerate(zip(made.poses, made.photos, strict=True)):
        picture(folder / f"{index}/rgb_rawlight.png", photo.colour)
        picture(folder / f"{index}/depth.png", photo.depth)
        picture(folder / f"{index}/semantic.png", nyu40[photo.labels])
        values = (1000 * pose[:3, 3], pose[:3, 2], -pose[:3, 1], half, [1.0])
        text(folder / f"{index}/camera_pose.txt", " ".join(numbers(value) for value in values))
    return made
