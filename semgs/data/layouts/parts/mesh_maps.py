"""Labels and depth of a frame from the mesh of its scene, by ray casting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol, final, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt8

from semgs.data.maps import Pixels
from semgs.geometry.cameras import Cameras


@runtime_checkable
class SeenMesh(Protocol):
    """A labelled mesh."""

    def seen(self, camera: Cameras) -> tuple[UInt8[np.ndarray, "h w"], Float32[np.ndarray, "h w"]]:
        """What a pinhole sees at its pixel centres: labels, 255 = none, and z-depths [m], 0 = none.

        Raises:
            InputError: a file of the scene cannot be used.
            ImportError: a library for ray casting is not installed; the error names the extra to install.
        """


@final
@dataclass(frozen=True)
class MeshLabels:
    """Labels from a mesh.

    Attributes:
        mesh: of the scene.
    """

    mesh: SeenMesh
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`, exact at the centres of the pixels.

        Raises:
            InputError, ImportError: as `SeenMesh.seen`.
        """
        return self.mesh.seen(pixels.camera)[0]


@final
@dataclass(frozen=True)
class MeshDepth:
    """Z-depths from a mesh.

    Attributes:
        mesh: of the scene.
    """

    mesh: SeenMesh
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> Float32[np.ndarray, "h w"]:
        """As `MapSource.read`, exact at the centres of the pixels.

        Raises:
            InputError, ImportError: as `SeenMesh.seen`.
        """
        return self.mesh.seen(pixels.camera)[1]
