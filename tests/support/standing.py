"""Cast rays at one piece of furniture."""

import numpy as np

from semgs.data.raycast import Raycaster
from semgs_rooms.pieces.solids import Piece, gather, triangulate


class Standing:
    """A piece alone in space."""

    def __init__(self, piece: Piece) -> None:
        self.solids = gather(piece.parts)
        corners, self.owners = triangulate(self.solids)
        self.caster = Raycaster(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))

    def hit(self, start, way) -> tuple[int, float]:
        """Class and distance of what a ray meets first; -1 and inf for nothing."""
        triangles, distances = self.caster.cast(np.array([start], float), np.array([way], float))
        if triangles[0] < 0:
            return -1, np.inf
        return int(self.solids.labels[self.owners[triangles[0]]]), float(distances[0])
