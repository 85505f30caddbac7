"""Splats of other programs, as the tests' own writers write them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fuzz.format import Seed


def plain(order: str, degree: int = 1, kind: str = "float") -> Seed:
    """A 3DGS PLY of three Gaussians."""

    def write(folder: Path) -> Path:
        from splat_files import columns_3dgs, known_row, ply, save

        rows = [known_row(degree, x=float(number), nx=0.0, ny=0.0, nz=0.0) for number in range(3)]
        columns = columns_3dgs(rows, kind) | {"instance": ("int", [0, 1, 2])}
        return save(folder / "room.ply", ply({"vertex": columns}, order, "made"))

    return write


def compressed(folder: Path) -> Path:
    from splat_files import compressed_ply, save

    draw = np.random.default_rng(0)
    packed = [tuple(int(number) for number in row) for row in draw.integers(0, 2**32, (5, 4))]
    harmonics = draw.integers(0, 256, (5, 9)).tolist()
    return save(folder / "room.compressed.ply", compressed_ply(packed, [{"min_x": -2.0}], harmonics))


def spz_of(version: int) -> Seed:
    """An SPZ of two Gaussians."""

    def write(folder: Path) -> Path:
        import struct

        from splat_files import save, spz, spz_blocks

        camera = struct.pack("<II3f", 0xADBE0002, 12, 0, 1, 2)
        data = spz(
            version, spz_blocks(version), flags=2 if version > 2 else 0, extensions=camera if version > 2 else b""
        )
        return save(folder / "room.spz", data)

    return write


def gltf_of(form: str) -> Seed:
    """A glTF of one Gaussian below a turned node."""

    def write(folder: Path) -> Path:
        from splat_files import glb, gltf, gltf_arrays, gltf_text, save

        content, body = gltf(
            gltf_arrays(), {"rotation": [0.6, 0, 0, 0.8], "scale": [2, 2, 2], "translation": [1, 2, 3]}
        )
        if form == "glb":
            return save(folder / "room.glb", glb(content, body))
        if form == "text":
            return save(folder / "room.gltf", gltf_text(content, body))
        save(folder / "room.bin", body)
        return save(folder / "room.gltf", gltf_text(content, body, "room.bin"))

    return write


def nerfstudio(folder: Path) -> Path:
    """The frame in which a splat was trained."""
    import json

    from splat_files import save

    frame = {"transform": [[0.0, -1, 0, 0.5], [1, 0, 0, -2], [0, 0, 1, 3]], "scale": 0.25}
    return save(folder / "dataparser_transforms.json", json.dumps(frame).encode())


def read_splat(path: Path, out: Path, changed: Sequence[str]) -> None:
    """Read a splat; what was read is in its ranges."""
    from semgs.splats.load import load_splat
    from semgs.splats.nerfstudio_frame import read_trained_frame

    if path.suffix == ".json":
        read_trained_frame(path, np.eye(4)[:3], 2.0)
        return
    splat = load_splat(path)
    splat.gaussians.checked()
    assert len(splat) > 0
    assert all(len(values) == len(splat) for values in splat.extra.values())


PLAIN = (
    plain("binary_little_endian"), plain("binary_big_endian", 0, "double"), plain("ascii"), plain("binary_little_endian", 3), compressed,
)  # fmt: skip
SPZ = (spz_of(2), spz_of(3), spz_of(4))
GLTF = (gltf_of("glb"), gltf_of("text"), gltf_of("beside"), nerfstudio)
