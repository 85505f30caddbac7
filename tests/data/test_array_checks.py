"""Arrays of callers: mistakes that a reader of files would notice, noticed."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from inspect import unwrap
from pathlib import Path

import numpy as np
import pytest
import torch

from semgs.data import views as views_module
from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.data.views import Views
from semgs.files.paths import typed_path
from semgs.model.weights.load import load

K = np.array([[128.0, 0, 80], [0, 126.0, 60], [0, 0, 1]])
"""Of images of 120x160 (height x width)."""
POSES = np.stack([np.eye(4), np.eye(4)])
POSES[1, 0, 3] = 0.3
IMAGES = np.random.default_rng(0).integers(0, 256, (2, 120, 160, 3), dtype=np.uint8)


def views(intrinsics: np.ndarray, images: np.ndarray = IMAGES) -> Views:
    return Views.from_arrays(images, POSES, intrinsics, (0.5, 10.0))


@pytest.mark.parametrize("which", ["all", "one"])
def test_intrinsics_divided_by_the_image_size_are_refused(which: str):
    divided = np.repeat((K / [[160], [120], [1]])[None], 2, axis=0)
    if which == "one":
        divided[0] = K
    with pytest.raises(ValueError, match=r"focal lengths 0.8 and 1.05 px .* look divided by the image size"):
        views(divided)


def test_intrinsics_of_images_of_twice_the_size_are_refused():
    with pytest.raises(
        ValueError, match=r"principal point \(160, 120\); expected it near the middle .* images of 2 times"
    ):
        views(K * [[2], [2], [1]])


@pytest.mark.parametrize(("factor", "said"), [(0.5, "0.5"), (1.5, "1.5")])
def test_intrinsics_of_another_size_are_warned_of(factor: float, said: str):
    with pytest.warns(UserWarning, match=rf"look like those of images of {said} times this size"):
        views(K * [[factor], [factor], [1]])


@pytest.mark.parametrize("centre", [(150.0, 60.0), (80.0, 12.0), (105.0, 50.0), (96.0, 72.0), (-30.0, 60.0)])
def test_principal_points_of_crops_are_accepted(centre: tuple[float, float]):
    moved = K.copy()
    moved[:2, 2] = centre
    assert views(moved).cameras.intrinsics[0, :2, 2].tolist() == list(centre)


@pytest.mark.parametrize(("changed", "said"), [((0, 0, 1.0), "0.01 to 100 times"), ((1, 1, 2e4), "0.01 to 100 times"), ((0, 2, 1700.0), "within 10 times")])  # fmt: skip
def test_intrinsics_of_no_lens_are_refused_as_in_files(changed: tuple[int, int, float], said: str):
    row, column, value = changed
    wrong = K.copy()
    wrong[row, column] = value
    with pytest.raises(ValueError, match=said):
        views(wrong)


@pytest.fixture(scope="module")
def pair() -> Views:
    """Two images of the demo room."""
    return open_scene(demo_scene()).read([0, 2], (180, 240))


OPENGL = np.diag([1.0, -1, -1, 1])


def composed(rotations: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Poses with the rotations of some and the positions of others."""
    poses = positions.copy()
    poses[:, :3, :3] = rotations[:, :3, :3]
    return poses


@pytest.mark.parametrize("order", [[0, 2], [2, 0], [1, 3], [3, 1]])
@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda poses: poses, None),
        (np.linalg.inv, "the poses are world to camera: pass their inverse"),
        (lambda poses: poses @ OPENGL, "the poses look like OpenGL's or Blender's"),
        (lambda poses: np.linalg.inv(poses @ OPENGL), "the poses are world to camera, with OpenGL's axes"),
        (
            lambda poses: composed(np.linalg.inv(poses), poses),
            "the poses have the rotations of world to camera: transpose",
        ),
        (
            lambda poses: composed(poses, np.linalg.inv(poses)),
            "the poses have the translations t of world to camera as positions",
        ),
        (lambda poses: composed(poses[::-1], poses), "the poses do not fit the images: "),
    ],
)
def test_poses_of_another_convention_are_warned_of(given: Callable, said: str | None, order: list[int]):
    pair = open_scene(demo_scene()).read(order, (180, 240))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Views.from_arrays(
            pair.images, given(pair.cameras.world_from_camera.numpy()), pair.cameras.intrinsics, (0.5, 10.0)
        )
    assert [str(one.message)[: len(said or "")] for one in caught] == [said] * (said is not None)


