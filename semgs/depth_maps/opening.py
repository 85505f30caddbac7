"""Opens sources of depth maps: folders of maps, exported networks, and models of the Hugging Face hub.

Exported networks are files for a runtime, as `semgs.segmenters.networks.network_files` describes them, with one more key:

    "meaning": "inverse"                       or "scaled" or "metric" (in metres): what the numbers are

What comes out is one number for each pixel: [1 height width], [1 1 height width] or [1 height width 1].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, final, get_args, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.depth_maps.depth_source import DepthMaps, Meaning
from semgs.depth_maps.frame_maps import FrameMaps
from semgs.depth_maps.map_folder import open_map_folder
from semgs.depth_maps.transformers_network import open_transformers_network
from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs.geometry.cameras import writable
from semgs.runtime.kept import kept
from semgs.segmenters.class_map_files import MadeBy
from semgs.segmenters.networks.cost import Cost, cost_of_photos
from semgs.segmenters.networks.network_files import (
    ENDINGS,
    ArrayNetwork,
    InputDescription,
    described_in,
    open_network_file,
    read_description,
    run_on,
)
from semgs.segmenters.networks.transformers_models import is_model
from semgs.segmenters.photo_maps import resampled

OWN = "maps"
"""Names the scene's own depth maps."""


@runtime_checkable
class DepthNetwork(Protocol):
    """A network that predicts the depth of every pixel of a single image."""

    @property
    def made_by(self) -> MadeBy:
        """Which network it is."""
        ...

    @property
    def meaning(self) -> Meaning:
        """What its numbers are."""
        ...

    @property
    def prompted(self) -> bool:
        """Whether it takes the depth of a sensor beside the image."""
        ...

    def __call__(
        self, image: UInt8[np.ndarray, "h w 3"], prompt: Float32[np.ndarray, "h w"] | None = None
    ) -> Float32[np.ndarray, "rows columns"]:
        """The map, at any resolution; it covers the whole image.

        Args:
            image: RGB.
            prompt: z-depths that a sensor measured, 0 where it measured nothing [m]; only for prompted networks.
        """
        ...


@final
@dataclass(frozen=True)
class PredictedMaps:
    """What a network predicts for the undistorted photos of a scene, each at its own size; `DepthMaps`.

    Attributes:
        network: the network.
    """

    network: DepthNetwork

    @property
    def title(self) -> str:
        """Name and licence of the network."""
        return self.network.made_by.title

    @property
    def made_by(self) -> MadeBy | None:
        """The network."""
        return self.network.made_by

    @property
    def meaning(self) -> Meaning:
        """What the numbers are."""
        return self.network.meaning

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "h w"]:
        """As `DepthMaps.of`.

        Raises:
            InputError: the photo cannot be read, or the network cannot take it.
        """
        prompt = frame.measured() if self.network.prompted else None
        values = torch.from_numpy(writable(self.network(frame.read_undistorted(), prompt)))[None]
        return resampled(values, frame, size, fit, undistorted=True)[0]

    def cost(self, frames: Sequence[Frame]) -> Cost | None:
        """As `cost_of_photos`; a prompted network gets a wall at 1 m."""
        network = self.network
        return cost_of_photos(
            lambda image: network(image, np.ones(image.shape[:2], np.float32) if network.prompted else None), frames
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


def open_depth_maps(name: str, meaning: Meaning | None = None) -> Callable[[Scene], DepthMaps]:
    """Open a source of depth maps once, for the frames of any scene.

    Args:
        name: "maps" for the scene's own, a folder of maps (`semgs.depth_maps.map_folder`), an exported network (.onnx or .tflite with a JSON beside
            it), a model folder of transformers, or hf:OWNER/NAME.
        meaning: what the numbers are; None for what the source says, or "scaled" for the scene's own.

    Raises:
        InputError: it cannot be read, or is no such source. So does the returned function.
        ImportError: the library that runs it is not installed.
    """
    if name == OWN:
        return lambda scene: FrameMaps(meaning or "scaled")
    path = typed_path(name)
    network: DepthNetwork | None = None
    if is_model(name):
        network = kept(open_transformers_network, name, meaning)
    elif path.suffix.lower() in ENDINGS:
        network = kept(open_exported_network, path, meaning)
    if network is not None:
        predicted = PredictedMaps(network)
        return lambda scene: predicted
    if path.is_dir():
        return lambda scene: open_map_folder(path, scene, meaning)
    expected = f"{OWN}, a folder of depth maps, an exported network (.onnx, .tflite), a model folder, or hf:OWNER/NAME"
    raise InputError(path, expected, "something else" if path.exists() else "nothing")


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
    found, description = read_description(path, ("meaning",), "see docs/segmenters.md", {"meaning": get_args(Meaning)})
    return description, found["meaning"]
