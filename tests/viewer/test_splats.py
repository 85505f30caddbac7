from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from wall_and_chair import CHAIR, GREEN, RED, WALL, wall_and_chair

from semgs.data.tables.classes import SCANNET20
from semgs.figures.class_images import UNKNOWN_GREY
from semgs.viewer.pick import pick
from semgs.viewer.splat_groups import SceneSplats


def test_a_group_for_each_class_that_occurs_the_most_frequent_first():
    splats = SceneSplats.of(wall_and_chair())
    assert [group.name for group in splats.groups] == ["wall", "chair"]
    # The wall is the left 30 of 50 columns of two views of 40 rows.
    assert [len(group.members) for group in splats.groups] == [2400, 1600]
    assert [group.share for group in splats.groups] == [0.6, 0.4]
    assert splats.groups[0].colour == SCANNET20.colours[WALL]
    assert set(splats.groups[0].members % 50) == set(range(30))


def test_a_scene_of_millimetres_looks_like_one_of_metres():
    large, small = (SceneSplats.of(wall_and_chair(scale=scale)).splats("colour") for scale in (1.0, 0.001))
    assert np.allclose(large.centres, small.centres, atol=1e-4)
    assert np.allclose(large.covariances, small.covariances, rtol=1e-3)
    # Unscaled, standard deviations of 8 micrometres would all be zero in float16.
    sides = np.array(np.diagonal(small.covariances, axis1=1, axis2=2), np.float16)
    assert (sides > 0).all()
    # The median depth is 2.5 m, which becomes 10 units: 4 times 0.7 of the 2 m / (0.9 * 50) that a pixel of the chair sees.
    assert np.allclose(
        np.sqrt(np.linalg.eigvalsh(small.covariances[-1].astype(float))[-1]), 4 * 0.7 * 2 / 45, rtol=1e-3
    )


@pytest.mark.parametrize(("scale", "decimals"), [(1.0, 3), (0.001, 6), (1000.0, 0), (1e6, 0)])
def test_positions_in_an_unknown_unit_are_to_a_thousandth_of_the_typical_depth(scale: float, decimals: int):
    """Of 2.5 units, 0.0025, so three digits after the point; of 2,500 units, 2.5, so none. Metres are to the centimetre."""
    scene = wall_and_chair((8, 10), scale=scale)
    assert SceneSplats.of(replace(scene, unit="unknown")).decimals == decimals
    assert SceneSplats.of(replace(scene, unit="metric")).decimals == 2


def test_covariances_stay_below_the_largest_float16():
    scene = wall_and_chair()
    scene.gaussians.colour.scales[7] = torch.tensor([1e3, 1.0, 2.0])
    found = SceneSplats.of(scene).splats("colour").covariances
    assert np.isfinite(found.astype(np.float16)).all()
    assert np.diagonal(found[7]).max() == pytest.approx(60_000, rel=1e-3)


def test_each_mode_shows_what_it_says():
    splats = SceneSplats.of(wall_and_chair())
    wall, chair = (group.members[0] for group in splats.groups)
    colour, classes, confidence, depth = (splats.splats(mode) for mode in splats.modes)
    assert np.allclose(colour.colours[[wall, chair]], np.rint(255 * np.array([RED, GREEN])), atol=1)
    assert tuple(classes.colours[wall]) == SCANNET20.colours[WALL]
    assert tuple(classes.colours[chair]) == SCANNET20.colours[CHAIR]
    assert len(np.unique(confidence.colours, axis=0)) == 1, "every class has a probability of 0.8"
    assert len(np.unique(depth.colours, axis=0)) == 2, "depths are 2 and 2.5"
    assert depth.colours[chair][0] > depth.colours[wall][0], "near is red"


