"""Scenes made of splats: places, bounds, cameras around them, and the frame of nerfstudio."""

from __future__ import annotations

import json
from dataclasses import replace
from math import cos, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
import torch
from known_scenes import write_scene
from posed import posed_cameras
from saved_scenes import SIZE, wall

from semgs.data.scenes import open_scene
from semgs.export.ply import save_ply
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png
from semgs.geometry.cameras import Cameras, project
from semgs.geometry.gaussians import Appearance, Gaussians, move_gaussians
from semgs.geometry.rotations import covariance, matrix_from_quaternion
from semgs.rendering.render import render
from semgs.scene.scene_file import FILE_NAME, load_scene, save_scene
from semgs.scene.upright import UpDirection, up_of
from semgs.splats import nerfstudio_frame
from semgs.splats.nerfstudio_frame import find_trained_frame, read_trained_frame
from semgs.splats.scene_opening import MOST_VIEWS, in_frame_of, open_splat
from semgs.splats.splat_cameras import cameras_around
from semgs.splats.splat_scene import find_places, likeness_to_own, note_on_look, share_like_own, splat_scene

Z_UP = torch.tensor([0.0, 0, 1], dtype=torch.float64)


def dots(means: torch.Tensor, sigma: float = 0.05, opacity: float = 0.99) -> Gaussians:
    """Round grey Gaussians."""
    count = len(means)
    colour = Appearance(torch.eye(4)[:1].repeat(count, 1), torch.full((count, 3), sigma), torch.zeros(count, 1, 3))
    return Gaussians(means.float(), torch.full((count,), opacity), colour)


def cameras_along_z(*positions: list[float]) -> Cameras:
    """Cameras at these positions that look along z, 20 x 30 pixels, 20 pixels of focal length."""
    poses = torch.eye(4, dtype=torch.float64).repeat(len(positions), 1, 1)
    poses[:, :3, 3] = torch.tensor(positions)
    k = torch.tensor([[20.0, 0, 15], [0, 20, 10], [0, 0, 1]], dtype=torch.float64)
    return Cameras(poses, k.expand(len(positions), 3, 3), (20, 30))


def test_a_gaussian_is_at_the_pixel_of_the_nearest_view_that_shows_it():
    cameras = cameras_along_z([0, 0, 0], [0, 0, 1.0])
    depths = torch.zeros(2, 20, 30)
    depths[0, 10, 15], depths[1, 10, 15] = 4.0, 3.0
    depths[0, 10, 17], depths[1, 10, 17] = 2.0, 0.5
    means = torch.tensor([[0.02, 0.02, 4.0], [0.25, 0.02, 2.02], [0.02, 0.02, 9.0], [0, 0, -5.0], [10.0, 0.01, 4.0]])
    places = find_places(means, cameras, depths)
    views, rows, columns = np.unravel_index(places.numpy(), (2, 20, 30))
    # Both see the first; only the first camera sees the second, as 2.02 is within 5 % of 2; both have something before the third.
    assert views[:3].tolist() == [1, 0, 1]
    assert rows[:3].tolist() == [10, 10, 10]
    assert columns[:3].tolist() == [15, 17, 15]
    assert (views[4], columns[4]) == (0, 29)  # to the right of both images, less far in the first


def test_a_scene_has_rendered_depth_and_can_be_saved_and_read(tmp_path: Path):
    known = wall(classes=False)
    scene = splat_scene(known.gaussians, known.cameras, source="a", model="PLY")
    inner = (slice(None), slice(3, -3), slice(3, -3))
    torch.testing.assert_close(scene.depths[inner], known.depths[inner], rtol=0.1, atol=0)
    assert (scene.confidences[inner] > 0.5).all()
    assert ((scene.depth_range[:, 0] > 0) & (scene.depth_range[:, 0] < 2) & (scene.depth_range[:, 1] > 2)).all()
    assert (scene.frames, scene.unit, scene.classes) == (("0", "1"), "unknown", None)
    views, rows, columns = np.unravel_index(scene.places.numpy(), scene.depths.shape)
    for view in (0, 1):
        seen = project(scene.gaussians.means.double(), scene.cameras[view])[views == view, :2].numpy()
        inside = ((seen > 0) & (seen < SIZE[::-1])).all(-1)
        assert inside.mean() > 0.9
        assert (np.floor(seen[inside]) == np.column_stack((columns, rows))[views == view][inside]).all()
    save_scene(tmp_path / FILE_NAME, scene)
    torch.testing.assert_close(load_scene(tmp_path).places, scene.places)


