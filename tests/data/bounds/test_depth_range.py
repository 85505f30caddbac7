"""Near and far, and what they are taken from."""

from __future__ import annotations

import json
import tracemalloc
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from landmarks import looking
from PIL import Image

from semgs.data.bounds.depth_range import FEW_POINTS, depth_range
from semgs.data.bounds.parallax import find_features, inverse_depths
from semgs.data.cameras.lens import Lens
from semgs.data.choosing.choice import choose
from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene

SIZE = (240, 320)
K = np.array([[280.0, 0, 171.3], [0, 272.0, 113.2], [0, 0, 1]])
EYES = [(-0.35, -0.1, -3.1), (0.2, 0.15, -2.9), (0.05, -0.2, -3.0)]


def plane(pose: np.ndarray) -> np.ndarray:
    """A picture of the plane z = 0, which carries a random texture, by the homography K [r1 r2 t]."""
    noise = np.random.default_rng(0).integers(0, 256, (90, 120), dtype=np.uint8)
    texture = cv2.GaussianBlur(cv2.resize(noise, (960, 720), interpolation=cv2.INTER_CUBIC), (0, 0), 2)
    world_from_texture = np.array([[0.006, 0, -2.9], [0, 0.006, -2.2], [0, 0, 1]])
    view = np.linalg.inv(pose)
    homography = K @ view[:3][:, [0, 1, 3]] @ world_from_texture
    half = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]])  # OpenCV's first pixel centre is at 0
    return cv2.warpPerspective(
        texture, half @ homography @ np.linalg.inv(half), SIZE[::-1], borderMode=cv2.BORDER_REFLECT
    )


def scene(folder: Path, eyes=EYES, scale: float = 1.0, blank: bool = False, **shared: object) -> Scene:
    """A scene that looks at the plane; lengths are in 1 / `scale` metres."""
    frames = []
    for index, eye in enumerate(eyes):
        pose = looking(eye, (0.1, 0, 0))
        picture = np.full(SIZE, 90, np.uint8) if blank else plane(pose)
        Image.fromarray(picture).save(folder / f"{index}.png")
        cv2.imwrite(str(folder / f"d{index}.png"), np.full(SIZE, 77, np.uint16))
        pose[:3, 3] *= scale
        opengl = pose * (1, -1, -1, 1)
        frames.append(
            {"file_path": f"{index}.png", "depth_file_path": f"d{index}.png", "transform_matrix": opengl.tolist()}
        )
    intrinsics = {"fl_x": K[0, 0], "fl_y": K[1, 1], "cx": K[0, 2], "cy": K[1, 2], "w": SIZE[1], "h": SIZE[0]}
    (folder / "transforms.json").write_text(json.dumps({**intrinsics, "metric": False, **shared, "frames": frames}))
    return open_scene(folder)


def test_a_metric_scene_has_the_range_of_rooms(tmp_path):
    bounds = scene(tmp_path, metric=True).depth_range([0, 1])
    assert (bounds.near, bounds.far, bounds.unit) == (0.5, 10.0, "metric")
    assert (bounds.median, bounds.typical) == (None, 5**0.5)


@pytest.mark.parametrize(("scale", "middle"), [(0.1, 0.3), (8.0, 24.0)], ids=["a table", "a hall"])
def test_points_of_a_metric_scene_outside_of_the_range_of_rooms_give_another(tmp_path, scale: float, middle: float):
    """The plane is at 3 m in a room; in a world a tenth as large at 0.3 m, which is too near for rooms, or at 24 m, too far."""
    bounds = scene(tmp_path, scale=scale, metric=True).depth_range([0, 1])
    assert bounds.unit == "metric"
    assert bounds.typical == pytest.approx(middle, rel=0.1)
    assert bounds.near < 0.8 * middle < 1.25 * middle < bounds.far
    assert bounds.reason.endswith("as 100% of them are outside of 0.5 to 10 m, the range of rooms")


@pytest.mark.parametrize(
    ("near", "far", "measured", "rooms"),
    [
        (22, 13, None, True),
        (22, 13, 3000, True),
        (40, 0, None, False),
        (40, 0, 3000, True),
        (60, 0, 3000, False),
        (0, 40, None, False),
        (10, 0, 300, False),
    ],
)
def test_wrong_matches_on_both_sides_and_few_that_depth_maps_deny_leave_the_range_of_rooms(
    tmp_path, near: int, far: int, measured: int | None, rooms: bool
):
    """Of 100 points some are at 0.3 and 60 m and the rest at 3 m; depth maps, if there are any, are at 3 m, or at 0.3 m."""
    made = scene(tmp_path, metric=True)
    for index in range(3):
        cv2.imwrite(str(tmp_path / f"d{index}.png"), np.full(SIZE, measured or 0, np.uint16))
    depths = np.repeat([0.3, 60.0, 3.0], [near, far, 100 - near - far])
    pose = made.frames[0].world_from_camera
    points = pose[:3, 3] + depths[:, None] * pose[:3, 2]
    bounds = replace(made, points=points).depth_range([0])
    assert ((bounds.near, bounds.far) == (0.5, 10.0)) == rooms


