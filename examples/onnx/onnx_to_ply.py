"""From photos to a labelled splat with ONNX Runtime alone: needs numpy, onnxruntime and pillow.

    semgs export-network small --views 2 --size 240x320 --out small.onnx
    python examples/onnx/onnx_to_ply.py small.onnx cameras.txt room.ply

cameras.txt has a line for each view: IMAGE fx fy cx cy near far, then the first three rows of the camera-to-world pose (OpenCV axes).
"""

import json
import sys
from pathlib import Path

import numpy as np
import onnxruntime
from PIL import Image

REST = 45  # 3DGS viewers expect harmonics up to degree 3: 15 above the constant for each of red, green, blue


def read_views(path: Path, size: tuple[int, int]) -> dict[str, np.ndarray]:
    """The network's inputs from a file of cameras; images of another size are resized together with their intrinsics."""
    images, poses, intrinsics, bounds = [], [], [], []
    for line in filter(None, map(str.strip, path.read_text().splitlines())):
        name, *numbers = line.split()
        fx, fy, cx, cy, near, far, *pose = map(float, numbers)
        with Image.open(path.parent / name) as photo:
            x, y = size[1] / photo.width, size[0] / photo.height
            resized = photo.convert("RGB").resize((size[1], size[0]), Image.Resampling.BOX)
        images.append(np.asarray(resized, np.float32).transpose(2, 0, 1) / 255)
        intrinsics.append([[fx * x, 0, cx * x], [0, fy * y, cy * y], [0, 0, 1]])
        poses.append([*np.reshape(pose, (3, 4)), [0, 0, 0, 1]])
        bounds.append([near, far])
    inputs = {"images": images, "world_from_camera": poses, "intrinsics": intrinsics, "depth_range": bounds}
    return {name: np.asarray(values, np.float32) for name, values in inputs.items()}


def write_ply(path: Path, arrays: dict[str, np.ndarray], classes: str) -> None:
    """The colour Gaussians as a 3DGS PLY, with the likeliest class of each as `label`."""
    harmonics, opacities = arrays["colour.features"], np.clip(arrays["opacities"], 1e-7, 1 - 1e-7)
    rest = np.zeros((len(harmonics), 3, REST // 3), np.float32)
    rest[..., : harmonics.shape[1] - 1] = harmonics[:, 1:].transpose(0, 2, 1)
    columns = {
        "x y z": arrays["means"], "nx ny nz": np.zeros_like(arrays["means"]), "f_dc_0 f_dc_1 f_dc_2": harmonics[:, 0],
        " ".join(f"f_rest_{k}" for k in range(REST)): rest.reshape(len(rest), -1),
        "opacity": np.log(opacities / (1 - opacities))[:, None], "scale_0 scale_1 scale_2": np.log(arrays["colour.scales"]),
        "rot_0 rot_1 rot_2 rot_3": arrays["colour.quaternions"],
    }  # fmt: skip
    names = " ".join(columns).split()
    table = np.empty(len(harmonics), [*((name, "<f4") for name in names), ("label", "u1")])
    for name, values in zip(names, np.hstack(list(columns.values())).T, strict=True):
        table[name] = values
    table["label"] = arrays["semantic.features"].argmax(-1)
    properties = "".join(f"property float {name}\n" for name in names)
    header = f"ply\nformat binary_little_endian 1.0\ncomment classes {classes}\nelement vertex {len(table)}\n{properties}property uchar label\nend_header\n"
    path.write_bytes(header.encode() + table.tobytes())


network, cameras, out = map(Path, sys.argv[1:])
session = onnxruntime.InferenceSession(network, providers=["CPUExecutionProvider"])
about = session.get_modelmeta().custom_metadata_map
height, width = map(int, about["size"].split("x"))
found = session.run(None, read_views(cameras, (height, width)))
arrays = dict(zip([output.name for output in session.get_outputs()], found, strict=True))
write_ply(out, arrays, about["classes"])
labels, counts = np.unique(arrays["semantic.features"].argmax(-1), return_counts=True)
most = json.loads(about["classes"])[labels[counts.argmax()]]
print(f"{out}: {len(arrays['means']):,} Gaussians, mostly {most}")
