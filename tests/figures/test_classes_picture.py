from __future__ import annotations

import numpy as np
import pytest
import torch

from semgs.data.tables.classes import SCANNET20
from semgs.figures.class_images import UNKNOWN_GREY, class_picture, legend, overlay, true_class_picture
from semgs.files.images.colours import HATCH
from semgs.rendering.rendering import Rendering, confidence_maps, label_maps, likeliest

FLOOR, CHAIR = SCANNET20.index("floor"), SCANNET20.index("chair")


def labels() -> np.ndarray:
    maps = np.full((20, 30), FLOOR, np.uint8)
    maps[5:15, 10:] = CHAIR
    maps[12:, :8] = 255
    return maps


def test_each_class_has_the_colour_of_the_table_and_what_is_unseen_is_hatched_in_no_class_colour() -> None:
    picture = class_picture(labels(), SCANNET20)
    assert (picture[0, 0] == SCANNET20.colours[FLOOR]).all()
    assert (picture[6, 12] == SCANNET20.colours[CHAIR]).all()
    stripes = {tuple(colour) for colour in picture[12:, :8].reshape(-1, 3).tolist()}
    assert stripes == set(HATCH)
    assert not stripes & set(SCANNET20.colours)


def test_true_classes_are_black_where_nobody_labelled_them() -> None:
    picture = true_class_picture(labels(), SCANNET20)
    assert (picture[12:, :8] == 0).all()
    assert (picture[0, 0] == SCANNET20.colours[FLOOR]).all()


def test_an_overlay_mixes_photo_and_class_and_leaves_the_unseen_alone() -> None:
    photo = np.full((20, 30, 3), 100, np.uint8)
    mixed = overlay(photo, labels(), SCANNET20, strength=0.25)
    expected = [round(0.75 * 100 + 0.25 * channel) for channel in SCANNET20.colours[CHAIR]]
    assert mixed[6, 12].tolist() == pytest.approx(expected, abs=1)
    assert (mixed[13, 3] == 100).all()


def test_the_legend_lists_the_classes_present_with_the_most_frequent_first() -> None:
    entries = legend([labels(), np.full((3, 4), CHAIR, np.uint8)], SCANNET20)
    chairs, floors = 10 * 20 + 12, 20 * 30 - 10 * 20 - 8 * 8
    assert [entry.name for entry in entries] == ["floor", "chair"]
    assert entries[0].colour == SCANNET20.colours[FLOOR]
    assert [entry.share for entry in entries] == pytest.approx([floors / (floors + chairs), chairs / (floors + chairs)])
    assert legend([np.full((3, 4), 255, np.uint8)], SCANNET20) == ()
    assert legend([], SCANNET20) == ()


def test_a_pixel_is_the_likeliest_class_where_it_was_seen_and_255_elsewhere() -> None:
    semantics = torch.full((1, 20, 2, 3), 0.01)
    semantics[0, CHAIR] = 0.81
    alphas = torch.tensor([[[0.0, 0.49, 0.5], [0.51, 0.9, 1.0]]])
    rendering = Rendering(torch.zeros(1, 3, 2, 3), semantics, torch.ones(1, 2, 3), alphas)
    assert label_maps(rendering).tolist() == [[[255, 255, CHAIR], [CHAIR, CHAIR, CHAIR]]]
    with pytest.raises(ValueError, match="no classes"):
        label_maps(Rendering(rendering.images, None, rendering.depths, alphas))


def test_a_seen_pixel_with_too_little_confidence_is_unknown_which_is_not_unseen() -> None:
    """A probability of 0.6 is 0.36 / 0.52 = 0.69 at a temperature of 0.5, and 0.551 at 2."""
    semantics = torch.tensor([0.6, 0.4])[:, None, None].expand(1, 2, 2, 3)
    alphas = torch.tensor([[[0.0, 0.49, 0.5], [0.51, 0.9, 1.0]]])
    unsure, sure = [[255, 255, 254], [254, 254, 254]], [[255, 255, 0], [0, 0, 0]]
    for temperature, threshold, expected in (
        (None, 0.6, sure), (None, 0.61, unsure), (0.5, 0.69, sure), (0.5, 0.7, unsure), (2.0, 0.55, sure), (2.0, 0.56, unsure),
    ):  # fmt: skip
        rendering = Rendering(torch.zeros(1, 3, 2, 3), semantics, torch.ones(1, 2, 3), alphas, temperature=temperature)
        assert label_maps(rendering, threshold).tolist() == [expected]
    confidence = confidence_maps(rendering)[0]
    assert confidence[0].tolist() == pytest.approx([0, 0, 0.6**0.5 / (0.6**0.5 + 0.4**0.5)])
    with pytest.raises(ValueError, match="no classes"):
        confidence_maps(Rendering(rendering.images, None, rendering.depths, alphas))
    picture = class_picture(np.array([[FLOOR, 254]], np.uint8), SCANNET20)
    assert picture[0].tolist() == [list(SCANNET20.colours[FLOOR]), list(UNKNOWN_GREY)]


def test_where_some_may_be_unknown_a_table_has_at_most_254_classes() -> None:
    semantics = torch.full((1, 255, 2, 3), 0.5 / 254)
    semantics[:, 7] = 0.5
    rendering = Rendering(torch.zeros(1, 3, 2, 3), semantics, torch.ones(1, 2, 3), torch.ones(1, 2, 3))
    assert (label_maps(rendering) == 7).all()
    with pytest.raises(ValueError, match="255 classes; expected at most 254"):
        label_maps(rendering, 0.5)


def test_of_equally_likely_classes_the_first_is_taken() -> None:
    semantics = torch.tensor([0.1, 0.4, 0.1, 0.4])[:, None, None].expand(3, 4, 2, 5)
    assert torch.equal(likeliest(semantics), torch.ones(3, 2, 5, dtype=torch.uint8))
