"""Text-prompted models: words make the class table at run time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.data.tables.classes import ClassTable
from semgs.segmenters.class_map_files import MadeBy
from semgs.segmenters.tables import make_word_table

TEMPERATURE = 1.0
"""Logits are divided by it before the softmax. At 1 a single word gets the probability that the model gives it: the sigmoid of its logit."""


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
