"""PLY files of the first 3DGS implementation and of everything that writes like it.

The element `vertex` has, in any order and of any type of numbers: x y z, f_dc_0..2 (the constant harmonics of red, green and blue), opacity (logit),
scale_0..2 (natural logarithm), rot_0..3 (w, x, y, z), and 0, 9, 24 or 45 properties f_rest: all higher harmonics of red, then green, then blue.
Source: https://github.com/graphdeco-inria/gaussian-splatting (scene/gaussian_model.py, save_ply). nx ny nz are left out if they are zero, as 3DGS writes them.

CloudCompare keeps what it does not know as scalar fields, and writes their names with a prefix: scalar_opacity, in older versions scal_opacity.

nerfstudio's ns-export gaussian-splat --ply-color-mode rgb writes red, green and blue as bytes in place of f_dc. Some exporters write scales and opacities as they are used,
not as logarithms and logits; see `look_like_lengths` and `look_like_shares`.

Mip-Splatting, and what follows it (Gaussian Opacity Fields, RaDe-GS), write Gaussians without their 3D smoothing filter, and its standard deviation as filter_3D. It is
applied here, as they do before they render: with squares s of the standard deviations and f of the filter, these become s + f, and opacities are multiplied by
sqrt(prod(s) / prod(s + f)), so that the Gaussian keeps its integral. Source: https://github.com/autonomousvision/mip-splatting (scene/gaussian_model.py, save_fused_ply).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from pathlib import Path

import numpy as np
from jaxtyping import Float

from semgs.data.ply_tables import VERTEX, PlyTables
from semgs.files.errors import InputError
from semgs.geometry.harmonics import DEGREE_0
from semgs.runtime.notes import Kind
from semgs.splats.splat import (
    DEGREES,
    Splat,
    check_all,
    check_count,
    make_gaussians,
    note_left_out,
    without_footprints,
)

POSITION = ("x", "y", "z")
CONSTANT = ("f_dc_0", "f_dc_1", "f_dc_2")
SCALES = ("scale_0", "scale_1", "scale_2")
ROTATION = ("rot_0", "rot_1", "rot_2", "rot_3")
NORMAL = ("nx", "ny", "nz")
NEEDED = (*POSITION, *CONSTANT, "opacity", *SCALES, *ROTATION)
FILTER = "filter_3D"
FOOTPRINT = "SemGS: scales contain the blur of a pixel; its variance is nx"
"""The comment of our own files whose scales contain footprints, which are taken away here."""

PREFIXES = ("scalar_", "scal_")
"""What CloudCompare writes before the names of properties."""

FACE = "face"
"""The element of a mesh."""

BYTES = ("red", "green", "blue")
ANCHORS = ("f_anchor_feat_", "f_offset_")
"""How the names of properties begin that make a vertex an anchor. https://github.com/city-super/Scaffold-GS (scene/gaussian_model.py, save_ply)."""

FEWEST, SAMPLED = 50, 1000
"""Fewer Gaussians than the first do not show how their numbers are meant; neighbours of so many as the second are looked at."""
LARGE = 1.5
"""Gaussians are seldom so many times as large as the distance to their nearest neighbour."""

LENGTHS = Kind(
    "Scales look like lengths, not like logarithms, and are read as such; --activated no reads logarithms.",
    "Scales look like lengths, not like logarithms, and are read as such.",
)
SHARES = Kind(
    "Opacities look like 0 to 1, not like logits, and are read as such; --activated no reads logits.",
    "Opacities look like 0 to 1, not like logits, and are read as such.",
)
"""What is said if a PLY is read in another way than its format says."""

Columns = Mapping[str, np.ndarray]

FILTERED = (f"its smoothing filter ({FILTER}, Mip-Splatting) is applied",)
"""What is said of a file that has one."""


