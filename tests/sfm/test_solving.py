"""Estimated cameras: those of known photos, in our conventions, and refusals with a reason."""

from __future__ import annotations

import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from pycolmap_photos import FOCAL, PLANES, Taken, poses_of, take

from semgs.data.cameras.lens import Lens
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png
from semgs.sfm import solving as module
from semgs.sfm.photos import PhotoSet, UprightPhoto
from semgs.sfm.pycolmap_library import pycolmap
from semgs.sfm.scale import KnownDistance, in_metres, named_photo, scaled
from semgs.sfm.scene_folder import PhotoDetails, write_colmap, write_photo_scene
from semgs.sfm.solving import PosedPhoto, Solution, best, expected_seconds, posed_photos

DISTANCE = float(np.linalg.norm(poses_of(3)[2, :3, 3]))
"""Between the cameras of p0 and p2; the user says that it is 2 m."""

NO_LINE = PhotoDetails(FOCAL), lambda line: None


@dataclass(frozen=True)
class Solved:
    folder: Path
    solution: Solution


@pytest.fixture(scope="module")
def in_two_metres(three: Taken, tmp_path_factory: pytest.TempPathFactory) -> Solved:
    """The scene of the three photos, with 2 m between the first and the last camera."""
    folder = tmp_path_factory.mktemp("solved") / "scene"
    return Solved(folder, solved(three, folder, PhotoDetails(FOCAL, KnownDistance("p0", "p2.png", 2.0))))


def solved(taken: Taken, folder: Path, known: PhotoDetails) -> Solution:
    folder.mkdir()
    return write_photo_scene(taken.folder, folder, known, lambda line: None)


def test_three_photos_get_their_relative_poses_and_metres(three: Taken, in_two_metres: Solved):
    found = in_two_metres.solution
    assert [photo.name for photo in found.photos] == ["p0.png", "p1.png", "p2.png"]
    first = np.linalg.inv(found.photos[0].world_from_camera)
    for photo, true in zip(found.photos[1:], three.world_from_camera[1:], strict=True):
        ours = first @ photo.world_from_camera
        assert np.degrees(np.arccos((np.trace(ours[:3, :3].T @ true[:3, :3]) - 1) / 2)) < 0.3
        np.testing.assert_allclose(ours[:3, 3], true[:3, 3] * 2 / DISTANCE, atol=0.03)
    assert found.unit == "metric"
    scene = open_scene(in_two_metres.folder)
    assert scene.unit == "metric"
    for frame, photo in zip(scene.frames, found.photos, strict=True):
        np.testing.assert_allclose(frame.world_from_camera, photo.world_from_camera, atol=1e-12)
        assert frame.lens == photo.lens
    depths = found.points @ found.photos[0].world_from_camera[:3, 2] - (
        found.photos[0].world_from_camera[:3, 2] @ found.photos[0].world_from_camera[:3, 3]
    )
    depths *= DISTANCE / 2
    assert 2.2 < np.percentile(depths, 5) < np.percentile(depths, 95) < 5.5


def test_photos_are_numbered_in_their_order_though_a_later_one_is_done_first(tmp_path: Path):
    # Noise has about a thousand features; the two grey photos have none, so their extraction ends long before.
    photos = [np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8)]
    photos += [np.full((480, 640, 3), 90, np.uint8)] * 2
    for number, photo in enumerate(photos):
        write_png(tmp_path / f"p{number}.png", photo)
    module._extract(
        tmp_path / "features.db", tmp_path, [UprightPhoto(f"p{n}.png", (480, 640), 500.0) for n in range(3)]
    )
    with pycolmap().Database.open(tmp_path / "features.db") as opened:
        assert [(one.image_id, one.name) for one in opened.read_all_images()] == [
            (1, "p0.png"),
            (2, "p1.png"),
            (3, "p2.png"),
        ]
        assert opened.num_keypoints_for_image(1) > 500
        assert opened.num_keypoints_for_image(2) == 0


