"""A reader of the PLY files that `semgs.export.ply` writes, made from the description of the layout alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from semgs.geometry.gaussians import Appearance, Gaussians

NAMES = [
    *("x", "y", "z", "nx", "ny", "nz"), *(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(45)), "opacity",
    *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4)),
]  # fmt: skip


def read_ply(path: Path) -> Gaussians:
    """The file as activated float32 quantities, reckoned in float64, without classes; an AssertionError if its layout is another."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = [line for line in head.decode("ascii").splitlines() if not line.startswith("comment ")]
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    count = int(lines[2].removeprefix("element vertex "))
    assert lines[3:] == [f"property float {name}" for name in NAMES]
    rows = torch.from_numpy(np.frombuffer(body, "<f4").reshape(count, len(NAMES)).astype(np.float64))
    means, _, constant, rest, opacity, scales, quaternions = rows.split([3, 3, 3, 45, 1, 3, 4], dim=-1)
    colour = Appearance(
        quaternions=torch.nn.functional.normalize(quaternions, dim=-1),
        scales=scales.exp(),
        features=torch.cat((constant[:, None], rest.unflatten(-1, (3, 15)).mT), dim=1),
    )
    gaussians = Gaussians(means, opacity[:, 0].sigmoid(), colour)
    return gaussians.map(lambda tensor: tensor.float().contiguous()).checked()
