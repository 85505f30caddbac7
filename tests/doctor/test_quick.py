"""The quick test before a reconstruction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

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


def test_it_says_that_photos_lie_on_their_side(tmp_path: Path):
    """As a phone held upright stores them: the pixels lie, EXIF says how to show them, and COLMAP made cameras for the pixels."""
    scene = open_scene(demo_scene())
    exif = Image.Exif()
    exif[0x0112] = 6
    frames = list(scene.frames)
    for position in (1, 3):
        with Image.open(str(frames[position].picture)) as image:
            image.save(tmp_path / f"{position}.png", exif=exif)
        frames[position] = replace(frames[position], picture=tmp_path / f"{position}.png")
    (warning,) = warnings_of(replace(scene, frames=tuple(frames)), (1, 3, 2))
    assert warning.startswith("Photos lie on their side, as EXIF says, and so do their cameras (2 of 3 tested).")
