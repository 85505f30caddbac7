"""Depth networks, exported or of Hugging Face's transformers, and opening of any source of depth maps.

Exported networks are files for a runtime, as `semgs.sources.network_files` describes them, with one more key:

    "meaning": "inverse"                       or "scaled" or "metric" (in metres): what the numbers are

What comes out is one number for each pixel: [1 height width], [1 1 height width] or [1 height width 1].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, final, get_args

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor
from torch.nn.functional import interpolate

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.depth_maps.depth_source import DepthMaps, FrameMaps, Meaning
from semgs.depth_maps.map_folder import open_map_folder
from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs.geometry.cameras import writable
from semgs.runtime.kept import kept
from semgs.sources.network_files import (
    ENDINGS,
    ArrayNetwork,
    InputDescription,
    description_of,
    open_network_file,
    read_description,
    run_on,
)
from semgs.sources.photo_maps import resampled
from semgs.sources.source import Cost, MadeBy, cost_of_photos
from semgs.sources.transformers_models import CONFIG, LOCAL, ModelFolder, find_model, is_model, prepare_image, runs

OWN = "maps"
"""Names the scene's own depth maps."""

PROMPTED = "prompt_depth_anything"
PADDED = "zoedepth"
CANONICAL = "depth_pro"
"""Predicts inverse depth for a focal length of the image's width, and the field of view."""

PADDING = 3
"""ZoeDepth's processor reflects so many times the square root of half an image's side at each border."""

KNOWN = {
    "depth_anything": "DepthAnythingForDepthEstimation",
    CANONICAL: "DepthProForDepthEstimation",
    "dpt": "DPTForDepthEstimation",
    PROMPTED: "PromptDepthAnythingForDepthEstimation",
    PADDED: "ZoeDepthForDepthEstimation",
}
"""Models that predict depth, by their type in `config.json`."""

MEANINGS: dict[str, Meaning] = {CANONICAL: "metric", "dpt": "inverse", PROMPTED: "metric", PADDED: "metric"}
"""What their numbers are. Those of Depth Anything depend on its `depth_estimation_type`."""


@final
@dataclass(frozen=True)
class ExportedNetwork:
    """A depth network in a file.

    Attributes:
        path: of the file.
        description: what it expects.
        meaning: what its numbers are.
        network: runs it.
        made_by: which one it is.
    """

    path: Path
    description: InputDescription
    meaning: Meaning
    network: ArrayNetwork
    made_by: MadeBy
    prompted: ClassVar[bool] = False

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


@final
@dataclass(frozen=True)
class TransformersNetwork:
    """A depth model of transformers with its processor.

    Attributes:
        folder: of the model.
        kind: its type in `config.json`.
        model: in evaluation mode, on the CPU.
        processor: prepares images, and turns what the model gives into maps of their size.
        meaning: what its numbers are.
        made_by: which model it is.
    """

    folder: Path
    kind: str
    model: Any
    processor: Any
    meaning: Meaning
    made_by: MadeBy

    @property
    def prompted(self) -> bool:
        """Whether it takes the depth of a sensor beside the image."""
        return self.kind == PROMPTED

    def __call__(
        self, image: UInt8[np.ndarray, "h w 3"], prompt: Float32[np.ndarray, "h w"] | None = None
    ) -> Float32[np.ndarray, "rows columns"]:
        """The map, of the size of the image.

        Raises:
            InputError: the model cannot take the image, needs the depth of a sensor, or gives numbers that are not finite.
        """
        options: dict[str, Any] = {}
        if self.prompted:
            if prompt is None or not (prompt > 0).any():
                raise InputError(self.folder, f"a measured depth of each photo, which {self.kind} completes", "none")
            usual = np.median(prompt[prompt > 0])
            options = {"prompt_depth": np.where(prompt > 0, prompt, usual), "prompt_scale_to_meter": 1.0}
        with runs(self.folder, image):
            found = self.model(**prepare_image(self.processor, image, options))
            values = self._depths(found, image.shape[:2]).numpy()
        if values.shape != image.shape[:2] or not np.isfinite(values).all():
            raise InputError(self.folder, "a finite number for each pixel", f"shape {[*values.shape]}")
        return np.asarray(values)

    def _depths(self, found: Any, size: tuple[int, int]) -> Float[Tensor, "h w"]:
        """The map of an image of a size, from what the model gave. The library does this for two kinds only with torchvision, which we do without."""
        values = found.predicted_depth.float()
        if self.kind == PADDED:
            pads = [int(PADDING * math.sqrt(side / 2)) if self.processor.do_pad else 0 for side in size]
            padded = [side + 2 * pad for side, pad in zip(size, pads, strict=True)]
            rows, columns = (slice(pad, pad + side) for side, pad in zip(size, pads, strict=True))
            return _resize(values, padded)[rows, columns]
        if self.kind == CANONICAL:
            inverse = values
            if found.field_of_view is not None:
                inverse = inverse * 2 * torch.tan(torch.deg2rad(found.field_of_view.float()) / 2)
            return 1 / _resize(inverse, size, "bilinear").clamp(min=1e-4, max=1e4)
        return _resize(values, size)


