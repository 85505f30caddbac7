"""Splats as other programs write them, from the descriptions of their layouts alone: numbers that are worked out by hand go in, bytes come out."""

from __future__ import annotations

import base64
import gzip
import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from semgs.geometry.gaussians import Appearance, Gaussians

SPLAT = "KHR_gaussian_splatting"

LETTERS = {"float": "f4", "double": "f8", "uchar": "u1", "uint": "u4", "int": "i4", "short": "i2"}
CHUNK = [f"{end}_{what}" for end in ("min", "max") for what in ("x", "y", "z")]
CHUNK += [f"{end}_scale_{what}" for end in ("min", "max") for what in "xyz"]
CHUNK_COLOURS = [f"{end}_{what}" for end in ("min", "max") for what in "rgb"]


def ply(
    elements: Mapping[str, Mapping[str, tuple[str, Sequence[float]]]], order: str = "binary_little_endian", comment: str = ""
) -> bytes:  # fmt: skip
    """A PLY of elements with properties (type, values), in the order given."""
    lines, body = ["ply", f"format {order} 1.0"], b""
    if comment:
        lines.append(f"comment {comment}")
    for name, columns in elements.items():
        count = len(next(iter(columns.values()))[1])
        lines.append(f"element {name} {count}")
        lines += [f"property {kind} {column}" for column, (kind, _) in columns.items()]
        if order == "ascii":
            rows = zip(*(values for _, values in columns.values()), strict=True)
            body += "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in rows).encode()
            continue
        end = "<" if order == "binary_little_endian" else ">"
        rows = np.empty(count, [(column, end + LETTERS[kind]) for column, (kind, _) in columns.items()])
        for column, (_, values) in columns.items():
            rows[column] = values
        body += rows.tobytes()
    return "\n".join([*lines, "end_header"]).encode() + b"\n" + body


def columns_3dgs(rows: Sequence[Mapping[str, float]], kind: str = "float") -> dict[str, tuple[str, list[float]]]:
    """The properties of a vertex element, all of one type."""
    return {name: (kind, [row[name] for row in rows]) for name in rows[0]}


def known_row(degree: int = 1, **changed: float) -> dict[str, float]:
    """At (1, -2, 3), half opaque, 1, 2 and 1/e large, turned by 120 degrees about (1, 1, 1); harmonic k of channel c is 0.1 k + c."""
    higher = (degree + 1) ** 2 - 1
    return {
        **dict(zip("xyz", (1.0, -2.0, 3.0), strict=True)),
        **{f"f_dc_{channel}": float(channel) for channel in range(3)},
        **{f"f_rest_{channel * higher + k}": channel + 0.1 * (k + 1) for channel in range(3) for k in range(higher)},
        "opacity": 0.0,
        "scale_0": 0.0,
        "scale_1": float(np.log(2)),
        "scale_2": -1.0,
        **{f"rot_{k}": 3.0 for k in range(4)},
    } | changed


def known_gaussian(degree: int = 1) -> Gaussians:
    """The same, activated."""
    count = (degree + 1) ** 2
    harmonics = torch.tensor([[[channel + 0.1 * k for channel in range(3)] for k in range(count)]])
    colour = Appearance(torch.full((1, 4), 0.5), torch.tensor([[1.0, 2.0, float(np.exp(-1.0))]]), harmonics)
    return Gaussians(torch.tensor([[1.0, -2.0, 3.0]]), torch.tensor([0.5]), colour)


def compressed_ply(
    packed: Sequence[tuple[int, int, int, int]],
    bounds: Sequence[Mapping[str, float]],
    harmonics: Sequence[Sequence[int]] = (),
    colours: bool = True,
) -> bytes:
    """A compressed PLY of (position, rotation, scale, colour), 256 to a chunk; bounds that are not given are 0 and 1."""
    names = CHUNK + (CHUNK_COLOURS if colours else [])
    default = {name: float(name.startswith("max")) for name in names}
    chunks = [default | dict(one) for one in bounds]
    vertices = zip(
        ("packed_position", "packed_rotation", "packed_scale", "packed_color"), zip(*packed, strict=True), strict=True
    )
    elements: dict[str, Any] = {
        "chunk": {name: ("float", [chunk[name] for chunk in chunks]) for name in names},
        "vertex": {name: ("uint", list(values)) for name, values in vertices},
    }
    if harmonics:
        columns = zip(*harmonics, strict=True)
        elements["sh"] = {f"f_rest_{number}": ("uchar", list(values)) for number, values in enumerate(columns)}
    return ply(elements)