def test_classes_and_confidence_have_the_shapes_of_the_semantic_gaussians():
    splats = SceneSplats.of(wall_and_chair())
    colour, classes, confidence, depth = (splats.splats(mode).covariances[0] for mode in splats.modes)
    assert np.array_equal(classes, confidence)
    assert np.array_equal(colour, depth)
    assert np.linalg.eigvalsh(classes)[-1] == pytest.approx(np.linalg.eigvalsh(colour)[-1] * (0.9 / 0.7) ** 2, rel=1e-3)


def test_an_overlay_of_a_half_is_half_way_to_the_colours_of_the_classes():
    splats = SceneSplats.of(wall_and_chair())
    plain, half, full = (splats.splats("colour", tint).colours.astype(float) for tint in (0.0, 0.5, 1.0))
    assert np.abs(half - (plain + full) / 2).max() <= 0.5
    assert np.array_equal(full, splats.splats("classes").colours)


def test_colours_are_those_that_the_own_input_view_sees():
    scene = wall_and_chair()
    harmonics = torch.zeros(len(scene.gaussians), 4, 3)
    harmonics[:, 3, 0] = 1.0  # red falls along +x with basis -0.4886 x
    object.__setattr__(scene.gaussians.colour, "features", harmonics)
    found = SceneSplats.of(scene).colours
    for view, gaussian in ((0, 777), (1, 2777)):
        offset = scene.gaussians.means[gaussian].double() - scene.cameras.centres[view]
        red = 0.5 - 0.48860251 * float(offset[0] / offset.norm())
        assert found[gaussian, 0] == pytest.approx(255 * red, abs=0.51)
        assert found[gaussian, 1] == 128


def test_the_least_confident_gaussians_are_unknown():
    scene = wall_and_chair()
    features = scene.gaussians.semantic.features
    features[5] = torch.full((20,), 0.7 / 19)
    features[5, WALL] = 0.3
    splats = SceneSplats.of(scene, min_confidence=0.5)
    assert splats.groups[-1].name == "unknown"
    assert splats.groups[-1].members.tolist() == [5]
    assert tuple(splats.splats("classes").colours[5]) == UNKNOWN_GREY


def test_thinning_leaves_out_what_covers_nothing_however_opaque_it_is():
    """Ten Gaussians of the second view, opaque, behind the wall."""
    scene = wall_and_chair()
    hidden = 2000 + 50 * torch.arange(15, 25) + 10
    centre = scene.cameras.centres[1].float()
    scene.gaussians.opacities[:] = 0.9
    scene.gaussians.opacities[hidden] = 1.0
    scene.gaussians.means[hidden] = centre + 1.5 * (scene.gaussians.means[hidden] - centre)
    kept = np.concatenate([group.members for group in SceneSplats.of(scene, at_most=3990).groups])
    assert len(kept) == 3990
    assert not set(hidden.tolist()) & set(kept.tolist())


def test_hiding_a_class_leaves_the_others():
    splats = SceneSplats.of(wall_and_chair(), at_most=3500)
    visible = splats.visible(["wall"])
    assert visible.sum() == 1600, "of all Gaussians, also of those that were thinned out"
    assert (splats.labels[visible] == CHAIR).all()
    assert splats.visible([]).all()


def test_a_scene_without_classes_is_one_group():
    splats = SceneSplats.of(wall_and_chair(classes=False))
    assert [(group.name, len(group.members)) for group in splats.groups] == [("scene", 4000)]
    assert splats.modes == ("colour", "confidence", "depth")
    assert splats.confidences[0] == pytest.approx(0.4), "of its depth"


def test_gaussians_without_a_class_are_in_the_group_unknown():
    """The first view, of 40 rows and 50 columns, has no classes; of the second one, 30 columns are wall."""
    scene = wall_and_chair()
    scene.gaussians.semantic.features[:2000] = 1 / 20
    groups = {group.name: len(group.members) for group in SceneSplats.of(scene).groups}
    assert groups == {"unknown": 2000, "wall": 1200, "chair": 800}
    hit = pick(scene, scene.cameras[0], (10.5, 20.5), visible=np.arange(4000) < 2000)
    assert hit is not None
    assert (hit.name, hit.probability) == ("unknown", 0)