def test_the_expected_time_counts_photos_pairs_and_cameras():
    large = [UprightPhoto(f"{n}.png", (1200, 1600)) for n in range(3)]
    # 3 photos of 2.5 s and 3 pairs of 0.09 s on two cores, then 3 cameras of 0.25 s on one, and a second to start
    assert expected_seconds(large, False, 2, focal_given=True) == pytest.approx(1 + (7.5 + 0.27) / 2 + 0.75)
    # without a focal length, cameras are solved from five starts
    assert expected_seconds(large, False, 2) == pytest.approx(1 + (7.5 + 0.27) / 2 + 5 * 0.75)
    # at a fifth of the side: 0.04 of the finding, 0.25 of the matching, 0.32 of the cameras
    small = [UprightPhoto(f"{n}.png", (240, 320)) for n in range(3)]
    assert expected_seconds(small, False, 1, focal_given=True) == pytest.approx(1 + 0.3 + 0.0675 + 0.24)


def test_the_expected_time_counts_every_solving():
    """Six photos from five starts and with a focal length for each; eight once and with one for each; frames of a clip, and photos with EXIF, have one lens."""

    def solvings(count: int, *, ordered: bool = False, focal_px: float | None = None) -> float:
        photos = [UprightPhoto(f"{n}.png", (1200, 1600), focal_px) for n in range(count)]
        given = expected_seconds(photos, ordered, 1, focal_given=True)
        return 1 + (expected_seconds(photos, ordered, 1) - given) / (0.25 * count)

    assert solvings(6) == pytest.approx(6)
    assert solvings(8) == pytest.approx(2)
    assert solvings(8, ordered=True) == solvings(8, focal_px=1300.0) == pytest.approx(1)
    assert solvings(2) == pytest.approx(1)


@pytest.mark.long
def test_the_same_photos_give_the_same_cameras(three: Taken, in_two_metres: Solved, tmp_path: Path):
    first = in_two_metres.solution
    second = solved(three, tmp_path / "again", PhotoDetails(FOCAL, KnownDistance("p0", "p2", 2.0)))
    for one, other in zip(first.photos, second.photos, strict=True):
        np.testing.assert_allclose(one.world_from_camera, other.world_from_camera, atol=1e-9)


def test_two_photos_without_a_focal_length_get_a_guess_that_is_called_one(three: Taken, tmp_path: Path):
    two = take(tmp_path / "two", three.world_from_camera[:2])
    found = solved(two, tmp_path / "scene", PhotoDetails())
    assert found.photos[0].lens.focal == (256.0, 256.0)  # 0.8 * 320
    assert "is a guess: 256 px for 320x240, 64 degrees across" in found.notes[-1]
    assert found.unit == "unknown"
    assert open_scene(tmp_path / "scene").unit == "unknown"


def one_point_model(size: tuple[int, int] = (80, 100), values: tuple[float, ...] = (120.0, 50.0, 40.0, 0.01)):
    """A camera at (1, 2, 3), turned by 90 degrees about y, that sees the world's point (4, 2.5, 3) at depth 3, 20 pixels below the middle."""
    library = pycolmap()
    model = library.Reconstruction()
    camera = library.Camera(camera_id=1, model="SIMPLE_RADIAL", width=size[1], height=size[0], params=list(values))
    model.add_camera_with_trivial_rig(camera)
    turned = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])  # camera from world: the world's x is forward
    image = library.Image(image_id=1, name="a.png", camera_id=1)
    pose = library.Rigid3d(library.Rotation3d(turned), -turned @ np.array([1.0, 2, 3]))
    model.add_image_with_trivial_frame(image, pose)
    return model


