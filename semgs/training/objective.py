"""The objective: a network and what it is trained for, as the one module that the engine wraps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from torch import Tensor, nn

from semgs.data.views import Batch, Views, joined
from semgs.model.encoding import Encoding
from semgs.rendering.rendering import Rendering
from semgs.training.validation import Validation

TERMS = ("total", "semantic", "colour", "smoothness", "depth", "gradients", "distribution", "psnr", "unlabelled")
"""What the objective says of a batch; only `total` has a gradient."""


class Supervision(ABC):
    """What a network learns from, and how it is validated.

    Attributes:
        measures: whether its batch norms measure statistics during training; if not, they use those that they have.
        without_depth: what to do about a scene without true depth; None if it can learn from it as it is.
    """

    measures: ClassVar[bool] = False
    without_depth: ClassVar[str | None] = None

    @abstractmethod
    def loss(self, network: Any, batch: Batch, head: nn.Module | None = None) -> dict[str, Tensor]:
        """Each of `TERMS` of a batch as a number, `total` with its gradient.

        Every term is a mean over scenes, so that the means of equal shares of a batch average to that of the whole.

        Args:
            network: what learns.
            batch: what it sees.
            head: what `head` gave.
        """

    def head(self, network: Any) -> nn.Module | None:
        """What learns beside the network and is dropped afterwards; None for nothing."""
        return None

    @abstractmethod
    def learning(self, network: Any) -> set[str]:
        """Names of the parameters that learn."""

    @abstractmethod
    def validate(self, network: Any, batches: Sequence[Batch]) -> Validation:
        """How good the network is on batches that it does not learn from."""

    @property
    @abstractmethod
    def without_labels(self) -> str | None:
        """What to do about scenes of which none has labels; None if it can learn from them as they are."""


class Objective(nn.Module):
    """From a batch to the terms of its loss.

    Args:
        network: what learns.
        supervision: what it learns from.

    Attributes:
        head: what learns beside the network, None for nothing.
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
    """The Gaussians of the contexts as the targets see them (and the contexts, if asked), and what they should see.

    The near bound is the smallest of each scene's contexts, as for its encoding. Both are on the Gaussians' device. The rendering is not
    clamped, so that pixels brighter than 1 have a gradient.
    """
    target = joined([batch.target, batch.context]) if context_targets else batch.target
    rendering = encoding.render(target.cameras, clamp=False)
    return rendering, target.to(rendering.images.device)


def all_views(batch: Batch) -> Views:
    """Targets, then contexts."""
    return joined([batch.target, batch.context])
