"""Photos and cameras at the limits of what can be: the scene is finite and sane, or refused in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from semgs.data.scenes import open_scene
from semgs.data.tables.classes import IGNORE
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load
from semgs.objectives.losses import cross_entropy

SIZE = (32, 48)
TURN = matrix_from_quaternion(torch.tensor([0.8, 0.3, -0.2, 0.4], dtype=torch.float64)).numpy()


@pytest.fixture(scope="module")
def small() -> SemGS:
    return load("small")


def smooth(index: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """A smooth photo, shifted a little from one frame to the next."""
    rows, columns = np.indices(size) / 10
    shifted = columns + 0.4 * index
    return np.rint(
        255 * (0.5 + 0.4 * np.stack((np.sin(shifted), np.cos(rows + shifted), np.sin(2 * rows)), -1))
    ).astype(np.uint8)


def along(index: int, scale: float = 1.0) -> np.ndarray:
    """A turned camera, 12 cm further along its x axis for each frame."""
    pose = np.eye(4)
    pose[:3, :3] = TURN
    pose[:3, 3] = scale * (TURN @ [0.12 * index, 0.02 * index, 0.0] + [1.0, 2.0, -0.5])
    return pose


def about(index: int) -> np.ndarray:
    """A camera that turns in place."""
    pose = along(0)
    turn = matrix_from_quaternion(torch.tensor([1.0, 0.0, 0.05 * index, 0.02 * index], dtype=torch.float64)).numpy()
    pose[:3, :3] = TURN @ turn
    return pose


def write(
    folder: Path,
    photo: Callable[[int], np.ndarray] = smooth,
    pose: Callable[[int], np.ndarray] = along,
    frames: int = 3,
    focal: float = 40.0,
    **more: object,
) -> Path:
    """A scene of such frames."""
    folder.mkdir(parents=True)
    listed = []
    for index in range(frames):
        write_png(folder / f"{index:03d}.png", photo(index))
        listed.append(
            {"file_path": f"{index:03d}.png", "transform_matrix": (pose(index) @ np.diag([1, -1, -1, 1])).tolist()}
        )
    height, width = photo(0).shape[:2]
    scene = {"w": width, "h": height, "fl_x": focal, "fl_y": 1.02 * focal, "cx": 0.46 * width, "cy": 0.55 * height}
    (folder / "transforms.json").write_text(json.dumps({**scene, "frames": listed, **more}))
    return folder


def sane(scene: Path, model: SemGS, frames: int = 3) -> bool:
    """Reconstruct and render a scene, and check every number; False if it is refused in one line."""
    try:
        views = open_scene(scene).read(range(frames))
    except InputError as error:
        refused = str(error)
    else:
        refused = ""
    if refused:
        assert "\n" not in refused
        assert str(scene) in refused
        return False
    encoding = model(views)
    rendering = encoding.render(views.cameras)
    gaussians = encoding.gaussians.checked()
    for name, values in {
        "means": gaussians.means, "scales": gaussians.colour.scales, "depths": encoding.depths, "images": rendering.images,
        "classes": rendering.semantics, "depth": rendering.depths, "alphas": rendering.alphas,
    }.items():  # fmt: skip
        assert torch.isfinite(values).all(), name
    assert (gaussians.colour.scales > 0).all()
    near, far = views.depth_range.T[..., None, None]
    assert ((encoding.depths >= 0.999 * near) & (encoding.depths <= 1.001 * far)).all()
    assert 0 <= rendering.images.min() <= rendering.images.max() <= 1
    torch.testing.assert_close(rendering.semantics.sum(-3), torch.ones_like(rendering.alphas), atol=1e-4, rtol=0)
    return True


def constant(*colour: int) -> Callable[[int], np.ndarray]:
    return lambda index: np.full((*SIZE, 3), colour, np.uint8)


def noise(index: int) -> np.ndarray:
    return np.random.default_rng(index).integers(0, 256, (*SIZE, 3), np.uint8)


PHOTOS = {
    "black": constant(0, 0, 0),
    "white": constant(255, 255, 255),
    "of one colour": constant(200, 30, 90),
    "noise": noise,
}


@pytest.mark.parametrize("metric", [True, False], ids=["metric", "of unknown scale"])
@pytest.mark.parametrize("photo", PHOTOS)
def test_photos_without_anything_to_see(small: SemGS, tmp_path: Path, photo: str, metric: bool) -> None:
    # Without a unit the scale has to be found in the photos; where they show nothing, that is said.
    assert sane(write(tmp_path / "scene", PHOTOS[photo], metric=metric), small) or not metric


@pytest.mark.parametrize("metric", [True, False], ids=["metric", "of unknown scale"])
@pytest.mark.parametrize(
    ("photo", "pose"),
    [(lambda index: smooth(0), lambda index: along(0)), (smooth, lambda index: along(0)), (smooth, about)],
    ids=["identical views", "no baseline", "pure rotation"],
)
def test_cameras_that_see_no_depth(
    small: SemGS, tmp_path: Path, photo: Callable[[int], np.ndarray], pose: Callable[[int], np.ndarray], metric: bool
) -> None:
    assert sane(write(tmp_path / "scene", photo, pose, metric=metric), small) or not metric


@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("metric", [True, False], ids=["metric", "of unknown scale"])
def test_tiny_and_huge_worlds(small: SemGS, tmp_path: Path, scale: float, metric: bool) -> None:
    sane(write(tmp_path / "scene", pose=lambda index: along(index, scale), metric=metric), small)


def test_the_shortest_and_longest_lenses(small: SemGS, tmp_path: Path) -> None:
    assert sane(write(tmp_path / "short", focal=1.0, metric=True), small)
    sane(write(tmp_path / "long", focal=1e5, metric=True), small)


def test_the_smallest_photos(small: SemGS, tmp_path: Path) -> None:
    assert sane(write(tmp_path / "scene", lambda index: smooth(index, (16, 17)), metric=True), small)


def test_sixteen_views(small: SemGS, tmp_path: Path) -> None:
    assert sane(write(tmp_path / "scene", frames=16, metric=True), small, 16)


@pytest.mark.long
def test_photos_of_twelve_megapixels(small: SemGS, tmp_path: Path) -> None:
    scene = write(tmp_path / "scene", lambda index: smooth(index, (3000, 4000)), frames=2, focal=3300.0, metric=True)
    assert sane(scene, small, 2)


def test_near_and_far_almost_the_same(small: SemGS, tmp_path: Path) -> None:
    views = open_scene(write(tmp_path / "scene", metric=True)).read([0, 1])
    narrow = views.changed(depth_range=torch.tensor([[2.0, 2.0 * (1 + 1e-6)]] * 2, dtype=torch.float64)).checked()
    encoding = small(narrow)
    torch.testing.assert_close(encoding.depths, torch.full_like(encoding.depths, 2.0), atol=1e-4, rtol=0)
    assert torch.isfinite(encoding.render(views.cameras).images).all()


def test_labels_that_are_all_unlabelled_cost_nothing() -> None:
    labels = torch.full((2, *SIZE), IGNORE, dtype=torch.uint8)
    shares = torch.full((2, 20, *SIZE), 0.05, requires_grad=True)
    loss = cross_entropy(shares, labels)
    loss.sum().backward()
    assert loss.tolist() == [0, 0]
    assert shares.grad is not None
    assert (shares.grad == 0).all()
