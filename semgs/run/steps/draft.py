"""A reconstruction in the making. Each step returns a draft that knows more."""

from __future__ import annotations

from dataclasses import dataclass

from semgs.data.choosing.choice import Choice
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.depth_maps.map_depth import MapPlacement
from semgs.depth_maps.sensor_depth import Placement
from semgs.model.memory.memory_plan import MemoryPlan
from semgs.run.steps.result import GivenSplat
from semgs.scene.encoding import Encoding
from semgs.scene.exposure import Exposures
from semgs.scene.photo_refinement import Refined
from semgs.segmenters.features.scene_features import SceneFeatures
from semgs.segmenters.labelling import Labelling


@dataclass(frozen=True)
class Refining:
    """How Gaussians were refined on photos.

    Attributes:
        passes: steps for each photo that were allowed.
        done: the refined Gaussians, and after how many passes they were best.
        before: the Gaussians before.
        check: name of the frame that decided when to stop; None without one.
        check_taught: whether it decided in a trial, and taught with the others afterwards.
    """

    passes: int
    done: Refined
    before: Encoding
    check: str | None = None
    check_taught: bool = False


@dataclass(frozen=True)
class Draft:
    """What is known of a reconstruction so far.

    Attributes:
        scene: the source of the frames.
        choice: input frames and held-out ones.
        context, target: the same as read; `target` is None if none is held out.
        encoding: the Gaussians.
        model: name of the model, or the format of a splat.
        labelling: where the classes come from; None for the model.
        placement: how the Gaussians were placed at a sensor's depth, or with the help of depth maps; None if their depth is the model's.
        plan: how memory was used; None for a network that `memory_plan` does not support.
        exposures: of the input photos; None if they are as taken.
        refining: how the Gaussians were refined; None if they were not.
        features: of the Gaussians; None for none.
        splat: whose Gaussians these are, with new classes; None if they are the network's.
    """

    scene: Scene
    choice: Choice
    context: Views
    target: Views | None
    encoding: Encoding
    model: str
    labelling: Labelling | None = None
    placement: Placement | MapPlacement | None = None
    plan: MemoryPlan | None = None
    exposures: Exposures | None = None
    refining: Refining | None = None
    features: SceneFeatures | None = None
    splat: GivenSplat | None = None

    @property
    def names(self) -> list[str]:
        """The names of the input frames."""
        return [self.scene.frames[position].name for position in self.choice.context]
