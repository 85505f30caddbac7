"""PLY files of Gaussians for 3DGS viewers.

The layout is that of the first 3DGS implementation, to the byte: binary little endian, float32
properties x y z, nx ny nz (zero), f_dc_0..2, f_rest_0..44, opacity (logit), scale_0..2 (log), rot_0..3 (w, x, y, z).
f_rest holds the harmonics above degree 0 channel by channel: 15 of red, 15 of green, 15 of blue.

Viewers blur by their own pixels, whose size is not known here, so scales contain the Gaussians' footprints. Each is also in nx, which viewers of splats do not read, and a comment
says so: `read_plain_ply` takes it away again. Gaussians without footprints have zeros there, and the file has no comment.

All 45 f_rest are always written, zero beyond the degree. Of the viewers we looked at, some read exactly these 62 floats by position
(the first 3DGS viewer, 3DGS.cpp), some look up f_rest by name (splatapult), and some accept only 0 or 45 of them (splatviz). None
refuses 45. This costs 180 bytes per Gaussian.

The coordinates are those of the Gaussians; PLY has no field that says which. Commands turn scenes upright first, and write the matrix back to
export.json (`semgs.export.export_record`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from semgs.data.ply_tables import write_ply
from semgs.data.tables.classes import ClassTable
from semgs.figures.class_images import UNKNOWN_GREY
from semgs.files.errors import check_type
from semgs.files.paths import typed_path
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.harmonics import DEGREE_0
from semgs.rendering.rendering import class_numbers
from semgs.splats.plain_ply import FOOTPRINT

_FULL = 15  # harmonics above degree 0, per channel, at degree 3
_SMALLEST_SCALE = 1e-20  # the log of 0, for a flat Gaussian, is not finite; this renders the same
_SMALLEST_OPACITY = 1e-7  # the same for the logits of 0 and 1


def save_ply(
    path: str | Path,
    gaussians: Gaussians,
    extra: Mapping[str, np.ndarray] | None = None,
    comments: Sequence[str] = (),
) -> None:
    """Write the colour Gaussians as a plain 3DGS PLY, in their order.

    Opacities are clamped to 1e-7 from 0 and 1, where the logit is not finite, and scales to at least 1e-20.

    Args:
        path: the file.
        gaussians: of one scene, without a batch axis.
        extra: further properties by name, after the others, a number for each Gaussian: uint8 as `uchar`, all others as `float`. Viewers that read
            62 floats by position cannot read such a file.
        comments: lines of the header; line ends in them become spaces.

    Raises:
        ValueError: they have a batch axis, or a number is not finite, or a further property has another count or a name that is taken.
        OSError: the file cannot be written.
    """
    Gaussians.check_type(gaussians)
    _write(path, gaussians, gaussians.colour, extra or {}, comments)


def save_semantic_ply(path: str | Path, gaussians: Gaussians, classes: ClassTable) -> None:
    """Write the semantic Gaussians as a plain 3DGS PLY: with their own shapes, in the colour of their likeliest class; light grey without one.

    The order is that of `save_ply`. Colours do not depend on the viewing direction.

    Args:
        path: the file.
        gaussians: of one scene, without a batch axis.
        classes: the table of their class distributions.

    Raises:
        ValueError: as for `save_ply`; or the Gaussians have no classes, or another number than the table.
        OSError: the file cannot be written.
    """
    Gaussians.check_type(gaussians)
    check_type("classes are", classes, ClassTable, "a class table, such as encoding.classes or load_scene(...).classes")
    if gaussians.semantic is None:
        raise ValueError("the Gaussians have no classes; expected those of a model with a semantic branch")
    if gaussians.semantic.features.shape[-1] != len(classes):
        raise ValueError(
            f"the Gaussians have {gaussians.semantic.features.shape[-1]} classes; "
            f"expected the {len(classes)} of table {classes.name}"
        )
    colours = torch.tensor([*classes.colours, UNKNOWN_GREY], dtype=torch.float32) / 255
    labels = class_numbers(gaussians.semantic.features).cpu().clamp(max=len(classes))
    harmonics = ((colours[labels] - 0.5) / DEGREE_0)[..., None, :]
    _write(path, gaussians, Appearance(gaussians.semantic.quaternions, gaussians.semantic.scales, harmonics))


_NAMES = (
    *("x", "y", "z", "nx", "ny", "nz"),
    *(f"f_dc_{i}" for i in range(3)),
    *(f"f_rest_{i}" for i in range(3 * _FULL)),
    "opacity",
    *(f"scale_{i}" for i in range(3)),
    *(f"rot_{i}" for i in range(4)),
)
"""The properties in their order."""


def _column(footprints: Float[Tensor, " g"] | None, means: Float64[Tensor, "g 3"]) -> Float64[Tensor, "g 1"]:
    """Footprints as a column; zeros without them."""
    return torch.zeros_like(means[:, :1]) if footprints is None else footprints.detach().to(means)[:, None]


def _write(
    path: str | Path,
    gaussians: Gaussians,
    shape: Appearance,
    extra: Mapping[str, np.ndarray] = MappingProxyType({}),
    comments: Sequence[str] = (),
) -> None:
    """Write positions and opacities with the shapes and harmonics of one branch."""
    path = typed_path(path)
    footprints = gaussians.footprints
    if footprints is not None:
        shape = replace(shape, scales=(shape.scales.double().square() + footprints.double()[..., None]).sqrt())
        comments = (*comments, FOOTPRINT)
    if gaussians.means.ndim != 2:
        raise ValueError(f"means are {tuple(gaussians.means.shape)}; a PLY holds one scene, expected [g 3]")
    means, opacities, quaternions, scales, harmonics = (
        tensor.detach().to("cpu", torch.float64)
        for tensor in (gaussians.means, gaussians.opacities, shape.quaternions, shape.scales, shape.features)
    )
    full = harmonics.new_zeros(len(means), 1 + _FULL, 3)
    full[:, : harmonics.shape[1]] = harmonics
    rows = torch.cat(
        (
            means,
            torch.nn.functional.pad(_column(footprints, means), (0, 2)),
            full[:, 0],
            full[:, 1:].mT.flatten(1),
            opacities.clamp(_SMALLEST_OPACITY, 1 - _SMALLEST_OPACITY).logit()[:, None],
            scales.clamp(min=_SMALLEST_SCALE).log(),
            torch.nn.functional.normalize(quaternions, dim=-1),
        ),
        dim=1,
    ).numpy()
    if not np.isfinite(rows).all():
        row, column = np.argwhere(~np.isfinite(rows))[0]
        raise ValueError(f"{_NAMES[column]} of Gaussian {row} is {rows[row, column]}; expected a finite number")
    columns = {name: rows[:, place] for place, name in enumerate(_NAMES)}
    for name, values in extra.items():
        if name in columns or values.shape != (len(rows),):
            raise ValueError(f"{name} is {values.shape}; expected a further property with {len(rows)} numbers")
        columns[name] = values
    write_ply(path, columns, comments)
