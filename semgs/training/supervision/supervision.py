"""Supervision: what a network learns from and how it is validated, one class for each value of the setting; and the objective, a network with its loss, which is the one module that the engine wraps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from semgs.data.tables.classes import IGNORE
from semgs.data.views import Batch, Views, joined
from semgs.files.errors import InputError
from semgs.model.classes.semantic import ClassMaps
from semgs.model.layers.network_input import widen
from semgs.objectives.depth_losses import depth_losses
from semgs.objectives.loss_weights import DepthLossWeights, LossWeights
from semgs.objectives.losses import cross_entropy, depth_error, losses, regional_smoothness
from semgs.objectives.metrics import psnr
from semgs.rendering.rendering import Rendering
from semgs.scene.encoding import Encoding
from semgs.training.data.teacher import divergence
from semgs.training.supervision.supervision_settings import SupervisionSettings, TeacherTarget
from semgs.training.supervision.validation import Comparison, Validation, class_strip, strip, validate, validate_depth

TERMS = ("total", "semantic", "colour", "smoothness", "depth", "gradients", "distribution", "psnr", "unlabelled")
"""What the objective computes for a batch; only `total` has a gradient."""


class Supervision(ABC):
    """What a network learns from, and how it is validated.

    Attributes:
        measures: whether batch norms measure statistics during training; if not, they keep those that they have.
    """

    measures: ClassVar[bool] = False

    @abstractmethod
    def loss(self, network: Any, batch: Batch, head: nn.Module | None = None) -> dict[str, Tensor]:
        """Each of `TERMS` as a number, `total` with its gradient.

        Every term is a mean over scenes, so that the means of equal shares of a batch average to the mean of the batch.

        Args:
            network: to train.
            batch: the samples.
            head: the layers from `head`, if there are any.
        """

    def head(self, network: Any) -> nn.Module | None:
        """Extra layers to train with the network and drop afterwards; None for none."""
        return None

    @abstractmethod
    def learning(self, network: Any) -> set[str]:
        """Names of the parameters that learn."""

    @abstractmethod
    def validate(self, network: Any, batches: Iterable[Batch]) -> Validation:
        """How good the network is on batches that it does not learn from."""


class Objective(nn.Module):
    """From a batch to the terms of its loss.

    Args:
        network: to train.
        supervision: what it learns from.

    Attributes:
        head: extra layers that are trained too; None for none.
    """

    def __init__(self, network: Any, supervision: Supervision) -> None:
        super().__init__()
        self.network = network
        self.supervision = supervision
        self.head = supervision.head(network)

    def forward(self, batch: Batch) -> dict[str, Tensor]:
        """Each of `TERMS` as a number, `total` with its gradient; all are NaN if there is no loss."""
        return self.supervision.loss(self.network, batch, self.head)


def render_targets(encoding: Encoding, batch: Batch, context_targets: bool = False) -> tuple[Rendering, Views]:
    """The Gaussians rendered from the target views (with `context_targets` also from the input views), and the true views.

    The near bound is the smallest of each scene's input views. Both results are on the Gaussians' device. The rendering is not clamped,
    so that pixels brighter than 1 have a gradient.
    """
    target = joined([batch.target, batch.context]) if context_targets else batch.target
    rendering = encoding.render(target.cameras, clamp=False)
    return rendering, target.to(rendering.images.device)


def all_views(batch: Batch) -> Views:
    """Target views, then input views."""
    return joined([batch.target, batch.context])


def make_supervision(
    settings: SupervisionSettings, class_weights: tuple[float, ...] | None = None, teacher_classes: int = 0
) -> Supervision:
    """The supervision that the settings name.

    Args:
        settings: of the supervision; their class weights may be a rule and are not used.
        class_weights: factor of each class in the cross-entropy, as numbers; None is 1 for all.
        teacher_classes: number of classes of the teacher; 0 for no teacher.
    """
    if settings.supervision == "labels":
        return Labels(class_weights, settings.losses)
    if settings.supervision == "pictures":
        return Pictures(class_weights, teacher_classes, settings.teacher_weight, settings.teacher_target)
    if settings.supervision == "depth":
        return Depth(settings.depth_losses)
    return Rendered(settings.losses, class_weights, settings.depth_weight, settings.context_targets)


@dataclass(frozen=True)
class Rendered(Supervision):
    """Learn from rendered views, as in the paper. Every parameter learns; without weights for classes, those of colour and depth alone.

    Attributes:
        losses: weights of the paper's three terms.
        class_weights: factor of each class in the cross-entropy; None is 1 for all.
        depth_weight: weight of the error in log depth of the input views.
        context_targets: also render and compare the input views.
    """

    losses: LossWeights = field(default_factory=LossWeights)
    class_weights: tuple[float, ...] | None = None
    depth_weight: float = 0.0
    context_targets: bool = False

    def loss(self, network: Any, batch: Batch, head: nn.Module | None = None) -> dict[str, Tensor]:
        """The paper's terms and the depth error; all are NaN if the Gaussians cannot be rendered."""
        encoding = network(batch.context)
        if not _is_finite(encoding):
            return _nan_terms(encoding)
        if not self.losses.teach_classes:  # rendering them would take time for nothing
            encoding = replace(encoding, gaussians=replace(encoding.gaussians, semantic=None))
        rendering, target = render_targets(encoding, batch, self.context_targets)
        terms = losses(rendering, target, self.losses, class_weights=self.class_weights)
        depth = torch.zeros_like(terms.total)
        if self.depth_weight and batch.context.depths is not None:
            depth = depth_error(encoding.depths, batch.context.depths.to(encoding.depths.device))
        return _terms(
            terms.total + self.depth_weight * depth,
            semantic=terms.semantic,
            colour=terms.colour,
            smoothness=terms.smoothness,
            depth=depth,
            psnr=psnr(rendering.images, target.images, target.hidden).mean(),
            unlabelled=terms.total.new_tensor(float(terms.unlabelled)),
        )

    def learning(self, network: Any) -> set[str]:
        """Every parameter of the network; without weights for classes, all but those of the semantic branch."""
        own = None if self.losses.teach_classes else network.semantic
        unused = set() if own is None else {id(parameter) for parameter in own.parameters()}
        return {name for name, parameter in network.named_parameters() if id(parameter) not in unused}

    def validate(self, network: Any, batches: Iterable[Batch]) -> Validation:
        """Scores of the rendered target views."""
        return validate(network, batches, _compare_renderings)