def _resize(
    values: Float[Tensor, "1 rows columns"], size: Sequence[int], mode: str = "bicubic"
) -> Float[Tensor, "h w"]:
    """A map at another size."""
    return interpolate(values[:, None], tuple(size), mode=mode, align_corners=False)[0, 0]


DepthNetwork = ExportedNetwork | TransformersNetwork
"""A network that predicts the depth of every pixel of a single image, which it covers as a whole, at any resolution."""


@final
@dataclass(frozen=True)
class PredictedMaps(DepthMaps):
    """What a network predicts for the undistorted photos of a scene, each at its own size.

    Attributes:
        network: the network.
    """

    network: DepthNetwork

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
    if is_model(name):
        predicted = PredictedMaps(kept(open_transformers_network, name, meaning))
        return lambda scene: predicted
    if path.suffix.lower() in ENDINGS:
        exported = PredictedMaps(kept(open_exported_network, path, meaning))
        return lambda scene: exported
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
    description, said = read_depth_network(description_of(path))
    network, made_by = open_network_file(path, description)
    return ExportedNetwork(path, description, meaning or said, network, made_by)


def read_depth_network(path: Path) -> tuple[InputDescription, Meaning]:
    """The description of a depth network in a file: what it expects, and what its numbers are.

    Raises:
        InputError: it is missing, or not as at the head of this module; the error names the key.
    """
    found, description = read_description(path, ("meaning",), {"meaning": get_args(Meaning)})
    return description, found["meaning"]


def open_transformers_network(name: str, meaning: Meaning | None = None) -> TransformersNetwork:
    """Open a model; downloads it if it is on the hub and not in the cache.

    Args:
        name: a folder, or hf:OWNER/NAME[@REVISION].
        meaning: what its numbers are; None for what its type and configuration say.

    Raises:
        InputError: it cannot be read or downloaded, is no depth network of a known kind, would run its own code, or has no safetensors weights.
        ImportError: transformers is not installed; the message names the extra.
    """
    found = find_model(name, KNOWN, "a depth network")
    said = MEANINGS.get(found.kind) or _meaning_of_depth_anything(found)
    # The processor of DepthPro, which stretches images like this one, needs torchvision.
    maker = "ViTImageProcessorPil" if found.kind == CANONICAL else "AutoImageProcessor"
    model, processor, made_by = found.load(
        lambda config: getattr(found.transformers, maker).from_pretrained(found.path, **LOCAL),
        whole=found.kind != PADDED,
    )
    return TransformersNetwork(found.path, found.kind, model, processor, meaning or said, made_by)


def _meaning_of_depth_anything(found: ModelFolder) -> Meaning:
    """What the numbers of a Depth Anything model are.

    Raises:
        InputError: its configuration says something unknown.
    """
    said = found.config.get("depth_estimation_type", "relative")
    if said not in ("relative", "metric"):
        raise InputError(found.path / CONFIG, "relative or metric", f"{said!r:.60}", key="depth_estimation_type")
    return "metric" if said == "metric" else "inverse"
