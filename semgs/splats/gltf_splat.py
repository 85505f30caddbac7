"""Gaussians in glTF files, with the extension KHR_gaussian_splatting.

Primitives of points with the extension are read, of all nodes of the scene; other meshes are left out. From the specification
(https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_gaussian_splatting): ROTATION is a quaternion (x, y, z, w), SCALE the standard
deviations, OPACITY is 0..1, and SH_DEGREE_d_COEF_n are the harmonics, in the basis of 3DGS, n counted from order -d. glTF has y up; coordinates stay the file's.

Some exporters write logarithms and logits, as PLY has them; see `StoredAs`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64

from semgs.files.errors import InputError
from semgs.files.gltf_container import Container, open_container
from semgs.geometry.gaussians import Appearance, Gaussians, move_gaussians
from semgs.geometry.harmonics import MAX_DEGREE
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.runtime.notes import Kind
from semgs.splats.plain_ply import FEWEST
from semgs.splats.splat import Splat, Usable, check_count, make_gaussians, note_left_out, without_footprints

EXTENSION = "KHR_gaussian_splatting"
KERNEL, COLOURS = "ellipse", "srgb_rec709_display"
SCALE, OPACITY = f"{EXTENSION}:SCALE", f"{EXTENSION}:OPACITY"
WIDTHS = {"POSITION": 3, f"{EXTENSION}:ROTATION": 4, SCALE: 3, OPACITY: 1}

FOOTPRINT = "_FOOTPRINT"
"""The attribute of our own files with the footprints that their scales contain, which are taken away here."""

SMALLEST = 6
"""Bytes of a position of three 16-bit integers."""

SIMILAR = 1e-3
"""How far the axes of a node may be from a rotation times a scale."""

LOGARITHMS = Kind(
    "Scales look like logarithms, not like lengths, and are read as such; --activated yes reads lengths.",
    "Scales look like logarithms, not like lengths, and are read as such.",
)
LOGITS = Kind(
    "Opacities look like logits, not like 0 to 1, and are read as such; --activated yes reads 0 to 1.",
    "Opacities look like logits, not like 0 to 1, and are read as such.",
)
"""What is said if a glTF is read in another way than its specification says."""

_HARMONIC = re.compile(rf"{EXTENSION}:SH_DEGREE_(\d+)_COEF_(\d+)")


@dataclass(frozen=True)
class Part:
    """A primitive of Gaussians in the scene.

    Attributes:
        attributes: accessors by name.
        place: in the file, for errors.
        matrix: from its coordinates to those of the scene.
    """

    attributes: dict[str, Any]
    place: str
    matrix: Float64[np.ndarray, "4 4"]


@dataclass(frozen=True)
class StoredAs:
    """How numbers are stored, by default as in the specification.

    Attributes:
        logarithms: scales are logarithms. They look so if most are negative.
        logits: opacities are logits. They look so if most are outside 0..1, and some are negative.
    """

    logarithms: bool = False
    logits: bool = False


def read_gltf(path: Path, data: bytes, activated: bool | None = None) -> Splat:
    """The splat of a .glb or .gltf file.

    Args:
        path: the file, whose folder may have its buffers.
        data: its bytes.
        activated: whether scales are lengths and opacities are 0 to 1, not logarithms and logits; None for what they look like.

    Raises:
        InputError: it is damaged, has no Gaussians, or they are compressed, have other colours or kernels, or are stretched by a node.
    """
    file = open_container(path, data)
    required = file.content.get("extensionsRequired", [])
    for name in required if isinstance(required, list) else [required]:
        if name != EXTENSION:
            raise InputError(path, f"no required extension but {EXTENSION}", f"{name!r:.60}", "extensionsRequired")
    parts = list(_parts(file))
    if not parts:
        raise InputError(
            path, f"Gaussians ({EXTENSION})", "none in its scene", advice="meshes and point clouds have no Gaussians"
        )
    count = sum(file.count(part.attributes.get("POSITION"), part.place) for part in parts)
    check_count(path, count)
    size = file.size()
    if count * SMALLEST > size:  # objects that are used again and again would need any amount of memory
        raise InputError(path, f"at most {size // SMALLEST:,} Gaussians in {size:,} bytes", f"{count:,}")
    stored = _look(file, parts) if activated is None else StoredAs(not activated, not activated)
    read = [_gaussians(file, part, stored) for part in parts]
    kept = np.concatenate([one.kept for one in read])
    names = set.intersection(*({name for name in part.attributes if name.startswith("_")} for part in parts))
    together, extra = _together([one.gaussians for one in read]), {}
    for name in sorted(names - ({FOOTPRINT} if together.footprints is not None else set())):
        columns = [file.array(part.attributes[name], part.place) for part in parts]
        if all(len(one) == len(usable.kept) for one, usable in zip(columns, read, strict=True)):
            values = np.concatenate(columns)[kept]
            extra[name] = values.squeeze(-1) if columns[0].shape[1] == 1 else values
    generator = file.content["asset"].get("generator")
    said = (generator,) if isinstance(generator, str) else ()
    left_out = note_left_out(len(kept) - len(together), len(kept))
    return Splat(together, "glTF", "y", extra=extra, comments=said).noted(
        *left_out,
        *([LOGARITHMS()] if activated is None and stored.logarithms else []),
        *([LOGITS()] if activated is None and stored.logits else []),
    )


def _look(file: Container, parts: list[Part]) -> StoredAs:
    """How the numbers of all primitives look. Fewer than `FEWEST` are refused if they are not as in the specification."""
    scales, opacities = (
        np.concatenate([_column(file, part, name, WIDTHS[name]) for part in parts]) for name in (SCALE, OPACITY)
    )
    if len(scales) < FEWEST:
        return StoredAs()
    outside = (opacities < 0) | (opacities > 1)
    return StoredAs(bool((scales < 0).mean() > 0.5), bool(outside.mean() > 0.5 and opacities.min() < 0))


def _parts(file: Container) -> Iterator[Part]:
    """The primitives of Gaussians in the scene, in the order of its nodes."""
    scene = file.entry("scenes", file.content.get("scene", 0), "scene")
    waiting = [(index, np.eye(4)) for index in _list(file, scene, "nodes", "scenes")][::-1]
    seen = set()
    while waiting:
        index, above = waiting.pop()
        place = f"nodes[{index!r:.20}]"
        node = file.entry("nodes", index, "nodes")
        if index in seen:
            raise InputError(file.path, "each node once", "one twice", place)
        seen.add(index)
        matrix = above @ _matrix(file, node, place)
        waiting += [(child, matrix) for child in _list(file, node, "children", place)][::-1]
        if "mesh" not in node:
            continue
        mesh = file.entry("meshes", node["mesh"], place)
        place = f"meshes[{node['mesh']}]"
        for number, primitive in enumerate(_list(file, mesh, "primitives", place)):
            extensions = primitive.get("extensions") if isinstance(primitive, dict) else None
            if isinstance(extensions, dict) and EXTENSION in extensions:
                yield _part(file, primitive, f"{place}.primitives[{number}]", matrix)


def _part(file: Container, primitive: dict[str, Any], place: str, matrix: np.ndarray) -> Part:
    """A primitive of Gaussians, of a kind that can be read."""
    settings, attributes = primitive["extensions"][EXTENSION], primitive.get("attributes")
    if not isinstance(settings, dict) or not isinstance(attributes, dict):
        raise InputError(file.path, "objects", f"{settings!r:.40}", place)
    inner = settings.get("extensions")
    if inner:
        name = next(iter(inner)) if isinstance(inner, dict) else inner
        raise InputError(file.path, "Gaussians that are not compressed", f"{name!r:.60}", place)
    for key, wanted in (("kernel", KERNEL), ("colorSpace", COLOURS)):
        if settings.get(key) != wanted:
            raise InputError(file.path, wanted, f"{settings.get(key)!r:.40}", f"{place}.{EXTENSION}.{key}")
    return Part(attributes, place, matrix)


def _gaussians(file: Container, part: Part, stored: StoredAs) -> Usable:
    """The Gaussians of a primitive, in the coordinates of the scene."""
    columns = {name: _column(file, part, name, width) for name, width in WIDTHS.items()}
    degree = _degree(file, part)
    names = [f"{EXTENSION}:SH_DEGREE_{d}_COEF_{n}" for d in range(degree + 1) for n in range(2 * d + 1)]
    harmonics = np.stack([_column(file, part, name, 3).astype(np.float32) for name in names], axis=1)
    means, rotations, scales, opacities = columns.values()
    counts = {len(means), len(rotations), len(scales), len(opacities), len(harmonics)}
    if len(counts) > 1:
        raise InputError(file.path, "attributes of one length", ", ".join(map(str, sorted(counts))), part.place)
    with np.errstate(over="ignore"):
        scales = np.exp(scales) if stored.logarithms else scales
        opacities = 1 / (1 + np.exp(-opacities)) if stored.logits else opacities
    footprints = None
    if FOOTPRINT in part.attributes:
        scales, footprints = without_footprints(scales, _column(file, part, FOOTPRINT, 1)[:, 0].astype(np.float64))
    usable = make_gaussians(
        file.path,
        means=means,
        opacities=opacities[:, 0],
        scales=scales,
        quaternions=np.roll(rotations, 1, axis=-1),
        harmonics=harmonics,
        footprints=footprints,
    )
    return _moved(file.path, usable, part)


def _column(file: Container, part: Part, name: str, width: int) -> np.ndarray:
    """An attribute [n width]."""
    if name not in part.attributes:
        raise InputError(file.path, f"the attribute {name}", "none", part.place)
    values = file.array(part.attributes[name], part.place)
    if values.shape[1] != width:
        raise InputError(file.path, f"{width} numbers for each Gaussian", f"{values.shape[1]}", f"{part.place}.{name}")
    return values


def _degree(file: Container, part: Part) -> int:
    """The highest degree of the harmonics of a primitive."""
    found = [_HARMONIC.fullmatch(name) for name in part.attributes]
    degree = max((int(match[1]) for match in found if match and len(match[1]) < 9), default=0)
    if degree > MAX_DEGREE:
        raise InputError(file.path, "harmonics of degree 0 to 3", f"degree {degree}", part.place)
    return degree


def _moved(path: Path, usable: Usable, part: Part) -> Usable:
    """Gaussians in the coordinates of the scene."""
    axes, gaussians = part.matrix[:3, :3], usable.gaussians
    if np.array_equal(part.matrix, np.eye(4)):
        return usable
    with np.errstate(all="ignore"):
        scale = np.cbrt(np.linalg.det(axes))
        similar = scale > 0 and np.abs(axes / scale @ (axes / scale).T - np.eye(3)).max() <= SIMILAR
    if not similar or not np.isfinite(part.matrix).all():
        raise InputError(path, "nodes that turn, move and scale evenly", "one that stretches or mirrors", part.place)
    rigid = torch.eye(4, dtype=torch.float64)
    rigid[:3, :3], rigid[:3, 3] = torch.from_numpy(axes / scale), torch.from_numpy(part.matrix[:3, 3])
    moved = move_gaussians(rigid, gaussians, scale=float(scale))
    checked = make_gaussians(
        path,
        means=float(scale) * gaussians.means.double().numpy() @ rigid[:3, :3].numpy().T + rigid[:3, 3].numpy(),
        opacities=moved.opacities.numpy(),
        scales=moved.colour.scales.numpy(),
        quaternions=moved.colour.quaternions.numpy(),
        harmonics=moved.colour.features.numpy(),
        footprints=None if moved.footprints is None else moved.footprints.numpy(),
    )
    kept = usable.kept.copy()
    kept[kept] = checked.kept
    return Usable(checked.gaussians, kept)


def _together(parts: list[Gaussians]) -> Gaussians:
    """The Gaussians of all primitives, with harmonics of the highest degree that one has."""
    if len(parts) == 1:
        return parts[0]
    most = max(one.colour.features.shape[1] for one in parts)
    features = [
        torch.nn.functional.pad(one.colour.features, (0, 0, 0, most - one.colour.features.shape[1])) for one in parts
    ]
    footprints = [one.footprints for one in parts if one.footprints is not None]
    return Gaussians(
        means=torch.cat([one.means for one in parts]),
        opacities=torch.cat([one.opacities for one in parts]),
        colour=Appearance(
            torch.cat([one.colour.quaternions for one in parts]),
            torch.cat([one.colour.scales for one in parts]),
            torch.cat(features),
        ),
        footprints=torch.cat(footprints) if len(footprints) == len(parts) else None,
    )


def _matrix(file: Container, node: dict[str, Any], place: str) -> Float64[np.ndarray, "4 4"]:
    """From the coordinates of a node to those above it."""
    matrix = np.eye(4)
    if "matrix" in node:
        return _numbers(file, node, "matrix", place, matrix.ravel()).reshape(4, 4).T
    x, y, z, w = _numbers(file, node, "rotation", place, np.array([0.0, 0.0, 0.0, 1.0]))
    length = float(np.sqrt(x * x + y * y + z * z + w * w))
    if not 0.5 < length < 2:
        raise InputError(file.path, "a quaternion of unit length", f"length {length:g}", f"{place}.rotation")
    turn = matrix_from_quaternion(torch.tensor([w, x, y, z], dtype=torch.float64) / length).numpy()
    matrix[:3, :3] = turn * _numbers(file, node, "scale", place, np.ones(3))
    matrix[:3, 3] = _numbers(file, node, "translation", place, np.zeros(3))
    return matrix


def _numbers(file: Container, node: dict[str, Any], key: str, place: str, default: np.ndarray) -> np.ndarray:
    """A list of finite numbers."""
    value = node.get(key)
    if value is None:
        return default
    good = isinstance(value, list) and len(value) == len(default) and all(type(one) in (int, float) for one in value)
    numbers = np.array(value, np.float64) if good else np.array([np.nan])
    if not np.isfinite(numbers).all():
        raise InputError(file.path, f"{len(default)} finite numbers", f"{value!r:.40}", f"{place}.{key}")
    return numbers


def _list(file: Container, entry: dict[str, Any], key: str, place: str) -> list[Any]:
    """A list; empty if it is missing."""
    value = entry.get(key, [])
    if not isinstance(value, list):
        raise InputError(file.path, "a list", f"{value!r:.40}", f"{place}.{key}")
    return value
