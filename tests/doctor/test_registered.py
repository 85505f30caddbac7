"""Depth of a camera with another focal length: found by the zoom at which it fits matches, or other depth maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_mistakes import Unregistered
from test_mistakes import NAMES, seen, walk
from test_warps import corner, small_walk

from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.doctor.diagnosis import Evidence, diagnose, judge_cameras
from semgs.doctor.mistakes import BAD_DEPTH
from semgs.doctor.registered import Zoom, unregistered, zooms_of_matches, zooms_of_warps
from semgs.doctor.rig import Rig, rig_of
from semgs.sfm.matches import ZOOMS, Matches, find_matches


def best(zooms: list[Zoom]) -> Zoom:
    return max(zooms, key=lambda zoom: zoom.gain)


def slanted(zoom: float) -> Matches:
    """True matches of a wall with 1 / z = 0.4 + 0.3 x + 0.2 y along the ray (x, y, 1), whose depth was read at a zoom.

    The walk's cameras do not see one wall, so depths are those at a match scaled by 1 / z there over 1 / z at `zoom` times its offset.
    """
    rig = walk()
    matches = seen(rig)
    rays = (matches.points - rig.centre[0]) / rig.focal[0]

    def nearness(factor: np.ndarray) -> np.ndarray:
        return 0.4 + factor * (0.3 * rays[..., 0] + 0.2 * rays[..., 1])[..., None]

    # The map was made by a camera of `zoom` times the focal length: at ZOOMS times the offset it has the depth at ZOOMS / zoom of it.
    zoomed = matches.depths[..., None] * nearness(np.ones(1)) / nearness(ZOOMS / zoom)
    given = matches.depths * (nearness(np.ones(1)) / nearness(np.ones(1) / zoom))[..., 0]
    return replace(matches, depths=given, zoomed=zoomed)


@pytest.mark.parametrize("step", [-11, 4])
def test_the_focal_length_of_the_depth_camera_is_found_from_matches(step: int):
    """1.03^-11 = 0.72, of a RealSense; 1.03^4 = 1.13, of a Kinect. There nothing is missed."""
    found = best(zooms_of_matches(walk(), slanted(1.03**step)))
    assert found.ratio == pytest.approx(1.03**step)
    assert found.error < 1e-6
    assert found.clear


def test_registered_depth_gains_nothing():
    found = best(zooms_of_matches(walk(), slanted(1.0)))
    assert found.gain == pytest.approx(1)
    assert not found.clear


def test_the_gain_is_the_geometric_mean_over_pairs():
    """Two cameras side by side, 0.5 m apart, with 100 px: a wall at 2 m moves by 25 px.

    The depth as given is 2.5 m (20 px, missed by 5) in half of the pairs and 5 m (10 px, missed by 15) in the others; at one zoom it is 2 m.
    With a floor of 0.1 px, the gain is sqrt(51 * 151) = 87.76.
    """
    count = 4
    poses = np.tile(np.eye(4), (2 * count, 1, 1))
    poses[1::2, 0, 3] = 0.5
    rig = Rig(poses, np.full((8, 2), 100.0), np.tile((31.0, 22.0), (8, 1)), np.tile((64.0, 48.0), (8, 1)))
    points = np.tile([[[40.0, 20.0], [15.0, 20.0]]], (8 * count, 1, 1))
    depths = np.full((8 * count, 2), np.nan)
    depths[:, 0] = np.repeat([2.5, 5.0, 2.5, 5.0], 8)
    zoomed = np.repeat(depths[..., None], len(ZOOMS), axis=2)
    zoomed[:, 0, 3] = 2.0
    matches = Matches(
        np.arange(8).reshape(4, 2), np.repeat(np.arange(count), 8), points, depths, np.ones((8 * count, 2)), (), zoomed
    )
    found = best(zooms_of_matches(rig, matches))
    assert found.ratio == ZOOMS[3]
    assert found.gain == pytest.approx((51 * 151) ** 0.5)
    assert found.error == pytest.approx(0, abs=1e-9)
    few = replace(matches, pair=np.repeat([0, 0, 1, 2], 8))  # three pairs say nothing
    assert zooms_of_matches(rig, few) == []


@pytest.mark.parametrize(
    ("found", "clear"),
    [
        (Zoom(0.72, 1.0, 1.1, 3.5), True),
        (Zoom(1.03, 1.0, 1.1, 3.5), False),  # a rough calibration
        (Zoom(0.72, 1.0, 1.04, 3.5), False),
        (Zoom(0.72, 1.0, 1.1, 2.5), False),
    ],
)
def test_only_clear_zooms_count(found: Zoom, clear: bool):
    assert found.clear == clear


def test_depth_maps_alone_show_another_focal_length_and_matches_whose():
    """The maps are those of cameras with 1.03^-9 = 0.77 times the focal length."""
    rig = small_walk()
    views = corner(replace(rig, focal=rig.focal * 1.03**-9))
    found = best(zooms_of_warps(rig, views))
    assert found.clear
    assert found.ratio == pytest.approx(1.03**-9, rel=0.04)
    # Matches fit the focal length that is given: the depth is of another camera.
    assert unregistered(rig, seen(rig, depth=False), views, np.inf) == found
    # Matches fit that of the depth: the focal length of the images is wrong.
    assert unregistered(rig, seen(replace(rig, focal=rig.focal * found.ratio), depth=False), views, np.inf) is None
    assert unregistered(rig, seen(rig, depth=False), corner(rig), np.inf) is None


def test_matches_do_not_count_if_depth_maps_then_agree_less():
    rig, matches = walk(), slanted(1.03**-11)
    large = tuple(
        replace(view, points=view.points * (10, 10, 1), map_from_pixel=np.diag((0.1, 0.1, 1.0)))
        for view in corner(small_walk())
    )
    assert unregistered(rig, matches, (), np.inf) is not None
    assert unregistered(rig, matches, large, np.inf) is None


def test_another_mistake_that_fits_better_comes_first():
    rig, matches = walk(), slanted(1.03**-11)
    found = judge_cameras(rig, Evidence(matches), "transforms.json", NAMES)
    assert found.finding is not None
    assert found.finding.mistake is BAD_DEPTH
    assert "0.72 times the focal length" in found.sentence
    assert np.isnan(found.finding.rig.depth_unit)
    assert unregistered(rig, matches, (), 0.0) is None


@pytest.mark.parametrize(("focal", "about"), [(585 / 525, 1.13), pytest.param(0.72, 0.72, marks=pytest.mark.long)])
def test_depth_of_another_camera_in_the_included_room_is_named(focal: float, about: float):
    scene = open_scene(demo_scene())
    frames = tuple(
        replace(frame, depth=Unregistered(frame.depth, focal)) for frame in scene.frames if frame.depth is not None
    )
    found = diagnose(replace(scene, frames=frames))
    assert found.finding is not None
    assert found.finding.mistake is BAD_DEPTH
    assert found.depth_focal == pytest.approx(about, rel=0.04)
    matches = find_matches(scene)
    assert not best(zooms_of_matches(rig_of(scene.frames), matches)).clear
