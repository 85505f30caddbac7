"""Files of cameras to render from."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from posed import posed_cameras

from semgs.export.camera_files import read_camera_file, write_camera_file
from semgs.files.errors import InputError

POSE = [0.0, 0, 1, 4, 1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 0, 1]
"""OpenGL: x right is the world's y, y up its z, and z backward its x."""

OPENCV = torch.tensor([[0.0, 0, -1, 4], [1, 0, 0, 5], [0, -1, 0, 6], [0, 0, 0, 1]], dtype=torch.float64)
PATH = {"camera_type": "perspective", "render_height": 100, "render_width": 160, "seconds": 2.0}
SHARED = {"w": 60, "h": 40, "fl_x": 50.0}
SQUARE = [POSE[row : row + 4] for row in range(0, 16, 4)]


def write(folder: Path, content: object) -> Path:
    path = folder / "cameras.json"
    path.write_text(json.dumps(content))
    return path


def test_a_camera_path_of_nerfstudio_has_its_vertical_field_of_view_and_opengl_axes(tmp_path: Path) -> None:
    """At 90 degrees, half of the height is one focal length: 50 px."""
    entries = [{"camera_to_world": POSE, "fov": 90.0, "aspect": 1.6}, {"camera_to_world": POSE, "fov": 60}]
    found = read_camera_file(write(tmp_path, PATH | {"camera_path": entries}))
    torch.testing.assert_close(found.world_from_camera[0], OPENCV)
    expected = torch.tensor([[50.0, 0, 80], [0, 50, 50], [0, 0, 1]], dtype=torch.float64)
    torch.testing.assert_close(found.intrinsics[0], expected)
    assert found.intrinsics[1, 0, 0].item() == pytest.approx(50 * 3**0.5)
    assert found.size == (100, 160)


def test_a_frame_of_transforms_json_may_state_what_the_others_share(tmp_path: Path) -> None:
    frames = [{"transform_matrix": SQUARE}, {"transform_matrix": SQUARE, "fl_y": 52.0, "cx": 31.0, "cy": 19.0}]
    found = read_camera_file(write(tmp_path, SHARED | {"frames": frames}))
    torch.testing.assert_close(found.world_from_camera[1], OPENCV)
    assert found.intrinsics[0].tolist() == [[50, 0, 30], [0, 50, 20], [0, 0, 1]]
    assert found.intrinsics[1].tolist() == [[50, 0, 31], [0, 52, 19], [0, 0, 1]]


def test_what_is_written_is_read_to_the_bit(tmp_path: Path) -> None:
    cameras = posed_cameras(3, (30, 41))
    write_camera_file(tmp_path / "transforms.json", cameras)
    again = read_camera_file(tmp_path / "transforms.json")
    assert torch.equal(again.world_from_camera, cameras.world_from_camera)
    assert torch.equal(again.intrinsics, cameras.intrinsics)
    assert again.size == cameras.size


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "expected a list camera_path .* or frames"),
        ({"camera_path": {}}, "found neither"),
        ({"frames": []}, "frames: expected 1 to 100,000 cameras, found 0"),
        (PATH | {"camera_path": [{"camera_to_world": POSE, "fov": 180}]}, r"camera_path\[0\]: .*fov is 180 degrees"),
        (PATH | {"camera_path": [{"camera_to_world": POSE}]}, r"fov is None; expected a number"),
        (PATH | {"camera_path": [{"camera_to_world": POSE[:9], "fov": 50}]}, "camera_to_world has 9 numbers; expected 16"),
        (PATH | {"camera_path": [{"camera_to_world": ["a"] * 16, "fov": 50}]}, r"camera_path\[0\]: "),
        (PATH | {"camera_path": [3]}, r"camera_path\[0\]: expected a camera, found 3, which is no object"),
        (PATH | {"camera_type": "fisheye", "camera_path": [{"camera_to_world": POSE, "fov": 50}]}, "camera_type is 'fisheye'"),
        (SHARED | {"frames": [{"transform_matrix": SQUARE}, 3]}, r"frames\[1\]"),
        (SHARED | {"camera_model": "EQUIRECTANGULAR", "frames": [{"transform_matrix": SQUARE}]}, r"frames\[0\]: .*'EQUIRECTANGULAR'; expected that of a pinhole"),
        (SHARED | {"frames": [{"transform_matrix": SQUARE, "camera_model": "VR180_L"}]}, r"frames\[0\]: .*'VR180_L'"),
        (SHARED | {"frames": [{"transform_matrix": {"a": 1}}]}, r"transform_matrix is \{'a': 1\}; expected 16 numbers"),
        (SHARED | {"fl_x": 10**400, "frames": [{"transform_matrix": SQUARE}]}, "expected a number"),
        (SHARED | {"frames": [{}]}, "transform_matrix has 1 numbers; expected 16"),
        (SHARED | {"h": 0.5, "frames": [{"transform_matrix": SQUARE}]}, "h is 0.5; expected 1 to 16384 pixels"),
        (SHARED | {"fl_x": True, "frames": [{"transform_matrix": SQUARE}]}, "fl_x is True; expected a number"),
        (SHARED | {"frames": [{"transform_matrix": [[2.0, 0, 0, 0], *SQUARE[1:]]}]}, r"frames\[0\]"),
        (SHARED | {"frames": [{"transform_matrix": SQUARE, "w": w} for w in (60, 64)]}, "one size, found 40x60, 40x64"),
    ],
)  # fmt: skip
def test_bad_files_are_refused_with_the_place_in_one_line(tmp_path: Path, content: object, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_camera_file(write(tmp_path, content))
    assert "\n" not in str(caught.value)
    assert "cameras.json" in str(caught.value)


def test_fields_of_view_in_radians_are_told_and_not_taken_for_degrees(tmp_path: Path) -> None:
    entries = [{"camera_to_world": POSE, "fov": fov} for fov in (0.5, 0.876673)]
    with pytest.raises(InputError) as raised:
        read_camera_file(write(tmp_path, PATH | {"camera_path": entries}))
    text = str(raised.value)
    assert (
        "expected fields of view in degrees, as nerfstudio writes them, found a fov of at most 0.8767, which looks like radians"
        in text
    )
    assert "0.8767 is 50.2 degrees" in text
    assert "\n" not in text
    for fov in (3.1416, 50.0):  # one that is no angle in radians, beside a zoom
        entries[1]["fov"] = fov
        assert read_camera_file(write(tmp_path, PATH | {"camera_path": entries})).intrinsics.shape == (2, 3, 3)


def test_missing_and_damaged_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent\.json"):
        read_camera_file(tmp_path / "absent.json")
    (tmp_path / "cut.json").write_text('{"frames": [')
    with pytest.raises(InputError, match=r"cut\.json"):
        read_camera_file(tmp_path / "cut.json")


def test_a_whole_number_too_long_for_numpy_is_a_number(tmp_path: Path) -> None:
    content = SHARED | {"fl_x": 10**20, "fl_y": 10**20, "frames": [{"transform_matrix": SQUARE}]}
    assert float(read_camera_file(write(tmp_path, content)).intrinsics[0, 0, 0]) == 1e20
