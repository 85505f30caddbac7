"""The objective: a network and its loss, as the one module that the engine wraps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, ClassVar

from torch import Tensor, nn

from semgs.data.views import Batch, Views, joined
from semgs.rendering.rendering import Rendering
from semgs.scene.encoding import Encoding
from semgs.training.supervision.validation import Validation

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