@pytest.mark.parametrize("scale", [0.1, 8.0])
def test_protocols_take_the_range_of_rooms_without_a_look_at_the_images(tmp_path, scale: float):
    bounds = scene(tmp_path, scale=scale, metric=True).depth_range([0, 1], stated=True)
    assert (bounds.near, bounds.far) == (0.5, 10.0)


@pytest.mark.parametrize(("counts", "ranges"), [(77, (0.0172, 0.344)), (3000, (0.5, 10.0)), (0, (0.5, 10.0))])
def test_depth_maps_of_a_metric_scene_count_where_images_show_nothing(tmp_path, counts: int, ranges: tuple):
    """Blank images give no points. The maps are at 0.077 m; a range of ratio 20 around that is 0.0172 to 0.344 m."""
    made = scene(tmp_path, blank=True, metric=True)
    for index in range(3):
        cv2.imwrite(str(tmp_path / f"d{index}.png"), np.full(SIZE, counts, np.uint16))
    bounds = made.depth_range([0, 1])
    np.testing.assert_allclose((bounds.near, bounds.far), ranges, rtol=2e-3)


@pytest.mark.parametrize(
    ("known", "counts", "unit", "said"),
    [
        (1.0, 3000, "metric", "Assumed: lengths are metres, because the depth maps look like a sensor's."),
        (0.3, 3000, "metric", "use --unit unknown"),
        (0.01, 3000, "unknown", "too sparse"),
        (1.0, 280, "unknown", "the median of its depth maps, 0.28,"),
        (1.0, 22000, "unknown", "the median of its depth maps, 22,"),
    ],
)
def test_lengths_are_metres_if_a_sensor_seems_to_have_measured_a_room(tmp_path, known, counts, unit, said):
    made = scene(tmp_path, metric=None)
    depths = np.where(np.random.default_rng(0).random(SIZE) < known, counts, 0).astype(np.uint16)
    for index in range(3):
        cv2.imwrite(str(tmp_path / f"d{index}.png"), depths)
    made = open_scene(tmp_path)
    assert made.unit == unit
    assert made.unit_source == (
        "its depth maps look like a sensor's in a room, but no file says so" if unit == "metric" else ""
    )
    (note,) = made.notes
    assert said in note
    assert open_scene(tmp_path, unit="metric").unit_source == "you say so"
    assert {open_scene(tmp_path, unit=given).unit for given in ("metric", "unknown")} == {"metric", "unknown"}


def test_dense_depth_of_cameras_that_colmap_solved_is_not_in_metres(tmp_path):
    """Multi-view stereo gives dense depth in COLMAP's unit; nerfstudio notes COLMAP's number of each image."""
    scene(tmp_path, metric=None)
    content = json.loads((tmp_path / "transforms.json").read_text())
    for index, frame in enumerate(content["frames"]):
        cv2.imwrite(str(tmp_path / f"d{index}.png"), np.full(SIZE, 3000, np.uint16))
        frame["colmap_im_id"] = index + 1
    (tmp_path / "transforms.json").write_text(json.dumps(content))
    made = open_scene(tmp_path)
    assert made.unit == "unknown"
    assert "its cameras are COLMAP's, whose unit is arbitrary" in made.notes[0]
    (tmp_path / "transforms.json").write_text(json.dumps({**content, "metric": True}))
    assert (open_scene(tmp_path).unit, open_scene(tmp_path).unit_source) == ("metric", "the file says so")


def test_the_unit_of_depth_maps_can_be_given_for_a_transforms_file(tmp_path):
    """77 counts are 0.077 m in millimetres, 3.08 m in steps of 4 cm, whatever the file says; then they look like a sensor's."""
    scene(tmp_path, metric=None, depth_unit_scale_factor=0.001)
    assert open_scene(tmp_path).unit == "unknown"
    made = open_scene(tmp_path, depth_unit=0.04)
    assert made.unit == "metric"
    np.testing.assert_allclose(made.frames[0].measured(), 3.08, rtol=1e-6)


def test_depth_files_that_are_missing_say_nothing_about_the_unit(tmp_path):
    scene(tmp_path, metric=None)
    for index in range(3):
        (tmp_path / f"d{index}.png").unlink()
    assert open_scene(tmp_path).unit == "unknown"


