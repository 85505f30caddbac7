"""SemGS: the complete network, from views to dual Gaussians."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.model.attention.transformer import CameraTransformer
from semgs.model.classes.refinement import Cues, ViewFeatures
from semgs.model.classes.semantic import SHAPE, ClassMaps, SemanticBranch
from semgs.model.classes.view_cache import ViewCache
from semgs.model.gaussians.heads import Decoder, coarse_disparities
from semgs.model.gaussians.placing import Placer
from semgs.model.layers.cnn import FeatureCNN, lay_out
from semgs.model.layers.network_input import WHOLE, Chunks, NetworkInput, by_chunks, widen
from semgs.model.memory.memory_plan import MemoryPlan, memory_plan
from semgs.model.memory.stage_memory import STAGES, Stage, Work
from semgs.model.settings import NetworkSettings
from semgs.model.sweep.depth import PlaneSweepDepth
from semgs.rendering.temperatures import Temperatures
from semgs.runtime.kernels import check_not_forked
from semgs.runtime.precision import Precision, in_full, in_own_precision
from semgs.scene.coarse_depth import SHRINK, CoarseDepth, FinerDepth
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

    def depth_layers(self) -> tuple[nn.Module, ...]:
        """Layers on which depth depends."""
        return (self.transformer, self.depth, *self.heads.depth_layers())

    def sweep_layers(self) -> tuple[nn.Module, ...]:
        """Layers on which the plane sweep depends."""
        return self.transformer, self.depth


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
        precision: of the layers, "float32" or "bf16"; depth, cameras and Gaussians stay in float32 or better.
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
        self.precision: Precision = "float32"
        self.temperatures: Temperatures | None = None
        self.cnn = cnn
        self.colour = colour
        self.semantic = semantic
        self.fuses = settings.semantic is not None and settings.semantic.fusion
        self._looks = 1
        self.placer = Placer(
            settings.stride, settings.colour.from_image, settings.conventions, settings.colour.shrink_seen
        )

    def train(self, mode: bool = True) -> SemGS:
        """Set the mode, as for every module. Convolutions use the faster memory format: channels last, except in training."""
        lay_out(self, torch.contiguous_format if mode else torch.channels_last)
        super().train(mode)  # some parts choose their own memory format
        return self

    @in_own_precision
    def forward(
        self,
        views: Views,
        chunks: Chunks | None = None,
        stage: Stage = nullcontext,
        cache: ViewCache | None = None,
    ) -> Encoding:
        """The Gaussians of N >= 2 views, and depth at their full size. Gaussians of hidden pixels have no opacity.

        Within autocast the layers compute in half precision, as with `precision` "bf16"; depth, cameras and Gaussians stay in float32 or better.

        Args:
            views: of one scene, or of a batch of scenes.
            chunks: views to process at a time; fewer need less memory and give the same numbers. None uses
                `memory_plan` for one scene in evaluation mode, and all views at once for a batch or in training.
            stage: context manager around each of `semgs.model.memory.stage_memory.STAGES`, for example to time it.
            cache: of earlier calls, which saves time if some of the views were in them; None for none. It carries no gradients.

        Raises:
            TypeError: it is given something else than views.
            ValueError: there is only one view.
            NotEnoughMemoryError: without `chunks`, one scene in evaluation mode does not fit into memory even with one view at a time.
            RuntimeError: this process was forked from one that had already rendered or encoded.
        """
        if not isinstance(views, Views):
            raise TypeError(
                f"the network takes semgs.Views, as scene.read(...) and Views.from_arrays(...) give them, and got {type(views).__name__}"
            )
        if (found := next(self.parameters()).dtype).itemsize < torch.float32.itemsize:
            raise TypeError(
                f"the network's weights are {found}; expected float32: call .float(), and set its precision to 'bf16' to compute faster"
            )
        inputs = self._inputs(views)
        chunks = self._chunks(views) if chunks is None else chunks
        with stage("cnn"):
            shallow = self.cnn(inputs.images)
        with stage("transformer_colour"):
            features = self.colour.transformer(shallow, inputs)
        with stage("transformer_semantic"):
            single = classify = None
            if self.semantic is not None:
                single = self._single(self.semantic, inputs, shallow, cache)
                classify = self.semantic(single, inputs)
        with stage("cost_volume"):
            cost = self.colour.depth.cost(features, inputs, chunks.cost)
        with stage("depth"):
            depth = self.colour.depth(cost, features, inputs, self._cues(inputs, single))
            decode = self.colour.heads(inputs, shallow, features, depth, chunks.heads)
        bounds = inputs.depth_range.flatten(0, 1)
        rays = self.placer.rays(inputs, views.size, depth.planes.bounds)

        def place(at: slice) -> Encoding:
            classes = None if classify is None else classify(at)
            return self.placer(decode(at), classes, inputs.small[at], rays[at], bounds[at], views.size)

        with stage("heads"):
            encoding = by_chunks(place, len(features), chunks.heads)
            # So far each view was a scene of its own; now views of the same scene are joined.
            leading, count = views.images.shape[:-4], len(views)
            encoding = encoding.map(lambda maps: maps.reshape(*leading, count * maps.shape[1], *maps.shape[2:]))
            if self.fuses and not self.training:
                encoding = encoding.fused(views.cameras)
            encoding = encoding.hide(views.hidden)
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
        return widen(maps, self.stride)[..., : views.size[0], : views.size[1]]

    @in_own_precision
    def class_maps(self, views: Views, alone: bool = False) -> ClassMaps:
        """The distributions of `classify`, one for each Gaussian; this is cheaper for training with labels.

        Raises:
            ValueError: as for `classify`.
        """
        if self.semantic is None:
            raise ValueError("the network has no semantic branch, so it cannot classify")
        inputs, evidence = self._inputs(views, fewest=1 if alone else 2), None
        single = self.semantic.refine(inputs, self.cnn, looks=self._looks_now, alone=alone)
        if alone:
            logits, evidence = self.semantic.single_view_logits(single, inputs), single.evidence
        else:
            logits = self.semantic(single, inputs)(slice(None))[:, SHAPE:]
        rows, columns = (-(-side // self.stride) for side in views.size)
        inside = logits[..., :rows, :columns]
        classes = in_full(inside).softmax(1)
        return ClassMaps(classes.reshape(*views.images.shape[:-3], *classes.shape[1:]), evidence)

    def sweep(self, views: Views) -> CoarseDepth:
        """The depth of N >= 2 views from the plane sweep alone, without refinement, heads or semantic branch.

        If the network has convex upsampling, `finer` is the depth after it.

        Args:
            views: of one scene, or of a batch of scenes.

        Raises:
            ValueError: there is only one view.
        """
        inputs, conventions = self._inputs(views), self.settings.conventions
        shallow = self.cnn(inputs.images)
        features = self.colour.transformer(shallow, inputs)
        cost = self.colour.depth.cost(features, inputs, None)
        depth = self.colour.depth(cost, features, inputs, self._cues(inputs))
        convex = self.colour.heads.convex_disparities(inputs, shallow, features, depth)
        leading, (height, width) = views.images.shape[:-3], views.size
        depths = 1 / coarse_disparities(depth, SHRINK, conventions)[:, :height, :width]
        # The centre of texel i lies on the border of pixels 4 i + 1 and 4 i + 2.
        rows, columns = ((side + 1) // SHRINK for side in (height, width))
        probabilities = depth.probabilities[..., :rows, :columns]

        def full(disparities: Tensor) -> Tensor:
            maps = widen(1 / disparities, self.stride)[:, :height, :width]
            return maps.reshape(*leading, *maps.shape[1:])

        return CoarseDepth(
            depths.reshape(*leading, *depths.shape[1:]),
            probabilities.reshape(*leading, *probabilities.shape[1:]),
            depth.planes.depths.reshape(*leading, -1),
            conventions.candidates,
            None if convex is None else FinerDepth(full(convex.mean()), full(convex.mode())),
        )

    def parts(self) -> dict[str, frozenset[str]]:
        """Names of the tensors (parameters and buffers) in each of `PARTS`; each tensor is in exactly one.

        "shared" is used by both branches: the shallow CNN, and layers of the class branch that give depth its cues. "depth" is the rest
        of what depth depends on, and "colour" the rest of the colour branch. "classes" are the layers that predict classes, and
        "semantic" the rest of the semantic branch.
        """
        colour, semantic = self.colour, self.semantic
        reports: dict[str, tuple[nn.Module, ...]] = {
            "classes": () if semantic is None else semantic.class_layers(),
            "shared": (*self._cue_layers(), *((self.cnn,) if self._shares_cnn else ())),
            "semantic": () if semantic is None else (semantic,),
            "depth": (self.cnn, *colour.depth_layers()),
            "colour": (colour,),
        }
        tensors = self.state_dict(keep_vars=True)
        parts = {}
        for part, layers in reports.items():
            own = {id(tensor) for layer in layers for tensor in layer.state_dict(keep_vars=True).values()}
            parts[part] = frozenset(name for name, tensor in tensors.items() if id(tensor) in own)
            tensors = {name: tensor for name, tensor in tensors.items() if name not in parts[part]}
        return {part: parts[part] for part in PARTS}

    def semantic_parameters(self, shared: bool = True, alone: bool = False) -> set[str]:
        """Names of the parameters on which `classify` depends; without `shared`, only those on which nothing else depends."""
        if self.semantic is None:
            return set()
        names = self._parameter_names(*self.semantic.layers(alone), *((self.cnn,) if self._shares_cnn else ()))
        return names if shared else names - self.parts()["shared"]

    def depth_parameters(self, shared: bool = True) -> set[str]:
        """Names of the parameters that learn from `sweep`; without `shared`, only those that the semantic branch does not use.

        Layers of the class branch that give depth its cues are not included, because depth never trains them.
        """
        cnn = () if self._shares_cnn and not shared else (self.cnn,)
        return self._parameter_names(*cnn, *self.colour.sweep_layers())

    def upsampling_parameters(self) -> set[str]:
        """Names of the parameters of the convex upsampling of depth; none without it."""
        return self._parameter_names(*self.colour.heads.upsampling_layers())

    def pretrained_parameters(self) -> set[str]:
        """Names of the parameters that can start from published weights; they should then learn at a lower rate."""
        return set() if self.semantic is None else self._parameter_names(*self.semantic.pretrained_layers())

    def second_parameters(self) -> set[str]:
        """Names of the parameters of the second network for classes; none without it."""
        mosaic = None if self.semantic is None else self.semantic.mosaic
        return set() if mosaic is None else self._parameter_names(mosaic)

    def _parameter_names(self, *layers: nn.Module) -> set[str]:
        """Names of the parameters of some layers."""
        own = {id(parameter) for layer in layers for parameter in layer.parameters()}
        return {name for name, parameter in self.named_parameters() if id(parameter) in own}

    @property
    def looks(self) -> int:
        """How often, outside training, it looks at each view for its classes: once, or twice, the second time at the mirror image in 1.5 times the
        size. Then classes are the mean of both distributions (test-time augmentation).

        Raises:
            ValueError: it is set to more than `most_looks`.
        """
        return self._looks

    @looks.setter
    def looks(self, looks: int) -> None:
        if not 1 <= looks <= self.most_looks:
            why = "" if self.most_looks > 1 else f", as {self.name} has no classes that depend on single views alone"
            raise ValueError(f"looks is {looks}; expected 1{' or 2' if self.most_looks > 1 else why}")
        self._looks = looks

    @property
    def _looks_now(self) -> int:
        return 1 if self.training else self.looks

    @property
    def most_looks(self) -> int:
        """How often it can look at each view: twice if the semantic branch does not compare views, else once."""
        return 1 if self.semantic is None else self.semantic.most_looks

    def _single(
        self, semantic: SemanticBranch, inputs: NetworkInput, shallow: Tensor, cache: ViewCache | None
    ) -> ViewFeatures:
        """What the semantic branch finds in single views, or found before."""
        if cache is None:
            return semantic.refine(inputs, self.cnn, shallow, self._looks_now)

        def compute(new: Sequence[int]) -> ViewFeatures:
            return semantic.refine(inputs.only(new), self.cnn, shallow[new], self._looks_now)

        return cache.features(inputs.images, compute)

    @property
    def _shares_cnn(self) -> bool:
        """Whether both branches use the shallow CNN."""
        return self.semantic is not None and self.semantic.shares_cnn

    def _cues(self, inputs: NetworkInput, single: ViewFeatures | None = None) -> Cues:
        """The class branch's cues, if depth reads them; from its features of the views, if they were already computed."""
        if self.semantic is None or not self.colour.depth.reads_cues:
            return ()
        return self.semantic.refinement.cues(inputs.images, () if single is None else single.cue_maps)

    def _cue_layers(self) -> tuple[nn.Module, ...]:
        """Layers of the class refinement on which depth depends."""
        if self.semantic is None or not self.colour.depth.reads_cues:
            return ()
        return self.semantic.refinement.cue_layers()

    def memory_plan(
        self, views: Views, targets: Views | None = None, *, available_bytes: float | None = None
    ) -> MemoryPlan:
        """The memory for encoding a scene with this network on its device, and for rendering its views.

        Args:
            views: the input views of one scene.
            targets: target views to render as well, as `semgs.run.steps.pipeline` does.
            available_bytes: as for `semgs.model.memory.memory_plan.memory_plan`.

        Raises:
            NotEnoughMemoryError: it does not fit even with one view at a time.
        """
        drawn = len(views) + (0 if targets is None else len(targets))
        return memory_plan(self.work(len(views), views.size, drawn), available_bytes)

    def work(self, views: int, size: tuple[int, int], drawn: int) -> Work:
        """The work of encoding a scene with this network, as its memory plan takes it.

        Args:
            views: number of input views.
            size: their (height, width) [px].
            drawn: number of views to render.
        """
        weight = self.cnn.conv1.weight
        network = (self.settings, self.class_count, self.fuses, weight.dtype, weight.device)
        return Work(*network, views, size, drawn, looks=self.looks)

    def _chunks(self, views: Views) -> Chunks:
        """How many views to process at a time."""
        return WHOLE if self.training or views.images.ndim > 4 else self.memory_plan(views).chunks

    def _inputs(self, views: Views, fewest: int = 2) -> NetworkInput:
        """The views in the form that the layers take; refuses too few views, and a forked process whose parent has computed."""
        check_not_forked()
        if len(views) < fewest:
            raise ValueError(f"the network got {len(views)} view; expected two or more that overlap")
        return NetworkInput.of(views, self.cnn.conv1.weight, self.stride)