@dataclass(frozen=True)
class Labels(Supervision):
    """Learn from the classes of the input views' own pixels. Nothing is rendered, and only the semantic branch learns.

    Attributes:
        class_weights: factor of each class in the cross-entropy; None is 1 for all.
        losses: weights of the paper's terms. The cross-entropy counts once, and the smoothness as often as its weight is a multiple of that
            of the cross-entropy.
    """

    class_weights: tuple[float, ...] | None = None
    losses: LossWeights = field(default_factory=LossWeights)

    def loss(self, network: Any, batch: Batch, head: nn.Module | None = None) -> dict[str, Tensor]:
        """The cross-entropy and the smoothness of the input views.

        Raises:
            ValueError: they have no labels.
        """
        views, maps = batch.context, network.class_maps(batch.context)
        terms = _label_terms(network, maps, views, self.class_weights, "labels")
        assert views.labels is not None
        pixels = widen(maps.distributions.flatten(end_dim=-4), network.stride)[..., : views.size[0], : views.size[1]]
        labels = views.labels.to(pixels.device).flatten(end_dim=-3)
        smoothness = regional_smoothness(pixels, labels, self.losses.smoothness_over).mean()
        share = self.losses.smoothness / self.losses.semantic
        return terms | {"total": terms["total"] + share * smoothness, "smoothness": smoothness.detach()}

    def learning(self, network: Any) -> set[str]:
        """The semantic branch and the layers that it shares."""
        return network.semantic_parameters()

    def validate(self, network: Any, batches: Iterable[Batch]) -> Validation:
        """Scores of the input views' classes."""
        return validate(network, batches, lambda model, batch: _compare_classes(model.classify(batch.context), batch))


@dataclass(frozen=True)
class Pictures(Supervision):
    """Like `Labels`, but for all views of a sample and each on its own, without other views.

    Its batches have enough different images for batch norms to measure statistics.

    Attributes:
        class_weights: as for `Labels`.
        teacher_classes: number of classes of a teacher, whose probabilities are learned too; 0 for no teacher.
        teacher_weight: weight of that second loss.
        teacher_target: what learns these probabilities: an extra "head", or the network's own "classes".
    """

    measures: ClassVar[bool] = True

    class_weights: tuple[float, ...] | None = None
    teacher_classes: int = 0
    teacher_weight: float = 1.0
    teacher_target: TeacherTarget = "head"

    def head(self, network: Any) -> nn.Module | None:
        """A linear layer from the evidence of the network's classes to the teacher's classes; it starts at zero. None if the network's own
        classes learn them.

        Raises:
            InputError: the network does not classify each view on its own, or has another number of classes than the teacher although
                its own classes should learn.
        """
        if not self.teacher_classes:
            return None
        channels = network.semantic.evidence_channels
        if not channels:
            raise InputError(
                "--teacher", "a network that classifies each view on its own", "one that does not",
                advice="give --network.class-backbone",
            )  # fmt: skip
        if self.teacher_target == "classes":
            if self.teacher_classes != network.class_count:
                raise InputError(
                    "--teacher", f"probabilities of the network's {network.class_count} classes", f"{self.teacher_classes} classes",
                    advice="give --teacher-target head",
                )  # fmt: skip
            return None
        head = nn.Conv2d(channels, self.teacher_classes, 1)
        for parameter in head.parameters():
            nn.init.zeros_(parameter)
        return head.to(next(network.parameters()).device)

    def loss(self, network: Any, batch: Batch, head: nn.Module | None = None) -> dict[str, Tensor]:
        """The cross-entropy of all views. With a teacher, `total` includes the divergence from it.

        Raises:
            ValueError: the views have no labels, or there are no teacher's probabilities.
        """
        views = all_views(batch)
        maps = network.class_maps(views, alone=True)
        terms = _label_terms(network, maps, views, self.class_weights, "pictures")
        if not self.teacher_classes:
            return terms
        if batch.taught is None:
            raise ValueError("the batch has no teacher's probabilities; expected them for every image")
        taught = batch.taught.flatten(end_dim=-4).to(maps.distributions.device)
        learner = network.semantic.refinement.classifier if head is None else head
        second = divergence(learner(maps.evidence), taught).mean()
        return terms | {"total": terms["total"] + self.teacher_weight * second}

    def learning(self, network: Any) -> set[str]:
        """The semantic branch without the layers that compare views, and the layers that it shares."""
        return network.semantic_parameters(alone=True)

    def validate(self, network: Any, batches: Iterable[Batch]) -> Validation:
        """Scores of the input views' classes, each view on its own."""
        return validate(
            network, batches, lambda model, batch: _compare_classes(model.classify(batch.context, alone=True), batch)
        )


