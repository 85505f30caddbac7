"""PLY files of the first 3DGS implementation and of everything that writes like it.

The element `vertex` has, in any order and of any type of numbers: x y z, f_dc_0..2 (the constant harmonics of red, green and blue), opacity (logit),
scale_0..2 (natural logarithm), rot_0..3 (w, x, y, z), and 0, 9, 24 or 45 properties f_rest: all higher harmonics of red, then green, then blue.
Source: https://github.com/graphdeco-inria/gaussian-splatting (scene/gaussian_model.py, save_ply). nx ny nz are left out if they are zero, as 3DGS writes them.

Mip-Splatting, and what follows it (Gaussian Opacity Fields, RaDe-GS), write Gaussians without their 3D smoothing filter, and its standard deviation as filter_3D. It is
applied here, as they do before they render: with squares s of the standard deviations and f of the filter, these become s + f, and opacities are multiplied by
sqrt(prod(s) / prod(s + f)), so that the Gaussian keeps its integral. Source: https://github.com/autonomousvision/mip-splatting (scene/gaussian_model.py, save_fused_ply).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from semgs.data.ply_tables import PlyTables
from semgs.files.errors import InputError
from semgs.splats.splat import DEGREES, Splat, check_all, check_count, make_gaussians, without_footprints

POSITION = ("x", "y", "z")
CONSTANT = ("f_dc_0", "f_dc_1", "f_dc_2")
SCALES = ("scale_0", "scale_1", "scale_2")
ROTATION = ("rot_0", "rot_1", "rot_2", "rot_3")
NORMAL = ("nx", "ny", "nz")
NEEDED = (*POSITION, *CONSTANT, "opacity", *SCALES, *ROTATION)
FILTER = "filter_3D"
FOOTPRINT = "SemGS: scales contain the blur of a pixel; its variance is nx"
"""The comment of our own files whose scales contain footprints, which are taken away here."""

VERTEX = "vertex"

Columns = Mapping[str, np.ndarray]

FILTERED = (f"its smoothing filter ({FILTER}, Mip-Splatting) is applied",)
"""What is said of a file that has one."""


def read_plain_ply(path: Path, ply: PlyTables) -> Splat:
    """The splat of a 3DGS PLY.

    Infinite logits, which other programs write for opacities of 0 and 1, are read as these.

    Args:
        path: the file, for errors.
        ply: its tables.

    Raises:
        InputError: it is a mesh, a point cloud or another kind of PLY, or its numbers are no Gaussians.
    """
    columns = ply.tables.get(VERTEX, {})
    missing = [name for name in NEEDED if name not in columns]
    if missing:
        raise InputError(
            path, "a PLY of 3D Gaussians", _kind(ply, missing), advice="meshes and point clouds have no Gaussians"
        )
    check_count(path, ply.counts[VERTEX], "element vertex")
    rest = rest_names(path, columns)
    logits, logs = together(columns, ("opacity",))[:, 0], together(columns, SCALES)
    check_all(path, "opacity", logits, ~np.isnan(logits), "a number")
    check_all(path, "scale", logs, ~np.isnan(logs), "a number")
    with np.errstate(over="ignore"):
        scales, opacities = np.exp(logs), 1 / (1 + np.exp(-logits))
    if FILTER in columns:
        scales, opacities = _filtered(path, scales, opacities, together(columns, (FILTER,)))
    footprints = None
    if FOOTPRINT in ply.comments and NORMAL[0] in columns:
        scales, footprints = without_footprints(scales, together(columns, NORMAL[:1])[:, 0])
    gaussians = make_gaussians(
        path,
        means=together(columns, POSITION),
        opacities=opacities,
        scales=scales,
        quaternions=together(columns, ROTATION),
        harmonics=by_coefficient(columns, rest, CONSTANT),
        footprints=footprints,
    )
    no_normals = footprints is not None or not any(columns[name].any() for name in NORMAL if name in columns)
    known = {*NEEDED, FILTER, *rest, *(NORMAL if no_normals else ())}
    return Splat(
        gaussians,
        "PLY",
        "-y",
        extra={name: np.array(values) for name, values in columns.items() if name not in known},
        comments=(
            *(one for one in ply.comments if one != FOOTPRINT),
            *(FILTERED if FILTER in columns else ()),
            *_not_read(ply, (VERTEX,)),
        ),
    )


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
    columns = ply.tables.get(VERTEX)
    if columns is None:
        return f"elements {', '.join(ply.tables) or '(none)'}"
    if not any(name in columns for name in (*CONSTANT, "opacity", *SCALES, *ROTATION)):
        return "a point cloud" if all(name in columns for name in POSITION) else "another kind of PLY"
    return f"none of the properties {', '.join(missing[:4])}"


def _not_read(ply: PlyTables, known: tuple[str, ...]) -> list[str]:
    """A line for each element that is not read."""
    return [f"element {name} ({count:,} rows) was not read" for name, count in ply.counts.items() if name not in known]
