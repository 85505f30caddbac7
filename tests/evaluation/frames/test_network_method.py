"""What an evaluation does between encoding and rendering."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import torch
from mapping_walls import KnowsTheWall, cameras_at, image
from torch import Tensor

from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.network_method import NetworkMethod
from semgs.evaluation.frames.predictions import Inputs
from semgs.evaluation.frames.protocols import neighbours
from semgs.geometry.harmonics import basis
from semgs.scene.encoding import Encoding
from semgs.scene.exposure import ExposureChoice

SIZE = (24, 36)


class TakesColours(KnowsTheWall):
    """As `KnowsTheWall`, with the colours of the photos."""

    def __call__(self, views: Views) -> Encoding:
        encoding = super().__call__(views)
        colours = views.images.movedim(1, -1).reshape(-1, 1, 3)
        colour = replace(encoding.gaussians.colour, features=(colours - 0.5) / basis(torch.zeros(3), 0))
        return replace(encoding, gaussians=replace(encoding.gaussians, colour=colour))


def test_input_views_come_to_a_common_exposure_if_asked(make_scene: Callable[..., Scene]) -> None:
    """Photos 0.8 c and 0.45 c come to 0.6 c, with gains of 3/4 and 4/3."""
    task = make_plan("neighbours", neighbours, (make_scene(),), (2,), None).tasks[0]

    def rendered(brightness: tuple[float, float], exposure: ExposureChoice) -> Tensor:
        """A third view of a wall between two photos of these exposures."""
        images = torch.stack([image(one, SIZE) for one in brightness])
        contexts = Views(images, cameras_at(0.0, 0.0, size=SIZE), [[0.5, 10.0]] * 2)
        inputs = Inputs(task, contexts, cameras_at(0.1, size=SIZE))
        found = NetworkMethod(TakesColours(), "cpu", "wall", exposure=exposure).predict(inputs).image
        assert found is not None
        return found

    even, common = rendered((0.6, 0.6), "as-taken"), rendered((0.8, 0.45), "fitted")
    torch.testing.assert_close(common, even, atol=1e-5, rtol=0)
    torch.testing.assert_close(rendered((0.8, 0.45), "auto"), common, atol=0, rtol=0)
    assert not torch.allclose(rendered((0.8, 0.45), "as-taken"), even, atol=0.01)