def read_plain_ply(path: Path, ply: PlyTables, activated: bool | None = None) -> Splat:
    """The splat of a 3DGS PLY.

    Infinite logits, which other programs write for opacities of 0 and 1, are read as these.

    Args:
        path: the file, for errors.
        ply: its tables.
        activated: whether scales are lengths and opacities are 0 to 1, not logarithms and logits; None for what they look like.

    Raises:
        InputError: it is a mesh, a point cloud or another kind of PLY, or its numbers are no Gaussians.
    """
    columns = _with_constants(_without_prefixes(ply.tables.get(VERTEX, {})))
    missing = [name for name in NEEDED if name not in columns]
    if missing:
        raise InputError(path, "a PLY of 3D Gaussians", _kind(ply, missing), advice=_remedy(columns, missing))
    check_count(path, ply.counts[VERTEX], "element vertex")
    rest = rest_names(path, columns)
    means = together(columns, POSITION)
    opacities, scales = together(columns, ("opacity",))[:, 0], together(columns, SCALES)
    lengths = look_like_lengths(scales, means) if activated is None else activated
    shares = look_like_shares(opacities) if activated is None else activated
    with np.errstate(over="ignore"):
        scales = scales if lengths else np.exp(scales)
        opacities = opacities if shares else 1 / (1 + np.exp(-opacities))
    if FILTER in columns:
        scales, opacities = _filtered(path, scales, opacities, together(columns, (FILTER,)))
    footprints = None
    if FOOTPRINT in ply.comments and NORMAL[0] in columns:
        scales, footprints = without_footprints(scales, together(columns, NORMAL[:1])[:, 0])
    usable = make_gaussians(
        path,
        means=means,
        opacities=opacities,
        scales=scales,
        quaternions=together(columns, ROTATION),
        harmonics=by_coefficient(columns, rest, CONSTANT),
        footprints=footprints,
    )
    no_normals = footprints is not None or not any(columns[name].any() for name in NORMAL if name in columns)
    known = {*NEEDED, FILTER, *rest, *(NORMAL if no_normals else ())}
    return Splat(
        usable.gaussians,
        "PLY",
        "-y",
        extra={name: values[usable.kept] for name, values in columns.items() if name not in known},
        comments=(
            *(one for one in ply.comments if one != FOOTPRINT),
            *(FILTERED if FILTER in columns else ()),
            *_not_read(ply, (VERTEX,)),
        ),
    ).noted(
        *note_left_out(len(means) - len(usable.gaussians), len(means)),
        *([LENGTHS()] if activated is None and lengths else []),
        *([SHARES()] if activated is None and shares else []),
    )