def test_a_first_image_without_matches_hides_no_inverted_poses(pair: Views):
    """The first is blank: the second and third decide."""
    images = torch.cat((torch.full_like(pair.images[:1], 0.5), pair.images))
    poses = torch.linalg.inv(pair.cameras.world_from_camera)
    with pytest.warns(UserWarning, match=r"are world to camera: .* between images 1 and 2"):
        Views.from_arrays(images, poses[[0, 0, 1]], pair.cameras.intrinsics[:1].repeat(3, 1, 1), (0.5, 10.0))


@pytest.mark.parametrize(("frames", "size"), [([5, 6], (120, 160)), ([4, 5], (90, 120))])
def test_inverted_poses_that_some_matches_fit_by_accident_are_warned_of(frames: list[int], size: tuple[int, int]):
    """Small images forgive: 29 % and 53 % of the matches fit inverted poses, 100 % and 94 % the right ones."""
    small = open_scene(demo_scene()).read(frames, size)
    with pytest.warns(UserWarning, match="are world to camera"):
        Views.from_arrays(
            small.images, torch.linalg.inv(small.cameras.world_from_camera), small.cameras.intrinsics, (0.5, 10.0)
        )


def test_poses_of_other_images_are_warned_of(pair: Views):
    """All readings of cameras that do not turn are alike; none fits images of cameras that do."""
    matrices = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    matrices[1, 0, 3] = 0.1
    with pytest.warns(UserWarning, match="the poses do not fit the images: 0% of the matches"):
        Views.from_arrays(pair.images, matrices, pair.cameras.intrinsics, (0.5, 10.0))


def test_a_reading_that_one_pair_fits_by_accident_is_not_enough():
    """Two thirds of the matches of the first pair fit, as camera 1 is turned by 0.64 degrees. Those of the others do not."""
    several = open_scene(demo_scene()).read([0, 1, 2, 3], (180, 240))
    poses = several.cameras.world_from_camera.numpy().copy()
    poses[2:] = composed(poses[2:].mT, poses[2:])
    turn = np.radians(0.64)
    poses[1, :3, :3] @= [[1, 0, 0], [0, np.cos(turn), -np.sin(turn)], [0, np.sin(turn), np.cos(turn)]]
    with pytest.warns(UserWarning, match="the poses do not fit the images"):
        Views.from_arrays(several.images, poses, several.cameras.intrinsics, (0.5, 10.0))


def test_poses_that_cannot_be_compared_are_accepted(pair: Views):
    matrices = pair.cameras.world_from_camera.clone()
    matrices[1] = matrices[0]
    Views.from_arrays(pair.images, matrices, pair.cameras.intrinsics, (0.5, 10.0))  # a warning would be an error


def test_arrays_that_are_read_only_are_copied_without_a_warning():
    parts = [IMAGES.copy(), POSES.copy(), np.broadcast_to(K, (2, 3, 3))]
    for part in parts[:2]:
        part.flags.writeable = False
    made = Views.from_arrays(*parts, (0.5, 10.0))
    assert torch.equal(made.images, views(K).images)


def test_arrays_that_run_backwards_are_copied():
    """OpenCV's BGR turned to RGB, a reversed sequence, a mirrored map: NumPy gives views with negative strides, which PyTorch refuses."""
    made = Views.from_arrays(IMAGES[::-1][..., ::-1], POSES[::-1], K[::-1][::-1], (10.0, 0.5)[::-1])
    expected = views(K).images.flip(0, 1)
    assert torch.equal(made.images, expected)
    assert torch.equal(made.cameras.world_from_camera, torch.from_numpy(POSES[::-1].copy()))
    listed = Views.from_arrays([image[..., ::-1] for image in IMAGES[::-1]], list(POSES[::-1]), K, (0.5, 10.0))
    assert torch.equal(listed.images, expected)
    planes = np.ascontiguousarray(np.moveaxis(IMAGES, -1, 1).astype(np.float32) / 255)
    assert torch.equal(Views.from_arrays(planes[::-1, ::-1], POSES[::-1], K, (0.5, 10.0)).images, expected)


# The tests check types at every call; these call what users call, which does not.