def test_holes_have_no_depth_and_no_camera_that_sees_anything_is_an_error():
    cameras = cameras_along_z([0, 0, 0], [0.1, 0, 0])
    scene = splat_scene(dots(torch.tensor([[0.0, 0, 2]]), 0.2), cameras)
    assert scene.depths[0, 10, 15] == pytest.approx(2.0)
    assert scene.depths[0, 0, 0] == scene.confidences[0, 0, 0] == 0
    with pytest.raises(ValueError, match="no camera sees the splat"):
        splat_scene(dots(torch.tensor([[0.0, 0, -2]])), cameras)


def box(count: int = 20_000) -> torch.Tensor:
    """Points on the sides of a room of 5 x 4 x 3 whose middle is (10, 20, 30)."""
    draw = torch.Generator().manual_seed(2)
    points = torch.rand(count, 3, generator=draw)
    sides = torch.randint(3, (count,), generator=draw)
    points[torch.arange(count), sides] = torch.randint(2, (count,), generator=draw).float()
    return (points - 0.5) * torch.tensor([5.0, 4, 3]) + torch.tensor([10.0, 20, 30])


def ball(count: int = 4000) -> torch.Tensor:
    """Points in a ball of radius 2 around (10, 20, 30)."""
    draw = torch.Generator().manual_seed(2)
    way = torch.nn.functional.normalize(torch.randn(count, 3, generator=draw), dim=-1)
    return 2 * torch.rand(count, 1, generator=draw) ** (1 / 3) * way + torch.tensor([10.0, 20, 30])


def test_cameras_of_a_room_are_in_its_middle_and_look_around_level():
    floaters = torch.tensor([[500.0, 0, 0], [0, -700, 40]])
    around = cameras_around(dots(torch.cat((box(), floaters))), Z_UP)
    assert around.inside
    assert (around.pivot - torch.tensor([10.0, 20, 30])).abs().max() < 0.1
    torch.testing.assert_close(around.cameras.centres, around.pivot.expand(8, 3))
    poses = around.cameras.world_from_camera
    assert (poses[:, 2, 2].abs() < 1e-12).all()  # level
    torch.testing.assert_close(poses[:, :3, 1], -Z_UP.expand(8, 3))  # y is down
    turned = poses[0, :3, 2] @ poses[:, :3, 2].mT
    torch.testing.assert_close(turned, torch.tensor([cos(radians(45 * k)) for k in range(8)], dtype=torch.float64))


def test_cameras_of_an_object_are_around_it_above_it_and_see_it_whole():
    points = ball()
    floaters = torch.tensor([[500.0, 0, 0], [0, -700, 40]])
    around = cameras_around(dots(torch.cat((points, floaters))), Z_UP)
    assert not around.inside
    assert (around.pivot - torch.tensor([10.0, 20, 30])).abs().max() < 0.2
    offsets = around.cameras.centres - around.pivot
    distance = offsets.norm(dim=-1)
    assert 2 < float(distance[0]) < 6
    torch.testing.assert_close(distance, distance[:1].expand(8))
    torch.testing.assert_close(offsets[:, 2] / distance, torch.full((8,), sin(radians(20)), dtype=torch.float64))
    for view in range(8):
        seen = project(points.double(), around.cameras[view])
        inside = (seen[:, :2] > 0).all(-1) & (seen[:, 0] < 640) & (seen[:, 1] < 480) & (seen[:, 2] > 0)
        assert inside.double().mean() > 0.8
        middle = project(around.pivot[None], around.cameras[view])[0]
        torch.testing.assert_close(middle[:2], torch.tensor([320.0, 240.0], dtype=torch.float64))


def test_what_is_usual_is_up_without_cameras_and_a_note_says_that_it_is_uncertain(tmp_path: Path):
    save_ply(tmp_path / "a.ply", dots(ball()))
    opened = open_splat(tmp_path / "a.ply")
    assert isinstance(opened.up, UpDirection)
    assert opened.up.direction.tolist() == [0, -1, 0]
    assert not up_of(opened.scene, opened.up).certain
    assert "no field of PLY says it, -Y is usual" in opened.up.warning
    given = open_splat(tmp_path / "a.ply", up="z").up
    assert isinstance(given, UpDirection)
    assert given.certain
    assert given.direction.tolist() == [0, 0, 1]


