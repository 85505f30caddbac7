"""The weights of the loss's terms; no torch, so that settings can be read and printed without it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class LossWeights:
    """Weights of the losses; the defaults are the paper's.

    Attributes:
        semantic: of the cross-entropy L_sem.
        colour: of the squared error L_c.
        smoothness: of the regional smoothness L_rs; 0 is the paper's ablation without it.
        smoothness_over: what L_rs of a view is: its sum divided by the number of labelled pixels, or the sum itself, as equation 6 of the
            paper reads. The sum grows with the size of the images.
    """

    semantic: float = 0.1
    colour: float = 1.0
    smoothness: float = 0.001
    smoothness_over: Literal["pixels", "sum"] = "pixels"

    @property
    def teach_classes(self) -> bool:
        """Whether a term depends on classes."""
        return self.semantic > 0 or self.smoothness > 0


@dataclass(frozen=True)
class DepthLossWeights:
    """Weights of the losses on depth; none is the paper's.

    Attributes:
        log: of the mean absolute error of log depth.
        gradients: of gradient matching: the error of log depth should not change between neighbouring pixels, at four scales.
        distribution: of the cross-entropy of the distribution over the depth candidates.
        sharp: of the depth after convex upsampling: error of log depth, mostly near edges, and gradient matching. It needs such a network.
    """

    log: float = 1.3
    gradients: float = 0.5
    distribution: float = 0.1
    sharp: float = 0.0