def look_like_lengths(scales: Float[np.ndarray, "g 3"], means: Float[np.ndarray, "g 3"]) -> bool:
    """Whether scales of a PLY look like standard deviations, not like their logarithms: none is negative, so that all Gaussians would be one unit large or
    more, and they would be much larger than the distances between neighbours."""
    known = np.isfinite(scales).all(-1) & np.isfinite(means).all(-1)
    if np.count_nonzero(known) < FEWEST or not (scales[known] >= 0).all() or not scales[known].any():
        return False
    from scipy.spatial import cKDTree

    distances, _ = cKDTree(means[known]).query(means[known][:: 1 + np.count_nonzero(known) // SAMPLED], k=2)
    with np.errstate(over="ignore"):
        return bool(np.exp(np.median(scales[known].max(-1))) > LARGE * np.median(distances[:, 1]))


def look_like_shares(opacities: Float[np.ndarray, " g"]) -> bool:
    """Whether opacities of a PLY look like 0 to 1, not like logits: these would all be within 0.5 to 0.73."""
    known = opacities[~np.isnan(opacities)]
    return bool(len(known) >= FEWEST and known.min() >= 0 and 0 < known.max() <= 1)


def _without_prefixes(columns: Columns) -> Columns:
    """Columns with the names that they had before CloudCompare wrote them; a name that is there already stays another's."""
    names = {name: reduce(str.removeprefix, PREFIXES, name) for name in columns}
    return {name if plain in columns else plain: columns[name] for name, plain in names.items()}


def _with_constants(columns: Columns) -> Columns:
    """Columns with the constant harmonics of the colours that nerfstudio writes as bytes, if it does."""
    if not all(name in columns and columns[name].dtype == np.uint8 for name in BYTES) or CONSTANT[0] in columns:
        return columns
    constants = {name: (columns[byte] / 255 - 0.5) / DEGREE_0 for name, byte in zip(CONSTANT, BYTES, strict=True)}
    return {name: values for name, values in columns.items() if name not in BYTES} | constants


def _filtered(
    path: Path, scales: np.ndarray, opacities: np.ndarray, deviations: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviations [g 3] and opacities [g] after the smoothing filter, whose standard deviations are [g 1]."""
    check_all(path, FILTER, deviations, np.isfinite(deviations) & (deviations >= 0), "a finite number, 0 or more")
    with np.errstate(over="ignore", invalid="ignore"):
        wider = np.hypot(scales, deviations)
        shares = np.where(wider > 0, scales / wider, 1)  # the filter of a flat Gaussian may be 0
    return wider, opacities * shares.prod(-1)


def together(columns: Columns, names: tuple[str, ...]) -> np.ndarray:
    """Some columns side by side [g n], as float64."""
    return np.stack([columns[name] for name in names], axis=-1, dtype=np.float64, casting="unsafe")


def rest_names(path: Path, columns: Columns) -> tuple[str, ...]:
    """The names of the harmonics above degree 0, in their order.

    Raises:
        InputError: they are not those of a degree from 0 to 3.
    """
    count = sum(name.startswith("f_rest_") for name in columns)
    names = tuple(f"f_rest_{number}" for number in range(count))
    if count not in DEGREES or not all(name in columns for name in names):
        found = ", ".join(sorted(name for name in columns if name.startswith("f_rest_"))[:3])
        raise InputError(path, "0, 9, 24 or 45 properties f_rest_0, f_rest_1, ...", f"{count} ({found}, ...)")
    return names


def by_coefficient(columns: Columns, rest: tuple[str, ...], constant: tuple[str, ...] = ()) -> np.ndarray:
    """Harmonics as float32 [g k 3].

    Args:
        columns: of the Gaussians.
        rest: names of those above degree 0, one channel after the other.
        constant: names of the constant ones of the three channels; none to leave them out.
    """
    first, per_channel = len(constant) // 3, len(rest) // 3
    places = [(0, channel, name) for channel, name in enumerate(constant)]
    places += [(first + number % per_channel, number // per_channel, name) for number, name in enumerate(rest)]
    harmonics = np.empty((len(columns[places[0][2]]), first + per_channel, 3), np.float32)
    with np.errstate(over="ignore"):
        for coefficient, channel, name in places:
            harmonics[:, coefficient, channel] = columns[name]
    return harmonics


def _kind(ply: PlyTables, missing: list[str]) -> str:
    """What a PLY is that lacks some properties."""
    if VERTEX not in ply.tables:
        return f"elements {', '.join(ply.tables) or '(none)'}"
    columns = _without_prefixes(ply.tables[VERTEX])
    if not any(name in columns for name in (*CONSTANT, "opacity", *SCALES, *ROTATION)):
        if FACE in ply.counts:
            return "a mesh"
        return "a point cloud" if all(name in columns for name in POSITION) else "another kind of PLY"
    return f"none of the properties {', '.join(missing[:4])}"


def _remedy(columns: Columns, missing: list[str]) -> str:
    """What to do about a PLY that lacks some properties."""
    if any(name.startswith(ANCHORS) for name in columns):
        return (
            "it has anchors (Scaffold-GS, Octree-GS and the like), whose Gaussians come from networks: export these with the program that trained it, "
            "or train with plain 3DGS"
        )
    if missing == [SCALES[2]]:
        return "2D Gaussians (2DGS) are flat and lack it: add it, such as -10 for each, or train with 3DGS"
    if missing == [*CONSTANT]:
        if all(name in columns for name in BYTES):
            return "export colours as harmonics: ns-export gaussian-splat --ply-color-mode sh_coeffs"
        return "it has Gaussians without colours: export them as harmonics with the program that trained it"
    return "meshes and point clouds have no Gaussians"


def _not_read(ply: PlyTables, known: tuple[str, ...]) -> list[str]:
    """A line for each element that is not read."""
    return [f"element {name} ({count:,} rows) was not read" for name, count in ply.counts.items() if name not in known]