def test_colmaps_pixels_and_axes_are_ours_and_its_poses_are_inverted():
    (photo,) = posed_photos(one_point_model(), [UprightPhoto("a.png", (80, 100))])
    np.testing.assert_allclose(photo.world_from_camera[:3, 3], [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(photo.world_from_camera[:3, 2], [1, 0, 0], atol=1e-12)  # forward
    # The middle of a picture of 100 x 80 is (50, 40) here and in COLMAP; OpenCV would have (49.5, 39.5).
    assert photo.lens.centre == (50.0, 40.0)
    assert photo.lens.size == (80, 100)
    assert photo.lens.distortion == (0.01, 0.0, 0.0, 0.0, 0.0)
    x = photo.world_from_camera[:3, :3].T @ (np.array([4.0, 2.5, 3]) - [1, 2, 3])
    np.testing.assert_allclose(x, [0, 0.5, 3], atol=1e-12)  # below the axis, since y is down
    np.testing.assert_allclose(120 * x[:2] / x[2] + [50, 40], [50, 60], atol=1e-12)


def test_a_solved_lens_that_folds_over_is_refused_with_what_to_do(tmp_path: Path):
    """r (1 - 0.3 r^2) is 0.70 at most, 632 px from the middle of 1920x1080 at 900 px: the corners, 1,101 px away, would show nothing."""
    model = one_point_model(size=(1080, 1920), values=(900.0, 960.0, 540.0, -0.3))
    photos = PhotoSet(tmp_path, tmp_path, (UprightPhoto("a.png", (1080, 1920)),))
    with pytest.raises(
        InputError, match=r"distortion \(-0\.3, .* cannot be undone over the whole picture; take them with a narrower"
    ) as caught:
        module._solution([model], photos, photos.photos, False, False, None)
    assert str(caught.value).startswith(f"{tmp_path}: expected photos of a lens")


def test_scaling_moves_cameras_and_keeps_their_rotation():
    pose = np.array([[0.0, 0, 1, 2], [0, 1, 0, 4], [-1, 0, 0, 6], [0, 0, 0, 1]])
    ours = scaled(pose, 0.5)
    np.testing.assert_array_equal(ours[:3, 3], [1, 2, 3])
    np.testing.assert_array_equal(ours[:3, :3], pose[:3, :3])
    np.testing.assert_array_equal(pose[:3, 3], [2, 4, 6])


def test_a_colmap_model_has_the_metres_and_the_same_cameras(in_two_metres: Solved, tmp_path: Path):
    found = in_two_metres.solution
    shutil.copytree(in_two_metres.folder / "images", tmp_path / "scene" / "images")
    write_colmap(tmp_path / "scene", found)
    scene = open_scene(tmp_path / "scene")
    assert scene.layout == "COLMAP"
    for frame, photo in zip(scene.frames, found.photos, strict=True):
        np.testing.assert_allclose(frame.world_from_camera, photo.world_from_camera, atol=1e-9)
    centres = [frame.world_from_camera[:3, 3] for frame in scene.frames]
    assert np.linalg.norm(centres[2] - centres[0]) == pytest.approx(2.0)


def test_a_distance_names_photos_that_were_registered(in_two_metres: Solved):
    found = in_two_metres.solution
    with pytest.raises(ValueError, match=r"no camera was estimated for 'p9'; there are p0\.png to p2\.png, or 0 to 2"):
        in_metres(found, KnownDistance("p0", "p9", 1.0))
    with pytest.raises(ValueError, match="taken from one place"):
        in_metres(found, KnownDistance("p0", "p0", 1.0))
    with pytest.raises(ValueError, match="expected more than 0"):
        KnownDistance("p0", "p1", -1.0)


def named(*names: tuple[str, str]) -> list[PosedPhoto]:
    """Photos with the names of their copies and of the originals."""
    lens = Lens((80, 100), (120.0, 120.0), (50.0, 40.0))
    return [PosedPhoto(copy, lens, np.eye(4), original) for copy, original in names]


@pytest.mark.parametrize(
    ("typed", "copy"),
    [
        ("DSC_1.JPG", "DSC_1.jpg"),  # on its side, so it was turned upright and written again
        ("photos/DSC_1.JPG", "DSC_1.jpg"),
        ("dsc_1", "DSC_1.jpg"),
        ("IMG_2.HEIC", "IMG_2_HEIC.jpg"),  # phones write both
        ("IMG_2.jpg", "IMG_2.jpg"),
        ("IMG_2_HEIC.jpg", "IMG_2_HEIC.jpg"),
        ("3", "100CANON_IMG_4.jpg"),
    ],
)
def test_photos_whose_copies_have_other_names_have_their_own(typed: str, copy: str):
    photos = named(
        ("DSC_1.jpg", "DSC_1.JPG"),
        ("IMG_2.jpg", "IMG_2.jpg"),
        ("IMG_2_HEIC.jpg", "IMG_2.HEIC"),
        ("100CANON_IMG_4.jpg", "IMG_4.jpg"),
    )
    assert named_photo(photos, typed).name == copy
    with pytest.raises(ValueError, match=r"no camera was estimated for 'DSC_1\.png'"):
        named_photo(photos, "DSC_1.png")


def test_photos_of_one_name_in_two_folders_of_a_camera_are_named_with_the_folder():
    photos = named(("IMG_1.jpg", "100CANON/IMG_1.JPG"), ("101CANON_IMG_1.jpg", "101CANON/IMG_1.JPG"))
    assert named_photo(photos, "DCIM/101CANON/IMG_1.JPG").name == "101CANON_IMG_1.jpg"
    assert named_photo(photos, "100CANON/IMG_1").name == "IMG_1.jpg"
    with pytest.raises(ValueError, match=r"2 photos are called 'IMG_1\.JPG'; their copies are IMG_1\.jpg"):
        named_photo(photos, "IMG_1.JPG")


def refused(folder: Path, tmp_path: Path) -> str:
    (tmp_path / "scene").mkdir()
    with pytest.raises(InputError) as caught:
        write_photo_scene(folder, tmp_path / "scene", *NO_LINE)
    return str(caught.value)


def test_photos_of_other_places_do_not_overlap(tmp_path: Path):
    take(tmp_path / "photos", poses_of(1))
    rng = np.random.default_rng(5)
    picture = cv2.resize(rng.integers(0, 255, (40, 53, 3)).astype(np.uint8), (320, 240))
    write_png(tmp_path / "photos" / "q.png", picture)
    line = refused(tmp_path / "photos", tmp_path)
    assert "too little overlap (2 photos); take photos that share at least half" in line


def test_two_photos_are_solved_with_both_thresholds_and_the_better_fit_counts(
    three: Taken, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    tried, unwatched = list[float](), module._models

    def models(*given: object) -> list[object]:
        tried.append(given[-1])
        return unwatched(*given) if given[-1] == 1.0 else []

    monkeypatch.setattr(module, "_models", models)
    found = solved(take(tmp_path / "two", three.world_from_camera[:2]), tmp_path / "scene", PhotoDetails(FOCAL))
    assert tried == [4.0, 1.0]
    motion = np.linalg.inv(found.photos[0].world_from_camera) @ found.photos[1].world_from_camera
    right = three.world_from_camera[1, :3, 3]
    assert motion[:3, 3] @ right / np.linalg.norm(motion[:3, 3]) / np.linalg.norm(right) > np.cos(np.radians(5))


def test_a_turn_at_a_focal_length_that_is_guessed_wrong_is_not_taken_for_a_motion(tmp_path: Path):
    """The guess is 256 px. With it, a turn of 8 degrees at 150 px looks like a motion: without the check, the turn was 5.6 degrees off."""
    turned = np.stack([np.eye(4)] * 2)
    turned[1, :3, :3] = cv2.Rodrigues(np.radians([0.0, -8, 0]))[0]
    taken = take(tmp_path / "photos", turned, focal=lambda index: 150.0)
    (tmp_path / "scene").mkdir()
    with pytest.raises(InputError, match="only turned"):
        write_photo_scene(taken.folder, tmp_path / "scene", PhotoDetails(), lambda line: None)


@pytest.mark.long
def test_a_camera_that_only_turned_is_refused(tmp_path: Path):
    poses = poses_of(3)
    poses[:, :3, 3] = 0
    line = refused(take(tmp_path / "photos", poses).folder, tmp_path)
    assert "only turned" in line
    assert "step sideways" in line


@pytest.mark.long
def test_a_single_plane_shows_the_cameras_but_not_the_focal_length(tmp_path: Path):
    """Cameras that face a plane and move along it see it shifted, whatever the focal length."""
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :2, 3] = [[0, 0], [0.4, 0.03], [0.8, 0.12]]
    taken = take(tmp_path / "photos", poses, PLANES[:1])
    found = solved(taken, tmp_path / "scene", PhotoDetails())
    assert "The focal length is a guess:" in found.notes[-1]
    low, high = map(int, re.search(r"The photos do not show it: (\d+) to (\d+) px", found.notes[-1]).groups())
    assert low < 200 < 320 < high
    assert low < found.photos[0].lens.focal[0] < high
    for photo in found.photos[1:]:
        moved = np.linalg.inv(found.photos[0].world_from_camera) @ photo.world_from_camera
        assert np.degrees(np.arccos((np.trace(moved[:3, :3]) - 1) / 2)) < 0.3


@dataclass(frozen=True)
class Model:
    """What pycolmap says of a model."""

    photos: int
    observations: int
    error: float
    focal: float = 256.0

    @property
    def cameras(self) -> dict[int, object]:
        camera = pycolmap().Camera(
            camera_id=7, model="SIMPLE_PINHOLE", width=240, height=320, params=[self.focal, 120, 160]
        )
        return {7: camera}

    def num_reg_images(self) -> int:
        return self.photos

    def compute_num_observations(self) -> int:
        return self.observations

    def compute_mean_reprojection_error(self) -> float:
        return self.error


def test_the_best_model_has_the_most_photos_then_the_smallest_error_unless_it_explains_little():
    good, wrong_focal = Model(6, 1700, 0.67), Model(6, 3100, 0.93)
    few_photos, few_observations = Model(5, 5000, 0.1), Model(6, 1000, 0.2)  # a third of 3,100 is 1,033
    assert best([wrong_focal, few_photos, good, few_observations]) == [good]
    assert best([]) == []


def test_of_models_that_fit_equally_well_the_usual_focal_length_comes_first():
    """0.8 of 320 px is 256 px: 300 is off by 1.17, 200 by 1.28. Errors of 0.52 are within 5 % of 0.5, 0.53 are not."""
    wide, usual, worse = Model(6, 900, 0.5, 200.0), Model(6, 900, 0.52, 300.0), Model(6, 900, 0.53, 256.0)
    assert best([wide, usual, worse]) == [usual, wide]


@pytest.mark.long
def test_without_a_focal_length_few_photos_start_from_several(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A focal length of 250 px is 0.78 of the longer side; starts are 0.5, 0.65, 0.8, 1 and 1.3 of it, 160 px to 416 px."""
    taken, started, unwatched = take(tmp_path / "photos", poses_of(3)), list[float](), module._models

    def models(database: Path, *others: object) -> list[object]:
        with pycolmap().Database.open(database) as opened:
            started.extend(camera.params[0] for camera in opened.read_all_cameras())
        return unwatched(database, *others)

    monkeypatch.setattr(module, "_models", models)
    found = solved(taken, tmp_path / "scene", PhotoDetails())
    assert started == [160, 208, 256, 320, 416]
    assert found.photos[0].lens.focal[0] == pytest.approx(FOCAL, rel=0.1)


def test_blank_walls_are_refused(tmp_path: Path):
    (tmp_path / "photos").mkdir()
    shade = np.tile(np.linspace(60, 200, 320), (240, 1))
    for index in range(2):
        write_png(tmp_path / "photos" / f"{index}.png", np.repeat((shade + index)[..., None], 3, -1).astype(np.uint8))
    assert "too little detail in them (2 photos)" in refused(tmp_path / "photos", tmp_path)


def test_a_texture_that_repeats_is_refused(tmp_path: Path):
    tile = np.random.default_rng(3).integers(0, 255, (20, 20, 3)).astype(np.uint8)
    wall = np.tile(cv2.resize(tile, (40, 40), interpolation=cv2.INTER_CUBIC), (9, 11, 1))
    (tmp_path / "photos").mkdir()
    for index, (row, column) in enumerate(((0, 0), (7, 13))):
        write_png(
            tmp_path / "photos" / f"{index}.png", np.ascontiguousarray(wall[row : row + 240, column : column + 320])
        )
    assert "a texture that repeats" in refused(tmp_path / "photos", tmp_path)


@pytest.mark.parametrize(
    ("machine", "said"), [("x86_64", r"pip install -e '\.\[sfm\]'"), ("aarch64", r"transforms\.json")]
)
def test_without_pycolmap_the_error_says_what_to_do(monkeypatch, three: Taken, tmp_path: Path, machine: str, said: str):
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    monkeypatch.setattr("platform.machine", lambda: machine)
    monkeypatch.setattr("platform.system", lambda: "Linux")
    with pytest.raises(ImportError, match=said):
        write_photo_scene(three.folder, tmp_path, PhotoDetails(), lambda line: None)


def test_planes_of_the_test_scene_are_at_several_depths():
    assert len({depth for _, depth, _ in PLANES}) == 4