@dataclass(frozen=True)
class Depth(Supervision):
    """Learn depth by plane sweep, before refinement, from the true depth of the input views. Nothing is rendered.

    Only the layers that this depth depends on learn, not the refinement and the heads, so a rendered stage should follow. With a weight for
    sharp depth, the convex upsampling learns too.

    Attributes:
        losses: weights of the terms.
    """

    losses: DepthLossWeights = field(default_factory=DepthLossWeights)

    def loss(self, network: Any, batch: Batch, head: nn.Module | None = None) -> dict[str, Tensor]:
        """The depth terms of the input views; there is no PSNR.

        Raises:
            ValueError: they have no true depth.
        """
        if batch.context.depths is None:
            raise ValueError("the scenes have no depth; supervision by depth needs it")
        terms = depth_losses(network.sweep(batch.context), batch.context.depths, self.losses)
        return _terms(terms.total, depth=terms.log, gradients=terms.gradients, distribution=terms.distribution)

    def learning(self, network: Any) -> set[str]:
        """The layers of the plane sweep, shared ones included, and the convex upsampling if it has a loss.

        Raises:
            InputError: it has a loss, but the network lacks it.
        """
        if not self.losses.sharp:
            return network.depth_parameters()
        upsampling = network.upsampling_parameters()
        if not upsampling:
            raise InputError(
                "--depth-losses.sharp", "0 without convex upsampling", f"{self.losses.sharp}",
                advice="give --network.depth-upsampling convex as well",
            )  # fmt: skip
        return network.depth_parameters() | upsampling

    def validate(self, network: Any, batches: Iterable[Batch]) -> Validation:
        """Errors of the input views' depth."""
        return validate_depth(network, batches)


def _terms(total: Tensor, **terms: Tensor) -> dict[str, Tensor]:
    """Each of `TERMS`: the total with its gradient, the others without. Missing terms are 0, a missing PSNR is NaN."""
    zero = total.new_zeros(())
    complete = dict.fromkeys(TERMS, zero) | {"psnr": zero + torch.nan} | terms
    return {name: term.detach() for name, term in complete.items()} | {"total": total}


def _label_terms(
    network: Any, maps: ClassMaps, views: Views, class_weights: tuple[float, ...] | None, supervision: str
) -> dict[str, Tensor]:
    """The terms if only the classes of the views' own pixels count. Nothing is rendered, so there is no PSNR."""
    if views.labels is None:
        raise ValueError(f"the scenes have no labels; supervision by {supervision} needs them")
    distributions = maps.distributions.flatten(end_dim=-4)
    labels = views.labels.to(distributions.device).flatten(end_dim=-3)
    total = cross_entropy(distributions, labels, class_weights, network.stride).mean()
    return _terms(total, semantic=total, unlabelled=(labels == IGNORE).flatten(1).all(1).sum().to(total))


def _compare_renderings(network: Any, batch: Batch) -> Comparison:
    """The rendered target views and the true ones."""
    rendering, target = render_targets(network(batch.context), batch)
    decibels = psnr(rendering.images, target.images, target.hidden)
    return Comparison(target, rendering.semantics, strip(rendering, target), decibels)


def _compare_classes(distributions: Tensor, batch: Batch) -> Comparison:
    """The classes of the input views and the true ones."""
    return Comparison(batch.context, distributions, class_strip(distributions, batch.context))


def _is_finite(encoding: Encoding) -> bool:
    """Whether every number of the Gaussians is finite."""
    return all(bool(tensor.detach().isfinite().all()) for tensor in encoding.gaussians.tensors().values())


def _nan_terms(encoding: Encoding) -> dict[str, Tensor]:
    """NaN for every term, with a gradient to every tensor, so that all processes that share the step skip it."""
    tensors = (encoding.depths, *encoding.gaussians.tensors().values())
    total = torch.stack([tensor.sum() for tensor in tensors]).sum() * torch.nan
    return dict.fromkeys(TERMS, total.detach()) | {"total": total}
