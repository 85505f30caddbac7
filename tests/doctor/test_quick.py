"""The quick test before a reconstruction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from semgs.data.scenes import open_scene
from semgs.doctor.quick import warnings_of
from semgs.rooms.sets.demo_room import demo_scene


def test_it_warns_of_inverted_poses_and_says_nothing_of_good_ones():
    scene = open_scene(demo_scene())
    assert warnings_of(scene, (1, 3, 2)) == []
    inverted = tuple(replace(frame, world_from_camera=np.linalg.inv(frame.world_from_camera)) for frame in scene.frames)
    (warning,) = warnings_of(replace(scene, frames=inverted), (1, 3, 2))
    assert warning.startswith("The cameras may be wrong.")
    assert "poses inverted" in warning
