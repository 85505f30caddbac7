"""Sensor depth: places Gaussians at the depth that a sensor measured for the input views.

The network never sees that depth: its heads predict colours, classes and shapes from features of the images, and these stay. Each Gaussian moves
along its ray. Where the sensor measured nothing, it takes the network's depth after a fit to the sensor's (`semgs.depth_maps.depth_fit`).
The sensor's maps should be registered to the images, which `registration` checks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, final

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import max_pool2d

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.frames import Frame
from semgs.data.maps import DepthMap, DepthThroughLens
from semgs.data.scene import Scene
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.depth_maps.depth_fit import DepthFit
from semgs.files.errors import InputError
from semgs.files.text import percent
from semgs.runtime.notes import Kind, Note
from semgs.scene.encoding import Encoding

DepthSource = Literal["network", "sensor", "both"]
"""Where the depth of the Gaussians comes from."""

FEWEST_MEASURED = 0.5
"""At least this share of the pixels of each input view must be measured."""

OPACITY = 0.6
"""Opacity of Gaussians at a measured depth, chosen by PSNR on rooms among 0.35 to 0.95. With less, what is near lets the far shine through at
wide baselines; with more, noise is visible at short ones."""

SENSOR_DOES_NOT_FIT = Kind(
    "The sensor's depth does not fit the model's: {frames}. Its unit (see --depth-unit) or the poses may be wrong, or it is not registered to the colour images.",
    "The sensor's depth does not fit the model's: {frames}. Its unit or the poses may be wrong, or it is not registered to the colour images.",
)
NOT_REGISTERED = Kind(
    "The sensor's depth is not registered to the colour images: its edges fit theirs better if it moves by about {right} px to the right and {down} px down."
)

SMALLEST = 1e-3
"""The noise of smaller depths is that of this depth [m]."""

POSITIVE = 1e-30
"""Stands for unknown depths, which have no weight, where logarithms are taken."""

WINDOW = 9
"""An edge of depth is within a window of this many pixels, because sensors measure nothing right beside it."""

JUMP = 0.08
"""Log depths that differ by more than this within the window are an edge."""

BRIGHTEST = 0.15
"""Stronger edges of the image count as this."""

STEP, REACH = 2, 8
"""Shifts are tried in steps of this many pixels, up to this many steps."""

FEWEST_EDGES = 1000
"""With fewer pixels near edges of depth, nothing can be said."""

CLEARLY = 1.2
"""Maps are shifted if the edges under them are stronger by this factor elsewhere. In registered rooms the gain was at most 1.1."""


@final
@dataclass(frozen=True)
class Registration:
    """Where the edges of depth fit the images best.

    Attributes:
        right, down: by which the depth maps seem to be shifted against the images, to within a few pixels [px].
        gain: edges under the depth edges there, relative to those at no shift: 1 if no shift is better.
        pixels: near edges of depth.
    """

    right: int
    down: int
    gain: float
    pixels: int

    @property
    def shifted(self) -> bool:
        """Whether the maps are clearly shifted. The largest shifts do not count: the best fit may be further away, and of something else."""
        inside = STEP < max(abs(self.right), abs(self.down)) < STEP * REACH
        return self.pixels >= FEWEST_EDGES and self.gain > CLEARLY and inside


@final
@dataclass(frozen=True)
class Placement:
    """How Gaussians were placed at the depth of a sensor.

    Attributes:
        source: of the depth: "sensor" or "both".
        fits: of the network's depth to the sensor's, one for each view.
        registration: of the sensor's depth to the images.
    """

    source: DepthSource
    fits: tuple[DepthFit, ...]
    registration: Registration

    @property
    def description(self) -> str:
        """Where the depth is from, in words."""
        return "the sensor" if self.source == "sensor" else "the sensor and the model"

    @property
    def shift(self) -> tuple[int, int] | None:
        """By how much the maps seem to be shifted to the right and down [px]; None if they are not."""
        return (self.registration.right, self.registration.down) if self.registration.shifted else None

    def lines(self, names: Sequence[str]) -> tuple[str, ...]:
        """Each fit as text.

        Args:
            names: of the frames.
        """
        return tuple(
            f"{name}: {percent(fit.measured)} measured; 1 / sensor = {fit.scale:.3f} / network {fit.shift:+.3f}, typical difference "
            f"{percent(fit.residual)}"
            for name, fit in zip(names, self.fits, strict=True)
        )

    def notes(self, names: Sequence[str]) -> tuple[Note, ...]:
        """What the user should know; names as for `lines`."""
        poor = [
            f"{name} (sensor / model {fit.ratio:.4g}, typical difference {percent(fit.residual)})"
            for name, fit in zip(names, self.fits, strict=True)
            if fit.poor
        ]
        found = []
        if poor:
            found.append(SENSOR_DOES_NOT_FIT(frames=", ".join(poor)))
        if self.registration.shifted:
            found.append(NOT_REGISTERED(right=-self.registration.right, down=-self.registration.down))
        return tuple(found)


def place_gaussians(
    encoding: Encoding, views: Views, source: Literal["sensor", "both"], *, metric: bool = True
) -> tuple[Encoding, Placement]:
    """Place Gaussians at the depth of a sensor. Returns them, and how they were placed.

    With "sensor", measured pixels take the measured depth, an opacity of `OPACITY` and a confidence of 1. With "both", the logarithm of depth
    is the mean of the sensor's and the network's (after the fit), weighted by their inverse variances; opacity and confidence are weighted
    alike. Other pixels keep opacity and confidence, and take the network's depth after the fit.

    Args:
        encoding: of the views.
        views: of one scene, with depths.
        source: of the depth.
        metric: whether lengths are metres, in which the noise of sensors is known.

    Raises:
        ValueError: the views have no depths, or nothing was measured in one of them.
    """
    if views.depths is None:
        raise ValueError("the views have no depths; expected those of a sensor")
    network, sensor = encoding.placed_depths(views.cameras), views.depths.to(encoding.depths)
    fits = tuple(DepthFit.of(*pair) for pair in zip(network, sensor, strict=True))
    fitted = torch.stack([fit(depths) for fit, depths in zip(fits, network, strict=True)])
    residuals = torch.tensor([fit.residual for fit in fits]).to(fitted)[:, None, None]
    variance = encoding.depth_spread.square() + residuals.square()
    noise = sensor_spread(sensor, metre_of(views, metric)).square()
    weights = (sensor > 0).to(fitted)
    if source == "both":
        weights = weights * variance / (variance + noise)
    shares = 1 - weights
    logs = weights * sensor.clamp(min=POSITIVE).log() + shares * fitted.log()
    moved = encoding.with_depths(
        logs.exp(),
        views.cameras,
        opacities=weights * OPACITY + shares * encoding.opacity_maps(),
        confidences=weights + shares * encoding.confidences,
        depth_spread=(weights.square() * noise + shares.square() * variance).sqrt(),
    )
    return moved.hide(views.hidden), Placement(source, fits, registration(views.images.to(sensor), sensor))


def metre_of(views: Views, metric: bool) -> float:
    """The length of a metre in the unit of views. If that is unknown, they are taken for a room: the middle of near and far is 2.2 m."""
    if metric:
        return 1.0
    return float(views.depth_range.log().mean().exp()) / (INDOOR_DEPTH_RANGE[0] * INDOOR_DEPTH_RANGE[1]) ** 0.5


def sensor_spread(depths: Float[Tensor, "*n"], metre: float = 1.0) -> Float[Tensor, "*n"]:
    """Standard deviation of log depth that a depth camera measures at depths, of which a metre has this length.

    This is the axial noise of a Kinect that faces a surface (Nguyen, Izadi and Lovell, "Modeling Kinect sensor noise for improved 3D
    reconstruction and tracking", 3DIMPVT 2012): 0.0012 + 0.0019 (z - 0.4)^2 [m].
    """
    z = (depths / metre).clamp(min=SMALLEST)
    return (0.0012 + 0.0019 * (z - 0.4).square()) / z


def registration(images: Float[Tensor, "v 3 h w"], depths: Float[Tensor, "v h w"]) -> Registration:
    """Whether depth maps are registered to their images, for all views together: the edges of depth should be where the images have edges.

    The network's own depth is too coarse for this test; images are not.

    Args:
        images: of the views.
        depths: z-depth of every pixel, 0 where nothing was measured [m].
    """
    margin = STEP * REACH
    inner = (slice(None), slice(margin, -margin), slice(margin, -margin))
    edges, strength = _near_edges(depths)[inner].to(images), _strength(images)
    pixels = int(edges.sum())
    if not pixels:
        return Registration(0, 0, 1.0, 0)
    height, width = edges.shape[-2:]
    found = {}
    for down in range(-margin, margin + 1, STEP):
        for right in range(-margin, margin + 1, STEP):
            under = strength[:, margin - down :, margin - right :][:, :height, :width]
            found[right, down] = float((under * edges).sum()) / pixels
    # Of shifts that are equally good, as within a window, the smallest counts.
    right, down = max(found, key=lambda shift: (round(found[shift], 4), -abs(shift[0]) - abs(shift[1])))
    return Registration(right, down, found[right, down] / max(found[0, 0], 1e-6), pixels)


def _near_edges(depths: Float[Tensor, "v h w"]) -> Bool[Tensor, "v h w"]:
    """Whether measured depths around each pixel differ by more than `JUMP`."""
    logs = depths.clamp(min=1e-3).log()
    known = depths > 0
    far, near = (
        max_pool2d(torch.where(known, sign * logs, -torch.inf)[:, None], WINDOW, 1, WINDOW // 2)[:, 0]
        for sign in (1, -1)
    )
    return far + near > JUMP


def _strength(images: Float[Tensor, "v 3 h w"]) -> Float[Tensor, "v h w"]:
    """The gradient of each image's brightness across two pixels, at most `BRIGHTEST`."""
    grey = torch.nn.functional.pad(images.mean(1, keepdim=True), (1, 1, 1, 1), mode="replicate")[:, 0]
    across, down = grey[:, 1:-1, 2:] - grey[:, 1:-1, :-2], grey[:, 2:, 1:-1] - grey[:, :-2, 1:-1]
    return (across.square() + down.square()).sqrt().clamp(max=BRIGHTEST)


def _unit_of(frame: Frame) -> str:
    """How a frame's depth map counts, if it is a file."""
    depth = frame.depth.map if isinstance(frame.depth, DepthThroughLens) else frame.depth
    return f" ({depth.path} in counts of {depth.unit:.3g} m, 0 where unknown)" if isinstance(depth, DepthMap) else ""


def read_measured(scene: Scene, positions: Sequence[int], size: tuple[int, int], depth_range: DepthRange) -> Views:
    """Read frames of which a sensor measured the depth; arguments as for `Scene.read`.

    Raises:
        InputError: a frame cannot be read, or has no depth, or too little.
    """
    without = [scene.frames[position].name for position in positions if scene.frames[position].depth is None]
    if without:
        raise InputError(
            scene.path,
            "a measured depth for every input frame, as --depth sensor and both need",
            f"none for {', '.join(without)}",
        )
    views = scene.read(positions, size, depth_range)
    assert views.depths is not None
    for position, depths in zip(positions, views.depths, strict=True):
        if (share := float((depths > 0).double().mean())) < FEWEST_MEASURED:
            raise InputError(
                scene.path,
                f"a measured depth at {percent(FEWEST_MEASURED)} of its pixels or more, as --depth sensor and both need",
                f"{percent(share)}{_unit_of(scene.frames[position])}",
                key=scene.frames[position].name,
            )
    return views
