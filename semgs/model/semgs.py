"""SemGS: the whole network, from views to dual Gaussians."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, replace
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate

from semgs.data.classes import SCANNET20, ClassTable
from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Gaussians
from semgs.geometry.plane_sweep import depth_candidates, expected_depth
from semgs.model.camera_attention import token_transforms
from semgs.model.chunks import WHOLE, Chunks, by_chunks
from semgs.model.cnn import FeatureCNN, ResidualBlock
from semgs.model.conventions import OURS, Conventions
from semgs.model.cost_volume import cost_volume, unit_features
from semgs.model.encoding import Encoding
from semgs.model.heads import (
    CostRegressor,
    Decoded,
    DepthRefinement,
    Head,
    Rays,
    Upsampler,
    colour_appearance,
    drawn_attributes,
    points,
    semantic_appearance,
    start_at,
    upsampled,
)
from semgs.model.layout import beside, lay_out
from semgs.model.pyramid import SemanticPyramid, near_side
from semgs.model.swin import MultiViewSwin

SHRINK = 4
"""Features are at 1/4 of the picture."""

MULTIPLE = 16
"""Sides of the pictures are padded to a multiple of this."""

STAGES = ("cnn", "transformer_colour", "transformer_semantic", "cost_volume", "depth", "heads")
"""Parts of the network that take time, in their order."""

Stage = Callable[[str], AbstractContextManager[object]]
"""What stands around each stage, given its name."""


class SemGS(nn.Module):
    """Views in, dual Gaussians out; the defaults are the paper's sizes with MVSplat's layer shapes.

    Args:
        classes: table of the semantic branch; None builds a colour-only network.
        channels: d of features and transformers.
        cnn_widths: channels of the shallow CNN.
        candidates: L.
        colour_blocks, semantic_blocks: transformer blocks of each branch.
        semantic_pyramid: widths of the coarser maps, at 1/8 of the picture and so on, of the pyramid that refines the
            semantic branch's features and classifies each view by itself, which the head corrects; none takes the paper's
            two residual blocks and leaves the classes to the head.
        windows: along each side of the token map; 1 is full attention (ablation *Sw-Trans*).
        expansion: of the transformers' feed-forward networks.
        reduction: 2 lets the transformers work at 1/8 of the picture.
        shared_layers: one shallow CNN for both branches (ablation *Sh-Layer*).
        camera_aware_colour, camera_aware_semantic: camera-aware attention in each branch (ablation *C-Inj*).
        output_transform: multiply the attention output by G; False is the paper's text.
        cost_width, cost_hidden, cost_levels: of the network that turns cost into depth probabilities.
        upsampled_channels, projected_channels: of the features at the Gaussians' scale.
        refine_width, refine_levels: of the full-size refinement.
        decoder_blocks: residual blocks a level on the way up of both U-Nets.
        colour_hidden, semantic_hidden: width between the two layers of the heads.
        paper_heads: the paper's text word by word instead of MVSplat's heads: depth is the upsampled expectation without
            refinement, means lie on pixel centres, opacity is a CNN on the upsampled distribution over the candidates,
            and both branches' heads see the picture and their upsampled transformer features alone.
        opacity_hidden: width between the two layers of that opacity CNN.
        last_kernel: of the heads' second layer.
        harmonics: coefficients a colour that the head predicts; those beyond degree 3 are never drawn nor computed.
        colour_from_image: the colour head predicts a correction of the picture's own colour.
        gaussian_stride: 1 places a Gaussian per pixel, 2 one per 2x2 pixels.
        cosine_cost: correlate features that are centred in each picture and of equal length, so that costs are
            cosines times the root of d; a network that starts from nothing learns depth far sooner with it.
        cost_prior: depth's logits are a correction of the cost itself, from normalised features; else they are free, and
            at a high learning rate they saturate into one candidate before the features have learned to match.
        initial_sigma: size at which Gaussians start, in pixels of their own grid; None leaves it to the draw.
        initial_depth_scale: factor on the drawn weights of depth's last layers; below 1 all candidates start alike.
        conventions: of geometry.
        name: of the preset.

    Attributes:
        classes: the class table, None for a colour-only network.
        settings: the arguments above as plain JSON, without `classes`.
        origin: one sentence on where the weights come from.
        temperatures: for `semgs.tempered`, of "rendered" pixels and of single "gaussians", where the weights have some; the network itself
            never applies them.
    """

    def __init__(
        self,
        *,
        classes: ClassTable | None = SCANNET20,
        channels: int = 128,
        cnn_widths: tuple[int, int, int] = (64, 96, 128),
        candidates: int = 128,
        colour_blocks: int = 6,
        semantic_blocks: int = 3,
        semantic_pyramid: tuple[int, ...] = (),
        windows: int = 2,
        expansion: int = 4,
        reduction: int = 1,
        shared_layers: bool = True,
        camera_aware_colour: bool = True,
        camera_aware_semantic: bool = True,
        output_transform: bool = True,
        cost_width: int = 128,
        cost_hidden: int = 256,
        cost_levels: int = 3,
        upsampled_channels: int = 128,
        projected_channels: int = 32,
        refine_width: int = 32,
        refine_levels: int = 5,
        decoder_blocks: int = 2,
        colour_hidden: int = 168,
        semantic_hidden: int = 54,
        paper_heads: bool = False,
        opacity_hidden: int = 32,
        last_kernel: int = 3,
        harmonics: int = 25,
        colour_from_image: bool = False,
        gaussian_stride: int = 1,
        cosine_cost: bool = False,
        cost_prior: bool = False,
        initial_sigma: float | None = None,
        initial_depth_scale: float = 1.0,
        conventions: Conventions = OURS,
        name: str = "base",
    ) -> None:
        super().__init__()
        self.settings = {
            key: value for key, value in locals().items() if key not in ("self", "__class__", "classes", "conventions")
        }
        self.settings["cnn_widths"] = list(cnn_widths)
        self.settings["semantic_pyramid"] = list(semantic_pyramid)
        self.settings["conventions"] = asdict(conventions)
        self.name = name
        self.origin = "untrained"
        self.temperatures: dict[str, float] = {}
        self.classes = classes
        self.conventions = conventions
        self.candidates = candidates
        self.camera_aware = {"colour": camera_aware_colour, "semantic": camera_aware_semantic}
        self.output_transform = output_transform
        self.harmonics = harmonics
        self.colour_from_image = colour_from_image
        self.stride = gaussian_stride
        self.cosine_cost = cosine_cost
        self.paper_heads = paper_heads
        self.factor = SHRINK // gaussian_stride

        self.cnn = FeatureCNN(cnn_widths, channels)
        self.colour_transformer = MultiViewSwin(channels, colour_blocks, windows, expansion, reduction)
        self.cost_regressor = CostRegressor(
            channels, candidates, cost_width, cost_hidden, cost_levels, decoder_blocks, cost_prior
        )
        seen = 3 + (channels if paper_heads else upsampled_channels)
        if paper_heads:
            self.opacity_head = Head(candidates, opacity_hidden, 1, last_kernel)
            self.colour_head = Head(seen, colour_hidden, 7 + 3 * harmonics, last_kernel)
        else:
            self.colour_upsampler = Upsampler(2 * channels, upsampled_channels, self.factor, conventions.pixel_centres)
            self.depth_refinement = DepthRefinement(
                upsampled_channels, projected_channels, refine_width, refine_levels, decoder_blocks
            )
            self.colour_head = Head(refine_width + seen, colour_hidden, 9 + 3 * harmonics, last_kernel)
        if classes is not None:
            self.semantic_cnn = None if shared_layers else FeatureCNN(cnn_widths, channels)
            self.semantic_refinement: SemanticPyramid | nn.Sequential
            if semantic_pyramid:
                self.semantic_refinement = SemanticPyramid(channels, tuple(semantic_pyramid), SHRINK, len(classes))
            else:
                self.semantic_refinement = nn.Sequential(
                    ResidualBlock(channels, channels), ResidualBlock(channels, channels)
                )
            self.semantic_transformer = MultiViewSwin(channels, semantic_blocks, windows, expansion, reduction)
            if not paper_heads:
                self.semantic_upsampler = Upsampler(
                    2 * channels, upsampled_channels, self.factor, conventions.pixel_centres
                )
            self.semantic_head = Head(seen, semantic_hidden, 7 + len(classes), last_kernel)
        for last in [self.cost_regressor.head[-1]] + ([] if paper_heads else [self.depth_refinement.to_disparity[-1]]):
            last.get_parameter("weight").data.mul_(initial_depth_scale)
        if initial_sigma is not None:
            start_at(self.colour_head, slice(0, 3) if paper_heads else slice(2, 5), initial_sigma)
            if classes is not None:
                start_at(self.semantic_head, slice(0, 3), initial_sigma)
        if classes is not None and semantic_pyramid:
            for parameter in self.semantic_head[-1].parameters():
                parameter.data[7:] = 0  # at first the classes are the pyramid's

    def train(self, mode: bool = True) -> SemGS:
        """As of every module; and its convolutions take the layout that is faster: channels last, but for the way back."""
        super().train(mode)
        lay_out(self, torch.contiguous_format if mode else torch.channels_last)
        if self._pyramid is not None:
            lay_out(self._pyramid, torch.channels_last)  # half the time of a step, there
        return self

    def forward(self, views: Views, chunks: Chunks = WHOLE, stage: Stage = nullcontext) -> Encoding:
        """The Gaussians of N >= 2 views, and depth at their full size.

        Args:
            views: of one scene, or of a batch of scenes.
            chunks: how much is done at a time; fewer views at a time need less memory and give the same numbers.
            stage: stands around each of `STAGES`, to time it, say.

        Raises:
            ValueError: there is one view only.
        """
        count = len(views)
        if count < 2:
            raise ValueError(f"the network was given {count} view; expected two or more that overlap")
        leading = views.images.shape[:-4]
        flat = _flattened(views, self.cnn.conv1.weight)
        encoding = self._encode(flat.images, flat.cameras, flat.depth_range, views.size, chunks, stage)
        return encoding.map(lambda tensor: tensor.reshape(*leading, *tensor.shape[1:]))

    def classify(self, views: Views, alone: bool = False) -> Float[Tensor, "*batch v class h w"]:
        """The distribution over classes of every pixel of N >= 2 views, as their own Gaussians have it: the semantic branch alone.

        Nothing is placed in space nor splatted; where Gaussians stand for several pixels, those have the same distribution.

        Args:
            views: of one scene, or of a batch of scenes.
            alone: pass the transformer over, and with a pyramid the head, so that no view learns from another; one will do,
                and cameras do not matter.

        Raises:
            ValueError: there is one view only, or the network has no semantic branch.
        """
        if len(views) < 2 and not alone:
            raise ValueError(f"the network was given {len(views)} view; expected two or more that overlap")
        flat = _flattened(views, self.cnn.conv1.weight)
        pictures = flat.images.flatten(0, 1)
        if self.classes is None:
            raise ValueError("the network has no semantic branch; it cannot classify")
        refined = self._semantic_refined(pictures, self.cnn(pictures))
        if alone and self._pyramid is not None:
            raw = self._pyramid_classes(self._pyramid, refined)
        else:
            seen = refined if alone else self._semantic_seen(refined, flat.cameras, flat.depth_range)
            raw = self._semantic_raw(self._shrunk(pictures), Semantic(refined, seen), slice(None))[:, 7:]
        classes = raw.to(torch.promote_types(raw.dtype, torch.float32)).softmax(1)
        wide = classes.repeat_interleave(self.stride, -1).repeat_interleave(self.stride, -2)
        return wide[..., : views.size[0], : views.size[1]].reshape(*views.images.shape[:-3], -1, *views.size)

    def semantic_parameters(self, shared: bool = True, alone: bool = False) -> set[str]:
        """Names of the parameters that `classify` depends on; without `shared`, those of them that nothing else depends on."""
        parts = ("semantic_", "cnn.") if shared and self.semantic_cnn is None else ("semantic_",)
        passed_over: tuple[str, ...] = ("semantic_transformer.",) if alone else ()
        if alone and self._pyramid is not None:
            passed_over += ("semantic_upsampler.", "semantic_head.")
        names = (name for name, _ in self.named_parameters())
        return {name for name in names if name.startswith(parts) and not name.startswith(passed_over)}

    def _encode(
        self,
        images: Float[Tensor, "b v 3 h w"],
        cameras: Cameras,
        depth_range: Float[Tensor, "b v 2"],
        size: tuple[int, int],
        chunks: Chunks,
        stage: Stage,
    ) -> Encoding:
        """As `forward`, for padded pictures of a batch, cropped back to `size`.

        Within autocast the layers compute in its half precision; depth, cameras and Gaussians stay in float32 or better.
        """
        b, v = images.shape[:2]
        pictures = images.flatten(0, 1)
        with stage("cnn"):
            shallow = self.cnn(pictures)
        with stage("transformer_colour"):
            colour = self._transformed(shallow, self.colour_transformer, "colour", cameras, depth_range)
        with stage("transformer_semantic"):
            semantic = self._semantic(pictures, shallow, cameras, depth_range)

        precise = torch.promote_types(colour.dtype, torch.float32)
        bounds = depth_range.to(colour.device, precise)
        candidates = depth_candidates(depth_range, self.candidates, self.conventions.candidates).to(bounds)
        with stage("cost_volume"):
            matched = (unit_features(colour) if self.cosine_cost else colour).unflatten(0, (b, v))
            cost = cost_volume(
                matched, cameras, bounds[..., 0], candidates, self.conventions, views_at_a_time=chunks.cost
            ).flatten(0, 1)
        small = self._shrunk(pictures)
        planes = candidates.flatten(0, 1)
        with stage("depth"):
            probabilities = self.cost_regressor(cost, colour, v).to(precise).softmax(1)
            confidences = probabilities.amax(1).repeat_interleave(self.factor, -1).repeat_interleave(self.factor, -2)
            decode: Callable[[slice], Decoded]
            if self.paper_heads:
                decode = lambda at: self._decoded_by_the_text(small[at], colour[at], probabilities[at], planes[at])  # noqa: E731
            else:
                features = beside(colour, shallow)
                decode = self._refined(
                    small, features, probabilities, planes, bounds.flatten(0, 1), confidences, v, chunks
                )
        rays = Rays.of(_shrunk(cameras, self.stride).flatten(), bounds)

        def placed(at: slice) -> Encoding:
            bounded = depth_range.flatten(0, 1)[at]
            return self._placed(decode(at), small[at], semantic, confidences[at], rays[at], at, size, bounded)

        with stage("heads"):
            encoding = by_chunks(placed, b * v, chunks.heads)
        # What was one scene for each view becomes the views of each scene.
        return encoding.map(lambda tensor: tensor.unflatten(0, (b, v)).flatten(1, 2))

    def _refined(
        self,
        small: Float[Tensor, "n 3 h w"],
        features: Float[Tensor, "n c h4 w4"],
        probabilities: Float[Tensor, "n l h4 w4"],
        candidates: Float[Tensor, "n l"],
        bounds: Float[Tensor, "n 2"],
        confidences: Float[Tensor, "n h w"],
        views: int,
        chunks: Chunks,
    ) -> Callable[[slice], Decoded]:
        """MVSplat's form: disparity is corrected and opacity found by the refinement, whose features the colour head sees.

        The refinement looks at all views together; the function that is returned decodes some of them.
        """
        sampling, corners = self.conventions.candidates, self.conventions.pixel_centres
        coarse = 1 / expected_depth(probabilities, candidates, sampling)
        disparities = upsampled(coarse[:, None], self.factor, corners)[:, 0]
        # The upsampled features are needed twice; where views come in chunks they are made twice rather than kept.
        kept = self.colour_upsampler(features) if chunks.heads is None else None

        def wide(at: slice) -> Tensor:
            return self.colour_upsampler(features[at]) if kept is None else kept[at]

        projected = by_chunks(lambda at: self.depth_refinement.project(wide(at)), len(small), chunks.heads)
        near, far = bounds[:, :, None, None].unbind(1)
        unit = near if self.conventions.relative_disparity else torch.ones_like(near)
        refined, raw = self.depth_refinement(small, projected, disparities * unit, confidences, views)
        depths = 1 / (disparities + raw[:, 0] / unit).clamp(1 / far, 1 / near)
        opacities = raw[:, 1].sigmoid()

        def decoded(at: slice) -> Decoded:
            seen = beside(refined[at], small[at], wide(at))
            attributes = drawn_attributes(self.colour_head, self.harmonics, seen)
            return Decoded(depths[at], opacities[at], attributes[:, 2:], attributes[:, :2])

        return decoded

    def _decoded_by_the_text(
        self,
        small: Float[Tensor, "n 3 h w"],
        features: Float[Tensor, "n c h4 w4"],
        probabilities: Float[Tensor, "n l h4 w4"],
        candidates: Float[Tensor, "n l"],
    ) -> Decoded:
        """The paper's form; upsampling is linear, so the expectation of the upsampled distribution is the upsampled one."""
        sampling, corners = self.conventions.candidates, self.conventions.pixel_centres
        distribution = upsampled(probabilities, self.factor, corners)
        wide = upsampled(features, self.factor, corners)
        return Decoded(
            expected_depth(distribution, candidates, sampling),
            self.opacity_head(distribution)[:, 0].to(distribution.dtype).sigmoid(),
            drawn_attributes(self.colour_head, self.harmonics, beside(small, wide)),
        )

    def _placed(
        self,
        decoded: Decoded,
        small: Float[Tensor, "n 3 h w"],
        semantic: Semantic | None,
        confidences: Float[Tensor, "n h w"],
        rays: Rays,
        at: slice,
        size: tuple[int, int],
        depth_range: Float[Tensor, "n 2"],
    ) -> Encoding:
        """Some of the views, each as a scene of its own, cropped to `size`; `at` says which of all they are."""
        depths = decoded.depths
        means = points(depths, decoded.offsets, rays, self.conventions)
        shown = small if self.colour_from_image else None
        appearance = colour_appearance(decoded.attributes, shown, depths, rays, self.conventions)
        classes = None
        if semantic is not None:
            classes = semantic_appearance(self._semantic_raw(small, semantic, at), depths, rays)
        kept = (size[0] + self.stride - 1) // self.stride, (size[1] + self.stride - 1) // self.stride

        def gathered(tensor: Tensor) -> Tensor:
            maps = tensor.reshape(*depths.shape, *tensor.shape[2:])
            return maps[:, : kept[0], : kept[1]].flatten(1, 2)

        def full(maps: Tensor) -> Tensor:
            wide = maps.repeat_interleave(self.stride, -1).repeat_interleave(self.stride, -2)
            return wide[:, None, : size[0], : size[1]]

        flat = Gaussians(means.flatten(1, 2), decoded.opacities.flatten(1), appearance, classes)
        return Encoding(flat.map(gathered), full(depths), full(confidences), depth_range[:, None])

    def _transformed(
        self,
        features: Float[Tensor, "n c h w"],
        transformer: MultiViewSwin,
        branch: str,
        cameras: Cameras,
        depth_range: Float[Tensor, "b v 2"],
    ) -> Float[Tensor, "n c h w"]:
        """Features of one branch after its transformer."""
        batch = cameras.batch
        transforms = None
        if self.camera_aware[branch]:
            transforms = token_transforms(
                cameras,
                depth_range[..., 0].amin(-1),
                transformer.grid((features.shape[-2], features.shape[-1])),
                features.shape[1],
                features,
                self.output_transform,
            )
        return transformer(features.unflatten(0, batch), transforms).flatten(0, 1)

    def _semantic(
        self,
        pictures: Float[Tensor, "n 3 h w"],
        shallow: Float[Tensor, "n c h4 w4"],
        cameras: Cameras,
        depth_range: Float[Tensor, "b v 2"],
    ) -> Semantic | None:
        """Features of the semantic branch, None for a colour-only network."""
        if self.classes is None:
            return None
        refined = self._semantic_refined(pictures, shallow)
        return Semantic(refined, self._semantic_seen(refined, cameras, depth_range))

    @property
    def _pyramid(self) -> SemanticPyramid | None:
        """What refines the semantic features where that is a pyramid."""
        refinement = None if self.classes is None else self.semantic_refinement
        return refinement if isinstance(refinement, SemanticPyramid) else None

    def _semantic_refined(
        self, pictures: Float[Tensor, "n 3 h w"], shallow: Float[Tensor, "n c h4 w4"]
    ) -> Float[Tensor, "n c h4 w4"]:
        """Features of the semantic branch before its transformer, of each view by itself."""
        cnn = self.semantic_cnn or self.cnn
        known = pictures if self._pyramid is None else near_side(pictures, SHRINK)
        features = shallow if known is pictures and cnn is self.cnn else cnn(known)
        if self._pyramid is None:
            return self.semantic_refinement(features)
        refined = self._pyramid(features, known)
        return refined if known is pictures else interpolate(refined, size=shallow.shape[-2:], mode="bilinear")

    def _semantic_seen(
        self, refined: Float[Tensor, "n c h4 w4"], cameras: Cameras, depth_range: Float[Tensor, "b v 2"]
    ) -> Float[Tensor, "n c h4 w4"]:
        """The same after the transformer, which looks at all views of a scene."""
        return self._transformed(refined, self.semantic_transformer, "semantic", cameras, depth_range)

    def _shrunk(self, pictures: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n 3 h2 w2"]:
        """The pictures at the Gaussians' scale."""
        return nn.functional.avg_pool2d(pictures, self.stride) if self.stride > 1 else pictures

    def _semantic_raw(
        self, small: Float[Tensor, "n 3 h w"], semantic: Semantic, at: slice
    ) -> Float[Tensor, "n channel h w"]:
        """What the semantic head says of some views, given their pictures at the Gaussians' scale."""
        raw = self.semantic_head(beside(small, self._upsampled_semantic(semantic, at)))
        if self._pyramid is None:
            return raw
        shape, logits = raw.split((7, raw.shape[1] - 7), dim=1)
        return torch.cat((shape, logits + self._pyramid_classes(self._pyramid, semantic.refined[at])), dim=1)

    def _pyramid_classes(
        self, pyramid: SemanticPyramid, refined: Float[Tensor, "n c h4 w4"]
    ) -> Float[Tensor, "n class h w"]:
        """Logits of the pyramid's own classes at the Gaussians' scale."""
        return upsampled(pyramid.classes(refined), self.factor, self.conventions.pixel_centres)

    def _upsampled_semantic(self, semantic: Semantic, at: slice) -> Float[Tensor, "n d h w"]:
        """What the semantic head sees of some views, beside the picture."""
        if self.paper_heads:
            return upsampled(semantic.features[at], self.factor, self.conventions.pixel_centres)
        return self.semantic_upsampler(beside(semantic.features[at], semantic.refined[at]))


def arguments(settings: Mapping[str, Any]) -> dict[str, Any]:
    """What `SemGS` takes beside its class table, from `SemGS.settings` or the same read from a file.

    Raises:
        KeyError, TypeError: these are no such settings.
    """
    given = {"semantic_pyramid": (), **settings}  # older files have none
    widths = {key: tuple(given[key]) for key in ("cnn_widths", "semantic_pyramid")}
    conventions = given["conventions"]
    if not isinstance(conventions, Conventions):
        conventions = Conventions(**conventions)
    return given | widths | {"conventions": conventions}


@dataclass(frozen=True)
class Semantic:
    """Features of the semantic branch: of its refinement, and of its transformer after that."""

    refined: Float[Tensor, "n c h4 w4"]
    features: Float[Tensor, "n c h4 w4"]


def _flattened(views: Views, like: Tensor) -> Views:
    """Views with one batch axis, on the network's device and in its dtype, padded to a multiple of 16 below and right."""
    height, width = views.size
    padded = (-(-height // MULTIPLE) * MULTIPLE, -(-width // MULTIPLE) * MULTIPLE)
    images = views.images.reshape(-1, *views.images.shape[-4:]).to(like)
    if padded != (height, width):
        images = nn.functional.pad(
            images.flatten(0, 1), (0, padded[1] - width, 0, padded[0] - height), mode="replicate"
        ).unflatten(0, images.shape[:2])
    cameras = views.cameras
    return Views(
        images,
        Cameras(
            cameras.world_from_camera.reshape(-1, len(views), 4, 4),
            cameras.intrinsics.reshape(-1, len(views), 3, 3),
            padded,
        ),
        views.depth_range.reshape(-1, len(views), 2),
    )


def _shrunk(cameras: Cameras, stride: int) -> Cameras:
    """The cameras of pictures whose sides are `stride` times smaller."""
    if stride == 1:
        return cameras
    scale = torch.tensor([1 / stride, 1 / stride, 1.0], dtype=torch.float64)
    height, width = cameras.size
    return replace(cameras, intrinsics=cameras.intrinsics * scale[:, None], size=(height // stride, width // stride))