@pytest.mark.parametrize("asked", [[0, 1], [2, 0], [0, 1, 2], [1], None])
def test_without_metres_the_pictures_tell_how_far_things_are(tmp_path, asked):
    bounds = scene(tmp_path).depth_range(asked)
    assert bounds.unit == "unknown"
    assert int(bounds.reason.split()[1]) >= FEW_POINTS // 2  # each point is seen twice
    assert "triangulated" in bounds.reason
    assert abs(bounds.middle / 3.0 - 1) < 0.1  # the plane, not the 0.077 of the depth maps
    assert bounds.typical == bounds.median == pytest.approx(3.0, rel=0.1)
    assert 15 < bounds.far / bounds.near < 40


def test_the_range_scales_with_the_world(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    one, other = scene(tmp_path / "a").depth_range([0, 1]), scene(tmp_path / "b", scale=7.3).depth_range([0, 1])
    np.testing.assert_allclose((other.near, other.far), (7.3 * one.near, 7.3 * one.far), rtol=1e-6)


def test_triangulated_points_are_at_their_depth(tmp_path):
    frames = scene(tmp_path).frames
    inverse = inverse_depths(find_features(frames[0]), find_features(frames[1]))
    assert len(inverse) > 100
    assert abs(np.median(1 / inverse) / 3.05 - 1) < 0.03
    assert (np.percentile(1 / inverse, (10, 90)) > (2.6, 2.6)).all()
    assert (np.percentile(1 / inverse, (10, 90)) < (3.6, 3.6)).all()


def test_sparse_points_of_a_long_recording_take_no_more_memory_than_those_of_a_short_one():
    """2,000 frames see 10,000 points 1 to 3 m away: all sightings are 160 MB, and near and far follow from those of 100 frames, 8 MB."""
    points = np.column_stack((np.zeros(10_000), np.zeros(10_000), np.linspace(1, 3, 10_000)))
    lens, seen = Lens((48, 64), (50.0, 50.0), (32.0, 24.0)), np.arange(10_000)
    frames = [Frame(f"{index}", Path(f"{index}.png"), lens, np.eye(4), points=seen) for index in range(2000)]
    tracemalloc.start()
    try:
        found = depth_range(frames, range(2000), "unknown", points)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 60e6
    assert found.median == pytest.approx(2, rel=1e-3)
    # A room around 2 m is nearer and farther than what is seen: 2 / 20^0.5 and 2 * 20^0.5.
    assert (found.near, found.far) == pytest.approx((0.4472, 8.944), rel=1e-3)


def test_pictures_that_do_not_match_leave_the_baseline(tmp_path):
    opened = scene(tmp_path, blank=True)
    bounds = opened.depth_range([0, 1])
    distance = float(np.linalg.norm(np.subtract(EYES[0], EYES[1])))
    assert "these cameras" in bounds.reason
    np.testing.assert_allclose(bounds.middle, 10 * distance, rtol=1e-9)
    assert "the scene's cameras" in opened.depth_range([1]).reason


def test_cameras_at_one_place_tell_no_scale(tmp_path):
    bounds = scene(tmp_path, eyes=[EYES[0]] * 3).depth_range([0, 1])
    assert (bounds.near, bounds.far, bounds.unit) == (0.5, 10.0, "unknown")
    assert "the scale is unknown" in bounds.reason


def test_all_views_that_are_read_get_the_same_range(tmp_path):
    opened = scene(tmp_path)
    bounds = opened.depth_range([2, 0])
    assert opened.read([2, 0], size=(48, 64)).depth_range.tolist() == [[bounds.near, bounds.far]] * 2


@pytest.mark.parametrize("asked", [[3, 4], [5]])
def test_the_fox_is_between_near_and_far(shared, asked):
    bounds = open_scene(shared / "data" / "fox").depth_range(asked)
    assert bounds.unit == "unknown"
    assert bounds.near < 3.5  # its nose, from the nearest camera
    assert 9 < bounds.far < 60  # the wall behind it


@pytest.mark.parametrize("count", [2, 3])
def test_a_choice_has_the_range_of_its_contexts_and_no_frame_is_looked_at_twice(shared, monkeypatch, count):
    fox, looked = open_scene(shared / "data" / "fox"), []
    monkeypatch.setattr(
        "semgs.data.bounds.depth_range.find_features", lambda frame: looked.append(frame.name) or find_features(frame)
    )
    choice = choose(fox, count)
    assert len(looked) == len(set(looked))
    assert choice.depth_range == fox.depth_range(choice.context)
    looked.clear()
    target = fox.read(choice.targets, (64, 36), choice.depth_range)
    assert target.depth_range.tolist() == [[choice.depth_range.near, choice.depth_range.far]] * len(choice.targets)
    assert looked == []
