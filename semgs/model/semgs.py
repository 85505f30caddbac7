"""SemGS: the complete network, from views to dual Gaussians."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.model.attention.transformer import CameraTransformer
from semgs.model.classes.refinement import Cues, Refined
from semgs.model.classes.semantic import SHAPE, ClassMaps, SemanticBranch
from semgs.model.gaussians.heads import Decoder, coarse_disparities
from semgs.model.gaussians.placing import Placer
from semgs.model.layers.chunks import WHOLE, Chunks, by_chunks
from semgs.model.layers.cnn import FeatureCNN
from semgs.model.layers.memory_format import lay_out
from semgs.model.layers.network_input import Padded, widened
from semgs.model.settings import NetworkSettings
from semgs.model.stages import STAGES, Stage
from semgs.model.sweep.depth import PlaneSweepDepth
from semgs.rendering.temperatures import Temperatures
from semgs.runtime.kernels import check_not_forked
from semgs.scene.coarse_depth import SHRINK, CoarseDepth
from semgs.scene.encoding import Encoding

__all__ = ["STAGES", "ColourBranch", "SemGS"]

PARTS = ("shared", "depth", "colour", "semantic", "classes")
"""The parts of a network in `SemGS.parts`."""


class ColourBranch(nn.Module):
    """The colour branch and depth.

    Args:
        transformer: over all views.
        depth: by plane sweep, from the transformer's features.
        heads: turns features and depth into the attributes of Gaussians.
    """

    def __init__(self, transformer: CameraTransformer, depth: PlaneSweepDepth, heads: Decoder) -> None:
        super().__init__()
        self.transformer = transformer
        self.depth = depth
        self.heads = heads


class SemGS(nn.Module):
    """Views in, dual Gaussians out. `semgs.model.build.build` builds it from settings.

    Args:
        settings: from which the parts were built; they are saved with the weights.
        classes: the class table of the semantic branch; None for a colour-only network.
        cnn: the shallow CNN.
        colour: the colour branch and depth.
        semantic: the semantic branch; None for a colour-only network.

    Attributes:
        name: of the network, such as "small".
        class_count: number of classes, 0 without a class table.
        stride: pixels per Gaussian along each side.
        origin: one sentence on where the weights come from.
        temperatures: calibrate the class distributions; None if the weights have none. The network itself never applies them.
        fuses: whether, outside training, input views agree on the classes of points that several of them see.
    """

    def __init__(
        self,
        settings: NetworkSettings,
        classes: ClassTable | None,
        cnn: FeatureCNN,
        colour: ColourBranch,
        semantic: SemanticBranch | None,
    ) -> None:
        super().__init__()
        self.settings = settings
        self.name = settings.name
        self.stride = settings.stride
        self.classes = classes
        self.class_count = 0 if classes is None else len(classes)
        self.origin = "untrained"
        self.temperatures: Temperatures | None = None
        self.cnn = cnn
        self.colour = colour
        self.semantic = semantic
        self.fuses = settings.semantic is not None and settings.semantic.fusion
        self.placer = Placer(
            settings.stride, settings.colour.from_image, settings.conventions, settings.colour.shrink_seen
        )

    def train(self, mode: bool = True) -> SemGS:
        """Set the mode, as for every module. Convolutions use the faster memory format: channels last, except in training."""
        lay_out(self, torch.contiguous_format if mode else torch.channels_last)
        super().train(mode)  # some parts choose their own memory format
        return self

    def forward(self, views: Views, chunks: Chunks | None = None, stage: Stage = nullcontext) -> Encoding:
        """The Gaussians of N >= 2 views, and depth at their full size.

        Within autocast the layers compute in half precision; depth, cameras and Gaussians stay in float32 or better.

        Args:
            views: of one scene, or of a batch of scenes.
            chunks: views to process at a time; fewer need less memory and give the same numbers. None uses
                `semgs.model.memory.memory_plan.memory_plan` for one scene in evaluation mode, and all views at once for a batch or in training.
            stage: context manager around each of `semgs.model.stages.STAGES`, for example to time it.

        Raises:
            ValueError: there is only one view.
            NotEnoughMemoryError: without `chunks`, one scene in evaluation mode does not fit into memory even with one view at a time.
            RuntimeError: this process was forked from one that had already rendered or encoded.
        """
        scene = self._padded(views)
        chunks = self._planned(views) if chunks is None else chunks
        with stage("cnn"):
            shallow = self.cnn(scene.images)
        with stage("transformer_colour"):
            features = self.colour.transformer(shallow, scene)
        with stage("transformer_semantic"):
            refined = None if self.semantic is None else self.semantic.refined(scene, self.cnn, shallow)
            semantic = None if self.semantic is None else self.semantic(refined, scene)
        with stage("cost_volume"):
            cost = self.colour.depth.cost(features, scene, chunks.cost)
        with stage("depth"):
            depth = self.colour.depth(cost, features, scene, self._cues(scene, refined))
            decode = self.colour.heads(scene, shallow, features, depth, chunks.heads)
        bounds = scene.depth_range.flatten(0, 1)
        rays = self.placer.rays(scene, views.size, depth.planes.bounds)

        def placed(at: slice) -> Encoding:
            classes = None if semantic is None else semantic(at)
            return self.placer(decode(at), classes, scene.small[at], rays[at], bounds[at], views.size)

        with stage("heads"):
            encoding = by_chunks(placed, len(features), chunks.heads)
            # So far each view was a scene of its own; now views of the same scene are joined.
            leading, count = views.images.shape[:-4], len(views)
            encoding = encoding.map(lambda maps: maps.reshape(*leading, count * maps.shape[1], *maps.shape[2:]))
            if self.fuses and not self.training:
                encoding = encoding.fused(views.cameras)
        return replace(encoding, classes=self.classes, temperatures=self.temperatures)

    def classify(self, views: Views, alone: bool = False) -> Float[Tensor, "*batch v class h w"]:
        """The class distribution of every pixel of N >= 2 views, from the semantic branch alone.

        Nothing is placed in space or splatted. Pixels that share a Gaussian have the same distribution. Each view speaks for itself: with
        `fuses`, the Gaussians of `forward` have classes on which the views agree.

        Args:
            views: of one scene, or of a batch of scenes.
            alone: classify each view on its own, without layers that compare views; then one view is enough, and cameras do not matter.

        Raises:
            ValueError: there is only one view, or the network has no semantic branch.
        """
        maps = self.class_maps(views, alone).distributions
        return widened(maps, self.stride)[..., : views.size[0], : views.size[1]]

    def class_maps(self, views: Views, alone: bool = False) -> ClassMaps:
        """The distributions of `classify`, one for each Gaussian; this is cheaper for training with labels.

        Raises:
            ValueError: as for `classify`.
        """
        if self.semantic is None:
            raise ValueError("the network has no semantic branch, so it cannot classify")
        scene, evidence = self._padded(views, fewest=1 if alone else 2), None
        refined = self.semantic.refined(scene, self.cnn)
        if alone:
            logits, evidence = self.semantic.logits_of(refined, scene), refined.evidence
        else:
            logits = self.semantic(refined, scene)(slice(None))[:, SHAPE:]
        rows, columns = (-(-side // self.stride) for side in views.size)
        inside = logits[..., :rows, :columns]
        classes = inside.to(torch.promote_types(inside.dtype, torch.float32)).softmax(1)
        return ClassMaps(classes.reshape(*views.images.shape[:-3], *classes.shape[1:]), evidence)

    def sweep(self, views: Views) -> CoarseDepth:
        """The depth of N >= 2 views from the plane sweep alone, without refinement, heads or semantic branch.

        Args:
            views: of one scene, or of a batch of scenes.

        Raises:
            ValueError: there is only one view.
        """
        scene, conventions = self._padded(views), self.settings.conventions
        features = self.colour.transformer(self.cnn(scene.images), scene)
        cost = self.colour.depth.cost(features, scene, None)
        depth = self.colour.depth(cost, features, scene, self._cues(scene))
        leading, (height, width) = views.images.shape[:-3], views.size
        depths = 1 / coarse_disparities(depth, SHRINK, conventions)[:, :height, :width]
        # The centre of texel i lies on the border of pixels 4 i + 1 and 4 i + 2.
        rows, columns = ((side + 1) // SHRINK for side in (height, width))
        probabilities = depth.probabilities[..., :rows, :columns]
        return CoarseDepth(
            depths.reshape(*leading, *depths.shape[1:]),
            probabilities.reshape(*leading, *probabilities.shape[1:]),
            depth.planes.depths.reshape(*leading, -1),
            conventions.candidates,
        )

    def parts(self) -> dict[str, frozenset[str]]:
        """Names of the tensors (parameters and buffers) in each of `PARTS`; each tensor is in exactly one.

        "shared" is used by both branches: the shallow CNN, and layers of the class branch that give depth its cues. "depth" is the rest
        of what depth depends on, and "colour" the rest of the colour branch. "classes" are the layers that predict classes, and
        "semantic" the rest of the semantic branch.
        """
        shares = self.semantic is not None and self.semantic.shares_cnn
        cues = tuple(f"semantic.refinement.{one}." for one in self._cue_layers())
        heads = (f"colour.heads.{one}." for one in self.colour.heads.depth_layers)
        classes = () if self.semantic is None else tuple(f"semantic.{one}." for one in self.semantic.class_layers())
        beginnings = (
            ("classes", classes),
            ("shared", cues),
            ("semantic", ("semantic.",)),
            ("shared" if shares else "depth", ("cnn.",)),
            ("depth", ("colour.transformer.", "colour.depth.", *heads)),
            ("colour", ("colour.",)),
        )
        found: dict[str, set[str]] = {part: set() for part in PARTS}
        for name in self.state_dict():
            found[next(part for part, some in beginnings if name.startswith(some))].add(name)
        return {part: frozenset(names) for part, names in found.items()}

    def semantic_parameters(self, shared: bool = True, alone: bool = False) -> set[str]:
        """Names of the parameters on which `classify` depends; without `shared`, only those on which nothing else depends."""
        if self.semantic is None:
            return set()
        used = tuple(f"semantic.{one}." for one in self.semantic.layers(alone))
        if self.semantic.shares_cnn:
            used += ("cnn.",)
        held = frozenset() if shared else self.parts()["shared"]
        return {name for name, _ in self.named_parameters() if name.startswith(used) and name not in held}

    def depth_parameters(self, shared: bool = True) -> set[str]:
        """Names of the parameters that learn from `sweep`; without `shared`, only those that the semantic branch does not use.

        Layers of the class branch that give depth its cues are not included, because depth never trains them.
        """
        used: tuple[str, ...] = ("colour.transformer.", "colour.depth.")
        if shared or self.semantic is None or not self.semantic.shares_cnn:
            used += ("cnn.",)
        return {name for name, _ in self.named_parameters() if name.startswith(used)}

    def pretrained_parameters(self) -> set[str]:
        """Names of the parameters that can start from published weights; they should then learn at a lower rate."""
        return {name for name, _ in self.named_parameters() if name.startswith("semantic.refinement.backbone.")}

    def _cues(self, scene: Padded, refined: Refined | None = None) -> Cues:
        """The class branch's cues, if depth reads them; from its refinement of the views, if that was already computed."""
        if self.semantic is None or not self.colour.depth.reads_cues:
            return ()
        return self.semantic.refinement.cues(scene.images, () if refined is None else refined.seen)

    def _cue_layers(self) -> tuple[str, ...]:
        """Names of the layers of the class refinement on which depth depends."""
        if self.semantic is None or not self.colour.depth.reads_cues:
            return ()
        return self.semantic.refinement.cue_layers

    def _planned(self, views: Views) -> Chunks:
        """How many views to process at a time."""
        if self.training or views.images.ndim > 4:
            return WHOLE
        from semgs.model.memory.memory_plan import memory_plan  # which imports this class

        return memory_plan(self, views).chunks

    def _padded(self, views: Views, fewest: int = 2) -> Padded:
        """The views in the form that the layers take; refuses too few views, and a forked process whose parent has computed."""
        check_not_forked()
        if len(views) < fewest:
            raise ValueError(f"the network got {len(views)} view; expected two or more that overlap")
        return Padded.of(views, self.cnn.conv1.weight, self.stride)
