"""Depth networks in files, exported for a runtime, as `semgs.segmenters.networks.network_files` describes them, with one more key:

    "meaning": "inverse"                       or "scaled" or "metric" (in metres): what the numbers are

What comes out is one number for each pixel: [1 height width], [1 1 height width] or [1 height width 1].
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import final, get_args

import numpy as np
from jaxtyping import Float32, UInt8

from semgs.depth_maps.depth_source import Meaning
from semgs.files.errors import InputError
from semgs.segmenters.class_map_files import MadeBy
from semgs.segmenters.networks.network_files import (
    ArrayNetwork,
    InputDescription,
    described_in,
    open_network_file,
    read_description,
    run_on,
)


@final
@dataclass(frozen=True)
class ExportedNetwork:
    """A depth network in a file; a `DepthNetwork`.

    Attributes:
        path: of the file.
        description: what it expects.
        meaning: what its numbers are.
        network: runs it.
        made_by: which one it is.
        prompted: never.
    """

    path: Path
    description: InputDescription
    meaning: Meaning
    network: ArrayNetwork
    made_by: MadeBy
    prompted: bool = False

    def __call__(
        self, image: UInt8[np.ndarray, "h w 3"], prompt: Float32[np.ndarray, "h w"] | None = None
    ) -> Float32[np.ndarray, "rows columns"]:
        """The map, at the network's own resolution.

        Raises:
            InputError: the network cannot take the image, or gives something else than one finite number for each pixel.
        """
        found = run_on(image, self.path, self.network, self.description)
        sides = [side for side in found.shape if side != 1]
        if found.dtype.kind != "f" or len(sides) != 2 or not np.isfinite(found).all():
            raise InputError(
                self.path, "one finite number for each pixel", f"{found.dtype} of shape {[*found.shape]}"
                + ("" if len(sides) != 2 else ", some not finite")
            )  # fmt: skip
        return found.reshape(sides).astype(np.float32)


def open_exported_network(path: Path, meaning: Meaning | None = None) -> ExportedNetwork:
    """Open a `.onnx` or `.tflite` file with its description.

    Args:
        path: the file.
        meaning: what its numbers are; None for what its description says.

    Raises:
        InputError: one of the files is missing or damaged, or they contradict each other.
        ImportError: the library that runs it is not installed.
    """
    if not path.is_file():
        raise InputError(path, "an exported network", "nothing")
    description, said = read_depth_network(described_in(path))
    network, made_by = open_network_file(path, description)
    return ExportedNetwork(path, description, meaning or said, network, made_by)


def read_depth_network(path: Path) -> tuple[InputDescription, Meaning]:
    """The description of a depth network in a file: what it expects, and what its numbers are.

    Raises:
        InputError: it is missing, or not as at the head of this module; the error names the key.
    """
    found, description = read_description(path, ("meaning",), "see docs/geometry.md", {"meaning": get_args(Meaning)})
    return description, found["meaning"]
