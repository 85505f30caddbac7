"""Gives the Gaussians of a scene classes from elsewhere: what a source says about the input views, made consistent between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.geometry.fusion import LEAST, fuse_classes
from semgs.scene.encoding import Encoding
from semgs.segmenters.class_map_files import Photos
from semgs.segmenters.class_source import ClassSource, Translated, notes_of, read_distributions


@dataclass(frozen=True)
class ClassVotes:
    """How much a segmenter and the network each vote for a class: factors of log probabilities, and what is added.

    Attributes:
        theirs, own, bias: for each class.
    """

    theirs: tuple[float, ...]
    own: tuple[float, ...]
    bias: tuple[float, ...]


@dataclass(frozen=True)
class Labelling:
    """How Gaussians get their classes.

    Attributes:
        source: what says the classes of the input views.
        own: whether the network's own classes vote too.
        votes: how much each of the two votes then; None for equal votes, where a class that the source cannot say gets none from it.
        fusion: whether views agree on a class for each point; otherwise each Gaussian has that of its own pixel.
    """

    source: ClassSource
    own: bool = False
    votes: ClassVotes | None = None
    fusion: bool = True

    @property
    def description(self) -> str:
        """Where the classes come from, in a sentence."""
        voters = f"{self.source.title}{', and the model' if self.own else ''}"
        return f"{voters}; {'fused over the input views' if self.fusion else 'each input view for itself'}"

    @property
    def saves_maps(self) -> bool:
        """Whether the maps of a network are saved."""
        source = self.source.source if isinstance(self.source, Translated) else self.source
        return isinstance(source, Photos) and source.save is not None

    @property
    def notes(self) -> tuple[str, ...]:
        """As `notes_of` the source."""
        return notes_of(self.source)

    def __call__(
        self, encoding: Encoding, scene: Scene, positions: Sequence[int], views: Views, fit: Fit = "crop"
    ) -> Encoding:
        """The encoding of frames of a scene, with these classes.

        Args:
            encoding: of the views.
            scene: contains the frames.
            positions: of the frames in the scene.
            views: the frames as read.
            fit: how they were read.

        Raises:
            InputError: as `ClassSource.of`.
            ValueError: the network's own classes are to vote, and it has none or another table.
        """
        maps = read_distributions(self.source, scene, positions, views.size, fit).to(encoding.depths)
        if self.own:
            if encoding.classes != self.source.classes:
                table = encoding.classes.name if encoding.classes else "no classes"
                raise ValueError(
                    f"the network has {table}, the segmenter {self.source.classes.name}; expected one table"
                )
            if self.votes is None:
                maps = combine(maps, encoding.class_maps(), torch.from_numpy(self.source.known).to(maps.device))
            else:
                maps = weigh(maps, encoding.class_maps(), self.votes)
        if self.fusion:
            maps = fuse_classes(maps, encoding.depths, encoding.depth_spread, views.cameras)
        return encoding.with_classes(maps, self.source.classes)


def combine(
    theirs: Float[Tensor, "*batch class h w"], own: Float[Tensor, "*batch class h w"], known: Bool[Tensor, " class"]
) -> Float[Tensor, "*batch class h w"]:
    """The product of two distributions; for a class that the first cannot say, it votes neither way.

    Not voting means: the mean of the log probabilities that it gives to the classes it knows, weighted by the second distribution.

    Args:
        theirs: of a segmenter.
        own: of the network.
        known: the classes that the segmenter can say.
    """
    theirs_log = (theirs + LEAST).log()
    shares = own * known[:, None, None]
    neutral = (shares * theirs_log).sum(-3, keepdim=True) / shares.sum(-3, keepdim=True).clamp(min=LEAST)
    return ((own + LEAST).log() + torch.where(known[:, None, None], theirs_log, neutral)).softmax(-3)


def weigh(
    theirs: Float[Tensor, "*batch class h w"], own: Float[Tensor, "*batch class h w"], votes: ClassVotes
) -> Float[Tensor, "*batch class h w"]:
    """The weighted product of two distributions."""
    factors = [torch.tensor(row).to(own)[:, None, None] for row in (votes.theirs, votes.own, votes.bias)]
    return (factors[0] * (theirs + LEAST).log() + factors[1] * (own + LEAST).log() + factors[2]).softmax(-3)
