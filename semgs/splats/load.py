"""Opens a splat of another program, of any of the formats."""

from __future__ import annotations

from pathlib import Path

from semgs.data.ply_tables import MAGIC, read_tables
from semgs.files.contents import read_bytes, refuse_checkpoint
from semgs.files.errors import InputError
from semgs.files.gltf_container import is_gltf
from semgs.files.paths import trained_splat, typed_path
from semgs.splats.compressed_ply import is_compressed, read_compressed_ply
from semgs.splats.endings import OTHERS
from semgs.splats.gltf_splat import read_gltf
from semgs.splats.plain_ply import read_plain_ply
from semgs.splats.splat import Splat
from semgs.splats.spz import is_spz, read_spz

EXPECTED = "a splat: PLY, compressed PLY, SPZ, or glTF with KHR_gaussian_splatting"


def load_splat(path: str | Path, activated: bool | None = None) -> Splat:
    """Read the Gaussians of another program: 3DGS PLY, compressed PLY of SuperSplat, SPZ of versions 2 to 4, or glTF with KHR_gaussian_splatting.

    The content decides what the format is. Coordinates are those of the file; SPZ comes with y down, as other programs convert it to PLY.

    Gaussians with a number that is not valid are left out if they are few, as trainings leave some; `Splat.notes` counts them.

    Args:
        path: the file.
        activated: as for `read_plain_ply` and `read_gltf`; other formats say it.

    Raises:
        InputError: it is missing, no splat, damaged, or many numbers in it are not valid. The error names the first one.
        ImportError: it is SPZ of version 4, and zstandard is not installed.
    """
    file = typed_path(path)
    if not file.is_file():
        trained = trained_splat(file) if file.is_dir() else None
        advice = None if trained is None else f"the splat of this training is {trained}"
        raise InputError(file, EXPECTED, "no such file" if not file.exists() else "no file", advice=advice)
    refuse_checkpoint(file, EXPECTED)
    data = read_bytes(file, EXPECTED)
    if data[:4] in (MAGIC + b"\n", MAGIC + b"\r"):
        ply = read_tables(file, data)
        return read_compressed_ply(file, ply) if is_compressed(ply) else read_plain_ply(file, ply, activated)
    if is_spz(data):
        return read_spz(file, data)
    if is_gltf(data):
        return read_gltf(file, data, activated)
    kind = OTHERS.get(file.suffix.lower()) if data else None
    advice = None if kind is None else f"convert it first: splat-transform {file.name} {file.stem}.ply"
    raise InputError(file, EXPECTED, kind or ("another kind of file" if data else "an empty file"), advice=advice)
