"""The drawing of the cameras on the doctor's page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from test_mistakes import NAMES, seen, walk

from semgs.doctor.diagnosis import Evidence, judge_cameras
from semgs.doctor.doctor_page import PLOT_PX, _axes, _cameras, _measured_points

RED, BLUE = (200, 30, 30), (40, 80, 160)


def test_up_is_where_the_images_have_it_and_the_way_lies_across():
    """Cameras that walk along y and look along x of a world whose z is up."""
    look = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, :3, :3] = look
    poses[:, 1, 3] = 0.5 * np.arange(4)
    across, ahead, up = _axes(poses)
    np.testing.assert_allclose(up, (0, 0, 1), atol=1e-12)
    np.testing.assert_allclose(np.abs(across), (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(np.abs(ahead), (1, 0, 0), atol=1e-12)


def test_grey_points_are_where_the_cameras_measured_them():
    """All pairs see points at known places: from whichever frame, (x, y, z) of the first camera is in front of it."""
    rig = walk()
    matches = seen(rig)
    found = judge_cameras(rig, Evidence(matches), "transforms.json", NAMES)
    places = _measured_points(rig, found)
    first = matches.pairs[matches.pair][:, 0]
    inverse = np.linalg.inv(rig.poses[first])
    local = np.einsum("mij,mj->mi", inverse[:, :3, :3], places) + inverse[:, :3, 3]
    np.testing.assert_allclose(local[:, 2], matches.depths[:, 0])
    pixels = local[:, :2] / local[:, 2:] * rig.focal[first] + rig.centre[first]
    np.testing.assert_allclose(pixels, matches.points[:, 0])


def test_both_views_show_the_first_camera_in_red_and_the_others_in_blue_also_without_some_poses():
    rig = walk()
    poses = rig.poses.copy()
    poses[0] = np.nan
    for one in (rig, replace(rig, poses=poses)):
        found = judge_cameras(rig, Evidence(seen(rig)), "transforms.json", NAMES)
        above, side = _cameras(one, found, "given")
        assert (above.caption, side.caption) == ("given cameras, from above", "given cameras, from the side")
        for view in (above, side):
            assert view.pixels.shape == (PLOT_PX, PLOT_PX, 3)
            for colour in (RED, BLUE):
                assert (view.pixels == colour).all(-1).sum() > 20
