"""PLY files of Gaussians as every 3DGS viewer reads them, and our own strict reader of them.

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
from semgs.files.errors import InputError
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


write_ply, write_semantic_ply = save_ply, save_semantic_ply
"""Their names before they were called as `save_scene` is."""


def read_ply(path: str | Path) -> Gaussians:
    """Read a PLY of the layout above, as activated float32 quantities (reckoned in float64), without classes.

    Files of lower degree with fewer f_rest (0, 9 or 24) are read as well.

    Raises:
        InputError: the file is missing, of another layout, shorter or longer than its header says, or has a Gaussian without axes.
    """
    try:
        content = Path(path).read_bytes()
    except (FileNotFoundError, IsADirectoryError) as error:
        raise InputError(path, "a PLY file", "none" if isinstance(error, FileNotFoundError) else "a folder") from error
    head, end, body = content.partition(b"end_header\n")
    lines = head.decode("ascii", errors="replace").splitlines()
    if not end or lines[:2] != ["ply", "format binary_little_endian 1.0"]:
        raise InputError(path, "a binary little-endian PLY", "something else")
    count = lines[2].removeprefix("element vertex ") if len(lines) > 2 else ""
    degree = _SIZES.get(sum(line.startswith("property float f_rest_") for line in lines))
    if not count.isdigit() or degree is None or lines[3:] != [f"property float {name}" for name in _names(degree)]:
        raise InputError(path, "the properties of a 3DGS PLY, in their order", "others", key="header")
    names = _names(degree)
    if len(body) != 4 * len(names) * int(count):
        raise InputError(
            path,
            f"{4 * len(names) * int(count)} bytes for its {count} Gaussians",
            f"{len(body)} bytes behind the header",
        )
    rows = torch.from_numpy(np.frombuffer(body, "<f4").reshape(int(count), len(names)).astype(np.float64))
    if not torch.isfinite(rows).all():
        row, column = (~torch.isfinite(rows)).nonzero()[0].tolist()
        raise InputError(path, "finite numbers", f"{rows[row, column]:g}", key=f"{names[column]} of Gaussian {row}")
    means, _, constant, rest, opacity, scales, quaternions = rows.split([3, 3, 3, 3 * degree, 1, 3, 4], dim=-1)
    higher = rest.unflatten(-1, (3, degree)).mT if degree else rest[:, None, :].expand(-1, 0, -1)
    colour = Appearance(
        quaternions=torch.nn.functional.normalize(quaternions, dim=-1),
        scales=scales.exp(),
        features=torch.cat((constant[:, None], higher.reshape(-1, degree, 3)), dim=1),
    )
    gaussians = Gaussians(means, opacity[:, 0].sigmoid(), colour).map(lambda tensor: tensor.float().contiguous())
    try:
        return gaussians.checked()
    except ValueError as error:
        raise InputError(path, "Gaussians that can be drawn", str(error)) from error


_SIZES = {3 * higher: higher for higher in (0, 3, 8, _FULL)}


def _names(higher: int) -> list[str]:
    """The properties in their order, with `higher` harmonics above degree 0 per channel."""
    return [
        *("x", "y", "z", "nx", "ny", "nz"),
        *(f"f_dc_{i}" for i in range(3)),
        *(f"f_rest_{i}" for i in range(3 * higher)),
        "opacity",
        *(f"scale_{i}" for i in range(3)),
        *(f"rot_{i}" for i in range(4)),
    ]


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
    names = _names(_FULL)
    if not np.isfinite(rows).all():
        row, column = np.argwhere(~np.isfinite(rows))[0]
        raise ValueError(f"{names[column]} of Gaussian {row} is {rows[row, column]}; expected a finite number")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    header += [f"property float {name}" for name in names] + ["end_header"]
    write_bytes(path, "\n".join(header).encode() + b"\n" + rows.astype("<f4").tobytes())
