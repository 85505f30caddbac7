"""Images of a scene from any camera."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from saved_scenes import CHAIR, SIZE, WALL, wall

from semgs.data.tables.classes import SCANNET20
from semgs.export.stills import GAP_PX, Stills, side_by_side
from semgs.figures.class_images import UNKNOWN_GREY
from semgs.rendering.temperatures import Temperatures

ALL = ("colour", "classes", "overlay", "depth", "confidence", "alpha", "rgba")


def images(min_confidence: float = 0.0, temperatures: Temperatures | None = None) -> dict[str, np.ndarray]:
    """Each image of the first camera, moved so that the wall ends within the image."""
    scene = wall(temperatures=temperatures)
    camera = scene.cameras[:1].relative_to((0.0, 0.0, 0.0))
    camera.world_from_camera[:, :3, 3] += 0.9 * camera.world_from_camera[:, :3, 0]
    with torch.no_grad():
        (found,) = Stills(scene, ALL, min_confidence).images(camera)
    return dict(zip(ALL, found, strict=True))


def test_each_shows_what_it_says_at_the_cameras_size() -> None:
    found = images()
    assert {name: image.shape for name, image in found.items()} == {
        name: (*SIZE, 4 if name == "rgba" else 3) for name in ALL
    }
    seen = found["alpha"][..., 0] > 250
    empty = found["alpha"][..., 0] < 5
    assert seen.mean() > 0.3
    assert empty.mean() > 0.05
    wall_colour, chair_colour = SCANNET20.colours[WALL], SCANNET20.colours[CHAIR]
    assert {tuple(colour) for colour in found["classes"][seen].tolist()} == {wall_colour, chair_colour}
    assert (found["colour"][empty] <= 5).all()
    assert (found["overlay"][empty] == found["colour"][empty]).all()
    tinted = found["colour"][seen] + 0.55 * (found["classes"][seen].astype(float) - found["colour"][seen])
    assert np.abs(found["overlay"][seen] - tinted).max() <= 1


def test_transparent_colour_over_black_is_the_colour() -> None:
    found = images()
    straight, alpha = found["rgba"][..., :3].astype(float), found["rgba"][..., 3:] / 255
    assert np.abs(straight * alpha - found["colour"]).max() <= 2
    edge = (alpha[..., 0] > 0.2) & (alpha[..., 0] < 0.6)
    assert edge.any()
    assert (straight[edge][:, 2] > 85).all()  # blue is 0.4 * 255 = 102 everywhere, and half of that over black
    assert (found["colour"][edge][:, 2] < 70).all()
    assert (found["rgba"][..., 3] == found["alpha"][..., 0]).all()


def test_what_is_not_sure_enough_is_grey_and_calibration_decides_what_that_is() -> None:
    """The chair has 0.62, or with T = 0.5 0.62^2 / (0.62^2 + 19 * 0.02^2) = 0.98."""
    found = images(min_confidence=0.7)
    seen = found["alpha"][..., 0] > 250
    colours = {tuple(colour) for colour in found["classes"][seen].tolist()}
    assert colours == {SCANNET20.colours[WALL], UNKNOWN_GREY}
    calibrated = images(min_confidence=0.7, temperatures=Temperatures(rendered=0.5, gaussians=9.0))
    share = (calibrated["classes"][seen] == SCANNET20.colours[CHAIR]).all(-1).mean()
    assert share > 0.9 * (found["classes"][seen] == UNKNOWN_GREY).all(-1).mean()
    assert calibrated["confidence"][seen].astype(int).sum() > found["confidence"][seen].astype(int).sum()


def test_images_side_by_side_have_white_between_them() -> None:
    one, other = np.full((3, 5, 3), 10, np.uint8), np.full((3, 5, 3), 20, np.uint8)
    joined = side_by_side([one, other])
    assert joined.shape == (3, 10 + GAP_PX, 3)
    assert joined[1, :, 0].tolist() == [10] * 5 + [255] * GAP_PX + [20] * 5
    assert (side_by_side([one]) == one).all()


def test_what_a_scene_cannot_show_is_refused() -> None:
    with pytest.raises(ValueError, match="no classes, so it cannot show overlay"):
        Stills(wall(classes=False), ("colour", "overlay"))
    with pytest.raises(ValueError, match="something to show"):
        Stills(wall(), ())
