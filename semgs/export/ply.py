"""PLY files of Gaussians as every 3DGS viewer reads them.

The layout is that of the first 3DGS implementation, to the byte: binary little endian, no comment lines, float32
properties x y z, nx ny nz (zero), f_dc_0..2, f_rest_0..44, opacity (logit), scale_0..2 (log), rot_0..3 (w, x, y, z).
f_rest holds the harmonics above degree 0 channel by channel: 15 of red, 15 of green, 15 of blue.

All 45 f_rest are written whatever the degree, zero where there is none: of the viewers looked at, some read exactly
these 62 floats by position (the first one itself, 3DGS.cpp), some ask for f_rest by name (splatapult), some know 0 and 45 only
(splatviz); none refuses 45. It costs 180 bytes a Gaussian.

Positions are float32, and so relative to `origin` of a scene that is far from that of its coordinates (`semgs.data.scene`); report.json and
`scene.safetensors` hold the origin, which a PLY has no place for.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch

from semgs.data.classes import ClassTable
from semgs.files.atomic import write_bytes
from semgs.geometry.gaussians import Appearance, Gaussians

DEGREE_0 = math.sqrt(1 / (4 * math.pi))
"""The constant harmonic Y_00: a colour c in 0..1 is the coefficient (c - 0.5) / DEGREE_0."""

_FULL = 15  # harmonics above degree 0, per channel, at degree 3
_SMALLEST_SCALE = 1e-20  # log of a flat Gaussian's zero is not finite; this draws the same
_SMALLEST_OPACITY = 1e-7  # likewise the logits of 0 and 1


def save_ply(path: str | Path, gaussians: Gaussians) -> None:
    """Write the colour Gaussians as a plain 3DGS PLY, in their order.

    Opacities are held 1e-7 away from 0 and 1, where their logit is not finite, scales at 1e-20 or more.

    Args:
        path: the file.
        gaussians: of one scene, without a batch axis.

    Raises:
        ValueError: they have a batch axis, or a number in them is not finite.
        OSError: the file cannot be written.
    """
    _write(path, gaussians, gaussians.colour)


def save_semantic_ply(path: str | Path, gaussians: Gaussians, classes: ClassTable) -> None:
    """Write the semantic Gaussians as a plain 3DGS PLY: their own shapes, each in the colour of its likeliest class.

    The file has the same order as `save_ply`'s, and colours that do not depend on the viewing direction.

    Args:
        path: the file.
        gaussians: of one scene, without a batch axis.
        classes: the table of their class distributions.

    Raises:
        ValueError: as `save_ply`; they have no classes, or not those of the table.
        OSError: the file cannot be written.
    """
    if gaussians.semantic is None:
        raise ValueError("the Gaussians have no classes; expected those of a model with a semantic branch")
    if gaussians.semantic.features.shape[-1] != len(classes):
        raise ValueError(
            f"the Gaussians have {gaussians.semantic.features.shape[-1]} classes; "
            f"expected the {len(classes)} of table {classes.name}"
        )
    colours = torch.tensor(classes.colours, dtype=torch.float32) / 255
    labels = gaussians.semantic.features.detach().argmax(-1).cpu()
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


def _write(path: str | Path, gaussians: Gaussians, shape: Appearance) -> None:
    """Write positions and opacities with the shapes and harmonics of one branch."""
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
            torch.zeros_like(means),
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
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    header += [f"property float {name}" for name in _NAMES] + ["end_header"]
    write_bytes(path, "\n".join(header).encode() + b"\n" + rows.astype("<f4").tobytes())
