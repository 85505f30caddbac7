"""What the panel of the viewer does, without a browser."""

from __future__ import annotations

from dataclasses import replace

import torch
from wall_and_chair import wall_and_chair

from semgs.scene.confidence import part_of
from semgs.viewer.pick import pick
from semgs.viewer.window import open_window


def test_a_scene_with_hidden_pixels_is_rendered_without_the_classes_that_are_not_shown():
    """Two views of 8x10 pixels without their first rows: 140 Gaussians with places. The wall is on the left 6 columns, the chair on the right 4."""
    whole = wall_and_chair((8, 10))
    visible = torch.arange(8 * 10).repeat(2) >= 10
    scene = part_of(replace(whole, places=torch.arange(2 * 8 * 10)), visible)
    assert len(scene.gaussians) == 2 * 7 * 10
    with open_window(scene, up="z") as window:
        both = window._render_image(scene.cameras[0])
        window._boxes["chair"].value = False
        wall = window._render_image(scene.cameras[0])
    red, green = both[4, 2].tolist(), both[4, 8].tolist()
    assert red[0] > 100 > red[1], "the wall"
    assert green[1] > 100 > green[0], "the chair"
    assert wall[4, 2, 0] > 100
    assert wall[4, 8, 1] < 20, "the chair is gone"


def test_each_mode_of_a_scene_without_classes_can_be_rendered():
    """The confidence of its Gaussians is that of their depth: the scale says so, and their colours are rendered (nothing was)."""
    scene = wall_and_chair((8, 10), classes=False)
    with open_window(scene, up="z") as window:
        colour = window._render_image(scene.cameras[0])
        assert colour[4, 2, 0] > 100 > colour[4, 2, 1], "the wall is red"
        assert "probability of the depth" in window._scales["confidence"].content
        for mode in window._splats.modes:
            window._mode = mode
            picture = window._render_image(scene.cameras[0])
            assert (mode == "depth") or (picture == colour).all()


def test_with_all_classes_hidden_a_render_is_empty_and_a_click_meets_nothing():
    scene = wall_and_chair((8, 10))
    with open_window(scene, up="z") as window:
        window._toggle_all_classes(False)
        assert (window._render_image(scene.cameras[0]) == 0).all()
        assert pick(scene, scene.cameras[0], (2.5, 4.5), window._find_visible()) is None
