"""Segmentation models of Hugging Face's transformers, as `semgs.sources.transformers_models` finds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, final, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.files.errors import InputError, input_error
from semgs.segmenters.class_source import Segmenter
from semgs.segmenters.tables import make_class_table, make_word_table
from semgs.sources.source import MadeBy
from semgs.sources.transformers_models import CONFIG, LOCAL, ModelFolder, find_model, prepare_image, runs

LOGITS = {
    "segformer": "SegformerForSemanticSegmentation",
    "upernet": "UperNetForSemanticSegmentation",
    "dpt": "DPTForSemanticSegmentation",
    "beit": "BeitForSemanticSegmentation",
}
"""Models that give each pixel logits, by their type in `config.json`."""

MASKS = {
    "maskformer": "MaskFormerForInstanceSegmentation",
    "mask2former": "Mask2FormerForUniversalSegmentation",
    "oneformer": "OneFormerForUniversalSegmentation",
}
"""Models that give masks with classes; a pixel's score of a class is the sum over the masks, not yet divided by that over the classes."""

PROMPTED = {"clipseg": "CLIPSegForImageSegmentation"}
"""Models that words describe the classes of."""

KNOWN = LOGITS | MASKS | PROMPTED

TEMPERATURE = 1.0
"""Logits are divided by it before the softmax. At 1 a single word gets the probability that the model gives it: the sigmoid of its logit."""


@final
@dataclass(frozen=True)
class Pretrained:
    """A segmentation model with its processor; a `Segmenter`.

    Attributes:
        folder: of the model.
        model: in evaluation mode, on the CPU.
        processor: prepares images, and turns what the model gives into scores.
        masks: whether scores are sums over masks; otherwise logits.
        classes: the model's own table.
        made_by: which model it is.
        options: what the processor takes beside an image.
    """

    folder: Path
    model: Any
    processor: Any
    masks: bool
    classes: ClassTable
    made_by: MadeBy
    options: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, image: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "class rows columns"]:
        """The distribution over the classes, at the model's own resolution.

        Args:
            image: RGB.

        Raises:
            InputError: the model cannot take the image, or gives something else than its classes.
        """
        with runs(self.folder, image):
            inputs = prepare_image(self.processor, image, self.options)
            found = self.processor.post_process_semantic_segmentation(
                self.model(**inputs), return_segmentation_scores=True
            )
        scores = found[0].segmentation_scores.float()
        if len(scores) != len(self.classes) or not scores.isfinite().all():
            raise InputError(self.folder, f"finite scores of {len(self.classes)} classes", f"shape {[*scores.shape]}")
        return (_shares(scores) if self.masks else scores.softmax(0)).numpy()


@final
@dataclass(frozen=True)
class ClipSeg:
    """CLIPSeg, which finds what words describe; `Prompted`.

    Attributes:
        folder: of the model.
        model: in evaluation mode, on the CPU.
        processor: prepares images and words.
        made_by: which model it is.
    """

    folder: Path
    model: Any
    processor: Any
    made_by: MadeBy

    def logits(
        self, image: UInt8[np.ndarray, "h w 3"], words: tuple[str, ...]
    ) -> Float32[np.ndarray, "word rows columns"]:
        """For each word the log-odds that a pixel shows it, at the model's own resolution.

        Args:
            image: RGB.
            words: a word or phrase each.

        Raises:
            InputError: the model cannot take the image or the words.
        """
        with runs(self.folder, image):
            pixels = prepare_image(self.processor.image_processor, image, {})["pixel_values"]
            tokens = self.processor.tokenizer(list(words), padding=True, return_tensors="pt")
            meanings = self.model.get_conditional_embeddings(
                batch_size=len(words), input_ids=tokens["input_ids"], attention_mask=tokens["attention_mask"]
            )
            maps = [
                self.model(pixel_values=pixels, conditional_embeddings=meaning[None]).logits for meaning in meanings
            ]
        return torch.stack([one.reshape(one.shape[-2:]) for one in maps]).float().numpy()


