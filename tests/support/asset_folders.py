"""A folder of assets that the tests write themselves: boxes of every class by several makers, and small pictures."""

import json
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

SIZES = {
    "chair": ("chair", "floor", (0.45, 0.48, 0.9)),
    "table": ("dining_table", "floor", (1.5, 0.8, 0.75)),
    "sofa": ("sofa", "floor", (1.9, 0.85, 0.8)),
    "bed": ("bed", "floor", (1.5, 2.0, 0.9)),
    "desk": ("desk", "floor", (1.4, 0.65, 0.74)),
    "cabinet": ("cabinet", "floor", (0.9, 0.45, 0.95)),
    "bookshelf": ("bookshelf", "floor", (1.0, 0.3, 1.6)),
    "toilet": ("toilet", "floor", (0.38, 0.66, 0.75)),
    "door": ("door", "wall", (0.95, 0.1, 2.1)),
    "clutter": ("vase", "surface", (0.12, 0.12, 0.2)),
}
MAKERS = ("aa", "bb", "cc", "dd", "ee")
PICTURES = {
    "wood_floor": True, "wood": True, "fabric": True, "tile": True, "plaster": True, "wallpaper": True, "stone": True,
    "painting": False, "photo": False, "poster": False, "carpet": True, "outdoor": False,
}  # fmt: skip
ORIGIN = {"source_repo": "someone/things", "commit": "0" * 40, "path": "a.glb", "author": "Someone"}


def box(size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, faces and texture coordinates of a box on z = 0, each face with the whole picture."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)]) * size
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    vertices = np.array([corners[i] for quad in quads for i in quad], dtype=np.float32)
    faces = np.array([t for k in range(6) for t in ((4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3))])
    uv = np.tile(np.array([[0, 1], [0, 0], [1, 0], [1, 1]], dtype=np.float32), (6, 1))
    return vertices, faces, uv


def png(picture: np.ndarray) -> bytes:
    return cv2.imencode(".png", picture[..., ::-1])[1].tobytes()


def write_glb(path: Path, nodes: dict[str, tuple], texture: bytes | None = None, **node_keys) -> None:
    """A file with one primitive a node: (vertices, faces, uv, linear colour)."""
    data, views, accessors, meshes, materials = b"", [], [], [], []

    def add(values: np.ndarray, kind: str, component: int) -> int:
        nonlocal data
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes})
        data += values.tobytes() + b"\0" * (-values.nbytes % 4)
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind})
        return len(accessors) - 1

    for number, (vertices, faces, uv, colour) in enumerate(nodes.values()):
        attributes = {"POSITION": add(vertices, "VEC3", 5126), "TEXCOORD_0": add(uv, "VEC2", 5126)}
        indices = add(faces.astype(np.uint32).ravel(), "SCALAR", 5125)
        meshes.append({"primitives": [{"attributes": attributes, "indices": indices, "material": number}]})
        surface = {"baseColorFactor": [*colour, 1.0]}
        materials.append({"name": f"m{number}_paint", "pbrMetallicRoughness": surface})
        if texture is not None:
            surface["baseColorTexture"] = {"index": 0}
    description = {
        "asset": {"version": "2.0"}, "meshes": meshes, "materials": materials, "accessors": accessors, "bufferViews": views,
        "nodes": [{"name": name, "mesh": k, **node_keys} for k, name in enumerate(nodes)],
    }  # fmt: skip
    if texture is not None:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(texture)})
        data += texture + b"\0" * (-len(texture) % 4)
        description |= {
            "images": [{"bufferView": len(views) - 1, "mimeType": "image/png"}],
            "textures": [{"source": 0}],
        }
    description["buffers"] = [{"byteLength": len(data)}]
    head = json.dumps(description).encode()
    head += b" " * (-len(head) % 4)
    body = struct.pack("<II", len(head), 0x4E4F534A) + head + struct.pack("<II", len(data), 0x004E4942) + data
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


@pytest.fixture(scope="session")
def write_mesh():
    return write_glb


@pytest.fixture(scope="session")
def box_mesh():
    return box


@pytest.fixture(scope="session")
def asset_folder(tmp_path_factory) -> Path:
    """Fifty meshes, ten of them textured, and sixty pictures."""
    folder, rng = tmp_path_factory.mktemp("assets"), np.random.default_rng(0)
    rows = []
    for label, (subtype, mount, size) in SIZES.items():
        for maker in MAKERS:
            name = f"{maker}_{label}_1"
            nodes = {"n0_body": (*box(size), (0.5, 0.3, 0.1))}
            texture = png(rng.integers(60, 200, (6, 9, 3), dtype=np.uint8)) if maker == "aa" else None
            parts = {}
            if label == "desk":
                x, y, z = size
                vertices, faces, uv = box((x / 2, y / 2, 0.1))
                nodes["n1_thing"] = (vertices + np.array([0, 0, z], np.float32), faces, uv, (0.1, 0.1, 0.1))
                parts = {"n1_thing": "clutter"}
            write_glb(folder / f"models/{name}.glb", nodes, texture)
            row = {
                "name": name, "class": label, "subtype": subtype, "file": f"models/{name}.glb", "extents_m": list(size),
                "mount": mount, "textured": texture is not None, "licence": "CC0-1.0", **ORIGIN,
            }  # fmt: skip
            rows.append(row | ({"part_classes": parts} if parts else {}))
    (folder / "catalog.json").write_text(json.dumps(rows))
    rows = []
    for kind, tileable in PICTURES.items():
        for number in range(5):
            file = f"textures/{kind}_{number}.png"
            (folder / "textures").mkdir(exist_ok=True)
            (folder / file).write_bytes(png(rng.integers(30, 220, (10, 14, 3), dtype=np.uint8)))
            rows.append({"name": f"{kind}_{number}", "kind": kind, "file": file, "size": [14, 10], "tileable": tileable,
                         "licence": "CC-BY-4.0", **ORIGIN})  # fmt: skip
    (folder / "textures.json").write_text(json.dumps(rows))
    return folder