@pytest.mark.long
def test_floor_and_walls_say_how_a_splat_without_cameras_is_tilted(tmp_path: Path):
    """-Y is usual; this room stands 25 degrees off, and turned."""
    turn = matrix_from_quaternion(torch.nn.functional.normalize(torch.tensor([1.0, 0.0, 0.4, 0.0]).double(), dim=0))
    tilt = matrix_from_quaternion(
        torch.tensor([cos(radians(12.5)), 0.6 * sin(radians(12.5)), 0.0, 0.8 * sin(radians(12.5))]).double()
    )
    half = matrix_from_quaternion(torch.tensor([sqrt(0.5), sqrt(0.5), 0.0, 0.0]).double())  # z up to -y up
    turned = tilt @ turn @ half
    points = (box(60_000).double() - torch.tensor([10.0, 20, 30])) @ turned.T
    save_ply(tmp_path / "a.ply", dots(points, 0.04))
    opened = open_splat(tmp_path / "a.ply")
    assert isinstance(opened.up, UpDirection)
    assert float(opened.up.direction @ turned[:, 2]) > cos(radians(2))
    assert float(turned[:, 2] @ torch.tensor([0.0, -1, 0]).double()) < cos(radians(20))
    assert not opened.up.certain
    assert "level or upright; no field of PLY says it" in opened.up.warning
    # The cameras were put about it: they look level.
    assert float((opened.scene.cameras.world_from_camera[:, :3, 2] @ opened.up.direction).abs().max()) < 1e-9


TRANSFORM = [[0.0, -1, 0, 0.5], [1, 0, 0, -2], [0, 0, 1, 3]]


def test_nerfstudios_frame_is_undone(tmp_path: Path):
    """x' = 0.25 (R x + t), with a quarter turn about z for R: x becomes y."""
    path = tmp_path / nerfstudio_frame.FILE_NAME
    path.write_text(json.dumps({"transform": TRANSFORM, "scale": 0.25}))
    original = torch.tensor([[4.0, 8, -12]])
    trained = 0.25 * (torch.tensor([[-8.0, 4, -12]]) + torch.tensor([0.5, -2, 3]))
    splat = dots(trained, 0.1)
    splat = Gaussians(
        splat.means,
        splat.opacities,
        Appearance(splat.colour.quaternions, torch.tensor([[0.1, 0.2, 0.3]]), splat.colour.features),
    )
    undone = read_trained_frame(path).undo(splat)
    torch.testing.assert_close(undone.means, original)
    # The long axes change places: along x of the trained frame was -y of the original one.
    torch.testing.assert_close(
        covariance(undone.colour.quaternions, undone.colour.scales)[0].diagonal().sqrt(), torch.tensor([0.8, 0.4, 1.2])
    )


def test_a_splat_of_a_capture_in_utm_is_as_exact_as_near_the_origin(tmp_path: Path):
    """5,400 km from the origin float32 counts in halves of a metre; relative to the scene's origin it counts in micrometres."""
    utm = np.array([432_100.0, 5_400_200.0, 310.0])

    def move(content: dict) -> None:
        for frame in content["frames"]:
            for row, far in zip(frame["transform_matrix"], utm, strict=False):
                row[3] += far

    scene = write_scene(tmp_path / "scene", 4, (24, 32), change=move)
    assert float(np.abs(scene.origin - utm).max()) < 4
    turn = np.array(TRANSFORM)[:, :3]
    transform = np.column_stack((turn, -turn @ utm))
    saved = {"transform": transform.tolist(), "scale": 0.25}
    (tmp_path / nerfstudio_frame.FILE_NAME).write_text(json.dumps(saved))
    beside = np.array([[0.3, 0.7, -0.2], [1.1, -0.4, 0.6]])
    trained = dots(torch.from_numpy(0.25 * beside @ turn.T), 0.02)
    found = in_frame_of(tmp_path / "a.ply", trained, scene)
    assert found.means.dtype == torch.float32
    np.testing.assert_allclose(found.means.numpy(), beside + utm - scene.origin, atol=1e-6)
    assert float(found.colour.scales.mean()) == pytest.approx(0.08)


