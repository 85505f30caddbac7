"""Depth networks of Hugging Face's transformers, as `semgs.segmenters.networks.transformers_models` finds them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor
from torch.nn.functional import interpolate

from semgs.depth_maps.depth_source import Meaning
from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs.segmenters.class_map_files import MadeBy
from semgs.segmenters.networks.transformers_models import (
    CONFIG,
    SCHEME,
    download_model,
    find_fault,
    identify,
    import_transformers,
    load_network,
    loads,
    model_type,
    prepare_image,
    quiet,
    runs,
)

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
class TransformersNetwork:
    """A depth model with its processor; a `DepthNetwork`.

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


def open_transformers_network(name: str, meaning: Meaning | None = None) -> TransformersNetwork:
    """Open a model; downloads it if it is on the hub and not in the cache.

    Args:
        name: a folder, or hf:OWNER/NAME[@REVISION].
        meaning: what its numbers are; None for what its type and configuration say.

    Raises:
        InputError: it cannot be read or downloaded, is no depth network of a known kind, would run its own code, or has no safetensors weights.
        ImportError: transformers is not installed; the message names the extra.
    """
    transformers = import_transformers(name)
    with quiet(transformers):
        folder = download_model(name, transformers) if name.startswith(SCHEME) else typed_path(name)
        kind, config = model_type(folder, KNOWN, "a depth network")
        said = MEANINGS.get(kind) or _meaning_of_depth_anything(folder, config)
        model = load_network(folder, KNOWN[kind], transformers)
        with loads(folder, "a processor of images"):
            # The processor of DepthPro, which stretches images like this one, needs torchvision.
            maker = transformers.ViTImageProcessorPil if kind == CANONICAL else transformers.AutoImageProcessor
            processor = maker.from_pretrained(folder, trust_remote_code=False, local_files_only=True)
    if kind != PADDED and (fault := find_fault(processor)):
        raise InputError(folder, "a processor of images that keeps the whole image", fault)
    return TransformersNetwork(folder, kind, model, processor, meaning or said, identify(name, folder, KNOWN[kind]))


def _meaning_of_depth_anything(folder: Path, config: dict[str, Any]) -> Meaning:
    """What the numbers of a Depth Anything model are.

    Raises:
        InputError: its configuration says something unknown.
    """
    said = config.get("depth_estimation_type", "relative")
    if said not in ("relative", "metric"):
        raise InputError(folder / CONFIG, "relative or metric", f"{said!r:.60}", key="depth_estimation_type")
    return "metric" if said == "metric" else "inverse"
