"""First hits of rays on a triangle mesh, with Embree. Only this module imports it."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int, Num

from semgs.files.errors import needs_extra

REACH = 1e30
"""The length of an unlimited ray [m]; Embree reports anything beyond as a miss."""


class Raycaster:
    """A triangle mesh to cast rays at.

    Embree works in float32: keep the mesh within some tens of metres of the origin. If you need hits to better than about 1e-6 of that
    distance, intersect the ray with the plane of the triangle in float64.

    Args:
        vertices: positions [m].
        faces: three vertex indices per triangle.

    Raises:
        ValueError: there is no triangle, a vertex is not finite, or a face refers to a vertex that does not exist.
        ImportError: embreex is not installed; the error names the extra to install.
    """

    def __init__(self, vertices: Num[np.ndarray, "n 3"], faces: Int[np.ndarray, "m 3"]) -> None:
        if len(faces) == 0:
            raise ValueError("the mesh has no triangle; expected at least one")
        if not np.isfinite(vertices).all():
            raise ValueError("a vertex of the mesh is not finite")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError(
                f"faces refer to vertices {faces.min()}..{faces.max()}, but the mesh has vertices 0..{len(vertices) - 1}"
            )
        with needs_extra("raycast", "casting rays needs embreex", "embreex"):
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(
            self._scene,
            np.ascontiguousarray(vertices, dtype=np.float32),
            np.ascontiguousarray(faces, dtype=np.int32),
        )

    def cast(
        self,
        origins: Num[np.ndarray, "r 3"],
        directions: Num[np.ndarray, "r 3"],
        reach: Num[np.ndarray, " r"] | None = None,
    ) -> tuple[Int[np.ndarray, " r"], Float[np.ndarray, " r"]]:
        """The first triangle that each ray hits, and where.

        Args:
            origins: start points [m].
            directions: of any length > 0.
            reach: length of each ray, in lengths of its direction; None for no limit.

        Returns:
            Index of the triangle, -1 for a miss, and the distance of the hit in lengths of the direction (inf for a miss). Both sides
            of a triangle count.
        """
        if len(origins) == 0:
            return np.zeros(0, np.int32), np.zeros(0, np.float32)
        hits = self._run(origins, directions, None if reach is None else np.array(reach, dtype=np.float32), output=True)
        triangles = hits["primID"]
        return triangles, np.where(triangles >= 0, hits["tfar"], np.float32(np.inf))

    def reached(
        self,
        origins: Num[np.ndarray, "r 3"],
        directions: Num[np.ndarray, "r 3"],
        reach: Num[np.ndarray, " r"] | float = REACH,
    ) -> np.ndarray:
        """Whether each ray reaches its end without hitting a triangle [r], boolean."""
        if len(origins) == 0:
            return np.zeros(0, bool)
        limits = np.array(np.broadcast_to(np.asarray(reach, dtype=np.float32), len(origins)))
        return self._run(origins, directions, limits, query="INTERSECT") < 0

    def _run(self, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray | None, **options: Any) -> Any:
        """What Embree finds for some rays."""
        origins, directions = (np.ascontiguousarray(rays, dtype=np.float32) for rays in (origins, directions))
        return self._scene.run(origins, directions, dists=reach, **options)
