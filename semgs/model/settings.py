"""Settings of the network: one frozen dataclass for each part, JSON by `as_json`; `semgs.model.build` turns them into modules.

The defaults are the paper's sizes with MVSplat's layer shapes.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from semgs.files.records import make_record


@dataclass(frozen=True)
class Conventions:
    """The differences between MVSplat's geometry and ours, each as a named choice.

    The defaults are ours. MVSplat's published weights were trained with its own conventions, so only the network `mvsplat` uses them
    (`MVSPLAT`). The labels D2-D8 are those of `docs/method.md`, which shows the effect of each.

    Attributes:
        own_intrinsics: the plane sweep projects into a source view with that view's own K; else with the reference
            view's (D2).
        z_depth: the predicted depth is z-depth when points are placed; else the distance along the unit ray (D3).
        standard_harmonics: predicted harmonics are in the 3DGS basis of the camera's frame; else in MVSplat's basis (D4).
        pixel_centres: feature texels are at .5 in the plane sweep and bilinear upsampling keeps image corners; else
            texels are at integers and upsampling keeps the centres of the corner texels (D6).
        mask_unseen: samples behind or outside a source view do not count in the mean; else their depth is clamped to
            1e-3 and what lies outside is zero.
        relative_disparity: the refinement reads disparity times the near bound and corrects it in units of 1 / near;
            else both are in 1 / m (D8).
        candidates: depth candidates uniform in inverse depth, or in depth (the paper's words).
    """

    own_intrinsics: bool = True
    z_depth: bool = True
    standard_harmonics: bool = True
    pixel_centres: bool = True
    mask_unseen: bool = True
    relative_disparity: bool = True
    candidates: Literal["inverse", "linear"] = "inverse"


OURS = Conventions()
MVSPLAT = Conventions(
    own_intrinsics=False,
    z_depth=False,
    standard_harmonics=False,
    pixel_centres=False,
    mask_unseen=False,
    relative_disparity=False,
)


LARGEST = 4096
"""The largest integer allowed in the settings of a file."""


@dataclass(frozen=True)
class TransformerSettings:
    """The transformer of one branch.

    Attributes:
        blocks: number of blocks.
        windows: along each side of the token map; 1 is full attention (ablation *Sw-Trans*).
        expansion: of the feed-forward networks.
        reduction: 2 lets the blocks work at 1/8 of the image.
        camera_aware: camera-aware attention (ablation *C-Inj*).
        output_transform: multiply the attention output by G; False is the paper's text.
    """

    blocks: int
    windows: int = 2
    expansion: int = 4
    reduction: int = 1
    camera_aware: bool = True
    output_transform: bool = True


@dataclass(frozen=True)
class DepthSettings:
    """Depth by plane sweep.

    Attributes:
        candidates: number of depth candidates (the paper's L).
        width, hidden, levels, decoder_blocks: of the U-Net that turns cost into probabilities; `hidden` is between its last two layers.
        cosine_cost: correlate features that are centred in each image and have equal length, so that costs are cosines times the root
            of d. With it, a network learns depth much faster from random weights.
        cost_prior: predict logits as a correction of the cost, from normalised features. Without it, at a high learning rate, they
            saturate at one candidate before the features have learned to match.
        initial_scale: factor for the random weights of depth's last layers; below 1, all candidates start with similar probability.
        cost_filter: channels of a 3D CNN that filters the cost volume (`semgs.model.sweep.cost_volume`); 0 for none.
        cue: the U-Net also reads coarse maps of single views from the class branch, which must be a `MobileNet`.
        upsampling: to the Gaussians' scale. "convex" is `semgs.model.sweep.upsampling`, which takes the place of the heads' correction of
            disparity.
    """

    candidates: int = 128
    width: int = 128
    hidden: int = 256
    levels: int = 3
    decoder_blocks: int = 2
    cosine_cost: bool = False
    cost_prior: bool = False
    initial_scale: float = 1.0
    cost_filter: int = 0
    cue: bool = False
    upsampling: Literal["bilinear", "convex"] = "bilinear"


@dataclass(frozen=True)
class MVSplatHeads:
    """MVSplat's heads: a U-Net at the Gaussians' scale corrects disparity and predicts opacity.

    Attributes:
        upsampled: channels of the features at the Gaussians' scale.
        projected: channels to which these are reduced for the U-Net.
        width, levels, decoder_blocks: of the U-Net.
        kind: which heads these are, in JSON.
    """

    upsampled: int = 128
    projected: int = 32
    width: int = 32
    levels: int = 5
    decoder_blocks: int = 2
    kind: Literal["mvsplat"] = "mvsplat"


@dataclass(frozen=True)
class PaperHeads:
    """The paper's text taken literally: depth is the upsampled expectation without refinement, means are on pixel centres, opacity is a
    CNN on the upsampled distribution over the candidates, and the heads only see the image and the upsampled transformer features.

    Attributes:
        opacity_hidden: width between the two layers of the opacity CNN.
        kind: which heads these are, in JSON.
    """

    opacity_hidden: int = 32
    kind: Literal["paper"] = "paper"


@dataclass(frozen=True)
class ColourSettings:
    """The colour branch and depth.

    Attributes:
        transformer, depth, heads: its parts.
        hidden: width between the two layers of the colour head.
        harmonics: coefficients per colour channel in the head; those beyond degree 3 are never computed or rendered.
        from_image: the head predicts a correction of the image's own colour.
        shrink_seen: multiply the sizes of Gaussians that n > 2 input views see by (2 / n)^shrink_seen; 0 for no shrinkage.
    """

    transformer: TransformerSettings = field(default_factory=lambda: TransformerSettings(blocks=6))
    depth: DepthSettings = field(default_factory=DepthSettings)
    heads: MVSplatHeads | PaperHeads = field(default_factory=MVSplatHeads)
    hidden: int = 168
    harmonics: int = 25
    from_image: bool = False
    shrink_seen: float = 0.0


@dataclass(frozen=True)
class TwoBlocks:
    """The paper's refinement of the class branch: two residual blocks at 1/4 of the image."""

    kind: Literal["two_blocks"] = "two_blocks"


@dataclass(frozen=True)
class MobileNet:
    """MobileNetV2 on the image and a light decoder: it classifies each view on its own, the head corrects its classes, and it can
    start from published weights.

    Attributes:
        width: channels in the decoder.
        kind: which refinement this is, in JSON.
    """

    width: int = 96
    kind: Literal["mobilenet"] = "mobilenet"


@dataclass(frozen=True)
class MosaicBeside:
    """MOSAIC beside the refinement: the classes of each view are the geometric mean of what both find, among those that MOSAIC knows.

    Attributes:
        share: of MOSAIC in the mean.
        enlargement: of its images relative to those that the MobileNet reads; it was made for larger ones.

    Raises:
        ValueError: the share is not in 0..1, or the enlargement not in 1..4.
    """

    share: float = 0.4
    enlargement: float = 1.6

    def __post_init__(self) -> None:
        if not 0 <= self.share <= 1:
            raise ValueError(f"the share of MOSAIC is {self.share}; expected 0..1")
        if not 1 <= self.enlargement <= 4:
            raise ValueError(f"the enlargement of MOSAIC's images is {self.enlargement}; expected 1..4")


@dataclass(frozen=True)
class SemanticSettings:
    """The semantic branch.

    Attributes:
        transformer, refinement: its parts.
        mosaic: a second network for the classes of each view; None for none.
        compares_views: whether the head reads the transformer's features; else there is no transformer, and it reads those of single views.
        own_cnn: its own shallow CNN; else it shares that of the colour branch (ablation *Sh-Layer*).
        hidden: width between the two layers of the semantic head.
        fusion: outside training, input views agree on the classes of points that several of them see (`Encoding.fused`).
    """

    transformer: TransformerSettings = field(default_factory=lambda: TransformerSettings(blocks=3))
    refinement: TwoBlocks | MobileNet = field(default_factory=TwoBlocks)
    mosaic: MosaicBeside | None = None
    compares_views: bool = True
    own_cnn: bool = False
    hidden: int = 54
    fusion: bool = False


@dataclass(frozen=True)
class NetworkSettings:
    """A complete network.

    Attributes:
        name: of the network from which these settings started.
        channels: d, of features and transformers.
        cnn_widths: channels of the shallow CNN.
        stride: 1 places a Gaussian per pixel, 2 one per 2x2 pixels.
        last_kernel: side of the heads' second layer.
        initial_sigma: initial size of Gaussians, in pixels of their own grid; None leaves it to the random weights.
        colour: the colour branch and depth.
        semantic: the semantic branch; None for a colour-only network.
        conventions: of geometry.

    Raises:
        ValueError: depth has a cue, but the class branch is no `MobileNet`; its upsampling is convex, but heads or conventions do not fit; or a
            branch has no windows, or the cost filter fewer than 0 channels.
    """

    name: str = "base"
    channels: int = 128
    cnn_widths: tuple[int, int, int] = (64, 96, 128)
    stride: int = 1
    last_kernel: int = 3
    initial_sigma: float | None = None
    colour: ColourSettings = field(default_factory=ColourSettings)
    semantic: SemanticSettings | None = field(default_factory=SemanticSettings)
    conventions: Conventions = OURS

    def __post_init__(self) -> None:
        giver = None if self.semantic is None else self.semantic.refinement
        if self.colour.depth.cue and not isinstance(giver, MobileNet):
            raise ValueError("depth_cue needs the class backbone; give class_backbone as well")
        for transformer in (self.colour.transformer, *([] if self.semantic is None else [self.semantic.transformer])):
            if transformer.windows < 1:
                raise ValueError(f"a branch has {transformer.windows} windows; expected 1 or more along each side")
        if self.colour.depth.cost_filter < 0:
            raise ValueError(f"cost_filter is {self.colour.depth.cost_filter}; expected 0 or more channels")
        fits = isinstance(self.colour.heads, MVSplatHeads) and self.conventions.pixel_centres
        if self.colour.depth.upsampling == "convex" and not fits:
            raise ValueError(
                "convex depth_upsampling needs MVSplat's heads and our pixel centres; leave paper_heads off, or make depth_upsampling bilinear"
            )

    def as_json(self) -> dict[str, Any]:
        """The settings as plain JSON."""
        return asdict(self)

    @classmethod
    def from_json(cls, saved: object) -> NetworkSettings:
        """The settings from `as_json`, also read back from a file.

        Raises:
            ValueError: these are not settings; the place is named.
        """
        settings = make_record(cls, saved, LARGEST)
        for part in ("colour", "semantic", "conventions"):
            if part not in saved:  # type: ignore[operator]
                raise ValueError(f"{part}: missing")
        return settings