@pytest.mark.parametrize(
    ("images", "error", "said"),
    [
        (["a.png", "b.png"], TypeError, "an image is a path, 'a.png'; expected pixels"),
        ([Path("a.png")], TypeError, "an image is a path"),
        ([{"a": 1}, None], TypeError, "an image is a dict; expected an array"),
        (IMAGES[0], ValueError, r"images are \(120, 160, 3\); expected a list of images"),
    ],
)
def test_what_is_no_list_of_images_is_said_to_be_what_it_is(monkeypatch, images: object, error: type, said: str):
    monkeypatch.setattr(views_module, "_as_image", unwrap(views_module._as_image))
    with pytest.raises(error, match=said):
        unwrap(Views.from_arrays.__func__)(Views, images, POSES, K, (0.5, 10.0))


def test_one_pose_for_several_images_is_refused():
    with pytest.raises(ValueError, match=r"world_from_camera is \(4, 4\) for 2 cameras; expected \[v 4 4\]"):
        Views.from_arrays(IMAGES, POSES[0], K, (0.5, 10.0))


@pytest.mark.parametrize("path", [None, ["a"], 3])
def test_what_is_no_path_is_said_to_be_what_it_is(path: object):
    with pytest.raises(TypeError, match=r"a path is (NoneType|list|int); expected text or pathlib\.Path"):
        unwrap(typed_path)(path)


def test_a_network_says_what_it_was_given_instead_of_views():
    network = load("small", weights="random")
    for other in ("photos", IMAGES[0], [views(K)], open_scene(demo_scene())):
        with pytest.raises(TypeError, match=rf"the network takes semgs\.Views, .* and got {type(other).__name__}"):
            unwrap(type(network).forward)(network, other)


@pytest.mark.parametrize("copied", [(0, 1), (0, 2), (1, 2)])
def test_a_view_that_is_there_twice_is_warned_of(copied: tuple[int, int]):
    order = [0, 1, 2]
    order[copied[1]] = copied[0]
    images = np.random.default_rng(1).integers(0, 256, (3, 120, 160, 3), dtype=np.uint8)
    poses = np.stack([np.eye(4)] * 3)
    poses[:, 0, 3] = (0, 0.3, 0.6)
    with pytest.warns(UserWarning, match=f"views {copied[0]} and {copied[1]} have the same image and pose"):
        Views.from_arrays(images[order], poses[order], K, (0.5, 10.0))


FLOATS = torch.from_numpy(IMAGES).permute(0, 3, 1, 2).float() / 255
FOUR = np.eye(4)
FOUR[:3, :3] = K


@pytest.mark.parametrize(
    ("images", "intrinsics"),
    [
        (FLOATS.clone().requires_grad_(), K),
        (FLOATS.bfloat16(), K),
        (FLOATS.half(), K),
        (FLOATS.numpy().astype(">f4"), K.astype(">f8")),
        ((image for image in IMAGES), K),
        (FLOATS, FOUR),
        (FLOATS, torch.from_numpy(np.stack([FOUR, FOUR]))),
    ],
)
def test_every_kind_of_array_gives_the_same_views(images: object, intrinsics: object):
    made = Views.from_arrays(images, POSES, intrinsics, (0.5, 10.0))
    torch.testing.assert_close(made.images, FLOATS, atol=4e-3, rtol=0)  # of bfloat16's eight bits
    assert torch.equal(made.cameras.intrinsics, torch.from_numpy(np.stack([K, K])))
    assert not made.images.requires_grad


@pytest.mark.parametrize(
    ("images", "poses", "intrinsics", "said"),
    [
        ([], POSES, K, "images have none; expected one or more of one size"),
        ([IMAGES[0], IMAGES[1, 20:]], POSES, K, r"images have sizes \(100, 160\) and \(120, 160\)"),
        (IMAGES, POSES, FOUR + np.eye(4)[::-1], r"intrinsics are 4x4; expected 3x3, or \[K 0; 0 1\]"),
        (IMAGES, [], K, r"world_from_camera is \(0,\)"),
    ],
)
def test_arrays_that_cannot_be_views_are_refused_in_a_sentence(
    images: object, poses: object, intrinsics: object, said: str
):
    with pytest.raises(ValueError, match=said):
        Views.from_arrays(images, poses, intrinsics, (0.5, 10.0))


def test_a_network_in_half_precision_says_what_to_do():
    network = load("small")
    for half in (network.half(), network.bfloat16()):
        with pytest.raises(
            TypeError, match=r"the network's weights are torch.(float|bfloat)16; expected float32: call .float\(\)"
        ):
            half(views(K))
