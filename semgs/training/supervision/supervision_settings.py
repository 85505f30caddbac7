"""Settings of the supervision: what a training learns from. No torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from semgs.objectives.loss_weights import DepthLossWeights, LossWeights
from semgs.training.setting_checks import check_values

SupervisedBy = Literal["rendered", "labels", "pictures", "depth"]

CLASS_WEIGHTINGS = {"inverse_root_frequency": 0.5, "inverse_fourth_root_frequency": 0.25}
"""Rules that give rare classes more weight: (1 / share of the pixels) to this power."""


@dataclass(frozen=True, kw_only=True)
class SupervisionSettings:
    """What a training learns from."""

    supervision: SupervisedBy = "rendered"
    """What the loss compares. rendered: rendered views, as in the paper. labels: classes of the input views' own pixels, before splatting; trains
    only the semantic branch and shared layers, five times faster. pictures: the same, but each sample is a single image of another scene,
    without the transformer between views; a first stage that learns what things look like. depth: depth of the plane sweep against true
    depth; needs depth, but no labels."""
    losses: LossWeights = field(default_factory=LossWeights)
    """Weights of the paper's three loss terms. With --supervision labels, only the ratio of smoothness and semantic matters."""
    depth_losses: DepthLossWeights = field(default_factory=DepthLossWeights)
    """Weights of the loss terms for --supervision depth."""
    class_weights: tuple[float, ...] | Literal["inverse_root_frequency", "inverse_fourth_root_frequency"] | None = None
    """Weight of each class in the cross-entropy; None weighs all alike, as the paper does. inverse_root_frequency counts how often each class
    occurs in the data and favours rare ones; inverse_fourth_root_frequency favours them less."""
    depth_weight: float = 0.0
    """Weight of the error in log depth of the input views, if their true depth is known (not in the paper)."""
    context_targets: bool = False
    """Also render and compare the input views (not in the paper). Depth is easiest to learn there."""
    teacher: str = ""
    """Folder with another network's class probabilities for the training images, from scripts/teach.py. The network also learns these, so the
    backbone does not forget real photos. Needs --supervision pictures."""
    teacher_weight: float = 1.0
    """Weight of that second loss, a Kullback-Leibler divergence."""

    def __post_init__(self) -> None:
        rule = isinstance(self.class_weights, str)
        check_values(
            self,
            supervision=(
                self.supervision in get_args(SupervisedBy),
                f"one of {', '.join(get_args(SupervisedBy))}",
            ),
            class_weights=(
                not rule or self.class_weights in CLASS_WEIGHTINGS,
                f"a factor for each class of the table, {', '.join(CLASS_WEIGHTINGS)}, or None",
            ),
            losses=(
                self.supervision != "labels" or self.losses.semantic > 0,
                "a cross-entropy above 0 (--losses.semantic) with --supervision labels",
            ),
            depth_weight=(self.depth_weight >= 0, "0 or more"),
            teacher=(not self.teacher or self.single_images, "none, except with --supervision pictures"),
            teacher_weight=(self.teacher_weight > 0, "a positive number"),
        )

    @property
    def single_images(self) -> bool:
        """Whether each sample is a single image, so that every image of a batch shows another scene."""
        return self.supervision == "pictures"

    @property
    def uses_labels(self) -> bool:
        """Whether labels matter."""
        return self.supervision != "depth"

    @property
    def without_labels(self) -> str | None:
        """Advice for data without any labels; None if none are needed."""
        if self.supervision == "rendered":
            advice = "train colour and depth alone with --losses.semantic 0 --losses.smoothness 0"
            return advice if self.losses.teach_classes else None
        return "give --supervision rendered" if self.uses_labels else None

    @property
    def without_depth(self) -> str | None:
        """Advice for a scene without true depth; None if none is needed."""
        return "leave them out, or give --supervision rendered" if self.supervision == "depth" else None