def open_transformers_model(name: str, words: tuple[str, ...] = ()) -> Segmenter:
    """Open a model; downloads it if it is on the hub and not in the cache.

    Args:
        name: a folder, or hf:OWNER/NAME[@REVISION].
        words: the classes, for a text-prompted model; () for others.

    Raises:
        InputError: it cannot be read or downloaded, is no segmenter of a known kind, would run its own code, or has no safetensors
            weights; or words are missing, or given to a model with classes of its own.
        ImportError: transformers is not installed; the message names the extra.
        ValueError: the words make no table.
    """
    found = find_model(name, KNOWN, "a segmenter")
    folder, kind = found.path, found.kind
    _check_words(name, kind, words)
    model, processor, made_by = found.load(lambda config: _processor(found, config))
    if kind in PROMPTED:
        return Words(ClipSeg(folder, model, processor, made_by), words)
    labels = model.config.id2label
    with input_error(folder / CONFIG, "a table of classes", key="id2label"):
        classes = make_class_table(made_by.name, [str(labels[label]) for label in sorted(labels)])
    options = {"task_inputs": ["semantic"]} if kind == "oneformer" else {}
    return Pretrained(folder, model, processor, kind in MASKS, classes, made_by, options)


def _check_words(name: str, kind: str, words: tuple[str, ...]) -> None:
    """Refuse words for a model with classes of its own, and a text-prompted model without words.

    Raises:
        InputError: as above.
    """
    if kind in PROMPTED and not words:
        raise InputError(
            name, f"words, as {kind} has no classes of its own", "none", advice="give --words chair table ..."
        )
    if words and kind not in PROMPTED:
        found = f"{kind}, which has its own classes"
        raise InputError(name, f"a text-prompted model for --words: {', '.join(PROMPTED)}", found)


def _processor(found: ModelFolder, config: Any) -> Any:
    """What prepares images for a model; for some kinds with a tokenizer."""
    transformers, images = found.transformers, found.transformers.AutoImageProcessor.from_pretrained
    if found.kind not in ("oneformer", "clipseg"):
        return images(found.path, **LOCAL)
    tokenizer = transformers.AutoTokenizer.from_pretrained(found.path, **LOCAL)
    if found.kind == "clipseg":
        return transformers.CLIPSegProcessor(images(found.path, **LOCAL), tokenizer)
    # The names of classes, which would be downloaded, are only for training.
    plain = images(found.path, class_info_file=None, **LOCAL)
    return transformers.OneFormerProcessor(plain, tokenizer, task_seq_length=config.task_seq_len)


def _shares(scores: Float[Tensor, "class rows columns"]) -> Float32[Tensor, "class rows columns"]:
    """Scores divided by their sum over the classes, however small that is; even where it is 0."""
    total = scores.double().sum(0)
    return torch.where(total > 0, scores / total.where(total > 0, 1.0), 1 / len(scores)).float()


@runtime_checkable
class Prompted(Protocol):
    """A model that says where in an image each of some words is."""

    @property
    def made_by(self) -> MadeBy:
        """Which model it is."""
        ...

    def logits(
        self, image: UInt8[np.ndarray, "h w 3"], words: tuple[str, ...]
    ) -> Float32[np.ndarray, "word rows columns"]:
        """For each word the log-odds that a pixel shows it, at any resolution; they cover the whole image.

        Args:
            image: RGB.
            words: a word or phrase each.
        """
        ...


@final
@dataclass(frozen=True)
class Words:
    """A text-prompted model with its words; a `Segmenter`.

    The distribution is the softmax over the words' logits and 0 for "none of these", the last class.

    Attributes:
        model: says where each word is.
        words: different, and none of them empty.

    Raises:
        ValueError: the words make no table.
    """

    model: Prompted
    words: tuple[str, ...]

    def __post_init__(self) -> None:
        make_word_table(self.words)

    @property
    def classes(self) -> ClassTable:
        """The words, and "none of these"."""
        return make_word_table(self.words)

    @property
    def made_by(self) -> MadeBy:
        """That of the model."""
        return self.model.made_by

    def __call__(self, image: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "class rows columns"]:
        """The distribution over the words and "none of these".

        Args:
            image: RGB.
        """
        found = torch.from_numpy(self.model.logits(image, self.words)) / TEMPERATURE
        return torch.cat((found, torch.zeros_like(found[:1]))).softmax(0).numpy()
