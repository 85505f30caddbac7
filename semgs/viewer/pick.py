"""What is under a pixel: class, probability and position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance
from semgs.rendering.reference import alphas_and_light, depth_order, project
from semgs.rendering.rendering import SEEN_ALPHA, UNKNOWN, UNSEEN, Rendering, class_numbers, confidence_maps, label_maps
from semgs.rendering.splats import Pinhole, Splats
from semgs.scene.scene_file import SavedScene
from semgs.viewer.splat_groups import UNKNOWN_NAME


@dataclass(frozen=True)
class Hit:
    """What a ray meets.

    Attributes:
        position: where the opacity along the ray passes 0.5, in the coordinates of the source's poses [unit of the scene].
        name: of the likeliest class of the pixel; "unknown" if it has none or is not sure enough; None for a scene without classes.
        probability: of the likeliest class, calibrated if the scene has temperatures; None for a scene without classes.
        thing: the number of the thing that most of this class belongs to there; 0 for none.
    """

    position: tuple[float, float, float]
    name: str | None
    probability: float | None
    thing: int = 0


def pick(
    scene: SavedScene,
    camera: Cameras,
    pixel: tuple[float, float],
    visible: Bool[np.ndarray, " g"] | None = None,
    min_confidence: float = 0.0,
    instances: Int64[np.ndarray, " g"] | None = None,
) -> Hit | None:
    """What a pixel shows, by the rules of the renderer: a class map rendered from the same camera has the same class there.

    Args:
        scene: the scene.
        camera: one, without leading axes, relative to the scene's `origin`.
        pixel: (x, y); centres of pixels are at .5 [px].
        visible: the Gaussians that count; None is all.
        min_confidence: a class that is less likely is unknown.
        instances: the number of the thing that each Gaussian belongs to, 0 for none.

    Returns:
        None if the opacity stays below 0.5.
    """
    gaussians = scene.gaussians.to(torch.float64)
    if visible is not None:
        kept = torch.from_numpy(visible)
        gaussians = gaussians.map(lambda tensor: tensor[kept])
        instances = None if instances is None else instances[visible]
    pinhole = Pinhole.of(camera)
    order = depth_order(gaussians.means, pinhole, scene.near)
    point = torch.tensor([pixel], dtype=torch.float64)

    def blended(appearance: Appearance) -> tuple[Tensor, Tensor]:
        """Which Gaussians a pass has, nearest first, and the light in front of each and behind the last."""
        shapes = (appearance.quaternions, appearance.scales)
        splats = Splats(gaussians.means, *shapes, gaussians.opacities, appearance.features.flatten(1))
        ellipses = project(splats, pinhole)
        drawn = order[ellipses.visible[order]]
        _, light = alphas_and_light(point, ellipses.centres[drawn], ellipses.conics[drawn], gaussians.opacities[drawn])
        return drawn, light[0]

    drawn, light = blended(gaussians.colour)
    solid = (1 - light[1:] >= SEEN_ALPHA).nonzero()
    if not len(solid):
        return None
    depth = pinhole.offsets(gaussians.means[drawn[solid[0]]])[0] @ pinhole.axes[2]
    position = pinhole.centre + depth * _ray(pinhole, pixel) + torch.tensor(scene.origin, dtype=torch.float64)
    x, y, z = position.tolist()
    if gaussians.semantic is None or scene.classes is None:
        return Hit((x, y, z), None, None)
    drawn, light = blended(gaussians.semantic)
    weights, features = -light.diff(), gaussians.semantic.features[drawn]
    shares = weights @ features + light[-1] / len(scene.classes)
    one = torch.ones(1, 1, 1, dtype=torch.float64)
    rendering = Rendering(
        images=one.expand(1, 3, 1, 1),
        semantics=shares[None, :, None, None],
        depths=one,
        alphas=one,
        temperature=None if scene.temperatures is None else scene.temperatures.rendered,
    )
    label = int(label_maps(rendering, min_confidence)[0, 0, 0])
    probability = float(confidence_maps(rendering)[0, 0, 0])
    if label in (UNKNOWN, UNSEEN):
        return Hit((x, y, z), UNKNOWN_NAME, probability)
    thing = 0
    if instances is not None:
        of_class = torch.where(class_numbers(features) == label, weights, 0)
        thing = int(np.bincount(instances[drawn.numpy()], of_class.numpy(), 1).argmax())
    return Hit((x, y, z), scene.classes.names[label], probability, thing)


def _ray(pinhole: Pinhole, pixel: tuple[float, float]) -> Float64[Tensor, " 3"]:
    """The direction of a pixel in the world, with length 1 along the optical axis."""
    slopes = [
        (at - centre) / focal for at, centre, focal in zip(pixel, pinhole.principal_px, pinhole.focal_px, strict=True)
    ]
    return torch.tensor([*slopes, 1.0], dtype=torch.float64) @ pinhole.axes
