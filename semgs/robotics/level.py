"""The level frame: the world turned until z is up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64


def level_from_world(up: Sequence[float]) -> Float64[np.ndarray, "3 3"]:
    """The smallest rotation that turns a direction into +z; the identity if it is +z already.

    Args:
        up: of any length above 0.

    Raises:
        ValueError: it has no direction.
    """
    direction = np.asarray(up, np.float64)
    length = np.linalg.norm(direction) if direction.shape == (3,) else 0.0
    if not (np.isfinite(length) and length > 0):
        raise ValueError(f"up is {tuple(up)}; expected a direction of three numbers, not all 0")
    x, y, z = direction / length
    if z < 0:  # turned upside down first, by half a turn about x
        return level_from_world((x, -y, -z)) @ np.diag([1.0, -1.0, -1.0])
    return np.array(
        [
            [1 - x * x / (1 + z), -x * y / (1 + z), -x],
            [-x * y / (1 + z), 1 - y * y / (1 + z), -y],
            [x, y, z],
        ]
    )
