"""Settings of the supervision: what a training learns from. No torch."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from semgs.files.records import check_values
from semgs.objectives.loss_weights import DepthLossWeights, LossWeights

SupervisedBy = Literal["rendered", "labels", "pictures", "depth"]
TeacherTarget = Literal["head", "classes"]

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
    teacher_target: TeacherTarget = "head"
    """What learns the teacher's probabilities. head: an extra head, for a teacher with classes of its own. classes: the network's own classes,
    for a teacher that has the same ones."""

    def __post_init__(self) -> None:
        rule = isinstance(self.class_weights, str)
        factors = self.class_weights if isinstance(self.class_weights, tuple) else (1.0,)
        terms = (self.losses.semantic, self.losses.colour, self.losses.smoothness)
        of_depth = self.depth_losses
        depth_terms = (of_depth.log, of_depth.gradients, of_depth.distribution, of_depth.sharp)
        check_values(
            self,
            supervision=(
                self.supervision in get_args(SupervisedBy),
                f"one of {', '.join(get_args(SupervisedBy))}",
            ),
            class_weights=(
                self.class_weights in CLASS_WEIGHTINGS if rule else _are_weights(factors),
                f"a factor of 0 or more for each class of the table, not all of them 0; {', '.join(CLASS_WEIGHTINGS)}; or None",
            ),
            depth_weight=(_are_weights((self.depth_weight, 1.0)), "0 or more"),
            losses=(
                _are_weights((*terms, self.depth_weight if self.supervision == "rendered" else 1.0))
                and (self.supervision != "labels" or self.losses.semantic > 0),
                "weights of 0 or more, one of them or of --depth-weight above 0 with --supervision rendered, and a "
                "cross-entropy above 0 (--losses.semantic) with --supervision labels",
            ),
            depth_losses=(
                _are_weights((*depth_terms, 0.0 if self.supervision == "depth" else 1.0)),
                "weights of 0 or more, and one above 0 with --supervision depth",
            ),
            teacher=(not self.teacher or self.single_images, "none, except with --supervision pictures"),
            teacher_weight=(_are_weights((self.teacher_weight,)), "a positive number"),
            teacher_target=(
                self.teacher_target in get_args(TeacherTarget),
                f"one of {', '.join(get_args(TeacherTarget))}",
            ),
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


def _are_weights(values: tuple[float, ...]) -> bool:
    """Whether these are finite numbers of 0 or more, and at least one is above 0."""
    return all(math.isfinite(value) and value >= 0 for value in values) and any(values)
