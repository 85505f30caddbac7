"""Pixel votes: what Gaussians collect from class maps, against blending weights worked out by hand and by rendering each Gaussian."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering import reference
from semgs.rendering.splats import Pinhole, Splats
from semgs.run.steps.splat_labelling import PixelVotes

SIZE = (9, 9)


def camera() -> Cameras:
    """At the origin, looking along +z; the axis passes the centre of the middle pixel."""
    intrinsics = torch.tensor([[[9.0, 0, 4.5], [0, 9, 4.5], [0, 0, 1]]], dtype=torch.float64)
    return Cameras(torch.eye(4, dtype=torch.float64)[None], intrinsics, SIZE)


def on_the_axis(*depths_and_opacities: tuple[float, float]) -> Gaussians:
    """Round Gaussians of 10 cm at some depths on the axis."""
    depths, opacities = torch.tensor(depths_and_opacities).unbind(1)
    count = len(depths)
    means = torch.stack((torch.zeros(count), torch.zeros(count), depths), 1)
    quaternions = torch.tensor([[1.0, 0, 0, 0]]).expand(count, 4)
    return Gaussians(means, opacities, Appearance(quaternions, torch.full((count, 3), 0.1), torch.zeros(count, 1, 3)))


def middle(*shares: float) -> torch.Tensor:
    """A class map that knows the middle pixel alone."""
    distributions = torch.zeros(len(shares), *SIZE)
    distributions[:, 4, 4] = torch.tensor(shares)
    return distributions


def test_gaussians_collect_by_their_blending_weight() -> None:
    """On its axis, 0.6 of a pixel is the Gaussian in front, 0.4 * 0.9 the one behind, and nothing is one behind the camera."""
    votes = PixelVotes(on_the_axis((2.0, 0.6), (3.0, 0.9), (-2.0, 0.9)), 2)
    votes.add(camera(), middle(0.749, 0.249))
    torch.testing.assert_close(votes.weights, torch.tensor([0.6, 0.36, 0.0]).sqrt())
    assert votes.unseen.tolist() == [False, False, True]
    semantic = votes.labelled().semantic
    assert semantic is not None
    torch.testing.assert_close(semantic.features, torch.tensor([[0.75, 0.25], [0.75, 0.25], [0.5, 0.5]]))


def test_pixels_of_a_photo_count_by_their_weights_and_photos_by_the_roots_of_theirs() -> None:
    """From behind the order turns round. The first Gaussian has 0.6 of the front photo's pixel and 0.1 * 0.6 of the other's, the second 0.36 and 0.9:
    roots 0.775 and 0.245, 0.6 and 0.949. The first photo says class 0 and the second class 1, each with odds of 1001."""
    scene = on_the_axis((2.0, 0.6), (3.0, 0.9), (50.0, 0.0))
    behind = camera()
    behind.world_from_camera[0] = torch.tensor([[-1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 5], [0, 0, 0, 1]])
    votes = PixelVotes(scene, 2)
    votes.add(camera(), middle(1.0, 0.0))
    votes.add(behind, middle(0.0, 1.0))
    labelled = votes.labelled()
    assert labelled.semantic is not None
    lead = torch.tensor([(0.774597 - 0.244949) / 1.019546, (0.6 - 0.948683) / 1.548683, 0.0])
    torch.testing.assert_close(labelled.semantic.features[:, 0], (lead * math.log(1001)).sigmoid())
    assert labelled.semantic.scales is scene.colour.scales
    assert labelled.means is scene.means


def test_the_weights_are_those_of_the_reference_renderer_gaussian_by_gaussian() -> None:
    torch.manual_seed(3)
    count = 40
    means = torch.rand(count, 3) * torch.tensor([2.0, 1.5, 1.0]) + torch.tensor([-1.0, -0.75, 2.0])
    quaternions = torch.nn.functional.normalize(torch.randn(count, 4), dim=1)
    shape = Appearance(quaternions, torch.rand(count, 3) * 0.2 + 0.02, torch.rand(count, 4, 3))
    scene = Gaussians(means, torch.rand(count), shape)
    distributions = torch.rand(5, *SIZE).softmax(0)
    votes = PixelVotes(scene, 5)
    votes.add(camera(), distributions)
    pinhole = Pinhole.of(camera()[0])
    order = reference.depth_order(means, pinhole, None)
    each = reference.splat(Splats(means, quaternions, shape.scales, scene.opacities, torch.eye(count)), order, pinhole)
    pixels = each.picture.float()
    weights = pixels.sum((1, 2))
    assert 20 < weights.sum() <= 81
    seen = weights > 0.01
    assert seen.sum() > 30
    logs = torch.einsum("ghw,chw->gc", pixels, (distributions + 1e-3).log()) / weights[:, None]
    torch.testing.assert_close(votes.weights[seen], weights[seen].sqrt(), rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(votes.labelled().semantic.features[seen], logs.softmax(1)[seen], rtol=1e-4, atol=1e-5)


def test_pixels_of_zeros_say_nothing() -> None:
    votes = PixelVotes(on_the_axis((2.0, 0.6)), 2)
    votes.add(camera(), torch.zeros(2, *SIZE))
    assert votes.unseen.tolist() == [True]


def test_a_map_of_another_size_or_table_is_refused() -> None:
    votes = PixelVotes(on_the_axis((2.0, 0.6)), 2)
    with pytest.raises(ValueError, match=r"distributions are \(3, 9, 9\); expected \(2, 9, 9\)"):
        votes.add(camera(), middle(0.2, 0.3, 0.5))
    with pytest.raises(ValueError, match="expected"):
        votes.add(camera(), torch.zeros(2, 9, 8))


def test_footprints_are_not_blurred_into_votes() -> None:
    """They would widen a Gaussian of 10 cm in a photo from so near; `label-splat` gives classes to the splat as its file has it."""
    plain = on_the_axis((2.0, 0.6), (3.0, 0.9))
    found = []
    for gaussians in (plain, replace(plain, footprints=torch.full((2,), 1.0))):
        votes = PixelVotes(gaussians, 2)
        votes.add(camera(), torch.full((2, *SIZE), 0.5))
        found.append(votes.weights)
    assert torch.equal(*found)


@pytest.mark.parametrize(("opacity", "seen"), [(0.0009, False), (0.0011, True)])
def test_less_than_a_thousandth_of_a_pixel_is_no_vote(opacity: float, seen: bool) -> None:
    """Behind 0.6 and 0.9 of the light, 0.04 is left; the last Gaussian has so much of it that 0.0009 or 0.0011 of the pixel is its."""
    votes = PixelVotes(on_the_axis((2.0, 0.6), (3.0, 0.9), (4.0, opacity / 0.04)), 2)
    votes.add(camera(), middle(1.0, 0.0))
    assert votes.unseen.tolist() == [False, False, not seen]
    assert float(votes.weights[2]) == (pytest.approx(math.sqrt(opacity)) if seen else 0.0)