def spz_blocks(version: int, degree: int = 1) -> list[bytes]:
    """Two Gaussians: (1, -2, 3) in x right, y down, z forward; and the zero of everything but the rotation."""
    positions = bytes.fromhex("001000 002000 00d0ff".replace(" ", "")) + bytes(9)  # 1, 2, -3 in steps of 1/4096
    rotations = {
        2: bytes([204, 51, 153, 0, 127, 128]),
        3: struct.pack("<II", 3 << 30 | 511 << 20 | (512 | 255) << 10, 0 << 30 | 511 << 20 | (512 | 511)),
    }[min(version, 3)]
    rest = [b"", bytes([192, 64, 128, 128, 192, 64, 64, 128, 192] + [128] * 9)][degree]
    return [positions, bytes([51, 255]), bytes([255, 0, 51, 0, 0, 0]), bytes([160, 176, 144, 0, 0, 0]), rotations, rest]


def spz(
    version: int, blocks: Sequence[bytes], *, count: int = 2, degree: int = 1, flags: int = 0, extensions: bytes = b"", bits: int = 12
) -> bytes:  # fmt: skip
    """An SPZ file of blocks: one gzip stream, or for version 4 a zstd stream for each block."""
    start = struct.pack("<4sIIBBB", b"NGSP", version, count, degree, bits, flags)
    if version < 4:
        return gzip.compress(start + b"\0" + b"".join(blocks) + extensions, mtime=0)
    import zstandard

    streams = [(zstandard.ZstdCompressor().compress(block), len(block)) for block in blocks if block]
    table = b"".join(struct.pack("<QQ", len(stream), size) for stream, size in streams)
    head = start + struct.pack("<BI12x", len(streams), 32 + len(extensions))
    return head + extensions + table + b"".join(stream for stream, _ in streams)


def gltf_arrays(degree: int = 1) -> dict[str, np.ndarray]:
    """The known Gaussian as attributes."""
    known = known_gaussian(degree)
    arrays = {
        "POSITION": known.means.numpy(),
        f"{SPLAT}:ROTATION": np.full((1, 4), 0.5, "<f4"),
        f"{SPLAT}:SCALE": known.colour.scales.numpy(),
        f"{SPLAT}:OPACITY": known.opacities.numpy()[:, None],
    }
    for index in range((degree + 1) ** 2):
        d = int(index**0.5)
        arrays[f"{SPLAT}:SH_DEGREE_{d}_COEF_{index - d * d}"] = known.colour.features[:, index].numpy()
    return arrays


def gltf(arrays: Mapping[str, np.ndarray], node: Mapping[str, Any] | None = None) -> tuple[dict[str, Any], bytes]:
    """The JSON of a glTF file with one primitive of Gaussians, and the bytes of its buffer."""
    body, views, accessors = b"", [], []
    names = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
    kinds = {"f": 5126, "B": 5121, "b": 5120, "H": 5123, "h": 5122}
    for values in arrays.values():
        values = np.ascontiguousarray(values)
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": values.nbytes})
        accessor = {"bufferView": len(views) - 1, "componentType": kinds[values.dtype.char], "count": len(values)}
        accessors.append(
            accessor | {"type": names[values.shape[1]]} | ({} if values.dtype.kind == "f" else {"normalized": True})
        )
        body += values.tobytes() + b"\0" * (-values.nbytes % 4)
    primitive = {
        "mode": 0,
        "attributes": {name: number for number, name in enumerate(arrays)},
        "extensions": {SPLAT: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}},
    }
    content = {
        "asset": {"version": "2.0", "generator": "by hand"},
        "extensionsUsed": [SPLAT],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **(node or {})}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(body)}],
    }
    return content, body


def glb(content: Mapping[str, Any], body: bytes) -> bytes:
    """The same as one binary file."""
    text = json.dumps(content).encode()
    chunks = b""
    for kind, data, padding in ((b"JSON", text, b" "), (b"BIN\0", body, b"\0")):
        data += padding * (-len(data) % 4)
        chunks += struct.pack("<I4s", len(data), kind) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def gltf_text(content: Mapping[str, Any], body: bytes, uri: str | None = None) -> bytes:
    """The same as text, the buffer inside it or in a file."""
    data = "data:application/octet-stream;base64," + base64.b64encode(body).decode()
    return json.dumps({**content, "buffers": [{"byteLength": len(body), "uri": uri or data}]}).encode()


def save(path: Path, data: bytes) -> Path:
    """Write a file."""
    path.write_bytes(data)
    return path