def test_what_nerfstudio_multiplied_in_from_transforms_json_is_taken_out(tmp_path: Path):
    """It saves transform x applied_transform and scale x applied_scale; the poses of the file have both already."""
    path = tmp_path / nerfstudio_frame.FILE_NAME
    own = np.vstack((TRANSFORM, [0, 0, 0, 1]))
    applied = np.array([[0.0, 1, 0, 7], [0, 0, 1, 8], [1, 0, 0, 9]])
    saved = own @ np.vstack((applied, [0, 0, 0, 1]))
    path.write_text(json.dumps({"transform": saved[:3].tolist(), "scale": 0.25 * 3}))
    found = find_trained_frame([tmp_path / "no", tmp_path], applied, 3.0)
    assert found is not None
    np.testing.assert_allclose(found.transform.numpy(), own, atol=1e-12)
    assert found.scale == pytest.approx(0.25)
    assert find_trained_frame([tmp_path / "no"]) is None


@pytest.mark.parametrize(
    ("content", "key"),
    [
        ({"scale": 1}, "transform"), ({"transform": TRANSFORM}, "scale"), ({"transform": TRANSFORM, "scale": 0}, "scale"),
        ({"transform": TRANSFORM, "scale": True}, "scale"), ({"transform": TRANSFORM[:2], "scale": 1}, "transform"),
        ({"transform": [[2.0, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]], "scale": 1}, "transform"),
        ({"transform": [[-1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 1}, "transform"), ([], None),
    ],
)  # fmt: skip
def test_a_file_that_says_no_frame_is_refused(tmp_path: Path, content: object, key: str | None):
    path = tmp_path / nerfstudio_frame.FILE_NAME
    path.write_text(json.dumps(content))
    with pytest.raises(InputError) as error:
        read_trained_frame(path)
    assert (error.value.path, error.value.key) == (path, key)


def surface_of(path: Path) -> Gaussians:
    """Gaussians 2 units in front of every camera of a scene, in its coordinates."""
    scene = open_scene(path)
    centres = torch.from_numpy(np.stack([frame.world_from_camera for frame in scene.frames]))
    spread = torch.randn(400, 3, generator=torch.Generator().manual_seed(3), dtype=torch.float64) * torch.tensor(
        [1.0, 1.0, 0.01]
    )
    points = (spread + torch.tensor([0.0, 0, 2.0])) @ centres[:, :3, :3].mT + centres[:, None, :3, 3]
    return dots(points.reshape(-1, 3), 0.08)


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    return write_scene(tmp_path / "scene", 10, (24, 32)).path


@pytest.mark.parametrize("trained", [False, True])
def test_a_scene_gives_its_cameras_photos_and_unit(tmp_path: Path, photos: Path, trained: bool):
    gaussians = surface_of(photos)
    (tmp_path / "splat").mkdir()
    if trained:
        frame = {"transform": TRANSFORM, "scale": 0.25}
        (tmp_path / "splat" / nerfstudio_frame.FILE_NAME).write_text(json.dumps(frame))
        matrix = torch.tensor(TRANSFORM, dtype=torch.float64)
        means = 0.25 * (gaussians.means.double() @ matrix[:, :3].T + matrix[:, 3])
        gaussians = dots(means, 0.02)
    save_ply(tmp_path / "splat" / "a.ply", gaussians)
    opened = open_splat(tmp_path / "splat" / "a.ply", photos)
    scene, source = opened.scene, open_scene(photos)
    assert len(scene.frames) == MOST_VIEWS
    assert (scene.frames[0], scene.frames[-1]) == (source.frames[0].name, source.frames[9].name)
    assert (scene.unit, scene.source, scene.model) == (source.unit, "a", "PLY")
    np.testing.assert_allclose(scene.cameras.world_from_camera[0], source.frames[0].world_from_camera, atol=1e-9)
    torch.testing.assert_close(scene.gaussians.means, surface_of(photos).means, rtol=1e-4, atol=1e-4)
    assert float(scene.gaussians.colour.scales.mean()) == pytest.approx(0.08, rel=1e-4)
    assert scene.depths[:, 12, 16].tolist() == pytest.approx([2.0] * MOST_VIEWS, rel=0.05)
    assert opened.photos is not None
    assert [photo.shape for photo in opened.photos] == [(24, 32, 3)] * MOST_VIEWS
    assert opened.pivot is None


def test_a_splat_that_looks_unlike_the_photos_has_a_note(tmp_path: Path, photos: Path):
    gaussians = surface_of(photos)
    save_ply(tmp_path / "a.ply", gaussians)
    for off, noted in ((0.17, False), (0.19, True)):  # 15 dB is a difference of 0.178
        for frame in open_scene(photos).frames:
            view = open_scene(photos).read([frame.name], (24, 32), (0.1, 100.0))
            image = render(gaussians, view.cameras).images[0].movedim(0, -1).numpy()
            image = image + np.where(image < 0.5, off, -off)
            write_png(photos.parent / frame.name, (255 * image).round().astype(np.uint8))
        assert (
            open_splat(tmp_path / "a.ply", photos).note.startswith("The splat does not look like the photos") == noted
        )


def test_a_part_of_a_splat_is_compared_with_what_it_shows_alone(tmp_path: Path, photos: Path):
    gaussians = surface_of(photos)
    source = open_scene(photos)
    for frame in source.frames:
        view = source.read([frame.name], (24, 32), (0.1, 100.0))
        image = render(gaussians, view.cameras).images[0].movedim(0, -1).numpy()
        write_png(photos.parent / frame.name, (255 * image).round().astype(np.uint8))
    middle = gaussians.means[:, 0].median()
    save_ply(tmp_path / "part.ply", gaussians.map(lambda tensor: tensor[gaussians.means[:, 0] < middle]))
    opened = open_splat(tmp_path / "part.ply", photos)
    shown = (opened.scene.depths > 0).double().mean()
    assert 0.2 < shown < 0.8
    assert opened.note == ""


def test_cameras_that_do_not_see_the_splat_are_refused_and_the_frame_of_nerfstudio_is_named(
    tmp_path: Path, photos: Path
):
    save_ply(tmp_path / "a.ply", dots(torch.full((5, 3), 1e4)))
    with pytest.raises(InputError, match=r"in the coordinates of .*dataparser_transforms"):
        open_splat(tmp_path / "a.ply", photos)


def test_up_of_a_splat_with_cameras_is_searched_like_that_of_our_own_scenes():
    """A room seen by level cameras that are turned with it."""
    cameras = posed_cameras(2, (60, 80))
    draw = torch.Generator().manual_seed(0)
    down = cameras.world_from_camera[:, :3, 1].mean(0)
    down = down / down.norm()
    flat = torch.randn(20_000, 3, generator=draw, dtype=torch.float64) * 2
    flat = (
        flat
        - (flat @ down)[:, None] * down
        + cameras.centres.mean(0)
        + 1.2 * down
        + 2 * cameras.world_from_camera[0, :3, 2]
    )
    found = up_of(splat_scene(dots(flat, 0.05), cameras))
    assert float(found.direction @ -down) > cos(radians(8))


def photograph(gaussians: Gaussians, photos: Path, gain: float = 1.0) -> None:
    """Make the photos of a scene what the Gaussians look like from there, or darker."""
    source = open_scene(photos)
    for frame in source.frames:
        view = source.read([frame.name], (24, 32), (0.1, 100.0))
        image = gain * render(gaussians, view.cameras).images[0].movedim(0, -1).numpy()
        write_png(photos.parent / frame.name, (255 * image).round().astype(np.uint8))


def coloured_surface(photos: Path) -> Gaussians:
    """The surface in colours that differ everywhere."""
    gaussians = surface_of(photos)
    features = torch.randn(gaussians.colour.features.shape, generator=torch.Generator().manual_seed(3))
    return replace(gaussians, colour=replace(gaussians.colour, features=features))


@pytest.mark.parametrize("recorded", ["its frame", "another frame", "another file", None])
def test_an_export_of_ours_is_moved_back_if_then_it_looks_like_the_photos(
    tmp_path: Path, photos: Path, recorded: str | None
):
    """It was turned by a quarter about its optical axis and moved by (0.1, 0, 0.2); export.json says how to undo that, or something else."""
    gaussians = coloured_surface(photos)
    photograph(gaussians, photos)
    file_from_scene = torch.eye(4, dtype=torch.float64)
    file_from_scene[:2, :2] = torch.tensor([[0.0, -1], [1, 0]])
    file_from_scene[:3, 3] = torch.tensor([0.1, 0, 0.2])
    save_ply(tmp_path / "gaussians.ply", move_gaussians(file_from_scene, gaussians))
    matrix = file_from_scene if recorded == "another frame" else torch.linalg.inv(file_from_scene)
    name = "points.ply" if recorded == "another file" else "gaussians.ply"
    if recorded is not None:
        listed = [{"name": name, "scene_from_file": matrix.tolist()}]
        (tmp_path / "export.json").write_text(json.dumps({"files": listed}))
    opened = open_splat(tmp_path / "gaussians.ply", photos)
    if recorded == "its frame":
        assert opened.note.startswith("The splat is moved by scene_from_file of export.json beside it")
        torch.testing.assert_close(opened.scene.gaussians.means, gaussians.means, rtol=1e-4, atol=1e-4)
    else:
        assert "are these cameras in its coordinates?" in opened.note


def test_a_splat_that_is_in_the_frame_of_its_photos_stays_there(tmp_path: Path, photos: Path):
    gaussians = coloured_surface(photos)
    photograph(gaussians, photos)
    save_ply(tmp_path / "a.ply", gaussians)
    turned = np.diag([-1.0, -1, 1, 1]).tolist()
    (tmp_path / "export.json").write_text(json.dumps({"files": [{"name": "a.ply", "scene_from_file": turned}]}))
    opened = open_splat(tmp_path / "a.ply", photos)
    assert opened.note == ""
    torch.testing.assert_close(opened.scene.gaussians.means, gaussians.means, rtol=1e-4, atol=1e-4)


def test_dark_photos_of_right_cameras_are_not_called_wrong_cameras(tmp_path: Path, photos: Path):
    """At a fifth of the light, PSNR is far below 15 dB, but every rendering is like its own photo."""
    gaussians = coloured_surface(photos)
    photograph(gaussians, photos, 0.2)
    save_ply(tmp_path / "a.ply", gaussians)
    assert open_splat(tmp_path / "a.ply", photos).note.endswith("but the cameras fit: exposure or colours may differ.")


def test_the_share_of_renderings_that_are_like_their_own_photo_by_hand():
    """Two stripes and two halves. The first is like its own photo; the second like the first's, and the third has no contrast, so it does not count."""
    stripes, halves = (
        (torch.arange(16) % 2).float().expand(1, 3, 8, 16),
        (torch.arange(16) // 8).float().expand(1, 3, 8, 16),
    )
    flat, seen = torch.full((1, 3, 8, 16), 0.5), torch.ones(3, 8, 16, dtype=torch.bool)
    images, photos = torch.cat((stripes, stripes, flat)), torch.cat((0.2 * stripes, halves, halves))
    assert share_like_own(images, photos, seen) == 0.5
    assert share_like_own(images[:1], photos[:1], seen[:1]) == 1.0
    assert share_like_own(images[2:], photos[2:], seen[2:]) is None
    # Correlations with their own photos are 1, and 0 for stripes and halves; the flat one does not count.
    assert likeness_to_own(images, photos, seen) == pytest.approx(0.5, abs=1e-6)
    assert likeness_to_own(images[2:], photos[2:], seen[2:]) == 0


def test_renderings_without_contrast_do_not_say_that_the_cameras_fit():
    assert note_on_look(12.0, None) == (
        "The splat does not look like the photos from their cameras (PSNR 12.0 dB in what it shows of them): are these cameras in its coordinates?"
    )
    assert note_on_look(15.0, None) == note_on_look(15.0, 0.51) == ""
    assert note_on_look(12.0, 0.51).endswith("but the cameras fit: exposure or colours may differ.")
    assert note_on_look(30.0, 0.5).endswith(
        "50% of its renderings are most like their own photo): are these cameras in its coordinates?"
    )


@pytest.mark.parametrize("matrix", ["none", None, [[1, 2], [3, 4]], np.diag([2.0, 2, 2, 1]).tolist(), [[{}]]])
def test_an_export_whose_frame_is_none_is_refused_in_one_line(tmp_path: Path, photos: Path, matrix: object):
    save_ply(tmp_path / "a.ply", surface_of(photos))
    (tmp_path / "export.json").write_text(json.dumps({"files": [{"name": "a.ply", "scene_from_file": matrix}]}))
    with pytest.raises(InputError, match=r"export.json: scene_from_file: expected a rigid motion"):
        open_splat(tmp_path / "a.ply", photos)
