"""Views beside two input views of a room: how far, to which side, and what `semgs evaluate --protocol aside` makes of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from semgs.data.scenes import open_scene
from semgs.evaluation.frames.protocols import aside, neighbours
from semgs.files.errors import InputError
from semgs_rooms.sets.room_scenes import RoomSettings, draw_scene, write_scene

SETTINGS = RoomSettings(3, (24, 32), style="other", aside=True)


def poses_of(index: int) -> dict[str, np.ndarray]:
    """The poses of a scene by name."""
    drawn = draw_scene(SETTINGS, index)
    assert drawn.names is not None
    return dict(zip(drawn.names, drawn.views.cameras.world_from_camera.numpy(), strict=True))


@pytest.mark.parametrize("index", [0, 1])
def test_steps_are_as_long_and_angles_as_large_as_their_names_say_and_lead_away_from_the_other_input(index: int):
    poses = poses_of(index)
    inputs = [poses[f"input_{number}"] for number in (0, 1)]
    assert len(poses) > 4
    for name, pose in poses.items():
        if not name.startswith("aside"):
            continue
        _, number, how = name.split("_")
        own, other = inputs[int(number)], inputs[1 - int(number)]
        moved = pose[:3, 3] - own[:3, 3]
        turn = np.degrees(np.arccos(np.clip((np.trace(pose[:3, :3] @ own[:3, :3].T) - 1) / 2, -1, 1)))
        if how.endswith("cm"):
            assert np.linalg.norm(moved) == pytest.approx(int(how[:-2]) / 100)
            assert turn == pytest.approx(0, abs=1e-4)
        else:
            assert turn == pytest.approx(int(how[:-3]), abs=1e-4)
            assert moved[2] == pytest.approx(0, abs=1e-9), "around the vertical"
        right = own[:3, 0]
        assert (moved @ right) * ((other[:3, 3] - own[:3, 3]) @ right) <= 0


def test_the_protocol_takes_the_input_views_for_every_view_aside(tmp_path: Path):
    write_scene(tmp_path / "scene", SETTINGS, 0)
    scene = open_scene(tmp_path / "scene")
    samples = aside(scene, 2)
    names = [Path(frame.name).stem for frame in scene.frames]
    assert {names[position] for sample in samples for position in sample.contexts} == {"input_0", "input_1"}
    assert {names[sample.target] for sample in samples} == {name for name in names if name.startswith("aside")}
    with pytest.raises(InputError, match=r"expected 3 input views, found 2; use --views 2"):
        aside(scene, 3)


def test_other_scenes_are_refused_with_the_way_to_make_some(tmp_path: Path):
    write_scene(tmp_path / "walk", RoomSettings(3, (24, 32), frames=3, style="other"), 0)
    scene = open_scene(tmp_path / "walk")
    assert len(neighbours(scene, 2)) == 1
    with pytest.raises(
        InputError, match=r"expected a scene with views aside, found none; semgs rooms --out OUT --aside draws them"
    ):
        aside(scene, 2)


def test_a_set_of_walks_keeps_its_settings():
    assert "aside" not in RoomSettings(3, (24, 32)).as_json()
    assert SETTINGS.as_json()["aside"] is True
