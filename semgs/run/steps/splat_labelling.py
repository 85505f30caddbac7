"""Labels a splat of another program: each photo says its classes, and each Gaussian collects those of the pixels that it contributes to.

Our network is a source of classes too, by what it says about each photo by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.data.bounds.depth_range import INDOOR_DEPTH_RANGE
from semgs.data.choosing.choice import Choice
from semgs.data.frames import Frame
from semgs.data.resampling import Fit, default_size
from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.data.tables.classes import ClassTable
from semgs.files.text import counted
from semgs.geometry.cameras import Cameras
from semgs.geometry.fusion import LEAST
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.model.semgs import SemGS
from semgs.rendering.render_features import gather_maps
from semgs.rendering.rendering import SEEN_ALPHA
from semgs.run.steps.finishing import finish
from semgs.run.steps.notes import notes_on_splat
from semgs.run.steps.result import Draft, GivenSplat, Reconstruction, RenderedViews
from semgs.runtime.stopwatch import Stages
from semgs.scene.encoding import Encoding
from semgs.scene.upright import Up
from semgs.segmenters.labelling import Labelling
from semgs.sources.source import MadeBy
from semgs.splats.splat_scene import share_like_own, splat_scene

SHOWN = 8
"""Photos of each role that are rendered and shown, evenly chosen."""

LEAST_WEIGHT = 0.001
"""A photo in which a Gaussian contributes less than this says nothing about it [px]."""


def hold_out(count: int, each: int) -> tuple[list[int], list[int]]:
    """The photos that say classes, and those that are held out for comparison: one of `each`, from the middle of them; 0 holds out none."""
    held = list(range(each // 2, count, each)) if each else []
    return [position for position in range(count) if position not in set(held)], held


@torch.no_grad()
def label_splat(
    scene: Scene,
    gaussians: Gaussians,
    labelling: Labelling,
    given: GivenSplat,
    positions: Sequence[int],
    held_out: Sequence[int] = (),
    size: Sequence[int] | None = None,
    *,
    up: Up = "auto",
    min_confidence: float = 0.0,
    stages: Stages | None = None,
) -> Reconstruction:
    """Give the Gaussians of a splat classes, and render them from the cameras of its photos. Geometry and colours stay as they are.

    Photos are read one at a time, so memory does not grow with them.

    Args:
        scene: the photos and their cameras.
        gaussians: of the splat, in the coordinates of the scene, relative to its origin.
        labelling: whose source says the classes of photos.
        given: where the splat comes from.
        positions: of the photos that say classes.
        held_out: of photos that do not; a few of them are compared with renderings.
        size: (height, width) of the photos as read [px]; None is `default_size` of the first one.
        up: the direction that is up; "auto" finds it.
        min_confidence: seen pixels with less are unknown in label maps.
        stages: shows and times the stages segment and render.

    Raises:
        InputError: a photo or its class map cannot be read.
        ValueError: there are no photos, or no camera sees anything of the splat.
    """
    stages, source = stages or Stages(), labelling.source
    if not positions:
        raise ValueError("there is no photo to say classes")
    height, width = default_size(scene.frames[positions[0]].lens.size) if size is None else size
    bounds = scene.depth_range(spread(positions, SHOWN))
    votes = PixelVotes(gaussians, len(source.classes))
    title = f"Classes of {counted(len(positions), 'photo')} from {source.title}"
    with stages.steps("segment", title, len(positions)) as done:
        for count, position in enumerate(positions):
            view = scene.read([position], (height, width), bounds)
            distributions = source.of(scene.frames[position], (height, width))
            if view.hidden is not None:
                distributions = distributions.masked_fill(view.hidden, 0)
            votes.add(view.cameras, distributions)
            done(count + 1)
    choice = Choice(
        tuple(spread(positions, SHOWN)),
        tuple(spread(held_out, SHOWN)),
        f"evenly chosen of {counted(len(positions), 'photo that says', 'photos that say')} classes"
        + (f" and {counted(len(held_out), 'that is', 'that are')} held out" if held_out else ""),
        bounds,
    )
    context = scene.read(choice.context, (height, width), bounds)
    target = scene.read(choice.targets, (height, width), bounds) if choice.targets else None
    x, y, z = map(float, scene.origin)
    saved = splat_scene(
        gaussians,
        context.cameras,
        frames=[scene.frames[position].name for position in choice.context],
        source=scene.name,
        model=f"{given.format} of {given.name}, classes from {labelling.description}",
        unit="metric" if scene.unit == "metric" else "unknown",
        origin=(x, y, z),
    )
    saved = replace(saved, gaussians=votes.labelled(), classes=source.classes)
    encoding = Encoding(
        gaussians=saved.gaussians,
        depths=saved.depths,
        confidences=saved.confidences,
        depth_spread=torch.zeros_like(saved.depths),
        depth_range=saved.depth_range,
        classes=saved.classes,
        stride=saved.stride,
        places=saved.places,
    )

    def about(rendered: RenderedViews) -> list[str]:
        """The notes on the splat, from what it looks like."""
        shown = [score.psnr_seen for score in rendered.scores if score.psnr_seen is not None]
        quality = float(np.median(shown)) if shown else 0.0
        seen = rendered.alphas >= SEEN_ALPHA
        seen = seen if context.hidden is None else seen & ~context.hidden
        own = share_like_own(rendered.images, context.images, seen)
        return [*given.notes, *notes_on_splat(int(votes.unseen.sum()), len(gaussians), quality, own)]

    draft = Draft(scene, choice, context, target, encoding, given.format, labelling, splat=given)
    return finish(draft, saved, about, stages=stages, min_confidence=min_confidence, up=up)


@final
@dataclass(frozen=True)
class NetworkClasses:
    """The classes of single photos from the semantic branch, a `semgs.segmenters.class_source.ClassSource`.

    Attributes:
        network: in evaluation mode.

    Raises:
        ValueError: the network has no classes.
    """

    network: SemGS

    def __post_init__(self) -> None:
        if self.network.classes is None:
            raise ValueError(
                f"{self.network.name} predicts colour only; expected a network with classes, or a segmenter"
            )

    @property
    def title(self) -> str:
        """Name of the network."""
        return self.network.name

    @property
    def made_by(self) -> MadeBy | None:
        """Nothing: weights carry their own card."""
        return None

    @property
    def classes(self) -> ClassTable:
        """The table of the network."""
        assert self.network.classes is not None
        return self.network.classes

    @property
    def known(self) -> Bool[np.ndarray, " class"]:
        """All of the table."""
        return np.ones(len(self.classes), bool)

    @torch.no_grad()
    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "class h w"]:
        """As `ClassSource.of`.

        Raises:
            InputError: the photo cannot be read.
        """
        view = frame.view(INDOOR_DEPTH_RANGE, size=size, fit=fit)  # by itself, classes do not depend on the range
        return self.network.classify(view.to(next(self.network.parameters()).device), alone=True)[0].cpu()


class PixelVotes:
    """The class distributions that Gaussians collect from photos, one photo after the other; memory does not grow with photos.

    Args:
        gaussians: of one scene, without a batch axis.
        classes: number of classes.

    Attributes:
        votes: sums over photos of the mean log probabilities, times the photo's weight.
        weights: sums of the weights of photos.
    """

    def __init__(self, gaussians: Gaussians, classes: int) -> None:
        self._gaussians = gaussians
        self.votes: Float[Tensor, "g class"] = gaussians.means.new_zeros(len(gaussians), classes)
        self.weights: Float[Tensor, " g"] = gaussians.means.new_zeros(len(gaussians))

    def add(self, camera: Cameras, distributions: Float[Tensor, "class h w"]) -> None:
        """Add what a photo says.

        Args:
            camera: of the photo, at the size of the map, with a leading axis of 1.
            distributions: over the classes of each pixel; pixels of zeros say nothing.

        Raises:
            ValueError: the map has another size than the camera, or another number of classes; or as `semgs.render`.
        """
        expected = (self.votes.shape[1], *camera.size)
        if tuple(distributions.shape) != expected:
            raise ValueError(
                f"distributions are {tuple(distributions.shape)}; expected {expected}: classes, height, width"
            )
        known = (distributions.sum(0, keepdim=True) > 0).to(distributions)
        logs = torch.cat(((distributions + LEAST).log() * known, known))
        sums = gather_maps(self._gaussians, logs[None], camera)[0].to(self.votes)
        logs, pixels = sums[:, :-1], sums[:, -1]
        seen = pixels >= LEAST_WEIGHT
        self.votes[seen] += logs[seen] / pixels[seen, None].sqrt()
        self.weights[seen] += pixels[seen].sqrt()

    @property
    def unseen(self) -> Bool[Tensor, " g"]:
        """The Gaussians of which no photo says a class."""
        return self.weights == 0

    def labelled(self) -> Gaussians:
        """The Gaussians with the classes on which photos agree, in the shapes that they have; those that are unseen have a uniform distribution."""
        features = (self.votes / self.weights.clamp(min=1e-12)[:, None]).softmax(1)
        shape = self._gaussians.colour
        return replace(self._gaussians, semantic=Appearance(shape.quaternions, shape.scales, features))
