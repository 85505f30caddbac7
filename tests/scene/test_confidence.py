"""How sure a scene is of each Gaussian and of each rendered pixel, by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from semgs.data.tables.classes import ClassTable
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.rendering import confidence_maps, label_maps
from semgs.rendering.temperatures import Temperatures
from semgs.scene.confidence import class_confidences, class_labels
from semgs.scene.scene_file import SavedScene

TWO = ClassTable("two", ("wall", "mug"), ((1, 2, 3), (4, 5, 6)), (0, 1))


def scene(temperatures: Temperatures | None, classes: bool = True) -> SavedScene:
    """One view of 3x5 pixels and a Gaussian for each 2x2 of them; all are (0.2, 0.8), but for the first: (0.5, 0.5)."""
    quaternions = torch.tensor([0.8, 0.0, 0.6, 0.0]).expand(6, 4)
    shares = torch.tensor([0.2, 0.8]).repeat(6, 1)
    shares[0] = 0.5
    shape = Appearance(quaternions, torch.full((6, 3), 5.0), torch.zeros(6, 1, 3))
    pose = torch.tensor(
        [[0.0, 0, 1, 0.5], [0, 1, 0, 2], [-1, 0, 0, 0], [0, 0, 0, 1]], dtype=torch.float64
    )  # looks along x
    means = torch.tensor([5.0, 2, 0]) + torch.arange(18.0).view(6, 3) / 100
    return SavedScene(
        gaussians=Gaussians(means, torch.full((6,), 0.9), shape, replace(shape, features=shares) if classes else None),
        cameras=Cameras(pose[None], torch.tensor([[[4.0, 0, 2.2], [0, 5, 1.3], [0, 0, 1]]]), (3, 5)),
        depths=torch.ones(1, 3, 5),
        confidences=torch.full((1, 3, 5), 0.3),
        depth_spread=torch.tensor([[[0.1, 0.3, 0.5, 0.5, 0.7], [0.1, 0.3, 0.5, 0.5, 0.9], [0.2] * 5]]),
        depth_range=torch.tensor([[0.5, 9.0]], dtype=torch.float64),
        unit="metric",
        classes=TWO if classes else None,
        frames=("a.jpg",),
        source="office",
        model="small",
        temperatures=temperatures,
        stride=2,
    )


def test_a_gaussians_confidence_is_calibrated_by_the_temperature_of_gaussians() -> None:
    """At T = 0.5 the distribution is squared: 0.64 / (0.64 + 0.04); at T = 2 its root is taken: 2 / (2 + 1)."""
    for temperatures, expected in (
        (None, 0.8),
        (Temperatures(rendered=9.0, gaussians=0.5), 0.64 / 0.68),
        (Temperatures(rendered=9.0, gaussians=2.0), 2 / 3),
    ):
        found = class_confidences(scene(temperatures))
        assert found.tolist() == pytest.approx([0.5, *[expected] * 5])


def test_without_classes_it_is_the_confidence_of_the_depth() -> None:
    assert class_confidences(scene(None, classes=False)).tolist() == pytest.approx([0.3] * 6)


def test_a_gaussians_depth_spread_is_the_mean_of_its_pixels() -> None:
    wall = scene(None)
    assert wall.depth_spread is not None
    assert wall.per_gaussian(wall.depth_spread).tolist() == pytest.approx([0.2, 0.5, 0.8, 0.2, 0.2, 0.2])


def test_a_rendered_pixel_is_calibrated_by_the_temperature_of_pixels() -> None:
    """All Gaussians cover the whole image, so the classes of all pixels are about alike; with T = 0.1 their odds are raised to the tenth power."""
    plain, sharp = (scene(one).render(scene(one).cameras) for one in (None, Temperatures(rendered=0.1, gaussians=9.0)))
    odds = confidence_maps(plain) / (1 - confidence_maps(plain))
    assert ((odds > 1.1) & (odds < 1.4)).all()
    raised = confidence_maps(sharp) / (1 - confidence_maps(sharp))
    assert raised.ravel().tolist() == pytest.approx((odds**10).ravel().tolist(), rel=1e-3)
    threshold = 0.7  # between the two
    assert confidence_maps(plain).max() < threshold < confidence_maps(sharp).min()
    assert (label_maps(plain, threshold) == 254).all()
    assert (label_maps(sharp, threshold) == 1).all()
    assert sharp.classes is TWO


def test_a_gaussian_whose_classes_are_equally_likely_has_none() -> None:
    assert class_labels(scene(None)).tolist() == [255, 1, 1, 1, 1, 1]
    assert class_labels(scene(None)).dtype == torch.uint8
    with pytest.raises(ValueError, match="expected a scene with 1 to 255 classes"):
        class_labels(scene(None, classes=False))


def test_the_only_class_of_a_table_is_the_class_of_every_gaussian() -> None:
    known = scene(None)
    one = ClassTable("one", ("mug",), ((4, 5, 6),), (0,))
    assert known.gaussians.semantic is not None
    shape = replace(known.gaussians.semantic, features=torch.ones(6, 1))
    alone = replace(known, gaussians=replace(known.gaussians, semantic=shape), classes=one)
    assert class_labels(alone).tolist() == [0] * 6
    assert (label_maps(alone.render(alone.cameras)) == 0).all()


def test_a_pixel_of_gaussians_without_a_class_has_none() -> None:
    known = scene(None)
    assert known.gaussians.semantic is not None
    shape = replace(known.gaussians.semantic, features=torch.full((6, 2), 0.5))
    without = replace(known, gaussians=replace(known.gaussians, semantic=shape))
    rendering = without.render(without.cameras)
    assert (rendering.alphas > 0.99).all()
    assert (label_maps(rendering) == 255).all()
    assert (label_maps(rendering, 0.9) == 255).all()
    assert (confidence_maps(rendering) == 0).all()
